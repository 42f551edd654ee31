//! Light of even directions, environments and skies, by visibility cuts.

use super::parts::EvenLight;
use super::stats::{CutStats, FrameTimes, milliseconds};
use super::task::Task;
use crate::cuts::illumination::Illumination;
use crate::cuts::shade::{Fragments, Shaded, irradiance_at_sites, shade};
use relight_scene::light_set::DistantLight;
use std::time::Instant;

impl Task<'_> {
    /// Light of one environment's or sky's even directions at fragments and points; `None` without cuts that know of them.
    ///
    /// One at a time, because a cut is chosen by what shines: of all together it would not be the sum of theirs.
    pub fn even_light(&self, distant: &DistantLight, times: &mut FrameTimes) -> Option<EvenLight> {
        let cuts = self.prepared.cuts.as_ref()?;
        let (directions, sites) = (cuts.directions()?, self.shot.sites.as_ref()?);
        let start = Instant::now();
        let parts = directions.cells.parts(|direction| distant.radiance(direction));
        let light = Illumination::of_parts(directions, &parts, self.settings.illumination_cut);
        times.illumination_cut += milliseconds(start);
        let start = Instant::now();
        let reflections = &self.shot.reflections;
        let by_cuts = Fragments {
            narrow: &reflections.narrow,
            ..self.fragments(sites, true)
        };
        let Shaded {
            mut radiance,
            uncertain,
            nodes,
            stats,
        } = shade(cuts, &light, &by_cuts);
        let scene = &self.prepared.scene;
        (light.uneven).resolve(
            scene,
            &self.shot.seen,
            &reflections.narrow,
            &uncertain,
            &mut radiance,
        );
        reflections.add_sky_to(&mut radiance, |direction| distant.radiance(direction));
        times.shade += milliseconds(start);
        let start = Instant::now();
        let transfer = self.prepared.transfer.as_ref().filter(|_| self.shot.transfers);
        let irradiance = transfer.map(|transfer| {
            irradiance_at_sites(cuts, &light, &transfer.finest.positions, &transfer.finest.normals)
        });
        times.direct_points += milliseconds(start);
        Some(EvenLight {
            radiance,
            irradiance,
            nodes: match self.settings.cut_layers {
                true => nodes,
                false => Vec::new(),
            },
            stats: CutStats {
                nodes: light.heights.len(),
                shading: stats,
            },
        })
    }
}
