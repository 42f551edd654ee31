//! Reflected light of the even directions at fragments: illumination × visibility × BRDF over merged cuts.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.2 and 4.2. Fragments that interpolate between the same sites share
//! one traversal.
//!
//! Deviation: where a glossy lobe is narrower than a node, the node is split for the BRDF down to the lobe's width,
//! and light is read at those small nodes, too; the paper takes one direction per node, or a fixed number.

use super::illumination::Illumination;
use super::sites::{FragmentSites, SITES};
use super::{DirectionTree, VisibilityCuts};
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::bsdf::{self, Incident, Lobe};
use relight_scene::shading::ShadingPoint;
use relight_transport::cuts::{Cut, merge};
use std::f32::consts::FRAC_1_PI;

/// Fragments per parallel task.
const TASK: usize = 256;

/// What a shading pass did.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShadeStats {
    /// Nodes of merged cuts over all fragments, dark ones included.
    pub merged_nodes: u64,
    /// Fragments that were shaded.
    pub fragments: u64,
}

/// Radiance that each fragment reflects towards its viewer (`views`, unit). Fragments without sites get none.
pub fn shade(
    cuts: &VisibilityCuts,
    light: &Illumination,
    sites: &FragmentSites,
    points: &[Option<ShadingPoint>],
    views: &[Vec3],
) -> (Vec<Vec3>, ShadeStats) {
    let tasks: Vec<(Vec<Vec3>, u64)> = (sites.order.par_chunks(TASK))
        .zip(sites.sites.par_chunks(TASK))
        .zip(sites.weights.par_chunks(TASK))
        .map_init(Merged::default, |merged, ((order, sites), weights)| {
            let mut nodes = 0;
            let mut last = None;
            let radiance = (0..order.len())
                .map(|i| {
                    if last != Some(sites[i]) {
                        merged.fill(cuts, light, sites[i]);
                        last = Some(sites[i]);
                    }
                    nodes += merged.nodes;
                    let fragment = order[i] as usize;
                    points[fragment].as_ref().map_or(Vec3::ZERO, |point| {
                        reflected(cuts, light, merged, point, views[fragment], &weights[i])
                    })
                })
                .collect();
            (radiance, nodes)
        })
        .collect();
    let mut out = vec![Vec3::ZERO; points.len()];
    let mut stats = ShadeStats {
        fragments: sites.order.len() as u64,
        ..ShadeStats::default()
    };
    let radiance = tasks.iter().flat_map(|task| &task.0);
    for (&fragment, &radiance) in sites.order.iter().zip(radiance) {
        out[fragment as usize] = radiance;
    }
    stats.merged_nodes = tasks.iter().map(|task| task.1).sum();
    (out, stats)
}

/// Irradiance of every site on a surface with the site's unit normal.
pub fn irradiance_at_sites(cuts: &VisibilityCuts, light: &Illumination, normals: &[Vec3]) -> Vec<Vec3> {
    let tree = &cuts.tree;
    let illumination = light.as_cut();
    (normals.par_iter().with_min_len(64).enumerate())
        .map(|(site, normal)| {
            let mut sum = Vec3::ZERO;
            merge([cuts.cuts.cut(site), illumination], |node, [seen, _]| {
                let slot = node.slot(tree.height);
                let cosine = normal.dot(tree.directions[slot]).max(0.0) * tree.lengths[slot];
                sum += light.flux[slot] * (seen * cosine);
            });
            sum
        })
        .collect()
}

/// Nodes as the BRDF takes them: structure of arrays.
#[derive(Default)]
struct Columns {
    direction: [Vec<f32>; 3],
    visibility: Vec<f32>,
    flux: [Vec<f32>; 3],
}

impl Columns {
    fn clear(&mut self) {
        for column in self.direction.iter_mut().chain(&mut self.flux) {
            column.clear();
        }
        self.visibility.clear();
    }

    fn push(&mut self, direction: Vec3, visibility: f32, flux: Vec3) {
        for axis in 0..3 {
            self.direction[axis].push(direction[axis]);
            self.flux[axis].push(flux[axis]);
        }
        self.visibility.push(visibility);
    }

    fn incident(&self) -> Incident<'_> {
        Incident {
            direction: self.direction.each_ref().map(Vec::as_slice),
            weight: &self.visibility,
            flux: self.flux.each_ref().map(Vec::as_slice),
        }
    }
}

/// The merged cut of some sites and of the illumination, without the nodes that are dark for all.
#[derive(Default)]
struct Merged {
    /// Nodes before dark ones were dropped.
    nodes: u64,
    slots: Vec<u32>,
    /// Visibility of the node from each site, times the length of the mean of its directions: by so much the mean of
    /// their cosines is smaller than the cosine of their mean.
    seen: [Vec<f32>; SITES],
    /// Angular radii of the nodes.
    radii: Vec<f32>,
    /// The nodes with visibility between the sites of the fragment at hand.
    whole: Columns,
    /// Parts of nodes that are wider than the lobe of the fragment at hand.
    split: Columns,
}

