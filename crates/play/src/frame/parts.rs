//! What is found of each lamp by itself.

use super::stats::CutStats;
use crate::still::Kept;
use crate::transfer::OverLobes;
use glam::Vec3;

/// Direct irradiance from which indirect light starts.
#[derive(Clone, Debug)]
pub(crate) struct Received {
    /// At the finest points, for transfer; `None` where it makes no light.
    pub points: Option<Vec<Vec3>>,
    /// What lobes send of the first bounce of it; `None` where that is nothing.
    pub over_lobes: Option<OverLobes>,
    /// What fragments see of it over two lobes: radiance, less what the points say of it ([`crate::glossy_ends`]); `None` where that is nothing.
    pub at_ends: Option<Vec<Vec3>>,
    /// At surface samples, for visibility cuts; `None` where these make no first bounce.
    pub samples: Option<Vec<Vec3>>,
}

impl Kept for Received {
    fn bytes(&self) -> usize {
        let over_lobes = self.over_lobes.as_ref().map_or(0, OverLobes::bytes);
        self.points.bytes() + self.samples.bytes() + over_lobes
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

impl Kept for EvenLight {
    fn bytes(&self) -> usize {
        self.radiance.bytes() + self.irradiance.bytes() + size_of_val(self.nodes.as_slice())
    }
}
