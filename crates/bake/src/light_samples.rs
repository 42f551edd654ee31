//! The lights that cuts cluster, and the tree over them.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.4 and 4.1.

use crate::candidates::Candidate;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::grid::morton_order;
use relight_transport::light_tree::{self, Features, sphere_direction};

/// Site clusters whose visibility steers the tree (section 4.1: 1024 work well).
const PILOTS: usize = 1024;

/// Most visibility entries of all lights together: 64 MB, so that a million lights take fewer pilots, not more memory.
const MOST_ENTRIES: usize = 1 << 26;

/// Directions evenly on the sphere in the order of the leaves of their tree.
#[derive(Debug)]
pub struct Directions {
    /// Lattice index of each leaf.
    pub order: Vec<u32>,
    /// Unit direction of each leaf.
    pub directions: Vec<Vec3>,
    /// Rays cast by the pilots.
    pub rays: u64,
}

/// Builds the tree over 2^`height` directions. `beta` mixes geometry (1) and what pilots among `sites` see (0).
pub fn directions(surfaces: &dyn Surfaces, sites: &[Candidate], height: u32, beta: f32) -> Directions {
    let n = 1u32 << height;
    let lattice: Vec<Vec3> = (0..n).map(|i| sphere_direction(i, n)).collect();
    // Geometry alone needs no pilots.
    let pilots = if beta < 1.0 {
        chosen(sites, PILOTS.min(MOST_ENTRIES >> height))
    } else {
        Vec::new()
    };
    let (visibility, rays) = pilot_visibility(surfaces, &pilots, &lattice);
    let order = light_tree::order(
        &Features {
            positions: &lattice,
            normals: &lattice,
            visibility: &visibility,
            pilots: pilots.len(),
        },
        beta,
    );
    Directions {
        directions: order.iter().map(|&i| lattice[i as usize]).collect(),
        order,
        rays,
    }
}

/// At most `count` sites, spread evenly: one of each run along a space-filling curve, which stands for the paper's
/// cluster of sites. Averaging several of a run makes cuts longer, not shorter (docs/cuts.md).
fn chosen(sites: &[Candidate], count: usize) -> Vec<Candidate> {
    let positions: Vec<Vec3> = sites.iter().map(|s| s.position).collect();
    let order = morton_order(&positions);
    let count = count.min(order.len());
    (0..count)
        .map(|i| sites[order[(2 * i + 1) * order.len() / (2 * count)] as usize])
        .collect()
}

/// What each pilot sees of each direction: ±127, 0 below its horizon. Entries of a light are neighbours.
fn pilot_visibility(surfaces: &dyn Surfaces, pilots: &[Candidate], lattice: &[Vec3]) -> (Vec<i8>, u64) {
    let columns: Vec<Vec<i8>> = pilots
        .par_iter()
        .map(|pilot| {
            let mut seen = vec![0; lattice.len()];
            let above: Vec<u32> = (0..lattice.len() as u32)
                .filter(|&i| pilot.geometric_normal.dot(lattice[i as usize]) > 0.0)
                .collect();
            let rays: Vec<Ray> = above
                .iter()
                .map(|&i| ray(pilot.origin, lattice[i as usize]))
                .collect();
            let mut occluded = vec![false; rays.len()];
            surfaces.occluded_packet(&rays, &mut occluded);
            for (&i, dark) in above.iter().zip(occluded) {
                seen[i as usize] = if dark { -127 } else { 127 };
            }
            seen
        })
        .collect();
    let mut rows = vec![0; pilots.len() * lattice.len()];
    rows.par_chunks_mut(pilots.len().max(1))
        .enumerate()
        .for_each(|(light, row)| {
            for (entry, column) in row.iter_mut().zip(&columns) {
                *entry = column[light];
            }
        });
    let rays = columns.iter().flatten().filter(|&&v| v != 0).count();
    (rows, rays as u64)
}

/// A ray without end.
pub(crate) fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}