impl Merged {
    fn fill(&mut self, cuts: &VisibilityCuts, light: &Illumination, sites: [u32; SITES]) {
        let tree = &cuts.tree;
        self.nodes = 0;
        self.slots.clear();
        self.seen.iter_mut().for_each(Vec::clear);
        self.radii.clear();
        self.whole.clear();
        // A site that is not there sees nothing, and costs nothing: its only node is the root.
        let root = [tree.height];
        let nothing = Cut {
            heights: &root,
            values: &[0.0],
        };
        let cut = |site: u32| {
            if site == u32::MAX {
                nothing
            } else {
                cuts.cuts.cut(site as usize)
            }
        };
        let [a, b, c, d] = sites.map(cut);
        merge([a, b, c, d, light.as_cut()], |node, values| {
            self.nodes += 1;
            let seen = values[0] + values[1] + values[2] + values[3];
            let slot = node.slot(tree.height);
            let flux = light.flux[slot];
            if seen <= 0.0 || flux == Vec3::ZERO {
                return;
            }
            self.slots.push(slot as u32);
            let length = tree.lengths[slot];
            for (column, &value) in self.seen.iter_mut().zip(values) {
                column.push(value * length);
            }
            self.radii.push(tree.radii[slot]);
            self.whole.push(tree.directions[slot], 0.0, flux);
        });
    }

    /// Visibility between the sites.
    fn interpolate(&mut self, weights: &[f32; SITES]) {
        let n = self.slots.len();
        let [a, b, c, d] = &self.seen;
        let (a, b, c, d) = (&a[..n], &b[..n], &c[..n], &d[..n]);
        let [wa, wb, wc, wd] = *weights;
        for (i, out) in self.whole.visibility[..n].iter_mut().enumerate() {
            *out = a[i] * wa + b[i] * wb + c[i] * wc + d[i] * wd;
        }
    }

    /// Moves the nodes that are wider than a lobe which they overlap to `split`, in parts.
    fn split_for(&mut self, tree: &DirectionTree, light: &Illumination, lobe: &Lobe) {
        self.split.clear();
        let Columns {
            direction: [x, y, z],
            visibility,
            ..
        } = &mut self.whole;
        for (i, seen) in visibility.iter_mut().enumerate() {
            let direction = Vec3::new(x[i], y[i], z[i]);
            if *seen > 0.0 && is_too_wide(lobe, direction, self.radii[i]) {
                let slot = self.slots[i] as usize;
                push_parts(
                    tree,
                    light,
                    lobe,
                    slot,
                    *seen / tree.lengths[slot],
                    &mut self.split,
                );
                *seen = 0.0;
            }
        }
    }
}

/// Diameter of a node, in angular radii of a lobe, above which it is split: three to four nodes then span what holds
/// 90 % of the lobe.
const RESOLUTION: f32 = 1.0 / 3.0;

fn is_too_wide(lobe: &Lobe, direction: Vec3, radius: f32) -> bool {
    // Between unit vectors |a − b|² = 2 − 2 cos, and a chord is never longer than its arc.
    let reach = radius + lobe.width;
    2.0 * radius > RESOLUTION * lobe.width && reach * reach > 2.0 - 2.0 * direction.dot(lobe.direction)
}

/// Appends a node of visibility `seen`, or, where it is too wide for the lobe, its descendants.
fn push_parts(
    tree: &DirectionTree,
    light: &Illumination,
    lobe: &Lobe,
    slot: usize,
    seen: f32,
    out: &mut Columns,
) {
    let flux = light.flux[slot];
    if flux == Vec3::ZERO {
        return;
    }
    let direction = tree.directions[slot];
    if slot < tree.leaves() && is_too_wide(lobe, direction, tree.radii[slot]) {
        push_parts(tree, light, lobe, 2 * slot, seen, out);
        push_parts(tree, light, lobe, 2 * slot + 1, seen, out);
    } else {
        out.push(direction, seen * tree.lengths[slot], flux);
    }
}

fn reflected(
    cuts: &VisibilityCuts,
    light: &Illumination,
    merged: &mut Merged,
    point: &ShadingPoint,
    view: Vec3,
    weights: &[f32; SITES],
) -> Vec3 {
    merged.interpolate(weights);
    if point.lambert {
        return bsdf::irradiance(point, &merged.whole.incident()) * point.diffuse * FRAC_1_PI;
    }
    let tree = &cuts.tree;
    // A lobe narrower than the even directions would fall between them: it is widened to theirs.
    let point = bsdf::at_least_as_wide(point, tree.radii[tree.leaves()]);
    match bsdf::lobe(&point, view) {
        Some(lobe) => {
            merged.split_for(tree, light, &lobe);
            bsdf::integrate(&point, view, &merged.whole.incident())
                + bsdf::integrate(&point, view, &merged.split.incident())
        }
        // Matt by its parameters, or seen from below its horizon.
        None => bsdf::integrate(&point, view, &merged.whole.incident()),
    }
}
