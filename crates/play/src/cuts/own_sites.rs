//! Sites of their own for fragments whose sites disagree, found once per shot.
//!
//! Between two sites of which one sees the sky and the other does not, interpolation draws a ramp as wide as they are
//! apart, whatever really is there: the rim of an arch, the end of a wall. Where a fragment's sites disagree about much of
//! what it gets of even light, it looks for itself at the lights that they disagree about, from the ends of its rays, so
//! that its cut is a mean over what its pixel covers.

use super::lights::{Directions, VisibilityCuts};
use super::node_view::NodeView;
use super::sites::{FragmentSites, SITES};
use glam::Vec3;
use rayon::prelude::*;
use relight_render::exposure::Exposure;
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::TracedScene;
use relight_transport::cuts::{Selector, SiteCuts, merge};
use relight_transport::light_tree::Node;
use relight_transport::sight::{FIRST_HEIGHT, Sampler, Sight};

/// What a fragment's sites disagree about, as a share of what it gets of even light, from which on it looks for itself. Under
/// lamps, which fill few directions, a twentieth left a seventh more error (docs/notebook/cuts.md).
const DISAGREE: f32 = 0.02;

/// A fragment that gets less than so much of what the mean one gets counts as if it got that.
const DARK: f32 = 0.1;

/// Most fragments that look for themselves, those whose sites disagree most: a cut takes one or two kilobytes.
const MOST: usize = 100_000;

/// Differences of visibility from a fragment's interpolated one, on average over its sites, that count as agreement.
const ALIKE: f32 = 0.02;

/// σ of own cuts for 32,768 lights, as the bake's default.
const SIGMA: f32 = 2.0;

/// Fragments that look one after the other.
const TASK: usize = 64;

/// `sites` of the fragments that a camera sees, with some of their own where they disagree. As they are where lights are not
/// directions.
pub fn with_own(
    cuts: &VisibilityCuts,
    scene: &TracedScene,
    seen: &Exposure,
    mut sites: FragmentSites,
) -> FragmentSites {
    let Some(directions) = cuts.directions() else {
        return sites;
    };
    if directions.tree.height < FIRST_HEIGHT {
        return sites;
    }
    let places = disagreeing(cuts, directions, seen, &sites);
    let leaves = cuts.lights.leaves();
    let parts: Vec<SiteCuts> = (places.par_chunks(TASK))
        .map_init(
            || Looker {
                cuts,
                directions,
                scene,
                seen,
                sites: &sites,
                sampler: Sampler::new(leaves),
                selector: Selector::default(),
                sigma: SIGMA * (leaves as f32 / 32_768.0).sqrt(),
                nodes: Vec::new(),
                unsettled: Vec::new(),
                rays: Vec::new(),
            },
            |looker, places| {
                let mut part = SiteCuts::default();
                for &place in places {
                    looker.look(place, &mut part);
                }
                part
            },
        )
        .collect();
    let mut own = SiteCuts::default();
    own.offsets.push(0);
    for part in parts {
        let start = own.heights.len() as u32;
        own.offsets.extend(part.offsets.iter().map(|end| start + end));
        own.heights.extend(part.heights);
        own.values.extend(part.values);
    }
    let first = cuts.cuts.sites() as u32;
    for (k, place) in (0..).zip(places) {
        let (sites, weights) = (&mut sites.sites[place], &mut sites.weights[place]);
        (*sites, *weights) = ([u32::MAX; SITES], [0.0; SITES]);
        (sites[0], weights[0]) = (first + k, 1.0);
    }
    sites.own = own;
    sites
}

/// Calls `visit` with each node of the merged cut of a fragment's sites, its interpolated visibility, and by how much the
/// sites differ from that on average.
fn interpolated(
    cuts: &VisibilityCuts,
    sites: &FragmentSites,
    place: usize,
    mut visit: impl FnMut(Node, f32, f32),
) {
    let weights = &sites.weights[place];
    merge(sites.cuts(cuts, sites.sites[place]), |node, seen| {
        let mean: f32 = weights.iter().zip(seen).map(|(w, v)| w * v).sum();
        let off = weights.iter().zip(seen).map(|(w, v)| w * (v - mean).abs()).sum();
        visit(node, mean, off);
    });
}

