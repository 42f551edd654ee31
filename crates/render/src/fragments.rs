//! Which rays of a pixel share a fragment.
//!
//! Rays come one after another; each joins the first fragment whose first ray it is like, and adds to its means. How a ray's surface reflects is forgotten
//! then, and found again for the one ray that stands for its fragment: of all rays it would be most of what is kept.

use crate::exposure::{Exposure, RayEnd};
use glam::Vec3;
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::{Look, TracedScene};

/// Ray ends that are kept of a pixel that sees one thing: the error of a straight edge of a shadow
/// falls with the power 3/4 of their number, to a quarter.
pub(crate) const ENDS: f32 = 6.0;

/// Ray ends that are kept of a pixel that sees several things, shared among its fragments by coverage. With 6 the Sponza with
/// leaves under lamps had a quarter more error (docs/notebook/cuts.md).
pub(crate) const FINER_ENDS: f32 = 16.0;

/// Cosine between the smooth normals of two rays above which they may share a fragment: 8°. A lamp that grazes a fold lights
/// one side of it only: 18° left Sponza's mouldings 2.7 % too dark instead of 1.7 %, for a tenth fewer fragments (docs/notebook/cuts.md).
const SAME_FACING: f32 = 0.99;

/// How far, in pixel footprints, the second ray's surface may lie off the first one's tangent plane.
const SAME_PLANE: f32 = 2.0;

/// What a ray shows.
#[derive(Clone, Copy)]
pub(crate) struct Sight {
    /// Unit direction of the last part of its way: of the ray itself, where no solid glass bends it.
    pub direction: Vec3,
    pub bent: bool,
    /// What it meets, `t` the length of the whole way, and how that reflects; `None` for the background.
    pub seen: Option<(SurfaceHit, ShadingPoint)>,
}

impl Sight {
    pub fn new(scene: &TracedScene, look: &Look) -> Sight {
        Sight {
            direction: look.ray.direction,
            bent: look.bent,
            seen: look.hit.map(|hit| {
                let point = seen_at(scene, look, &hit);
                (
                    SurfaceHit {
                        t: look.length(),
                        ..hit
                    },
                    point,
                )
            }),
        }
    }

    /// What a fragment shows.
    pub fn of(row: &Exposure, f: usize) -> Sight {
        Sight {
            direction: row.directions[f],
            bent: row.is_bent(f),
            seen: row.hits[f].zip(row.points[f]),
        }
    }

    /// Whether two rays may share a fragment; `footprint`: size of a pixel at distance 1.
    pub fn is_like(&self, other: &Sight, footprint: f32) -> bool {
        if self.bent != other.bent || (self.bent && self.direction.dot(other.direction) <= SAME_FACING) {
            return false;
        }
        match (&self.seen, &other.seen) {
            (None, None) => true,
            (Some((a, p)), Some((b, q))) => {
                let off_plane = (b.position - a.position).dot(a.geometric_normal).abs();
                p.material == q.material
                    && a.normal.dot(b.normal) > SAME_FACING
                    && (p.lambert || p.shading_normal.dot(q.shading_normal) > SAME_FACING)
                    && off_plane < SAME_PLANE * footprint * a.t.max(b.t)
                    && (p.emission == Vec3::ZERO) == (q.emission == Vec3::ZERO)
            }
            _ => false,
        }
    }
}

/// How what an eye looks at reflects.
fn seen_at(scene: &TracedScene, look: &Look, hit: &SurfaceHit) -> ShadingPoint {
    let mut point = scene.shading_point(hit).facing(-look.ray.direction);
    // As if what lies behind panes had their colour.
    let tint = look.tint * scene.tint(&look.ray, hit.t);
    for color in [
        &mut point.base_color,
        &mut point.diffuse,
        &mut point.f0,
        &mut point.emission,
    ] {
        *color *= tint;
    }
    point
}

/// The rays of a pixel so far, and their fragments.
pub(crate) struct PixelRays<'a> {
    scene: &'a TracedScene,
    /// Size of a pixel at distance 1.
    footprint: f32,
    rays: Vec<PixelRay>,
    groups: Vec<Group>,
}

struct PixelRay {
    /// Unit direction from the camera.
    through: Vec3,
    look: Look,
    group: usize,
}

