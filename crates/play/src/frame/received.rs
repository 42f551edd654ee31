//! What a light lets arrive where indirect light starts.

use super::parts::Received;
use super::settings::FrameSettings;
use crate::gloss;
use crate::prepared::PreparedScene;
use crate::shadow_edges::Places;
use crate::shot::RelitShot;
use crate::spread::PointPlaces;
use crate::transfer::OverLobes;
use glam::Vec3;
use relight_render::irradiance::{Arrivals, Place, incident_at, irradiance_around, irradiance_at};
use relight_render::lightcuts::{LightcutStats, ManyLights};
use relight_render::lighting::Met;
use relight_scene::light_set::LightSet;
use relight_scene::surface::SurfaceHit;

/// Directions that points know of light at what lobes end on, for each that they know of their own light: the eye sees them one by one.
const AT_ENDS: u32 = 4;

/// Where light arrives from which indirect light starts.
#[derive(Clone, Copy)]
pub(super) struct Starts<'a> {
    /// Places of the finest points, if transfer makes light.
    pub points: Option<&'a PointPlaces>,
    /// Surface samples, if visibility cuts make the first bounce.
    pub samples: Option<&'a [Option<SurfaceHit>]>,
}

/// A scene whose points and samples are lit.
#[derive(Clone, Copy)]
pub(super) struct Receiving<'a> {
    pub prepared: &'a PreparedScene,
    pub settings: &'a FrameSettings,
}

impl Receiving<'_> {
    /// Irradiance of one light where indirect light starts.
    pub fn of(&self, starts: Starts, lights: &LightSet, light: usize) -> Received {
        if lights.is_dark(light) {
            return Received {
                over_lobes: None,
                at_ends: None,
                points: starts.points.map(|places| vec![Vec3::ZERO; places.points()]),
                samples: starts.samples.map(|hits| vec![Vec3::ZERO; hits.len()]),
            };
        }
        let irradiance = |hits: &[Option<SurfaceHit>], footprint: f32| {
            irradiance_at(
                &self.prepared.scene,
                lights,
                light,
                hits,
                footprint,
                self.settings.point_samples,
                self.settings.seed,
            )
        };
        Received {
            over_lobes: None,
            at_ends: None,
            points: starts.points.map(|places| {
                if self.settings.coarse {
                    // A wide point's own place stands for all of its surface.
                    return irradiance(&self.prepared.points, self.prepared.footprint()).0;
                }
                let (mut lit, met) = irradiance(&places.hits, self.prepared.footprint());
                self.soften(lights, light, &met, &mut lit);
                places.means(lit)
            }),
            samples: starts.samples.map(|hits| irradiance(hits, 0.0).0),
        }
    }

    /// The same, with what lobes make of its first bounce.
    pub fn with_lobes(&self, starts: Starts, lights: &LightSet, light: usize) -> Received {
        let received = self.of(starts, lights, light);
        Received {
            over_lobes: (received.points.as_deref())
                .filter(|_| !lights.is_dark(light))
                .and_then(|direct| self.over_lobes(lights, light, direct)),
            ..received
        }
    }

    /// What lobes make of the first bounce of a light that gives the points this irradiance.
    fn over_lobes(&self, lights: &LightSet, light: usize, direct: &[Vec3]) -> Option<OverLobes> {
        let PreparedScene { scene, points, .. } = self.prepared;
        let transfer = self.prepared.transfer.as_ref()?;
        let glossy = self.prepared.gloss.senders(scene, points, transfer)?;
        let wanted: Vec<u32> = glossy.numbers().collect();
        gloss::over_lobes(
            glossy,
            transfer,
            direct,
            &self.arrivals(lights, light, &wanted, self.settings.point_samples),
        )
    }

    /// What a shot's fragments see over two lobes of a light that gives the points this irradiance.
    pub fn at_ends(
        &self,
        shot: &RelitShot,
        lights: &LightSet,
        light: usize,
        direct: &[Vec3],
    ) -> Option<Vec<Vec3>> {
        let (transfer, ends) = (self.prepared.transfer.as_ref()?, &shot.reflections.ends);
        if ends.points().is_empty() {
            return None;
        }
        let arrivals = self.arrivals(
            lights,
            light,
            ends.points(),
            AT_ENDS * self.settings.point_samples,
        );
        ends.over_lobes(transfer, shot.seen.len(), direct, &arrivals)
    }

    /// Whence a light comes at some of the finest points, by so many samples of what has extent.
    fn arrivals(&self, lights: &LightSet, light: usize, wanted: &[u32], samples: u32) -> Arrivals {
        incident_at(
            &self.prepared.scene,
            lights,
            light,
            &self.prepared.points,
            wanted,
            self.prepared.footprint(),
            samples,
            self.settings.seed,
        )
    }

    /// Irradiance of all lights at the finest points by lightcuts.
    pub fn by_lightcuts(&self, many: &ManyLights, places: &PointPlaces) -> (Vec<Vec3>, LightcutStats) {
        let footprint = self.prepared.footprint();
        let irradiance_at =
            |hits: &[Option<SurfaceHit>]| many.irradiance_at(&self.prepared.scene, hits, footprint);
        if self.settings.coarse {
            return irradiance_at(&self.prepared.points);
        }
        let (irradiance, stats) = irradiance_at(&places.hits);
        (places.means(irradiance), stats)
    }

    /// Takes the mean over a point's surface where a shadow's edge passes it.
    fn soften(&self, lights: &LightSet, light: usize, met: &[Met], lit: &mut [Vec3]) {
        // Surfaces of the scene stand still, and what comes from all around has no edges.
        if !lights.is_lamp(light) {
            return;
        }
        let around = |spots: &[Place], runs: &[(usize, u32)]| {
            irradiance_around(
                &self.prepared.scene,
                lights,
                light,
                spots,
                runs,
                self.prepared.footprint(),
                self.settings.seed,
            )
        };
        let Some(transfer) = &self.prepared.transfer else {
            return;
        };
        let places = Places {
            scene: &self.prepared.scene,
            hits: &self.prepared.places.hits,
            disk_radius: transfer.finest.disk_radius,
        };
        self.prepared.edges.soften(places, met, around, lit);
    }
}