/// Places in the order of `sites` whose fragments look for themselves, rising.
fn disagreeing(
    cuts: &VisibilityCuts,
    directions: &Directions,
    seen: &Exposure,
    sites: &FragmentSites,
) -> Vec<usize> {
    let height = cuts.lights.height();
    let even: Vec<(f32, f32)> = (0..sites.order.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|place| {
            let Some(hit) = seen.hits[sites.order[place] as usize] else {
                return (0.0, 0.0);
            };
            let (mut gets, mut about) = (0.0, 0.0);
            interpolated(cuts, sites, place, |node, seen, off| {
                let view = directions.tree.views[node.slot(height)];
                let share = hit.normal.dot(view.direction).max(0.0) * view.length * node.len() as f32;
                gets += share * seen;
                about += share * off;
            });
            (gets, about)
        })
        .collect();
    let mean = even.iter().map(|f| f64::from(f.0)).sum::<f64>() / even.len().max(1) as f64;
    let dark = DARK * mean as f32;
    let mut wanted: Vec<(f32, usize)> = (even.iter().enumerate())
        .map(|(place, (gets, about))| (about / gets.max(dark), place))
        .filter(|&(off, _)| off > DISAGREE)
        .collect();
    wanted.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    wanted.truncate(MOST);
    let mut places: Vec<usize> = wanted.into_iter().map(|w| w.1).collect();
    places.sort_unstable();
    places
}

/// Looks from one fragment after the other.
struct Looker<'a> {
    cuts: &'a VisibilityCuts,
    directions: &'a Directions,
    scene: &'a TracedScene,
    seen: &'a Exposure,
    sites: &'a FragmentSites,
    sampler: Sampler,
    selector: Selector,
    sigma: f32,
    /// The merged cut of the fragment's sites with its interpolated values.
    nodes: Vec<(Node, f32)>,
    /// Nodes of height [`FIRST_HEIGHT`] about which the sites disagree, rising.
    unsettled: Vec<u32>,
    rays: Vec<Ray>,
}

impl Looker<'_> {
    /// Appends the cut of the fragment in `place`.
    fn look(&mut self, place: usize, out: &mut SiteCuts) {
        let fragment = self.sites.order[place] as usize;
        let hits = self.seen.places_of(self.scene, fragment);
        self.interpolate(place);
        let leaves = self.cuts.lights.leaves();
        let mut sight = FragmentSight {
            scene: self.scene,
            hits: &hits,
            leaves: &self.directions.tree.views[leaves..],
            rays: &mut self.rays,
        };
        self.sampler.sample_in(self.unsettled.iter().copied(), &mut sight);
        let sigma = self.sigma * self.mean_seen(&hits).sqrt();
        let mut unsettled = self.unsettled.iter().peekable();
        let mut done = 0;
        for &(node, seen) in &self.nodes {
            while let Some(&block) = unsettled.next_if(|&&block| block << FIRST_HEIGHT < node.end()) {
                let start = block << FIRST_HEIGHT;
                done = start + (1 << FIRST_HEIGHT);
                let seen = &self.sampler.seen()[start as usize..done as usize];
                (self.selector).select(seen, sigma, usize::MAX, &mut out.heights, &mut out.values);
            }
            if node.first() >= done {
                out.heights.push(node.height);
                out.values.push(seen);
            }
        }
        out.offsets.push(out.heights.len() as u32);
    }

    /// Finds what the sites of the fragment in `place` agree about.
    fn interpolate(&mut self, place: usize) {
        let (nodes, unsettled) = (&mut self.nodes, &mut self.unsettled);
        nodes.clear();
        unsettled.clear();
        interpolated(self.cuts, self.sites, place, |node, seen, off| {
            nodes.push((node, seen));
            if off > ALIKE {
                let first = node.first() >> FIRST_HEIGHT;
                let first = unsettled.last().map_or(first, |&last| first.max(last + 1));
                unsettled.extend(first..node.end().div_ceil(1 << FIRST_HEIGHT));
            }
        });
    }

    /// Mean visibility of what is above the fragment's horizon, as interpolated.
    fn mean_seen(&self, hits: &[SurfaceHit]) -> f32 {
        let Some(hit) = hits.first() else { return 0.0 };
        let height = self.cuts.lights.height();
        let (mut above, mut sum) = (0.0, 0.0);
        for &(node, seen) in &self.nodes {
            let direction = self.directions.tree.views[node.slot(height)].direction;
            if hit.geometric_normal.dot(direction) > 0.0 {
                above += node.len() as f32;
                sum += node.len() as f32 * seen;
            }
        }
        if above > 0.0 { sum / above } else { 0.0 }
    }
}

/// What a fragment sees of the directions, from each of its places as often as light from there counts for it: the share of a
/// pixel that faces a lamp tells whether the lamp is seen.
struct FragmentSight<'a> {
    scene: &'a TracedScene,
    hits: &'a [SurfaceHit],
    leaves: &'a [NodeView],
    rays: &'a mut Vec<Ray>,
}