/// Rays that share a fragment.
struct Group {
    first: Sight,
    count: u32,
    through: Vec3,
    sums: Sums,
}

/// Sums of what a fragment has the mean of.
#[derive(Clone, Copy, Default)]
struct Sums {
    geometric_normal: Vec3,
    normal: Vec3,
    shading_normal: Vec3,
    base_color: Vec3,
    diffuse: Vec3,
    f0: Vec3,
    emission: Vec3,
}

impl<'a> PixelRays<'a> {
    pub fn new(scene: &'a TracedScene, footprint: f32) -> PixelRays<'a> {
        PixelRays {
            scene,
            footprint,
            rays: Vec::new(),
            groups: Vec::new(),
        }
    }

    /// How many rays there are.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Adds a ray that leaves the camera in the unit direction `through`.
    pub fn push(&mut self, through: Vec3, look: Look) {
        let sight = Sight::new(self.scene, &look);
        let footprint = self.footprint;
        let like = |group: &Group| group.first.is_like(&sight, footprint);
        let group = self.groups.iter().position(like).unwrap_or_else(|| {
            self.groups.push(Group {
                first: sight,
                count: 0,
                through: Vec3::ZERO,
                sums: Sums::default(),
            });
            self.groups.len() - 1
        });
        self.groups[group].add(through, &sight);
        self.rays.push(PixelRay { through, look, group });
    }

    /// Appends the pixel's fragments, with about `ends` of the places where its rays end, and forgets its rays.
    pub fn append_to(&mut self, row: &mut Exposure, ends: f32) {
        row.offsets.push(row.coverage.len() as u32);
        let all = self.rays.len() as f32;
        for (index, group) in self.groups.iter().enumerate() {
            let coverage = group.count as f32 / all;
            row.coverage.push(coverage);
            let members = || self.rays.iter().filter(|ray| ray.group == index);
            // Any number of first rays of the pattern is evenly spread.
            let kept = (members().filter_map(|ray| ray.look.hit.as_ref())).map(|hit| RayEnd {
                primitive: hit.primitive,
                barycentric: hit.barycentric,
                front: hit.front,
            });
            row.ends.extend(kept.take((ends * coverage).ceil() as usize));
            row.end_offsets.push(row.ends.len() as u32);
            let middle = group.through / group.count as f32;
            let distance = |ray: &&PixelRay| (ray.through - middle).length_squared();
            let Some(nearest) = members().min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
                continue;
            };
            let sight = Sight::new(self.scene, &nearest.look);
            row.directions.push(sight.direction);
            if self.scene.bends() {
                row.through.push(nearest.through);
            }
            let (hit, point) = sight.seen.unzip();
            row.hits.push(hit);
            row.points.push(point.map(|point| group.mean(&point)));
        }
        self.rays.clear();
        self.groups.clear();
    }
}

impl Group {
    fn add(&mut self, through: Vec3, sight: &Sight) {
        self.count += 1;
        self.through += through;
        let Some((_, point)) = &sight.seen else { return };
        let sums = &mut self.sums;
        sums.geometric_normal += point.geometric_normal;
        sums.normal += point.normal;
        sums.shading_normal += point.shading_normal;
        sums.base_color += point.base_color;
        sums.diffuse += point.diffuse;
        sums.f0 += point.f0;
        sums.emission += point.emission;
    }

    /// How the fragment reflects of which `point` is one.
    fn mean(&self, point: &ShadingPoint) -> ShadingPoint {
        let (sums, count) = (&self.sums, self.count as f32);
        let normal = sums.shading_normal / count;
        let mean = ShadingPoint {
            // The facet that the middle ray meets may face a grazing lamp less than the others do.
            geometric_normal: (sums.geometric_normal / count)
                .try_normalize()
                .unwrap_or(point.geometric_normal),
            base_color: sums.base_color / count,
            diffuse: sums.diffuse / count,
            f0: sums.f0 / count,
            emission: sums.emission / count,
            shading_normal: normal.try_normalize().unwrap_or(point.shading_normal),
            ..*point
        };
        // Only what the normal map adds: over a smooth curve normals change evenly, and a lobe of their spread
        // would have tails that reach farther than any of them.
        let smooth = (sums.normal / count).length();
        bsdf::spread_by_normals(&mean, 1.0 - (smooth - normal.length()).max(0.0))
    }
}
