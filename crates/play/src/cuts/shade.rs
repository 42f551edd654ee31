//! Reflected light of many lights at fragments: illumination × visibility × BRDF over merged cuts.
//!
//! Source: Cheslack-Postava et al. 2008, sections 3.2 and 4.2. Fragments that interpolate between the same sites share
//! one traversal.
//!
//! Deviation: where a glossy lobe is narrower than a node, the node is split for the BRDF down to the lobe's width,
//! and light is read at those small nodes, too; the paper takes one direction per node, or a fixed number.

use super::illumination::Illumination;
use super::lights::{CutLights, SurfaceSamples, VisibilityCuts};
use super::position_tree;
use super::sites::{FragmentSites, SITES};
use super::uneven::uncertain::{ShadedFragment, Uncertain, UncertaintyFinder, matt_part};
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::bsdf::{self, Incident, Lobe};
use relight_scene::shading::ShadingPoint;
use relight_transport::cuts::merge;
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

/// What [`shade`] made.
#[derive(Debug, Default)]
pub struct Shaded {
    /// Radiance that each fragment reflects towards its viewer. Fragments without sites get none.
    pub radiance: Vec<Vec3>,
    /// Uneven cells of the light that may be partly hidden, fragment by fragment.
    pub uncertain: Vec<Uncertain>,
    /// Nodes of the merged cut of each fragment, dark ones included; 0 where it was not shaded.
    pub nodes: Vec<u32>,
    /// What it took.
    pub stats: ShadeStats,
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
    /// Those whose lobes something else shades; empty for none.
    pub narrow: &'a [bool],
    /// Shade surfaces that are matt, too.
    pub matt: bool,
}

impl Fragments<'_> {
    /// How a fragment reflects that is to be shaded, and the direction to its viewer.
    fn reflecting(&self, fragment: usize) -> Option<(&ShadingPoint, Vec3)> {
        let point = self.points[fragment].as_ref()?;
        let wanted =
            (self.matt || !point.lambert) && (point.diffuse != Vec3::ZERO || !self.is_narrow(fragment));
        wanted.then(|| (point, self.views[fragment]))
    }

    /// Whether something else shades a fragment's lobe.
    fn is_narrow(&self, fragment: usize) -> bool {
        self.narrow.get(fragment) == Some(&true)
    }
}