impl FragmentSight<'_> {
    /// Sum over the places of what light from a direction counts for there: the cosines.
    fn counts(&self, direction: Vec3) -> f32 {
        self.hits.iter().map(|hit| cosine(hit, direction)).sum()
    }

    /// The place that looks at a light.
    fn looking(&self, light: u32) -> &SurfaceHit {
        let direction = self.leaves[light as usize].direction;
        // Steps of the golden ratio are even among neighbours in the tree.
        let mut left = (light as f32 * 0.618_034).fract() * self.counts(direction);
        let before = self.hits.iter().position(|hit| {
            left -= cosine(hit, direction);
            left < 0.0
        });
        // Rounding may leave a little of the sum.
        &self.hits[before.unwrap_or(0)]
    }
}

fn cosine(hit: &SurfaceHit, direction: Vec3) -> f32 {
    hit.normal.dot(direction).max(0.0)
}

impl Sight for FragmentSight<'_> {
    fn factor(&self, light: usize) -> f32 {
        if self.counts(self.leaves[light].direction) > 0.0 {
            1.0
        } else {
            f32::NAN
        }
    }

    fn occluded(&mut self, lights: &[u32], dark: &mut [bool]) {
        self.rays.clear();
        let mut behind = Vec::with_capacity(lights.len());
        for &light in lights {
            let direction = self.leaves[light as usize].direction;
            let hit = self.looking(light);
            behind.push(hit.geometric_normal.dot(direction) <= 0.0);
            let ray = ray_from(hit, direction);
            self.rays.push(ray);
        }
        self.scene.occluded_packet(self.rays, dark);
        // Smooth normals see what the facet they are on hides.
        for (dark, behind) in dark.iter_mut().zip(behind) {
            *dark |= behind;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::FragmentSight;
    use crate::cuts::illumination::Illumination;
    use crate::cuts::node_view::NodeView;
    use crate::cuts::shade::shade;
    use crate::cuts::tests::{HalfRoof, LIGHTS};
    use glam::Vec3;
    use relight_scene::surface::SurfaceHit;

    /// Truth: what the roof leaves of the sky, weighted by cosines, is a wedge of angles 0 to φ: (1 − cos φ)/2. Tolerance: a
    /// direction is 0.11 wide, so that the roof's edge is off by up to 0.055 and the irradiance by half of that, and
    /// half as much again for sums over 1024 directions.
    #[test]
    fn a_fragment_between_sites_that_disagree_sees_what_is_there() {
        let worst = |own: bool| {
            let roof = HalfRoof::new(own);
            // A sky of radiance 1.
            let even = vec![Vec3::splat(4.0 * std::f32::consts::PI / LIGHTS as f32); LIGHTS as usize];
            let light = Illumination::of_directions(roof.cuts.directions().unwrap(), &even, 64);
            let shaded = shade(&roof.cuts, &light, &roof.fragments());
            let lit = roof.between_the_sites(&shaded.radiance);
            assert!(lit.len() > 200);
            let error = |&(x, found): &(f32, f32)| {
                let truth = 0.5 * (1.0 - 1.0f32.atan2(-x).cos());
                (found - truth).abs()
            };
            lit.iter().map(error).fold(0.0, f32::max)
        };
        assert!(worst(false) > 0.1, "{}", worst(false));
        assert!(worst(true) < 0.04, "{}", worst(true));
    }

    /// Truth: cosines. A fold with sides that lean by ±α (sin α = 0.6) shows a light along x one side only, one from above
    /// both alike, and one in between (0.6, 0.8, 0) the one side by 1, the other by 0.28.
    #[test]
    fn the_sides_of_a_fold_look_as_often_as_light_counts_for_them() {
        let roof = HalfRoof::new(false);
        let hit = roof.seen.hits.iter().flatten().next().unwrap();
        let side = |lean: f32| SurfaceHit {
            normal: Vec3::new(lean, 0.8, 0.0),
            ..*hit
        };
        let hits = [side(0.6), side(-0.6)];
        for (direction, share) in [
            (Vec3::X, 1.0),
            (Vec3::Y, 0.5),
            (Vec3::new(0.6, 0.8, 0.0), 1.0 / 1.28),
        ] {
            let view = NodeView {
                direction,
                length: 1.0,
                radius: 0.0,
            };
            let sight = FragmentSight {
                scene: &roof.scene,
                hits: &hits,
                leaves: &[view; 64],
                rays: &mut Vec::new(),
            };
            let first = (0..64)
                .filter(|&light| sight.looking(light).normal.x > 0.0)
                .count();
            // Steps of the golden ratio are even to one or two in 64.
            assert!((first as f32 - 64.0 * share).abs() <= 2.0, "{direction}: {first}");
        }
    }
}
