//! What a lamp's light sends over lobes.

use super::clusters::{SAMPLES, Sample};
use super::disk::{Disk, Receiver};
use super::links::LobeLink;
use super::senders::{GlossyPoint, GlossySenders};
use super::weights::lobes_end;
use crate::lit::{Lit, share};
use crate::transfer::{OverLobes, Transfer};
use glam::Vec3;
use rayon::prelude::*;

/// Least α of a lobe, which sends some 25 times as much one way as a matt surface does: what links are right to within a part in a hundred for
/// is then within a quarter.
const SLOPE: f32 = 0.1;

/// Most places of a point's surface by which its lobe is taken.
const PLACES: f32 = 16.0;

/// Part of the mean of what all points reflect of a lamp that a sender must be able to add to a receiver's light. What it sends to one place is mostly far
/// less than it could.
const DIM: f32 = 1.0 / 256.0;

/// A lamp's light at what is glossy.
pub(super) struct LampLight<'a> {
    of: &'a GlossySenders,
    transfer: &'a Transfer,
    /// Of what senders reflect of it, means over their points, W/m².
    radiosities: Vec<Vec3>,
    /// What finest points that are glossy reflect of it, W/m²; of others nothing.
    glossy: Vec<Vec3>,
    /// Means of that over senders' points.
    matt: Vec<Vec3>,
    /// Whence it comes at each of the glossy points.
    lit: Vec<Lit>,
    /// What each of the points that stand for clusters reflects of it.
    sent: Vec<Sent>,
    /// Of each sender, about the most that it sends anywhere over its lobes: radiosity, W/m².
    most: Vec<f32>,
    /// What senders must be able to add to a receiver's light, W/m².
    least: f32,
}

/// What a point that stands for a cluster reflects of a lamp's light.
struct Sent {
    place: Vec3,
    normal: Vec3,
    /// If it is matt: radiosity, W/m².
    matt: Vec3,
    /// Which glossy point it is, and what part of the lamp's light there is the cluster's.
    lobe: Option<(usize, Vec3)>,
}

