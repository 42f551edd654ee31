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
use relight_scene::bsdf;
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
                let cosine = normal.dot(tree.means[slot]).max(0.0);
                sum += light.flux[slot] * (seen * cosine);
            });
            sum
        })
        .collect()
}

/// The merged cut of some sites and of the illumination, without the nodes that are dark for all.
#[derive(Default)]
struct Merged {
    /// Nodes before dark ones were dropped.
    nodes: u64,
    slots: Vec<u32>,
    /// Visibility of the node from each site.
    seen: [Vec<f32>; SITES],
    /// Mean directions and flux, an array per coordinate.
    direction: [Vec<f32>; 3],
    flux: [Vec<f32>; 3],
    /// Visibility from the fragment, between its sites.
    visibility: Vec<f32>,
}

impl Merged {
    fn fill(&mut self, cuts: &VisibilityCuts, light: &Illumination, sites: [u32; SITES]) {
        let tree = &cuts.tree;
        self.nodes = 0;
        self.slots.clear();
        for column in (self.seen.iter_mut())
            .chain(&mut self.direction)
            .chain(&mut self.flux)
        {
            column.clear();
        }
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
            for (column, &value) in self.seen.iter_mut().zip(values) {
                column.push(value);
            }
            let direction = tree.means[slot];
            for axis in 0..3 {
                self.direction[axis].push(direction[axis]);
                self.flux[axis].push(flux[axis]);
            }
        });
        self.visibility.resize(self.slots.len(), 0.0);
    }

    /// Visibility between the sites.
    fn interpolate(&mut self, weights: &[f32; SITES]) {
        let n = self.slots.len();
        let [a, b, c, d] = &self.seen;
        let (a, b, c, d) = (&a[..n], &b[..n], &c[..n], &d[..n]);
        let [wa, wb, wc, wd] = *weights;
        for (i, out) in self.visibility[..n].iter_mut().enumerate() {
            *out = a[i] * wa + b[i] * wb + c[i] * wc + d[i] * wd;
        }
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
        irradiance(merged, point) * point.diffuse * FRAC_1_PI
    } else {
        glossy(&cuts.tree, light, merged, point, view)
    }
}

/// Irradiance of a matt point.
fn irradiance(merged: &Merged, point: &ShadingPoint) -> Vec3 {
    const LANES: usize = 8;
    let n = merged.slots.len();
    let (shading, geometric) = (point.shading_normal, point.geometric_normal);
    let [dx, dy, dz] = &merged.direction;
    let [r, g, b] = &merged.flux;
    let columns = (&dx[..n], &dy[..n], &dz[..n], &merged.visibility[..n]);
    let received = |i: usize| {
        let (x, y, z, seen) = (columns.0[i], columns.1[i], columns.2[i], columns.3[i]);
        let above = geometric.x * x + geometric.y * y + geometric.z * z > 0.0;
        let cosine = shading.x * x + shading.y * y + shading.z * z;
        if above { seen * cosine.max(0.0) } else { 0.0 }
    };
    let mut lanes = [[0.0f32; LANES]; 3];
    let whole = n - n % LANES;
    for start in (0..whole).step_by(LANES) {
        for lane in 0..LANES {
            let i = start + lane;
            let received = received(i);
            lanes[0][lane] += received * r[i];
            lanes[1][lane] += received * g[i];
            lanes[2][lane] += received * b[i];
        }
    }
    let mut sum = Vec3::from(lanes.map(|lanes| lanes.iter().sum::<f32>()));
    for i in whole..n {
        sum += Vec3::new(r[i], g[i], b[i]) * received(i);
    }
    sum
}

/// A lobe as nodes are compared with it.
struct Lobe {
    axis: Vec3,
    /// Angular radius, radians.
    width: f32,
}

/// Angular widths of a lobe beyond which its tail is smooth enough for one direction per node.
const TAIL: f32 = 3.0;

fn glossy(
    tree: &DirectionTree,
    light: &Illumination,
    merged: &Merged,
    point: &ShadingPoint,
    view: Vec3,
) -> Vec3 {
    // A lobe narrower than the even directions would fall between them: it is widened to theirs.
    let point = ShadingPoint {
        alpha: point.alpha.max(tree.radii[tree.leaves()]),
        ..*point
    };
    let normal = point.shading_normal;
    let lobe = Lobe {
        axis: normal * (2.0 * normal.dot(view)) - view,
        // The reflected direction turns by twice what the half vector does, whose distribution α is the slope of.
        width: 2.0 * point.alpha,
    };
    let mut sum = Vec3::ZERO;
    for (&slot, &seen) in merged.slots.iter().zip(&merged.visibility) {
        if seen > 0.0 {
            sum += node_reflected(tree, light, &point, view, &lobe, slot as usize) * seen;
        }
    }
    sum
}

/// BRDF × cosine × flux of a node, split where the lobe is narrower than the node.
fn node_reflected(
    tree: &DirectionTree,
    light: &Illumination,
    point: &ShadingPoint,
    view: Vec3,
    lobe: &Lobe,
    slot: usize,
) -> Vec3 {
    let flux = light.flux[slot];
    if flux == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let direction = tree.directions[slot];
    let radius = tree.radii[slot];
    if slot < tree.leaves() && 2.0 * radius > lobe.width {
        // On unit vectors |a − b|² = 2 − 2 cos; for angles up to π the chord is at least 2/π of the arc.
        let reach = radius + TAIL * lobe.width;
        let chord2 = 2.0 - 2.0 * direction.dot(lobe.axis);
        if reach * reach > chord2 {
            return node_reflected(tree, light, point, view, lobe, 2 * slot)
                + node_reflected(tree, light, point, view, lobe, 2 * slot + 1);
        }
    }
    let cosine = point.shading_normal.dot(direction);
    if cosine <= 0.0 {
        return Vec3::ZERO;
    }
    bsdf::eval(point, view, direction) * flux * cosine
}
