//! The lights that cuts cluster, as sites see them, and the tree over them.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.4 and 4.1.

use crate::cuts::surface_lights::SurfaceLights;
use crate::points::candidates::Candidate;
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

/// Lights that cuts cluster.
#[derive(Clone, Debug)]
pub enum Lights {
    /// Even directions.
    Directions {
        /// Lattice index of each.
        order: Vec<u32>,
        /// Unit directions.
        directions: Vec<Vec3>,
    },
    /// Even samples of the surfaces.
    Surface(SurfaceLights),
}

impl Lights {
    /// `count` directions of the lattice, in its order.
    pub fn directions(count: u32) -> Lights {
        Lights::Directions {
            order: (0..count).collect(),
            directions: (0..count).map(|i| sphere_direction(i, count)).collect(),
        }
    }

    /// Number of lights.
    pub fn len(&self) -> usize {
        match self {
            Lights::Directions { directions, .. } => directions.len(),
            Lights::Surface(samples) => samples.normals.len(),
        }
    }

    /// Whether there are none, which no tree can be built over.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What an unoccluded light counts for at a site: 1 for directions, A cos θ/(d² + A/π) for surface samples, 0 for
    /// those that face away; NaN for what lies below the site's horizon and counts for nothing.
    #[inline]
    pub fn factor(&self, site: &Candidate, light: usize) -> f32 {
        match self {
            Lights::Directions { directions, .. } => {
                if site.geometric_normal.dot(directions[light]) > 0.0 {
                    1.0
                } else {
                    f32::NAN
                }
            }
            Lights::Surface(samples) => samples.factor(site, light),
        }
    }

    /// The shadow ray from a site to a light that is above its horizon.
    #[inline]
    pub fn ray(&self, site: &Candidate, light: usize) -> Ray {
        match self {
            Lights::Directions { directions, .. } => Ray {
                origin: site.origin,
                direction: directions[light],
                t_min: 0.0,
                t_max: f32::INFINITY,
            },
            Lights::Surface(samples) => samples.ray(site, light),
        }
    }

    /// Positions and normals by which the tree gathers neighbours.
    fn places(&self) -> (&[Vec3], &[Vec3]) {
        match self {
            Lights::Directions { directions, .. } => (directions, directions),
            Lights::Surface(samples) => (&samples.positions, &samples.normals),
        }
    }

    fn reordered(&self, by: &[u32]) -> Lights {
        match self {
            Lights::Directions { order, directions } => Lights::Directions {
                order: by.iter().map(|&i| order[i as usize]).collect(),
                directions: by.iter().map(|&i| directions[i as usize]).collect(),
            },
            Lights::Surface(samples) => Lights::Surface(samples.reordered(by)),
        }
    }
}

/// Lights in the order of the leaves of their tree.
#[derive(Debug)]
pub struct LightLeaves {
    /// The lights.
    pub lights: Lights,
    /// What cuts count in: 1 for directions; for surface samples the mean factor of what the pilots see, over all
    /// pilots and the samples above their horizons.
    pub unit: f32,
    /// Rays cast by the pilots.
    pub rays: u64,
}

/// The order of a tree's leaves.
pub struct Ordered {
    /// Which light each leaf is.
    pub order: Vec<u32>,
    /// As [`LightLeaves::unit`].
    pub unit: f32,
    /// Rays cast.
    pub rays: u64,
}

/// Builds the tree over lights, a power of two of them. `beta` mixes geometry (1) and what pilots among `sites` see (0).
pub fn in_tree(surfaces: &dyn Surfaces, sites: &[Candidate], lights: &Lights, beta: f32) -> LightLeaves {
    let ordered = order(surfaces, sites, lights, beta);
    LightLeaves::new(lights, &ordered)
}

impl LightLeaves {
    /// Lights in a tree's order.
    pub fn new(lights: &Lights, ordered: &Ordered) -> LightLeaves {
        LightLeaves {
            lights: lights.reordered(&ordered.order),
            unit: ordered.unit,
            rays: ordered.rays,
        }
    }
}

