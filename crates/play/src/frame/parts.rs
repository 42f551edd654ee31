//! What is found of each lamp by itself.

use super::stats::CutStats;
use crate::still::Kept;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_transport::pyramid::VectorIrradiance;

/// Direct irradiance from which indirect light starts.
#[derive(Clone, Debug)]
pub(crate) struct Received {
    /// At the finest points, for transfer; `None` where it makes no light.
    pub points: Option<Vec<Vec3>>,
    /// At all receivers, what lobes add to the first bounce of it ([`crate::gloss`]); `None` where they add nothing.
    pub over_lobes: Option<Vec<VectorIrradiance>>,
    /// At surface samples, for visibility cuts; `None` where these make no first bounce.
    pub samples: Option<Vec<Vec3>>,
}

impl Kept for Received {
    fn bytes(&self) -> usize {
        let over_lobes = self.over_lobes.as_deref().map_or(0, size_of_val);
        self.points.bytes() + self.samples.bytes() + over_lobes
    }
}

impl Received {
    /// The same of a lamp of another colour than 1.
    pub fn times(mut self, color: Vec3) -> Received {
        for irradiance in [&mut self.points, &mut self.samples].into_iter().flatten() {
            multiply(irradiance, color);
        }
        if let Some(over_lobes) = self.over_lobes.as_mut().filter(|_| color != Vec3::ONE) {
            let color = Vec3A::from(color);
            let times = |value: &mut VectorIrradiance| {
                value.x *= color;
                value.y *= color;
                value.z *= color;
            };
            over_lobes.par_iter_mut().with_min_len(TASK).for_each(times);
        }
        self
    }
}

/// Places that are multiplied together.
const TASK: usize = 4096;

/// Light of a lamp of another colour than 1.
pub(crate) fn multiply(light: &mut [Vec3], color: Vec3) {
    if color != Vec3::ONE {
        (light.par_iter_mut().with_min_len(TASK)).for_each(|light| *light *= color);
    }
}

/// Light of even directions.
#[derive(Clone, Debug)]
pub(crate) struct EvenLight {
    /// Reflected by each fragment.
    pub radiance: Vec<Vec3>,
    /// At each finest point, if transfer takes it on.
    pub irradiance: Option<Vec<Vec3>>,
    /// Nodes that each fragment was shaded with, where somebody wants to know; else empty.
    pub nodes: Vec<u32>,
    pub stats: CutStats,
}

impl EvenLight {
    /// The same of another colour than 1.
    pub fn times(mut self, color: Vec3) -> EvenLight {
        multiply(&mut self.radiance, color);
        if let Some(irradiance) = &mut self.irradiance {
            multiply(irradiance, color);
        }
        self
    }
}

impl Kept for EvenLight {
    fn bytes(&self) -> usize {
        self.radiance.bytes() + self.irradiance.bytes() + size_of_val(self.nodes.as_slice())
    }
}
