//! Which rays of a pixel share a fragment.
//!
//! Rays come one after another; each joins the first fragment whose first ray it is like, and adds to its means. How a ray's surface reflects is forgotten
//! then, and found again for the one ray that stands for its fragment: of all rays it would be most of what is kept. Of most materials only the colour changes
//! within a triangle: after the first few rays of a fragment that is all that is looked up of those that meet the same triangles. Looking at a ray takes twice the
//! time of casting it.

use crate::exposure::{Exposure, RayEnd};
use glam::Vec3;
use relight_scene::bsdf;
use relight_scene::rays::{Hit, Ray};
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::{BaseColors, Faces, Look, TracedScene};

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

/// Rays of a fragment that are looked at where its triangles are curved: the pattern's first three span the pixel.
const LOOKED_AT: u32 = 3;

/// Standard error of the mean colour of a pixel, as a part of it, below which no more rays are cast. By rays that are spread evenly it is less than
/// what as many random ones give.
const EVEN: f32 = 0.02;

/// Cosine between normals that count as equal: 2°.
const EQUAL_FACING: f32 = 0.9994;

/// What a ray from the eye meets.
pub(crate) enum Met {
    /// It is straight: a triangle, or nothing.
    Straight(Option<Hit>),
    /// Solid glass may have bent it.
    Bent(Box<Look>),
}

impl Met {
    /// Calls `visit(i, met)` for each of some rays from one place, in order.
    pub fn by_each(scene: &TracedScene, rays: &[Ray], mut visit: impl FnMut(usize, Met)) {
        if scene.bends() {
            for (i, ray) in rays.iter().enumerate() {
                visit(i, Met::Bent(Box::new(scene.look(ray, |_, _, _| ()))));
            }
        } else {
            scene.closest_hits_packet(rays, |i, hit| visit(i, Met::Straight(hit)));
        }
    }

    /// What the ray shows.
    pub fn sight(&self, scene: &TracedScene, faces: &mut Faces<'_>, ray: &Ray) -> Sight {
        match self {
            Met::Straight(hit) => {
                let hit = hit.as_ref().map(|hit| faces.hit_by(ray, hit));
                Sight::new(scene, &Look::straight(ray, hit))
            }
            Met::Bent(look) => Sight::new(scene, look),
        }
    }

    /// The triangle on which the ray ends, and where on it.
    fn place(&self) -> Option<(u32, [f32; 2])> {
        match self {
            Met::Straight(hit) => hit.as_ref().map(|hit| (hit.triangle, [hit.u, hit.v])),
            Met::Bent(look) => look.hit.as_ref().map(|hit| (hit.primitive, hit.barycentric)),
        }
    }

    /// Whether a straight ray meets this triangle, or nothing.
    pub fn is_on(&self, triangle: Option<u32>) -> bool {
        matches!(self, Met::Straight(hit) if hit.map(|hit| hit.triangle) == triangle)
    }

    /// Whether two straight rays meet the same triangle, or both nothing.
    fn is_where(&self, other: &Met) -> bool {
        matches!(other, Met::Straight(hit) if self.is_on(hit.map(|hit| hit.triangle)))
    }
}

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

    pub fn as_ref(&self) -> SightRef<'_> {
        SightRef {
            direction: self.direction,
            bent: self.bent,
            seen: self.seen.as_ref().map(|(hit, point)| (hit, point)),
        }
    }
}

/// A [`Sight`] that lies elsewhere.
#[derive(Clone, Copy)]
pub(crate) struct SightRef<'a> {
    direction: Vec3,
    bent: bool,
    seen: Option<(&'a SurfaceHit, &'a ShadingPoint)>,
}