/// The order of [`in_tree`].
pub fn order(surfaces: &dyn Surfaces, sites: &[Candidate], lights: &Lights, beta: f32) -> Ordered {
    let has_unit = matches!(lights, Lights::Surface(_));
    // Geometry alone needs no pilots.
    let pilots = if beta < 1.0 || has_unit {
        chosen(sites, PILOTS.min(MOST_ENTRIES / lights.len().max(1)))
    } else {
        Vec::new()
    };
    let seen = pilot_visibility(surfaces, &pilots, lights);
    let (positions, normals) = lights.places();
    let driven = beta < 1.0;
    let order = light_tree::order(
        &Features {
            positions,
            normals,
            visibility: if driven { &seen.rows } else { &[] },
            pilots: if driven { pilots.len() } else { 0 },
        },
        beta,
    );
    Ordered {
        order,
        unit: if has_unit { seen.unit() } else { 1.0 },
        rays: seen.rays,
    }
}

/// At most `count` sites, spread evenly: one of each run along a space-filling curve, which stands for the paper's
/// cluster of sites.
fn chosen(sites: &[Candidate], count: usize) -> Vec<Candidate> {
    let positions: Vec<Vec3> = sites.iter().map(|s| s.position).collect();
    let order = morton_order(&positions);
    let count = count.min(order.len());
    (0..count)
        .map(|i| sites[order[(2 * i + 1) * order.len() / (2 * count)] as usize])
        .collect()
}

/// What pilots see.
struct PilotView {
    /// ±127, 0 below a pilot's horizon; entries of a light are neighbours.
    rows: Vec<i8>,
    rays: u64,
    /// Lights above the horizons of all pilots, and the sum of the factors of those that are seen.
    above: u64,
    sum: f64,
}

impl PilotView {
    /// Mean factor of what is seen; 1 where nothing is.
    fn unit(&self) -> f32 {
        let mean = (self.sum / self.above.max(1) as f64) as f32;
        if mean.is_normal() { mean } else { 1.0 }
    }
}

fn pilot_visibility(surfaces: &dyn Surfaces, pilots: &[Candidate], lights: &Lights) -> PilotView {
    let columns: Vec<(Vec<i8>, f64, u64)> = pilots
        .par_iter()
        .map(|pilot| {
            let mut seen = vec![0; lights.len()];
            let mut facing: Vec<(u32, f32)> = Vec::new();
            for light in 0..lights.len() {
                let factor = lights.factor(pilot, light);
                if factor > 0.0 {
                    facing.push((light as u32, factor));
                } else if factor == 0.0 {
                    seen[light] = -127;
                }
            }
            let rays: Vec<Ray> = (facing.iter())
                .map(|&(light, _)| lights.ray(pilot, light as usize))
                .collect();
            let mut occluded = vec![false; rays.len()];
            surfaces.occluded_packet(&rays, &mut occluded);
            let mut sum = 0.0;
            for (&(light, factor), dark) in facing.iter().zip(occluded) {
                seen[light as usize] = if dark { -127 } else { 127 };
                sum += if dark { 0.0 } else { f64::from(factor) };
            }
            (seen, sum, rays.len() as u64)
        })
        .collect();
    let mut rows = vec![0; pilots.len() * lights.len()];
    rows.par_chunks_mut(pilots.len().max(1))
        .enumerate()
        .for_each(|(light, row)| {
            for (entry, column) in row.iter_mut().zip(&columns) {
                *entry = column.0[light];
            }
        });
    PilotView {
        rows,
        rays: columns.iter().map(|c| c.2).sum(),
        above: (columns.iter())
            .map(|c| c.0.iter().filter(|&&v| v != 0).count() as u64)
            .sum(),
        sum: columns.iter().map(|c| c.1).sum(),
    }
}
