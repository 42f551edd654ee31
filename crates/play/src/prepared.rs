//! A scene with its transport, ready to be lit.

use crate::cell_reflectances::CellReflectances;
use crate::cuts::VisibilityCuts;
use crate::frame::parts::Received;
use crate::gloss::Gloss;
use crate::shadow_edges::ShadowEdges;
use crate::snap::snapped;
use crate::spread::PointPlaces;
use crate::still::Still;
use crate::transfer::Transfer;
use crate::transferred::Transferred;
use crate::virtual_points::VirtualPoints;
use relight_render::irradiance;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;

/// A scene with its transport, ready to be lit.
pub struct PreparedScene {
    /// Surfaces and materials.
    pub scene: TracedScene,
    /// Operators; `None` for an asset without points.
    pub transfer: Option<Transfer>,
    /// Where each finest point lies on the scene's surfaces.
    pub points: Vec<Option<SurfaceHit>>,
    /// Where direct light is found for them.
    pub places: PointPlaces,
    /// What is known around those where shadows' edges pass.
    pub edges: ShadowEdges,
    /// Virtual lights at the points, for integrators that take them.
    pub virtual_points: VirtualPoints,
    /// Visibility cuts; `None` for an asset baked without.
    pub cuts: Option<VisibilityCuts>,
    /// What lamps that stand still let arrive at points and surface samples.
    pub(crate) received: Still<Received>,
    /// Which points are glossy, of materials as they are.
    pub(crate) gloss: Gloss,
    /// What the points reflected before any edit; found at the first.
    pub(crate) cells: Option<CellReflectances>,
    /// What all of it together became.
    pub(crate) transferred: Transferred,
}

impl PreparedScene {
    /// Puts the finest points back on the scene's surfaces: the file stores them to a fraction of their
    /// distance, shadow rays need them exact.
    pub fn new(
        scene: TracedScene,
        transfer: Option<Transfer>,
        cuts: Option<VisibilityCuts>,
    ) -> PreparedScene {
        let points = transfer.as_ref().map_or_else(Vec::new, |t| {
            snapped(
                &scene,
                &t.finest.positions,
                &t.finest.normals,
                t.finest.disk_radius,
            )
        });
        let places = transfer.as_ref().map_or_else(PointPlaces::default, |t| {
            PointPlaces::new(&scene, &t.finest, &points)
        });
        let edges = ShadowEdges::new(places.hits.len());
        PreparedScene {
            scene,
            transfer,
            points,
            places,
            edges,
            virtual_points: VirtualPoints::default(),
            cuts,
            received: Still::default(),
            gloss: Gloss::default(),
            cells: None,
            transferred: Transferred::default(),
        }
    }

    /// Surface that each place of the finest points stands for, m².
    pub fn footprint(&self) -> f32 {
        let radius = self.transfer.as_ref().map_or(0.0, |t| t.finest.disk_radius);
        irradiance::FOOTPRINT * radius * radius
    }

    /// Even directions that its cuts know of; 0 where they know of none.
    pub fn directions(&self) -> u32 {
        let cuts = self.cuts.as_ref().filter(|cuts| cuts.directions().is_some());
        cuts.map_or(0, |cuts| cuts.lights.leaves() as u32)
    }
}