impl LampLight<'_> {
    /// `direct`: a lamp's irradiance at the finest points; `lit`: whence it comes at the glossy ones.
    pub fn new<'a>(
        of: &'a GlossySenders,
        transfer: &'a Transfer,
        direct: &[Vec3],
        lit: Vec<Lit>,
    ) -> LampLight<'a> {
        let irradiances = transfer.senders.pulled(direct).concat();
        let radiosity = transfer.radiosity(direct);
        let sum: f64 = radiosity.iter().map(|own| f64::from(own.max_element())).sum();
        let radiosities = transfer.senders.pulled(&radiosity).concat();
        let glossy: Vec<Vec3> = (radiosity.iter().zip(&of.is_glossy))
            .map(|(&own, &is_glossy)| if is_glossy { own } else { Vec3::ZERO })
            .collect();
        let sent: Vec<Sent> = (of.weighed.clusters.samples.par_iter().with_min_len(256))
            .map(|&Sample { point, around }| {
                let around = irradiances[around as usize];
                let lobe = of
                    .glossy(point)
                    .filter(|&glossy| !lit[glossy].is_dark() && around != Vec3::ZERO);
                let part = |glossy: usize| match lit[glossy].is_unoccluded() {
                    // The light around says how much of it there is.
                    true => share(around, lit[glossy].irradiance()),
                    // Rays have its visibility: on average they are right.
                    false => Vec3::ONE,
                };
                let point = point as usize;
                Sent {
                    place: transfer.finest.positions[point],
                    normal: transfer.finest.normals[point],
                    matt: around * transfer.albedo[point],
                    lobe: lobe.map(|glossy| (glossy, part(glossy))),
                }
            })
            .collect();
        let most = |sent: &Sent| {
            sent.lobe.map_or(0.0, |(glossy, part)| {
                part.max_element() * lit[glossy].most(&of.points[glossy].shading, SLOPE)
            })
        };
        let most = (0..of.weighed.clusters.len() as u32)
            .into_par_iter()
            .with_min_len(256)
            .map(|sender| {
                let sent = &sent[of.weighed.clusters.range_of(sender)];
                sent.iter().map(most).fold(0.0, f32::max)
            })
            .collect();
        LampLight {
            of,
            transfer,
            radiosities,
            matt: transfer.senders.pulled(&glossy).concat(),
            glossy,
            lit,
            sent,
            most,
            least: DIM * (sum / radiosity.len() as f64) as f32,
        }
    }

    /// What receivers of all levels get of what is glossy.
    pub fn over_lobes(self) -> OverLobes {
        let links = &self.of.weighed.links;
        let received = links.received(self.transfer, |link, receiver| {
            let (part, least) = (link.part_over_lobes, self.least);
            let most = self.most[link.sender as usize] * link.weight.length() * part;
            // Fading in: a lamp that moves is not to switch what it adds.
            let over_lobes = match most > least {
                true => self.difference(link, receiver) * part * (most / least - 1.0).min(1.0),
                false => Vec3::ZERO,
            };
            self.matt[link.sender as usize] + over_lobes
        });
        OverLobes {
            received,
            sent: self.glossy,
        }
    }

    /// What a link's sender has to send over lobes to where the link has them end, less what it would have if it were matt: radiosity, W/m².
    fn difference(&self, link: &LobeLink, receiver: usize) -> Vec3 {
        let (sender, clusters) = (link.sender, &self.of.weighed.clusters);
        let Some(to) = lobes_end(self.transfer, receiver, link.weight) else {
            return Vec3::ZERO;
        };
        let (radius, spread) = (clusters.radius_of(sender), clusters.spread_of(sender));
        let mut seen = Seen::default();
        for sent in &self.sent[clusters.range_of(sender)] {
            match sent.lobe {
                Some((glossy, part)) => seen.add(&self.over_lobe(sent, (radius, spread), glossy, part, &to)),
                None => {
                    let part = to.form_factor(sent.place, sent.normal, radius);
                    seen.add(&Seen {
                        more: Vec3::ZERO,
                        matt: part * sent.matt,
                        part,
                    });
                }
            }
        }
        if seen.part <= 0.0 {
            return Vec3::ZERO;
        }
        // The light of all of the cluster says how much of it there is; one of its points may have all of it.
        let least = Vec3::splat(f32::MIN_POSITIVE);
        let had = (seen.matt / seen.part).max(least);
        let expected = self.radiosities[sender as usize].max(least);
        seen.more / seen.part * (expected / had).min(Vec3::splat(SAMPLES as f32))
    }

    /// What a receiver sees of one of a sender's points, which stands for a disk and normals that add `spread` to α²; `part` of the lamp's light is there.
    fn over_lobe(
        &self,
        sent: &Sent,
        (radius, spread): (f32, f32),
        glossy: usize,
        part: Vec3,
        to: &Receiver,
    ) -> Seen {
        let (lit, GlossyPoint { shading, albedo, .. }) = (&self.lit[glossy], &self.of.points[glossy]);
        let disk = Disk {
            middle: sent.place,
            normal: sent.normal,
            radius,
        };
        let alpha = (shading.alpha * shading.alpha + spread).sqrt().max(SLOPE);
        // Half vectors turn by half of what the way to the receiver or to the lamp does over a place of the disk: by less than a lobe is wide.
        let near = sent.place.distance(to.place).min(lit.distance());
        let wide = radius / (2.0 * alpha * near).max(f32::MIN_POSITIVE);
        let count = (wide * wide).ceil().clamp(1.0, PLACES) as usize;
        let (mut seen, mut bright) = (Seen::default(), 0.0);
        for (place, radius) in disk.places(count) {
            let away = place - sent.place;
            let own_bright = lit.brightness(sent.normal, away);
            bright += own_bright;
            let own = to.form_factor(place, sent.normal, radius);
            if own <= 0.0 {
                continue;
            }
            let light = own * own_bright;
            let reflected = lit.reflected(
                shading,
                (shading.position + away, to.place, away),
                (radius, spread),
                SLOPE,
            );
            seen.add(&Seen {
                more: light * part * (reflected - *albedo * lit.irradiance()),
                matt: light * sent.matt,
                part: own,
            });
        }
        if bright <= 0.0 {
            return Seen::default();
        }
        // Places are as bright as all of the disk is, on average.
        let per_bright = count as f32 / bright;
        Seen {
            more: seen.more * per_bright,
            matt: seen.matt * per_bright,
            part: seen.part,
        }
    }
}

/// What a receiver sees of a sender, times form factors, W/m².
#[derive(Default)]
struct Seen {
    /// Over lobes, less what it would if they were matt.
    more: Vec3,
    /// If all is matt.
    matt: Vec3,
    /// The sum of the form factors.
    part: f32,
}

impl Seen {
    fn add(&mut self, other: &Seen) {
        self.more += other.more;
        self.matt += other.matt;
        self.part += other.part;
    }
}
