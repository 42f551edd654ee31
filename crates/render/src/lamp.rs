//! Irradiance of a lamp without extent at many places: one shadow ray each, of which little else is to be known.

use crate::direct::shadow_ray;
use crate::lighting::{DARK, LIT, Met};
use crate::place::Place;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::light_set::{LightSample, LightSet};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::TracedScene;

/// Places per parallel task and per packet of shadow rays.
const PACKET: usize = 256;

/// Cosine under which a lamp at `distance` lights a place, for the mean over the `footprint` (m²) that the place stands
/// for, where `cosine` is that of its middle.
///
/// A lamp nearer than the next point would light its own point like a sun, and give the scene a thousand times the
/// light that it has. It is seen as if it hung √(h² + A/2π) above the place instead of h: then it sends half of its
/// light down whatever h is (∫ h/(x² + h²)^{3/2} dA = 2π), right above a place the 2π/A that half of its light is on
/// the footprint, and from some footprints away what the middle gets. docs/notebook/stability.md has the figures.
pub(crate) fn cosine_over(footprint: f32, distance: f32, cosine: f32) -> f32 {
    let squared = f64::from(distance) * f64::from(distance);
    let lifted = f64::from(footprint) * std::f64::consts::FRAC_1_PI / 2.0 / squared;
    let cosine = f64::from(cosine);
    let farther = 1.0 + lifted;
    ((cosine * cosine + lifted).sqrt() / (farther * farther.sqrt())) as f32
}

/// Irradiance by a sample from above, of a lamp the mean over the `footprint` that the place stands for.
pub(crate) fn contribution(place: &Place, sample: &LightSample, footprint: f32) -> Vec3 {
    let cosine = place.normal.dot(sample.direction);
    if footprint > 0.0 && sample.distance.is_finite() {
        sample.radiance_over_pdf * cosine_over(footprint, sample.distance, cosine)
    } else {
        sample.radiance_over_pdf * cosine
    }
}

/// A lamp without extent.
pub(crate) struct Lamp<'a> {
    pub scene: &'a TracedScene,
    pub lights: &'a LightSet<'a>,
    pub light: usize,
    /// See [`contribution`].
    pub footprint: f32,
}

/// Shadow rays that are cast together.
#[derive(Default)]
struct Packet {
    rays: Vec<Ray>,
    /// Where each starts, within the task, and what arrives there if nothing is in the way.
    unoccluded: Vec<(usize, Vec3)>,
    /// What gets through.
    passed: Vec<Vec3>,
    occluded: Vec<bool>,
}

impl Lamp<'_> {
    /// Irradiance at `count` places, and what their rays met.
    pub fn irradiance_at(
        &self,
        count: usize,
        place: impl Fn(usize) -> Option<Place> + Sync,
    ) -> (Vec<Vec3>, Vec<Met>) {
        let (mut out, mut met) = (vec![Vec3::ZERO; count], vec![0; count]);
        let tasks = out.par_chunks_mut(PACKET).zip(met.par_chunks_mut(PACKET));
        tasks
            .enumerate()
            .for_each_init(Packet::default, |packet, (task, (out, met))| {
                self.light(|local| place(task * PACKET + local), packet, out, met);
            });
        (out, met)
    }

    /// Lights the places of a task.
    fn light(
        &self,
        place: impl Fn(usize) -> Option<Place>,
        packet: &mut Packet,
        out: &mut [Vec3],
        met: &mut [Met],
    ) {
        let Packet {
            rays,
            unoccluded,
            passed,
            occluded,
        } = packet;
        rays.clear();
        unoccluded.clear();
        for local in 0..out.len() {
            let Some(place) = place(local) else { continue };
            let Some(sample) = self.lights.sample(self.light, &place.start, [0.0; 3]) else {
                continue;
            };
            if place.faces(sample.direction) {
                rays.push(shadow_ray(self.scene, &place.start, &sample));
                unoccluded.push((local, contribution(&place, &sample, self.footprint)));
            }
        }
        passed.clear();
        passed.resize(rays.len(), Vec3::ZERO);
        self.scene.passed_packet(rays, passed, occluded);
        for (&(local, light), &passed) in unoccluded.iter().zip(passed.iter()) {
            met[local] = if passed == Vec3::ZERO { DARK } else { LIT };
            out[local] = light * passed;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: a lamp of 1 W/sr above a plane sends 2π down, however near it hangs. A square lattice of points, each for its
    /// square; the mean over places of the lamp between them is the integral over the plane. Tolerance: what lies beyond
    /// the lattice, a share of height/reach, and as much again for the lift. Single places: right above a point
    /// the lift leaves 1.5 times the light, in the middle between four the least.
    #[test]
    fn a_lamp_upon_a_plane_of_points_gives_half_of_its_light_on_average() {
        let flux = |height: f64, offset: [f64; 2], footprint: f32| -> f64 {
            let reach = 150;
            let mut sum = 0.0;
            for i in -reach..=reach {
                for j in -reach..=reach {
                    let (x, z) = (f64::from(i) + offset[0], f64::from(j) + offset[1]);
                    let squared = x * x + z * z + height * height;
                    let cosine = height / squared.sqrt();
                    let spread = if footprint > 0.0 {
                        f64::from(cosine_over(footprint, squared.sqrt() as f32, cosine as f32))
                    } else {
                        cosine
                    };
                    sum += spread / squared;
                }
            }
            sum / (2.0 * std::f64::consts::PI)
        };
        for height in [1e-3, 1e-2, 0.1, 0.5, 2.0] {
            let steps = 6;
            let mut mean = 0.0;
            for k in 0..steps * steps {
                let offset = [k % steps, k / steps].map(|at| f64::from(at) / f64::from(steps));
                let found = flux(height, offset, 1.0);
                assert!((0.6..1.6).contains(&found), "{height} {offset:?}: {found}");
                mean += found / f64::from(steps * steps);
            }
            assert!((mean - 1.0).abs() < 0.02, "{height}: {mean}");
        }
        assert!(
            flux(1e-3, [0.0; 2], 0.0) > 1e5,
            "the middle alone takes it for a sun"
        );
        // Ten footprints away it is the cosine: A/2π in 100 A is a six-hundredth, 1.5 of them at normal incidence.
        assert!((cosine_over(1.0, 10.0, 1.0) - 1.0).abs() < 3e-3);
    }
}