impl<'a> SightRef<'a> {
    /// What a fragment shows.
    pub fn of(row: &'a Exposure, f: usize) -> SightRef<'a> {
        SightRef {
            direction: row.directions[f],
            bent: row.is_bent(f),
            seen: row.hits[f].as_ref().zip(row.points[f].as_ref()),
        }
    }

    /// The triangle that is met.
    pub fn triangle(&self) -> Option<u32> {
        self.seen.map(|(hit, _)| hit.primitive)
    }

    /// Whether two rays may share a fragment; `footprint`: size of a pixel at distance 1.
    pub fn is_like(&self, other: &SightRef<'_>, footprint: f32) -> bool {
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
    faces: Faces<'a>,
    colors: BaseColors<'a>,
    rays: Vec<PixelRay>,
    groups: Vec<Group>,
}

struct PixelRay {
    ray: Ray,
    met: Met,
    of: Of,
}

/// What a ray is of.
#[derive(Clone, Copy)]
struct Of {
    /// Whether it meets a front.
    front: bool,
    facing: Facing,
    /// Whether that is how all of its triangle faces.
    is_flat: bool,
    group: usize,
}

/// Normals where a ray ends, or sums of them.
#[derive(Clone, Copy, Default)]
struct Facing {
    geometric: Vec3,
    smooth: Vec3,
    shading: Vec3,
}

/// Rays that share a fragment.
struct Group {
    first: Sight,
    /// How metallic it is, if in a triangle nothing but its base colour changes.
    metallic: Option<f32>,
    count: u32,
    /// Sums over all rays.
    through: Vec3,
    base_color: Vec3,
    facing: Facing,
    /// Sum of the squares of base colours.
    squares: f32,
    /// How many were looked at.
    looked_at: u32,
    /// Whether those face the same way.
    is_flat: bool,
    /// Sums over those.
    sums: Sums,
}

/// Sums of how rays reflect.
#[derive(Clone, Copy, Default)]
struct Sums {
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
            faces: Faces::new(scene),
            colors: BaseColors::new(scene),
            rays: Vec::new(),
            groups: Vec::new(),
        }
    }

    /// How many rays there are.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Adds a ray from the camera and what it meets.
    pub fn push(&mut self, ray: Ray, met: Met) {
        let (of, base_color) = match self.known(&met) {
            Some(known) => (known, self.base_color(&met)),
            None => self.look_at(&ray, &met),
        };
        let group = &mut self.groups[of.group];
        group.count += 1;
        group.through += ray.direction;
        group.base_color += base_color;
        group.squares += base_color.length_squared();
        group.facing.geometric += of.facing.geometric;
        group.facing.smooth += of.facing.smooth;
        group.facing.shading += of.facing.shading;
        self.rays.push(PixelRay { ray, met, of });
    }

    /// Whether all rays show one thing, of which more of them would tell more: its mean colour, or what nobody looked for.
    pub fn is_one_uneven(&self) -> bool {
        match &self.groups[..] {
            [group] => group.metallic.is_none() || !group.is_even(),
            _ => false,
        }
    }

    /// What is known of a ray by another on the same triangle; `None` where more than its colour may differ.
    fn known(&self, met: &Met) -> Option<Of> {
        let alike = self.rays.iter().rev().find(|ray| ray.met.is_where(met))?;
        let group = &self.groups[alike.of.group];
        let is_flat = alike.of.is_flat || (group.is_flat && group.looked_at >= LOOKED_AT);
        (is_flat && group.metallic.is_some()).then_some(alike.of)
    }

    /// The base colour where a ray ends, linear RGB.
    fn base_color(&mut self, met: &Met) -> Vec3 {
        met.place()
            .map_or(Vec3::ZERO, |(triangle, at)| self.colors.at(triangle, at))
    }

    /// What a ray shows, to whose means it adds, and its base colour.
    fn look_at(&mut self, ray: &Ray, met: &Met) -> (Of, Vec3) {
        let sight = met.sight(self.scene, &mut self.faces, ray);
        let footprint = self.footprint;
        let like = |group: &Group| group.first.as_ref().is_like(&sight.as_ref(), footprint);
        let group = self.groups.iter().position(like).unwrap_or_else(|| {
            self.groups.push(Group::new(self.scene, sight));
            self.groups.len() - 1
        });
        self.groups[group].add(&sight);
        let Some((hit, point)) = &sight.seen else {
            let nothing = Of {
                front: true,
                facing: Facing::default(),
                is_flat: true,
                group,
            };
            return (nothing, Vec3::ZERO);
        };
        let of = Of {
            front: hit.front,
            facing: Facing {
                geometric: point.geometric_normal,
                smooth: point.normal,
                shading: point.shading_normal,
            },
            is_flat: self.faces.is_flat(hit.primitive, EQUAL_FACING),
            group,
        };
        (of, point.base_color)
    }

