//! Albedos of the metallic-roughness BRDF, from tables.
//!
//! The specular part's directional albedo is linear in f0 and f90: E = f0 A(μ, α) + f90 B(μ, α) (the split sum of Karis
//! 2013), with A and B the means of (1 − F_c) G2/G1 and F_c G2/G1 over visible normals, F_c = (1 − wo·h)⁵. The
//! diffuse part as glTF prints it has D = c_diff (1 − f0) K(μ) with K(μ) = (1/π) ∫ (1 − (1 − wo·h)⁵) cosθ dω,
//! independent of α. The tables are integrated once per process, on first use, by a fixed quadrature.
//!
//! Anisotropic lobes are taken as the geometric mean of those that are as wide everywhere as along and as across the tangent, whatever
//! the azimuth; what the diffuse part may have is what the brighter of the two leaves.
//!
//! Errors (tested against quadrature of the BRDF): directional albedos within 3e-3, hemispherical ones within
//! 1e-2.

use super::layers::Over;
use super::microfacet::{masking, sample_visible_normal};
use super::mixture;
use crate::shading::{Gloss, MIN_ALPHA, ShadingPoint};
use glam::Vec3;
use std::f32::consts::TAU;
use std::sync::LazyLock;

/// Nodes over x = μ^¼: the root puts many of them near the horizon, where masking varies around μ = α.
const COSINES: usize = 96;
/// Nodes over α^¼, for the same reason.
const ROUGHNESSES: usize = 48;
/// Nodes of the quadrature over visible normals, and over directions for K. A Fibonacci number: that makes the
/// lattice of [`lattice`] even. Square grids are much worse, since masking cuts off along an axis.
const QUADRATURE: usize = 610;
/// Nodes of the quadrature over μ for averages.
const AVERAGE_NODES: usize = 16;

/// What a table lookup may understate the specular albedo by; held back from the diffuse part so that the
/// total stays at or below one.
const TABLE_MARGIN: f32 = 3e-3;

struct Tables {
    /// (A, B) for each roughness, row by row over the cosines.
    specular: Vec<[f32; 2]>,
    /// K for each cosine.
    diffuse: Vec<f32>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| Tables {
    specular: (0..ROUGHNESSES * COSINES)
        .map(|at| specular_integrals(node_alpha(at / COSINES), node_cosine(at % COSINES)))
        .collect(),
    diffuse: (0..COSINES).map(|at| diffuse_integral(node_cosine(at))).collect(),
});

fn node_cosine(at: usize) -> f32 {
    let x = at as f32 / (COSINES - 1) as f32;
    // The limit at the horizon is approached, not reached.
    (x * x * x * x).max(1e-7)
}

/// Place of a cosine in the tables, in 0..=1.
fn cosine_place(cos: f32) -> f32 {
    cos.max(0.0).sqrt().sqrt()
}

/// Place of α in the tables, in 0..=1.
fn alpha_place(alpha: f32) -> f32 {
    let lowest = MIN_ALPHA.sqrt().sqrt();
    (alpha.sqrt().sqrt() - lowest) / (1.0 - lowest)
}

fn node_alpha(at: usize) -> f32 {
    let lowest = MIN_ALPHA.sqrt().sqrt();
    let root = lowest + (1.0 - lowest) * at as f32 / (ROUGHNESSES - 1) as f32;
    (root * root).powi(2)
}

/// Point `k` of the Fibonacci lattice of [`QUADRATURE`] points on the unit square.
fn lattice(k: usize) -> [f32; 2] {
    // 377 is the Fibonacci number before 610.
    let turn = (k * 377 % QUADRATURE) as f32 / QUADRATURE as f32;
    [(k as f32 + 0.5) / QUADRATURE as f32, turn]
}

/// A and B at one roughness and angle.
fn specular_integrals(alpha: f32, cos_o: f32) -> [f32; 2] {
    let wo = Vec3::new((1.0 - cos_o * cos_o).max(0.0).sqrt(), 0.0, cos_o);
    let mut sums = [0.0f64; 2];
    for k in 0..QUADRATURE {
        let u = lattice(k);
        let h = sample_visible_normal(wo, alpha, u);
        let cos_oh = wo.dot(h);
        let cos_i = 2.0 * cos_oh * h.z - cos_o;
        if cos_i <= 0.0 {
            continue;
        }
        let weight = masking(cos_o, cos_i, alpha);
        let schlick = (1.0 - cos_oh).max(0.0).powi(5);
        sums[0] += f64::from(weight * (1.0 - schlick));
        sums[1] += f64::from(weight * schlick);
    }
    sums.map(|sum| (sum / QUADRATURE as f64) as f32)
}

