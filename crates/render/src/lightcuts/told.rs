//! The cut of one place, to be looked at.

use super::cut::Cut;
use super::lit::{LightcutSettings, Lit, Receiver};
use super::sights::Sights;
use crate::many_lights::{PointLights, clamp_limit};
use glam::Vec3;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::light_clusters::{ClusterEmission, LightClusters};

/// A cluster on the cut of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutCluster {
    /// Lower corner of the box around its lights, world space, metres; of lights that are infinitely far around unit vectors towards them.
    pub low: Vec3,
    /// Upper corner.
    pub high: Vec3,
    /// Whether its lights are infinitely far.
    pub distant: bool,
    /// Whether its lights are virtual, which makes their light indirect.
    pub indirect: bool,
    /// Number of its lights.
    pub lights: usize,
    /// Radiance that they make the place send towards its viewer, W/(m² sr).
    pub radiance: Vec3,
}

/// The clusters that light a place on its way to a viewer, brightest first; those that send nothing there are left out. `clusters` are the
/// trees over `points`; `towards`: the unit vector to the viewer.
pub fn cut_at(
    scene: &TracedScene,
    points: &PointLights,
    clusters: &LightClusters,
    settings: &LightcutSettings,
    hit: &SurfaceHit,
    towards: Vec3,
) -> Vec<CutCluster> {
    let lit = Lit {
        scene,
        points,
        clusters,
        settings: *settings,
    };
    let point = scene.shading_point(hit).facing(towards);
    let receiver = Receiver::new(hit, &point, towards);
    let (mut cut, mut sights) = (Cut::default(), Sights::default());
    sights.begin(&lit, std::iter::once(hit));
    cut.choose(&lit, &receiver, &mut sights, &mut 0);
    let limit = clamp_limit(cut.total.as_vec3(), points.clamp);
    let mut all: Vec<CutCluster> = (cut.nodes())
        .map(|of_cut| {
            let node = &clusters.nodes[of_cut.node as usize];
            CutCluster {
                low: node.low,
                high: node.high,
                distant: matches!(clusters.emission(of_cut.node), ClusterEmission::Directional),
                indirect: points.is_virtual(node.representative as usize),
                lights: clusters.lights(of_cut.node),
                radiance: lit.clamped(of_cut.node, of_cut.term, limit),
            }
        })
        .filter(|cluster| cluster.radiance != Vec3::ZERO)
        .collect();
    all.sort_by(|a, b| b.radiance.element_sum().total_cmp(&a.radiance.element_sum()));
    all
}
