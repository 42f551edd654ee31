//! Reflected light of many lights at fragments: illumination × visibility × BRDF over merged cuts.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.2 and 4.2. Fragments that interpolate between the same sites share
//! one traversal.
//!
//! Deviation: where a glossy lobe is narrower than a node, the node is split for the BRDF down to the lobe's width,
//! and light is read at those small nodes, too; the paper takes one direction per node, or a fixed number.

use super::illumination::Illumination;
use super::sites::{FragmentSites, SITES};
use super::{Directions, Lights, SurfaceSamples, VisibilityCuts, position_tree};
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

/// What is shaded.
#[derive(Clone, Copy)]
pub struct Fragments<'a> {
    /// Between which sites each fragment interpolates.
    pub sites: &'a FragmentSites,
    /// How each reflects.
    pub points: &'a [Option<ShadingPoint>],
    /// Unit directions to the viewer.
    pub views: &'a [Vec3],
    /// Shade surfaces that are matt, too.
    pub matt: bool,
}

/// Radiance that each fragment reflects towards its viewer. Fragments without sites get none.
pub fn shade(cuts: &VisibilityCuts, light: &Illumination, fragments: &Fragments) -> (Vec<Vec3>, ShadeStats) {
    let Fragments {
        sites, points, views, ..
    } = *fragments;
    let tasks: Vec<(Vec<Vec3>, ShadeStats)> = (sites.order.par_chunks(TASK))
        .zip(sites.sites.par_chunks(TASK))
        .zip(sites.weights.par_chunks(TASK))
        .map_init(Merged::default, |merged, ((order, sites), weights)| {
            let mut stats = ShadeStats::default();
            let mut last = None;
            let radiance = (0..order.len())
                .map(|i| {
                    let fragment = order[i] as usize;
                    let wanted = |point: &&ShadingPoint| fragments.matt || !point.lambert;
                    let Some(point) = points[fragment].as_ref().filter(wanted) else {
                        return Vec3::ZERO;
                    };
                    if last != Some(sites[i]) {
                        merged.fill(cuts, light, sites[i]);
                        last = Some(sites[i]);
                    }
                    stats.merged_nodes += merged.nodes;
                    stats.fragments += 1;
                    reflected(&cuts.lights, light, merged, point, views[fragment], &weights[i])
                })
                .collect();
            (radiance, stats)
        })
        .collect();
    let mut out = vec![Vec3::ZERO; points.len()];
    let radiance = tasks.iter().flat_map(|task| &task.0);
    for (&fragment, &radiance) in sites.order.iter().zip(radiance) {
        out[fragment as usize] = radiance;
    }
    let stats = ShadeStats {
        merged_nodes: tasks.iter().map(|task| task.1.merged_nodes).sum(),
        fragments: tasks.iter().map(|task| task.1.fragments).sum(),
    };
    (out, stats)
}