    /// Appends the pixel's fragments, with about `ends` of the places where its rays end, and forgets its rays.
    pub fn append_to(&mut self, row: &mut Exposure, ends: f32) {
        row.offsets.push(row.coverage.len() as u32);
        let all = self.rays.len() as f32;
        for (index, group) in self.groups.iter().enumerate() {
            let coverage = group.count as f32 / all;
            row.coverage.push(coverage);
            let members = || self.rays.iter().filter(|ray| ray.of.group == index);
            // Any number of first rays of the pattern is evenly spread.
            let kept = members().filter_map(|ray| {
                let (primitive, barycentric) = ray.met.place()?;
                Some(RayEnd {
                    primitive,
                    barycentric,
                    front: ray.of.front,
                })
            });
            row.ends.extend(kept.take((ends * coverage).ceil() as usize));
            row.end_offsets.push(row.ends.len() as u32);
            let middle = group.through / group.count as f32;
            let distance = |of: &&PixelRay| (of.ray.direction - middle).length_squared();
            let Some(nearest) = members().min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
                continue;
            };
            let sight = (nearest.met).sight(self.scene, &mut self.faces, &nearest.ray);
            row.directions.push(sight.direction);
            if self.scene.bends() {
                row.through.push(nearest.ray.direction);
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
    /// Of no ray yet, of those that are like one.
    fn new(scene: &TracedScene, first: Sight) -> Group {
        let metallic = match &first.seen {
            Some((hit, _)) => scene.metallic_but_for_color(hit.primitive),
            None => Some(0.0),
        };
        Group {
            first,
            metallic,
            count: 0,
            through: Vec3::ZERO,
            base_color: Vec3::ZERO,
            facing: Facing::default(),
            squares: 0.0,
            looked_at: 0,
            is_flat: true,
            sums: Sums::default(),
        }
    }

    fn add(&mut self, sight: &Sight) {
        self.looked_at += 1;
        let (Some((first, _)), Some((hit, point))) = (&self.first.seen, &sight.seen) else {
            return;
        };
        self.is_flat = self.is_flat && first.normal.dot(hit.normal) > EQUAL_FACING;
        let sums = &mut self.sums;
        sums.base_color += point.base_color;
        sums.diffuse += point.diffuse;
        sums.f0 += point.f0;
        sums.emission += point.emission;
    }

    /// Whether the mean of its colours is known within [`EVEN`].
    fn is_even(&self) -> bool {
        let count = self.count as f32;
        let mean = (self.base_color / count).length_squared();
        (self.squares / count - mean) / count <= EVEN * EVEN * mean
    }

    /// How the fragment reflects of which `point` is one.
    fn mean(&self, point: &ShadingPoint) -> ShadingPoint {
        let (facing, all) = (&self.facing, self.count as f32);
        let (sums, looked_at) = (&self.sums, self.looked_at as f32);
        let normal = facing.shading / all;
        // By how much the base colour of all differs from that of those looked at, which colours both kinds of reflection.
        let base_color = self.base_color / all;
        let further = base_color - sums.base_color / looked_at;
        let metallic = self.metallic.unwrap_or(0.0);
        let mean = ShadingPoint {
            // The facet that the middle ray meets may face a grazing lamp less than the others do.
            geometric_normal: (facing.geometric / all)
                .try_normalize()
                .unwrap_or(point.geometric_normal),
            base_color,
            diffuse: sums.diffuse / looked_at + further * (1.0 - metallic),
            f0: sums.f0 / looked_at + further * metallic,
            emission: sums.emission / looked_at,
            shading_normal: normal.try_normalize().unwrap_or(point.shading_normal),
            ..*point
        };
        // Only what the normal map adds: over a smooth curve normals change evenly, and a lobe of their spread
        // would have tails that reach farther than any of them.
        let smooth = (facing.smooth / all).length();
        bsdf::spread_by_normals(&mean, 1.0 - (smooth - normal.length()).max(0.0))
    }
}
