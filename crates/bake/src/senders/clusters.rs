//! Senders: clusters of finest points that see alike, told apart by which of some places in open space they see
//! ([`relight_transport::senders`]).

use crate::error::BakeError;
use crate::params::BakeParams;
use crate::points::candidates::Candidate;
use crate::points::poisson::PointLevels;
use crate::points::seen::open_ways;
use crate::units::Units;
use glam::{Vec2, Vec3};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere};
use relight_transport::senders::{PILOTS, SenderTree, Signed, nearest_seeds};

/// Stage number of the pilots' random stream.
const STAGE_PILOTS: u32 = 4;

/// Places in open space: on straight ways between surfaces that importance particles take.
fn pilots(surfaces: &dyn Surfaces, points: &PointLevels, seed: u64) -> Vec<Vec3> {
    let places = &points.levels[points.levels.len() - 1].points;
    (0..PILOTS)
        .map(|i| {
            let mut s = Stream::new(seed, STAGE_PILOTS, i as u64);
            let place = &places[((s.uniform() * places.len() as f32) as usize).min(places.len() - 1)];
            let direction = Frame::around(place.geometric_normal)
                .world_from_local(cosine_hemisphere(Vec2::new(s.uniform(), s.uniform())));
            let ray = Ray {
                origin: place.origin,
                direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            let reach = surfaces
                .closest_hit(&ray)
                .map_or(points.levels[0].disk_radius, |hit| hit.t);
            place.origin + direction * (reach * s.uniform())
        })
        .collect()
}

/// Places per unit of work: 128 rays each, a second or so.
const PLACES_PER_UNIT: usize = 1 << 15;

/// Which pilots places see, a bit each.
pub struct Signatures(pub Vec<u128>);

fn signed(
    surfaces: &dyn Surfaces,
    places: &[Candidate],
    pilots: &[Vec3],
    units: Units,
) -> Result<Vec<Signed>, BakeError> {
    let inputs = units.inputs(|key| {
        key.places(places).vectors(pilots.iter());
    });
    let mut signed = Vec::with_capacity(places.len());
    for range in units.ranges(0..places.len(), PLACES_PER_UNIT) {
        let places = &places[range.clone()];
        let Signatures(seen) = units.taken_or_made("pilots", inputs, &range, || {
            Ok(signatures(surfaces, places, pilots))
        })?;
        signed.extend(places.iter().zip(seen).map(|(place, signature)| Signed {
            position: place.position,
            normal: place.normal,
            widening: place.widening,
            signature,
        }));
    }
    Ok(signed)
}

fn signatures(surfaces: &dyn Surfaces, places: &[Candidate], pilots: &[Vec3]) -> Signatures {
    let to_pilot = |place: &Candidate, k: usize| (pilots[k] - place.origin, 1.0);
    Signatures(open_ways(surfaces, places, PILOTS, to_pilot))
}

/// The senders, and what tells them apart.
pub struct SenderClusters {
    /// The clusters.
    pub tree: SenderTree,
    /// Places in open space.
    pub pilots: Vec<Vec3>,
    /// Which of those the finest points see.
    pub finest: Vec<Signed>,
}

/// Groups the finest points into clusters that see alike. `importance` is that of the finest points.
///
/// # Errors
/// A unit cannot be kept.
pub fn sender_clusters(
    surfaces: &dyn Surfaces,
    points: &PointLevels,
    importance: Vec<u8>,
    params: &BakeParams,
    units: Units,
) -> Result<SenderClusters, BakeError> {
    let pilots = pilots(surfaces, points, params.seed);
    let sending = params.sender_levels.min(points.levels.len());
    let finest = signed(
        surfaces,
        &points.levels[points.levels.len() - 1].points,
        &pilots,
        units,
    )?;
    let seeds: Vec<Vec<Signed>> = points.levels[..sending]
        .iter()
        .map(|level| signed(surfaces, &level.points, &pilots, units))
        .collect::<Result<_, BakeError>>()?;
    let spacing = |level: usize| points.levels[level].disk_radius;
    let leaf_of_point = nearest_seeds(&finest, &seeds[sending - 1], spacing(sending - 1));
    let parents = (1..sending)
        .map(|l| nearest_seeds(&seeds[l], &seeds[l - 1], spacing(l - 1)))
        .collect();
    let counts: Vec<usize> = seeds.iter().map(Vec::len).collect();
    let tree = SenderTree::new(&counts, leaf_of_point, parents, importance);
    Ok(SenderClusters { tree, pilots, finest })
}