/// Reflected light of each fragment.
pub fn shade(cuts: &VisibilityCuts, light: &Illumination, fragments: &Fragments) -> Shaded {
    let sites = fragments.sites;
    let tasks: Vec<Shaded> = (sites.order.par_chunks(TASK))
        .zip(sites.sites.par_chunks(TASK))
        .zip(sites.weights.par_chunks(TASK))
        .map_init(Merged::default, |merged, ((order, sites), weights)| {
            let mut shaded = Shaded::default();
            let mut last = None;
            for (i, &fragment) in order.iter().enumerate() {
                let Some((point, view)) = fragments.reflecting(fragment as usize) else {
                    shaded.radiance.push(Vec3::ZERO);
                    shaded.nodes.push(0);
                    continue;
                };
                if last != Some(sites[i]) {
                    merged.fill(cuts, light, fragments.sites, sites[i]);
                    last = Some(sites[i]);
                }
                shaded.stats.merged_nodes += merged.nodes;
                // A tree of 2^31 leaves would not fit a machine.
                shaded.nodes.push(merged.nodes as u32);
                shaded.stats.fragments += 1;
                let (weights, narrow) = (&weights[i], fragments.is_narrow(fragment as usize));
                let radiance = if narrow {
                    merged.interpolate(weights);
                    bsdf::integrate_diffuse(point, view, &merged.whole.incident())
                } else {
                    reflected(&cuts.lights, light, merged, point, view, weights)
                };
                shaded.radiance.push(radiance);
                if !light.uneven.is_empty() {
                    let matt = narrow.then(|| matt_part(point, view));
                    let place = ShadedFragment {
                        fragment,
                        point: matt.as_ref().unwrap_or(point),
                        view,
                        weights,
                        radiance,
                    };
                    merged.find_uncertain(light, sites[i], &place, &mut shaded.uncertain);
                }
            }
            shaded
        })
        .collect();
    let mut radiance = vec![Vec3::ZERO; fragments.points.len()];
    let mut nodes = vec![0; fragments.points.len()];
    let shaded = tasks
        .iter()
        .flat_map(|task| task.radiance.iter().zip(&task.nodes));
    for (&fragment, (&reflected, &count)) in sites.order.iter().zip(shaded) {
        radiance[fragment as usize] = reflected;
        nodes[fragment as usize] = count;
    }
    Shaded {
        radiance,
        nodes,
        stats: ShadeStats {
            merged_nodes: tasks.iter().map(|task| task.stats.merged_nodes).sum(),
            fragments: tasks.iter().map(|task| task.stats.fragments).sum(),
        },
        uncertain: tasks.into_iter().flat_map(|task| task.uncertain).collect(),
    }
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
                let node = light.view(&cuts.lights, slot, position);
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

/// The merged cut of some sites and of the illumination, without the nodes that are dark for all.
#[derive(Default)]
struct Merged {
    /// Nodes before dark ones were dropped.
    nodes: u64,
    /// Slot of each node and its visibility from each site, as the traversal finds them; more than there are.
    found: Vec<(u32, [f32; SITES])>,
    slots: Vec<u32>,
    /// Visibility of the node from each site.
    seen: [Vec<f32>; SITES],
    /// [`super::node_view::NodeView`] of each node, its direction being in `whole`.
    lengths: Vec<f32>,
    radii: Vec<f32>,
    /// Middles (x, y, z), spreads and radii of nodes of surface samples, see [`position_tree::PositionTree`].
    near: [Vec<f32>; 5],
    /// Whether each node is too wide for the fragment at hand.
    wide: Vec<bool>,
    /// The nodes with visibility between the sites of the fragment at hand.
    whole: Columns,
    /// Parts of nodes that are too wide for the fragment at hand.
    split: Columns,
    finder: UncertaintyFinder,
    /// Whether `finder` has looked these nodes up.
    looked_up: bool,
}

impl Merged {
    fn fill(
        &mut self,
        cuts: &VisibilityCuts,
        light: &Illumination,
        fragments: &FragmentSites,
        sites: [u32; SITES],
    ) {
        let height = cuts.lights.height();
        let [a, b, c] = fragments.cuts(cuts, sites);
        let all = [a, b, c, light.as_cut()];
        // A merged cut has at most as many nodes as its parts together.
        let most = all.iter().map(|cut| cut.heights.len()).sum();
        if self.found.len() < most {
            self.found.resize(most, (0, [0.0; SITES]));
        }
        let found = &mut self.found[..most];
        let (mut nodes, mut lit) = (0, 0);
        merge(all, |node, values| {
            let slot = node.slot(height);
            let [a, b, c, _] = *values;
            // Without a branch, see the traversal: the next node overwrites a dark one.
            found[lit] = (slot as u32, [a, b, c]);
            lit += usize::from((a + b + c > 0.0) & (light.flux[slot] != Vec3::ZERO));
            nodes += 1;
        });
        self.nodes = nodes;
        self.looked_up = false;
        self.spread_out(cuts, light, lit);
    }

    /// Appends the uneven cells of the light that are uncertain for a fragment between `sites`.
    #[inline(never)]
    fn find_uncertain(
        &mut self,
        light: &Illumination,
        sites: [u32; SITES],
        place: &ShadedFragment,
        out: &mut Vec<Uncertain>,
    ) {
        let Some(stakes) = light.uneven.stakes(place) else {
            return;
        };
        if !self.looked_up {
            let found = self.found[..self.slots.len()].iter().copied();
            self.finder.look_up(&light.uneven, sites, found);
            self.looked_up = true;
        }
        self.finder.find(&light.uneven, place, &stakes, out);
    }

    /// Fills the columns for the first `n` nodes that were found.
    fn spread_out(&mut self, cuts: &VisibilityCuts, light: &Illumination, n: usize) {
        let found = &self.found[..n];
        self.slots.clear();
        self.slots.extend(found.iter().map(|node| node.0));
        let [a, b, c] = self.seen.each_mut().map(|column| sized(column, n));
        let [red, green, blue] = self.whole.flux.each_mut().map(|column| sized(column, n));
        for i in 0..n {
            let (slot, seen) = found[i];
            [a[i], b[i], c[i]] = seen;
            [red[i], green[i], blue[i]] = light.flux[slot as usize].to_array();
        }
        sized(&mut self.whole.visibility, n);
        let [x, y, z] = self.whole.direction.each_mut().map(|column| sized(column, n));
        let (lengths, radii) = (sized(&mut self.lengths, n), sized(&mut self.radii, n));
        match &cuts.lights {
            // Distant lights look the same from everywhere.
            CutLights::Directions(_) => {
                for i in 0..n {
                    let view = light.views[found[i].0 as usize];
                    [x[i], y[i], z[i]] = view.direction.to_array();
                    lengths[i] = view.length;
                    radii[i] = view.radius;
                }
            }
            // Others are looked at from each fragment.
            CutLights::Surface(SurfaceSamples { tree, .. }) => {
                let [x, y, z, spreads, wide] = self.near.each_mut().map(|column| sized(column, n));
                for i in 0..n {
                    let slot = found[i].0 as usize;
                    [x[i], y[i], z[i]] = tree.middles[slot].to_array();
                    spreads[i] = tree.spreads[slot];
                    wide[i] = tree.radii[slot];
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
        let [a, b, c] = &self.seen;
        let (a, b, c) = (&a[..n], &b[..n], &c[..n]);
        let lengths = &self.lengths[..n];
        let [wa, wb, wc] = *weights;
        for (i, out) in self.whole.visibility[..n].iter_mut().enumerate() {
            *out = (a[i] * wa + b[i] * wb + c[i] * wc) * lengths[i];
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
        let n = self.slots.len();
        let [x, y, z] = self.whole.direction.each_ref().map(|column| &column[..n]);
        let radii = &self.radii[..n];
        // First all of them without a branch, since few are.
        let wide = sized(&mut self.wide, n);
        for i in 0..n {
            wide[i] = splitter.is_too_wide(Vec3::new(x[i], y[i], z[i]), radii[i]);
        }
        for (i, &wide) in wide.iter().enumerate() {
            let seen = self.whole.visibility[i];
            if wide && seen > 0.0 {
                let slot = self.slots[i] as usize;
                splitter.push_parts(slot, seen / self.lengths[i], &mut self.split);
                self.whole.visibility[i] = 0.0;
            }
        }
    }
}

/// A column as a slice of `n` entries, whatever they hold.
fn sized<T: Copy + Default>(column: &mut Vec<T>, n: usize) -> &mut [T] {
    column.resize(n, T::default());
    &mut column[..n]
}

/// Diameter of a node, in angular radii of a lobe, above which it is split: four nodes then lie side by side in what holds
/// 90 % of the lobe. Six take up to half more time and change relMSE by 0.00004 (docs/notebook/cuts.md).
const RESOLUTION: f32 = 0.5;

/// Angular radius (radians) above which a node of near lights is split whatever the lobe: directions to its leaves then
/// differ by more than the second order in which their mean is known, and a fragment within it has no direction to it.
const WIDEST: f32 = 0.5;

/// What is matt has a lobe for which no node is too wide.
const NO_LOBE: Lobe = Lobe {
    direction: Vec3::Y,
    width: f32::INFINITY,
};

#[inline(always)]
fn overlaps(lobe: &Lobe, direction: Vec3, radius: f32) -> bool {
    // Between unit vectors |a − b|² = 2 − 2 cos, and a chord is never longer than its arc.
    let reach = radius + lobe.width;
    reach * reach > 2.0 - 2.0 * direction.dot(lobe.direction)
}

/// Which nodes are too wide for a fragment.
struct Splitter<'a> {
    lights: &'a CutLights,
    light: &'a Illumination,
    /// Where the fragment is.
    from: Vec3,
    lobe: Lobe,
    /// Largest angular radius whatever the lobe.
    widest: f32,
}

impl Splitter<'_> {
    #[inline(always)]
    fn is_too_wide(&self, direction: Vec3, radius: f32) -> bool {
        // & instead of &&: without branches the compiler takes several nodes at a time.
        (radius > self.widest)
            | ((2.0 * radius > RESOLUTION * self.lobe.width) & overlaps(&self.lobe, direction, radius))
    }

    /// Appends a node of visibility `seen`, or, where it is too wide, its descendants.
    fn push_parts(&self, slot: usize, seen: f32, out: &mut Columns) {
        let flux = self.light.flux[slot];
        if flux == Vec3::ZERO {
            return;
        }
        let view = self.light.view(self.lights, slot, self.from);
        if slot < self.lights.leaves() && self.is_too_wide(view.direction, view.radius) {
            self.push_parts(2 * slot, seen, out);
            self.push_parts(2 * slot + 1, seen, out);
        } else {
            out.push(view.direction, seen * view.length, flux);
        }
    }
}

fn reflected(
    lights: &CutLights,
    light: &Illumination,
    merged: &mut Merged,
    point: &ShadingPoint,
    view: Vec3,
    weights: &[f32; SITES],
) -> Vec3 {
    if let CutLights::Surface(_) = lights {
        merged.look_from(point.position);
    }
    merged.interpolate(weights);
    let mut splitter = Splitter {
        lights,
        light,
        from: point.position,
        lobe: NO_LOBE,
        widest: match lights {
            CutLights::Directions(_) => f32::INFINITY,
            CutLights::Surface(_) => WIDEST,
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
        CutLights::Directions(directions) => directions.tree.views[lights.leaves()].radius,
        CutLights::Surface(samples) => {
            bsdf::lobe(point, view).map_or(0.0, |lobe| merged.grain(samples, &lobe))
        }
    };
    let point = bsdf::at_least_as_wide(point, grain);
    // None where it is matt by its parameters, or seen from below its horizon.
    splitter.lobe = bsdf::lobe(&point, view).unwrap_or(NO_LOBE);
    merged.split_by(&splitter);
    bsdf::integrate(&point, view, &merged.whole.incident())
        + bsdf::integrate(&point, view, &merged.split.incident())
}