/// K at one angle.
fn diffuse_integral(cos_o: f32) -> f32 {
    let wo = Vec3::new((1.0 - cos_o * cos_o).max(0.0).sqrt(), 0.0, cos_o);
    let mut sum = 0.0f64;
    for k in 0..QUADRATURE {
        let u = lattice(k);
        let (sin, cos) = (TAU * u[1]).sin_cos();
        let wi = Vec3::new(u[0].sqrt() * cos, u[0].sqrt() * sin, (1.0 - u[0]).sqrt());
        let cos_oh = (0.5 * (1.0 + wo.dot(wi))).max(0.0).sqrt();
        sum += f64::from(1.0 - (1.0 - cos_oh).max(0.0).powi(5));
    }
    (sum / QUADRATURE as f64) as f32
}

/// Index of the lower node and weight of the upper one.
fn place(x: f32, nodes: usize) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (nodes - 1) as f32;
    let at = (x as usize).min(nodes - 2);
    (at, x - at as f32)
}

/// The two rows of the specular table between which a roughness lies, and the weight of the upper one.
struct SpecularRows(&'static [[f32; 2]], &'static [[f32; 2]], f32);

fn specular_rows(alpha: f32) -> SpecularRows {
    let (row, f) = place(alpha_place(alpha), ROUGHNESSES);
    let (low, high) = TABLES.specular[row * COSINES..(row + 2) * COSINES].split_at(COSINES);
    SpecularRows(low, high, f)
}

impl SpecularRows {
    /// (A, B) at a node of the cosines.
    fn at_node(&self, node: usize) -> [f32; 2] {
        let SpecularRows(low, high, f) = *self;
        [0, 1].map(|k| low[node][k] * (1.0 - f) + high[node][k] * f)
    }

    /// (A, B) at a place between cosines, interpolated.
    fn at(&self, (column, fc): (usize, f32)) -> [f32; 2] {
        let SpecularRows(low, high, fr) = *self;
        let along = |row: &[[f32; 2]], k: usize| row[column][k] * (1.0 - fc) + row[column + 1][k] * fc;
        [0, 1].map(|k| along(low, k) * (1.0 - fr) + along(high, k) * fr)
    }
}

/// (A, B), interpolated.
fn specular_factors(alpha: f32, cos: f32) -> [f32; 2] {
    specular_rows(alpha).at(place(cosine_place(cos), COSINES))
}

/// K, interpolated.
fn diffuse_factor(cos: f32) -> f32 {
    let (at, f) = place(cosine_place(cos), COSINES);
    TABLES.diffuse[at] * (1.0 - f) + TABLES.diffuse[at + 1] * f
}

/// Directional albedo E of the specular part alone, seen at cosine `cos` with the normal; RGB in 0..=1.
pub fn specular(point: &ShadingPoint, cos: f32) -> Vec3 {
    let [along, across] = specular_each(point, cos);
    match point.gloss {
        Gloss::GgxAnisotropic { .. } => (along * across).map(f32::sqrt),
        _ => along,
    }
}

/// E of lobes as wide as this one along and across the tangent.
fn specular_each(point: &ShadingPoint, cos: f32) -> [Vec3; 2] {
    let of = |alpha| specular_albedo(point.f0, point.f90, specular_factors(alpha, cos));
    match point.gloss {
        Gloss::GgxAnisotropic { alpha, .. } => alpha.map(of),
        _ => [of(point.alpha); 2],
    }
}