/// Irradiance of every site on a surface with the site's place and unit normal.
pub fn irradiance_at_sites(
    cuts: &VisibilityCuts,
    light: &Illumination,
    positions: &[Vec3],
    normals: &[Vec3],
) -> Vec<Vec3> {
    let height = cuts.lights.height();
    let illumination = light.as_cut();
    (normals.par_iter().zip(positions).with_min_len(64).enumerate())
        .map(|(site, (normal, &position))| {
            let mut sum = Vec3::ZERO;
            merge([cuts.cuts.cut(site), illumination], |node, [seen, _]| {
                let slot = node.slot(height);
                let node = cuts.lights.view(slot, position);
                let cosine = normal.dot(node.direction).max(0.0) * node.length;
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

fn fill_column<T>(column: &mut Vec<T>, values: impl ExactSizeIterator<Item = T>) {
    column.clear();
    column.extend(values);
}

/// The merged cut of some sites and of the illumination, without the nodes that are dark for all.
#[derive(Default)]
struct Merged {
    /// Nodes before dark ones were dropped.
    nodes: u64,
    /// Slot of each node and its visibility from each site, as the traversal finds them.
    found: Vec<(u32, [f32; SITES])>,
    slots: Vec<u32>,
    /// Visibility of the node from each site.
    seen: [Vec<f32>; SITES],
    /// [`NodeView`] of each node, its direction being in `whole`.
    lengths: Vec<f32>,
    radii: Vec<f32>,
    /// Middles (x, y, z), spreads and radii of nodes of surface samples, see [`position_tree::PositionTree`].
    near: [Vec<f32>; 5],
    /// The nodes with visibility between the sites of the fragment at hand.
    whole: Columns,
    /// Parts of nodes that are too wide for the fragment at hand.
    split: Columns,
}

impl Merged {
    fn fill(&mut self, cuts: &VisibilityCuts, light: &Illumination, sites: [u32; SITES]) {
        let height = cuts.lights.height();
        self.nodes = 0;
        self.found.clear();
        // A site that is not there sees nothing, and costs nothing: its only node is the root.
        let root = [height];
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
            let slot = node.slot(height);
            let flux = light.flux[slot];
            if seen <= 0.0 || flux == Vec3::ZERO {
                return;
            }
            let [a, b, c, d, _] = *values;
            self.found.push((slot as u32, [a, b, c, d]));
        });
        self.spread_out(cuts, light);
    }

    /// Fills the columns for the nodes that were found.
    fn spread_out(&mut self, cuts: &VisibilityCuts, light: &Illumination) {
        let Merged {
            found,
            slots,
            seen,
            lengths,
            radii,
            near,
            whole,
            ..
        } = self;
        fill_column(slots, found.iter().map(|node| node.0));
        for (k, column) in seen.iter_mut().enumerate() {
            fill_column(column, found.iter().map(|node| node.1[k]));
        }
        for (axis, column) in whole.flux.iter_mut().enumerate() {
            fill_column(column, slots.iter().map(|&slot| light.flux[slot as usize][axis]));
        }
        whole.visibility.resize(slots.len(), 0.0);
        match &cuts.lights {
            // Distant lights look the same from everywhere.
            Lights::Directions(Directions { tree, .. }) => {
                fill_column(lengths, slots.iter().map(|&slot| tree.lengths[slot as usize]));
                fill_column(radii, slots.iter().map(|&slot| tree.radii[slot as usize]));
                for (axis, column) in whole.direction.iter_mut().enumerate() {
                    fill_column(
                        column,
                        slots.iter().map(|&slot| tree.directions[slot as usize][axis]),
                    );
                }
            }
            // Others are looked at from each fragment.
            Lights::Surface(SurfaceSamples { tree, .. }) => {
                let [x, y, z, spreads, wide] = near;
                for (axis, column) in [x, y, z].into_iter().enumerate() {
                    fill_column(
                        column,
                        slots.iter().map(|&slot| tree.middles[slot as usize][axis]),
                    );
                }
                fill_column(spreads, slots.iter().map(|&slot| tree.spreads[slot as usize]));
                fill_column(wide, slots.iter().map(|&slot| tree.radii[slot as usize]));
                for column in whole.direction.iter_mut().chain([lengths, radii]) {
                    column.resize(slots.len(), 0.0);
                }
            }
        }
    }

    /// Looks at nodes of surface samples from a fragment.
    fn look_from(&mut self, from: Vec3) {
        let n = self.slots.len();
        let [x, y, z, spreads, radii] = self.near.each_ref().map(|column| &column[..n]);
        let [dx, dy, dz] = self.whole.direction.each_mut().map(|column| &mut column[..n]);
        let (seen_lengths, seen_radii) = (&mut self.lengths[..n], &mut self.radii[..n]);
        for i in 0..n {
            let middle = Vec3::new(x[i], y[i], z[i]);
            let view = position_tree::view(middle, spreads[i], radii[i], from);
            (dx[i], dy[i], dz[i]) = view.direction.into();
            seen_lengths[i] = view.length;
            seen_radii[i] = view.radius;
        }
    }

    /// Visibility between the sites, times the lengths.
    fn interpolate(&mut self, weights: &[f32; SITES]) {
        let n = self.slots.len();
        let [a, b, c, d] = &self.seen;
        let (a, b, c, d) = (&a[..n], &b[..n], &c[..n], &d[..n]);
        let lengths = &self.lengths[..n];
        let [wa, wb, wc, wd] = *weights;
        for (i, out) in self.whole.visibility[..n].iter_mut().enumerate() {
            *out = (a[i] * wa + b[i] * wb + c[i] * wc + d[i] * wd) * lengths[i];
        }
    }

    /// Mean angular radius of the leaves in a lobe, weighted by how much the lobe sees of them.
    fn grain(&self, samples: &SurfaceSamples, lobe: &Lobe) -> f32 {
        let tree = &samples.tree;
        let leaf = tree.radii[tree.middles.len() / 2];
        let (mut sum, mut weight) = (0.0, 0.0);
        for (i, &seen) in self.whole.visibility.iter().enumerate() {
            let direction = Vec3::from(self.whole.direction.each_ref().map(|column| column[i]));
            if seen > 0.0 && overlaps(lobe, direction, self.radii[i]) {
                // The node's own radius is known in metres and as it is seen.
                sum += seen * leaf * self.radii[i] / tree.radii[self.slots[i] as usize];
                weight += seen;
            }
        }
        if weight > 0.0 { sum / weight } else { 0.0 }
    }

    /// Moves the nodes that are too wide to `split`, in parts.
    fn split_by(&mut self, splitter: &Splitter) {
        self.split.clear();
        let Columns {
            direction: [x, y, z],
            visibility,
            ..
        } = &mut self.whole;
        for (i, seen) in visibility.iter_mut().enumerate() {
            let direction = Vec3::new(x[i], y[i], z[i]);
            if *seen > 0.0 && splitter.is_too_wide(direction, self.radii[i]) {
                let slot = self.slots[i] as usize;
                splitter.push_parts(slot, *seen / self.lengths[i], &mut self.split);
                *seen = 0.0;
            }
        }
    }
}

/// Diameter of a node, in angular radii of a lobe, above which it is split: six nodes then lie side by side in what holds
/// 90 % of the lobe.
const RESOLUTION: f32 = 1.0 / 3.0;

/// Angular radius (radians) above which a node of near lights is split whatever the lobe: directions to its leaves then
/// differ by more than the second order in which their mean is known, and a fragment within it has no direction to it.
const WIDEST: f32 = 0.5;

fn overlaps(lobe: &Lobe, direction: Vec3, radius: f32) -> bool {
    // Between unit vectors |a − b|² = 2 − 2 cos, and a chord is never longer than its arc.
    let reach = radius + lobe.width;
    reach * reach > 2.0 - 2.0 * direction.dot(lobe.direction)
}

/// Which nodes are too wide for a fragment.
struct Splitter<'a> {
    lights: &'a Lights,
    light: &'a Illumination,
    /// Where the fragment is.
    from: Vec3,
    lobe: Option<Lobe>,
    /// Largest angular radius whatever the lobe.
    widest: f32,
}

impl Splitter<'_> {
    fn is_too_wide(&self, direction: Vec3, radius: f32) -> bool {
        radius > self.widest
            || self.lobe.is_some_and(|lobe| {
                2.0 * radius > RESOLUTION * lobe.width && overlaps(&lobe, direction, radius)
            })
    }

    /// Appends a node of visibility `seen`, or, where it is too wide, its descendants.
    fn push_parts(&self, slot: usize, seen: f32, out: &mut Columns) {
        let flux = self.light.flux[slot];
        if flux == Vec3::ZERO {
            return;
        }
        let view = self.lights.view(slot, self.from);
        if slot < self.lights.leaves() && self.is_too_wide(view.direction, view.radius) {
            self.push_parts(2 * slot, seen, out);
            self.push_parts(2 * slot + 1, seen, out);
        } else {
            out.push(view.direction, seen * view.length, flux);
        }
    }
}

fn reflected(
    lights: &Lights,
    light: &Illumination,
    merged: &mut Merged,
    point: &ShadingPoint,
    view: Vec3,
    weights: &[f32; SITES],
) -> Vec3 {
    if let Lights::Surface(_) = lights {
        merged.look_from(point.position);
    }
    merged.interpolate(weights);
    let mut splitter = Splitter {
        lights,
        light,
        from: point.position,
        lobe: None,
        widest: match lights {
            Lights::Directions(_) => f32::INFINITY,
            Lights::Surface(_) => WIDEST,
        },
    };
    if point.lambert {
        if splitter.widest == f32::INFINITY {
            return bsdf::irradiance(point, &merged.whole.incident()) * point.diffuse * FRAC_1_PI;
        }
        merged.split_by(&splitter);
        let sum = |part: &Columns| bsdf::irradiance(point, &part.incident());
        return (sum(&merged.whole) + sum(&merged.split)) * point.diffuse * FRAC_1_PI;
    }
    // A lobe narrower than the lights would fall between them: it is widened to theirs.
    let grain = match lights {
        Lights::Directions(directions) => directions.tree.radii[lights.leaves()],
        Lights::Surface(samples) => bsdf::lobe(point, view).map_or(0.0, |lobe| merged.grain(samples, &lobe)),
    };
    let point = bsdf::at_least_as_wide(point, grain);
    // None where it is matt by its parameters, or seen from below its horizon.
    splitter.lobe = bsdf::lobe(&point, view);
    merged.split_by(&splitter);
    bsdf::integrate(&point, view, &merged.whole.incident())
        + bsdf::integrate(&point, view, &merged.split.incident())
}