fn specular_albedo(f0: Vec3, f90: f32, [a, b]: [f32; 2]) -> Vec3 {
    (f0 * a + f90 * b).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Directional albedo D of the diffuse part as glTF prints it.
fn diffuse_printed(point: &ShadingPoint, cos: f32) -> Vec3 {
    let k = diffuse_factor(cos);
    match point.veil {
        Some([v0, v90]) => point.diffuse * ((1.0 - v90) + (v90 - v0) * k),
        None if point.f90 == 1.0 => point.diffuse * (Vec3::ONE - point.f0) * k,
        None => point.diffuse * ((1.0 - point.f90) + (Vec3::splat(point.f90) - point.f0) * k),
    }
}

/// Largest directional albedo of the diffuse part that conserves energy: min(D, 1 − E).
pub(super) fn diffuse_limit(point: &ShadingPoint, cos: f32) -> Vec3 {
    let [along, across] = specular_each(point, cos);
    limit(diffuse_printed(point, cos), along.max(across))
}

fn limit(printed: Vec3, specular: Vec3) -> Vec3 {
    let left = Vec3::splat(1.0 - TABLE_MARGIN) - specular;
    printed.min(left.max(Vec3::ZERO))
}

/// The factor s(μ) of the module [`super`], per channel in 0..=1.
pub(super) fn diffuse_scale(point: &ShadingPoint, cos: f32) -> Vec3 {
    let [along, across] = specular_each(point, cos);
    scale(diffuse_printed(point, cos), along.max(across))
}

fn scale(printed: Vec3, specular: Vec3) -> Vec3 {
    // 0/0 where there is no diffuse part in a channel: any factor will do.
    limit(printed, specular) / printed.max(Vec3::splat(f32::MIN_POSITIVE))
}

/// Bins of cosines in [`GRAZING`].
const BINS: usize = 64;

/// For each bin of cosines the most that B is from its lower end on, whatever the roughness.
static GRAZING: LazyLock<[f32; BINS]> = LazyLock::new(|| {
    std::array::from_fn(|bin| {
        let (first, _) = place(cosine_place(bin as f32 / BINS as f32), COSINES);
        let rows = TABLES.specular.chunks(COSINES);
        let factors = rows.flat_map(|row| &row[first..]).map(|[_, b]| *b);
        factors.fold(0.0, f32::max)
    })
});

/// s(μ_o) s(μ_i).
pub(super) fn diffuse_scales(point: &ShadingPoint, cos_o: f32, cos_i: f32) -> Vec3 {
    match are_unscaled(point, cos_o.min(cos_i)) {
        true => Vec3::ONE,
        false => diffuse_scale(point, cos_o) * diffuse_scale(point, cos_i),
    }
}

/// Whether a bound of what there is of either part says that s is 1 from a cosine on, as for most: no more of the diffuse one than at
/// K = 1, no more of the other than f0 + f90 B.
pub(super) fn are_unscaled(point: &ShadingPoint, cos: f32) -> bool {
    let bin = ((cos * BINS as f32) as usize).min(BINS - 1);
    let most = point.diffuse.max_element() + point.f0.max_element() + point.f90 * GRAZING[bin];
    most < 1.0 - TABLE_MARGIN - ROUNDING
}

/// Of a few sums and products of numbers below 1.
const ROUNDING: f32 = 8.0 * f32::EPSILON;

/// Nodes within which [`DiffuseScale::unscaled_from`] is found: five halvings.
const NODES_APART: usize = 3;

/// s(μ) of one point of [`is_plain`] GGX at many angles.
pub(super) struct DiffuseScale {
    f0: Vec3,
    /// D over K.
    printed: Vec3,
    rows: SpecularRows,
}

impl DiffuseScale {
    pub fn new(point: &ShadingPoint) -> DiffuseScale {
        DiffuseScale {
            f0: point.f0,
            printed: point.diffuse * (Vec3::ONE - point.f0),
            rows: specular_rows(point.alpha),
        }
    }

    /// A cosine from which s is 1 on, since it grows with the cosine; infinite where it never is.
    pub fn unscaled_from(&self) -> f32 {
        let is_one = |node: usize| {
            let printed = self.printed * TABLES.diffuse[node];
            let specular = specular_albedo(self.f0, 1.0, self.rows.at_node(node));
            limit(printed, specular) == printed
        };
        let (mut low, mut high) = (0, COSINES - 1);
        if !is_one(high) {
            return f32::INFINITY;
        }
        while high - low > NODES_APART {
            let middle = (low + high) / 2;
            if is_one(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        node_cosine(high)
    }

    /// The same as [`diffuse_scale`] but for rounding.
    pub fn at(&self, cos: f32) -> Vec3 {
        let (at, f) = place(cosine_place(cos), COSINES);
        let factors = self.rows.at((at, f));
        let diffuse = TABLES.diffuse[at] * (1.0 - f) + TABLES.diffuse[at + 1] * f;
        scale(self.printed * diffuse, specular_albedo(self.f0, 1.0, factors))
    }
}

/// A node of the average over cosine-weighted directions.
struct AverageNode {
    /// Place between the tables' cosines.
    column: (usize, f32),
    /// K there.
    diffuse: f32,
    weight: f32,
}

/// ∫ 2μ f dμ with x = √μ, since f varies near the horizon: ∫ 4x³ f dx, by midpoints.
static AVERAGE: LazyLock<[AverageNode; AVERAGE_NODES]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let x = (k as f32 + 0.5) / AVERAGE_NODES as f32;
        AverageNode {
            column: place(cosine_place(x * x), COSINES),
            diffuse: diffuse_factor(x * x),
            weight: 4.0 * x * x * x / AVERAGE_NODES as f32,
        }
    })
});

/// Share of the light that a point reflects in all, averaged over cosine-weighted directions of arrival: RGB in
/// 0..=1. The albedo for bounces, so that metals and glossy surfaces send light, too.
///
/// Exact for Lambert; Phong and Ward within 5e-3; anisotropic GGX within 2e-2; otherwise within 1e-2 of the BRDF's own integral. The double integral of the diffuse part
/// is taken as a product of single ones, since K hardly depends on the angle.
pub fn hemispherical_albedo(point: &ShadingPoint) -> Vec3 {
    if point.lambert {
        return point.diffuse;
    }
    if let Some(lobe) = mixture::Lobe::of(point) {
        return lobe.hemispherical_albedo(point);
    }
    if !is_plain(point) {
        return extended(point);
    }
    let (mut reflected, mut printed, mut scaled) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    let rows = specular_rows(point.alpha);
    let all_printed = point.diffuse * (Vec3::ONE - point.f0);
    for node in &*AVERAGE {
        let specular = specular_albedo(point.f0, 1.0, rows.at(node.column));
        let own = all_printed * node.diffuse;
        reflected += specular * node.weight;
        printed += own * node.weight;
        scaled += limit(own, specular) * node.weight;
    }
    let diffuse = scaled * scaled / printed.max(Vec3::splat(f32::MIN_POSITIVE));
    (reflected + diffuse).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Whether a point is GGX of the core specification alone: what runs fastest.
pub(super) fn is_plain(point: &ShadingPoint) -> bool {
    point.gloss == Gloss::Ggx && point.f90 == 1.0 && point.veil.is_none() && point.layers.is_none()
}

/// [`hemispherical_albedo`] of GGX with any extension.
fn extended(point: &ShadingPoint) -> Vec3 {
    let (mut printed, mut scaled) = (Vec3::ZERO, Vec3::ZERO);
    let nodes = || {
        (0..AVERAGE_NODES)
            .map(|k| ((k as f32 + 0.5) / AVERAGE_NODES as f32).powi(2))
            .zip(&*AVERAGE)
    };
    for (cos, node) in nodes() {
        printed += diffuse_printed(point, cos) * node.weight;
        scaled += diffuse_limit(point, cos) * node.weight;
    }
    let kept = scaled / printed.max(Vec3::splat(f32::MIN_POSITIVE));
    let mut total = Vec3::ZERO;
    for (cos, node) in nodes() {
        let base = (specular(point, cos) + diffuse_limit(point, cos) * kept).min(Vec3::ONE);
        let seen = match &point.layers {
            Some(layers) => {
                let over = Over::at(layers, cos, cos);
                base * over.base + over.coat * white(layers.coat_alpha, cos) + over.sheen * over.sheen_albedo
            }
            None => base,
        };
        total += seen * node.weight;
    }
    total.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Directional albedo of GGX that mirrors all light.
pub(super) fn white(alpha: f32, cos: f32) -> f32 {
    let [a, b] = specular_factors(alpha, cos);
    (a + b).clamp(0.0, 1.0)
}
