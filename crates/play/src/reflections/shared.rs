//! What wide lobes of neighbouring fragments see far away, found together.
//!
//! A lobe that makes up a tenth of what a fragment reflects takes few rays, of which one in many meets the bright spot above a lamp: its fragment
//! is a white dot. What a wide lobe sees of things far away is next to the same a few pixels on. So the rays of all fragments of a block of pixels that are
//! alike show it, and each fragment takes the mean of the groups around it by its place between them. Near things, which each place sees otherwise,
//! are shown by its own rays alone. Neither is biased: each ray counts in one of both means, with all others of its length.

use super::which::{WIDE, matt_albedo};
use glam::{Vec2, Vec3};
use relight_render::exposure::{Blocks, Sighted};
use relight_scene::bsdf;
use std::f32::consts::SQRT_2;

/// Pixels along a side of the blocks whose wide lobes share what they see far away: 64 times as many rays as one
/// fragment has leave an eighth of its noise, and across a few pixels a wide lobe sees the same.
pub(super) const BLOCK: usize = 8;

/// Least angle under which a block is seen, radians: in lightmaps all are seen from where they are.
const LEAST_ANGLE: f32 = 1e-3;

/// Cosine of the angle by which normals and views that are alike differ at most: a fifth of such a radius.
const ALIKE: f32 = 0.98;

/// By how much reflectances of the matt parts of fragments that are alike differ at most: wide lobes' rays show what their matt parts do, too ([`super::follower`]),
/// a third of it at most, and a dark tile of a floor must not take a bright one's.
const ALIKE_IN_COLOUR: f32 = 0.1;

/// How far away things are at least that a group shows, over its extent, corner to corner: from most of its places, which are half as far from each other,
/// directions to them differ by a quarter of such a radius.
const FAR: f32 = 2.0;

/// One that shares what it sees far away.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    /// Which fragment.
    pub fragment: u32,
    /// Column and row of its pixel.
    pub pixel: [u32; 2],
    /// What its lobe reflects of even light.
    pub albedo: Vec3,
    /// What its matt part does.
    matt: Vec3,
    normal: Vec3,
    view: Vec3,
    /// How far away it is: logarithm over the angle under which the block is seen, so that one step is as deep as the block is wide.
    depth: f32,
    /// Extent of what a whole block shows there, as deep as it is wide, m.
    extent: f32,
}

/// Fragments of a block that are alike.
#[derive(Clone, Debug)]
pub(super) struct Group {
    pub members: Vec<Member>,
    /// Their mean [`Member::depth`].
    depth: f32,
    /// How far away what they share is, m: a power of two, so that it is the same for most blocks around.
    pub beyond: f32,
}

/// Fragments whose lobes are followed, one block's: which they are, their pixels, and where their rays start.
pub(super) type Followed = (u32, [u32; 2], Vec<Sighted>);

/// Splits fragments of a block, seen from `eye`, into groups that share what they see far away, and those whose lobes are not wide: their places in `followed`, each in
/// their order.
pub(super) fn groups(followed: &[Followed], eye: Vec3) -> (Vec<Vec<(usize, Member)>>, Vec<usize>) {
    let mut groups: Vec<Vec<(usize, Member)>> = Vec::new();
    let mut narrow = Vec::new();
    let angle = angle(followed);
    for (at, own) in followed.iter().enumerate() {
        if !is_wide(&own.2) {
            narrow.push(at);
            continue;
        }
        let own = Member::of(own, eye, angle);
        let is_like = |other: &Member| other.is_like(&own) && other.depth.floor() == own.depth.floor();
        match groups.iter_mut().find(|group| is_like(&group[0].1)) {
            Some(group) => group.push((at, own)),
            None => groups.push(vec![(at, own)]),
        }
    }
    (groups, narrow)
}

/// Angle under which a whole block is seen, corner to corner, radians, by its first and last fragment. The least is of a block of the sharpest pictures.
fn angle(followed: &[Followed]) -> f32 {
    let seen = |followed: Option<&Followed>| {
        let (_, pixel, starts) = followed?;
        Some((Vec2::from(pixel.map(|x| x as f32)), starts.first()?.view))
    };
    let (Some(first), Some(last)) = (seen(followed.first()), seen(followed.last())) else {
        return LEAST_ANGLE;
    };
    let pixels = first.0.distance(last.0).max(1.0);
    (first.1.distance(last.1) / pixels * BLOCK as f32 * SQRT_2).max(LEAST_ANGLE)
}

fn is_wide(starts: &[Sighted]) -> bool {
    !starts.is_empty() && (starts.iter()).all(|start| bsdf::width_facing(&start.point) >= WIDE)
}

impl Member {
    /// A fragment with places to start from.
    fn of((fragment, pixel, starts): &Followed, eye: Vec3, angle: f32) -> Member {
        let mean = |of: &dyn Fn(&Sighted) -> Vec3| starts.iter().map(of).sum::<Vec3>() / starts.len() as f32;
        let distance = starts[0].hit.position.distance(eye).max(f32::MIN_POSITIVE);
        Member {
            fragment: *fragment,
            pixel: *pixel,
            albedo: mean(&|start| bsdf::lobe_albedo(&start.point, start.view)),
            matt: mean(&|start| matt_albedo(&start.point, start.view)),
            normal: mean(&|start| start.point.shading_normal).normalize_or_zero(),
            view: mean(&|start| start.view).normalize_or_zero(),
            depth: distance.ln() / angle,
            extent: SQRT_2 * angle * distance,
        }
    }

    fn is_like(&self, other: &Member) -> bool {
        self.normal.dot(other.normal) > ALIKE
            && self.view.dot(other.view) > ALIKE
            && (self.matt - other.matt).abs().max_element() < ALIKE_IN_COLOUR
    }
}

/// From where on a group with these members and places shares what it sees, m.
pub(super) fn beyond(members: &[(usize, Member)], places: impl Iterator<Item = Vec3> + Clone) -> f32 {
    let low = places.clone().reduce(Vec3::min);
    let high = places.reduce(Vec3::max);
    let extent = low.zip(high).map_or(0.0, |(low, high)| low.distance(high));
    (FAR * extent.max(members[0].1.extent)).log2().ceil().exp2()
}

impl Group {
    /// `beyond`: [`beyond`] of its members.
    pub fn new(members: Vec<Member>, beyond: f32) -> Group {
        let depth = members.iter().map(|member| member.depth).sum::<f32>() / members.len() as f32;
        Group {
            members,
            depth,
            beyond,
        }
    }
}

/// What fragments take of the groups' means.
#[derive(Clone, Debug, Default)]
pub(super) struct Shares {
    /// Fragments, what their lobes reflect of even light, and where their parts end.
    pub fragments: Vec<(u32, Vec3, u32)>,
    /// Groups, numbered through, and parts of them, which sum to 1.
    pub parts: Vec<(u32, f32)>,
}

/// What each fragment takes of the groups around it that are like its own one: by its place between the middles of blocks and between depths, and by how many
/// members they have. `groups`: of each block.
pub(super) fn shares(blocks: &Blocks, groups: &[Vec<Group>]) -> Shares {
    let firsts: Vec<u32> = (groups.iter())
        .scan(0, |first, groups| {
            Some(std::mem::replace(first, *first + groups.len() as u32))
        })
        .collect();
    let mut shares = Shares::default();
    for group in groups.iter().flatten() {
        for member in &group.members {
            let first = shares.parts.len();
            for (block, weight) in around(blocks, member.pixel) {
                for (number, other) in (firsts[block]..).zip(&groups[block]) {
                    let near = 1.0 - (other.depth - member.depth).abs();
                    if near > 0.0 && other.beyond == group.beyond && other.members[0].is_like(member) {
                        let members = other.members.len() as f32;
                        shares.parts.push((number, weight * near * members));
                    }
                }
            }
            let all: f32 = shares.parts[first..].iter().map(|part| part.1).sum();
            shares.parts[first..].iter_mut().for_each(|part| part.1 /= all);
            let end = shares.parts.len() as u32;
            shares.fragments.push((member.fragment, member.albedo, end));
        }
    }
    shares
}

/// Blocks whose middles are around a pixel's, and their weights, which sum to 1 but at the image's border: bilinear.
fn around(blocks: &Blocks, pixel: [u32; 2]) -> impl Iterator<Item = (usize, f32)> {
    let place = (Vec2::from(pixel.map(|x| x as f32 + 0.5)) / blocks.side as f32) - 0.5;
    let (across, down) = (blocks.across, blocks.fragments.len() / blocks.across);
    let (low, part) = (place.floor(), place - place.floor());
    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
        .into_iter()
        .filter_map(move |step| {
            let block = low + Vec2::from(step);
            let weight = Vec2::from(step.map(|s| 1.0 - s)) + part * (2.0 * Vec2::from(step) - 1.0);
            let inside = block.x >= 0.0 && block.y >= 0.0 && block.x < across as f32 && block.y < down as f32;
            (inside && weight.x * weight.y > 0.0)
                .then(|| (block.y as usize * across + block.x as usize, weight.x * weight.y))
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_scene::shading::ShadingPoint;
    use relight_scene::surface::SurfaceHit;

    const EYE: Vec3 = Vec3::new(0.8, 1000.0, 0.4);

    /// Fragments of a level plastic surface, seen from above, whose matt part reflects `matt`; one every decimetre.
    fn seen(pixels: &[[u32; 2]], alpha: f32, matt: f32) -> Vec<Followed> {
        let of_pixel = |(fragment, &[x, y]): (u32, &[u32; 2])| {
            let hit = SurfaceHit {
                t: 1.0,
                position: Vec3::new(0.1 * x as f32, 0.0, 0.1 * y as f32),
                position_error: Vec3::ZERO,
                geometric_normal: Vec3::Y,
                normal: Vec3::Y,
                front: true,
                primitive: 0,
                barycentric: [0.0; 2],
            };
            let point = ShadingPoint {
                lambert: false,
                alpha,
                f0: Vec3::splat(0.04),
                ..ShadingPoint::lambert(&hit, Vec3::splat(matt))
            };
            let view = Vec3::Y;
            (fragment, [x, y], vec![Sighted { hit, point, view }])
        };
        (0..).zip(pixels).map(of_pixel).collect()
    }

    #[test]
    fn wide_lobes_that_look_alike_share() {
        let row: Vec<[u32; 2]> = (0..8).map(|x| [x, 0]).collect();
        let (together, narrow) = groups(&seen(&row, 1.0, 0.5), EYE);
        assert_eq!((together.len(), together[0].len(), narrow.len()), (1, 8, 0));
        let (together, narrow) = groups(&seen(&row, 0.05, 0.5), EYE);
        assert_eq!((together.len(), narrow.len()), (0, 8));
        // Dark and bright tiles, and one that is upright.
        let mut tiles = seen(&row, 1.0, 0.5);
        tiles[4..].clone_from_slice(&seen(&row[4..], 1.0, 0.05));
        tiles[7].2[0].point.shading_normal = Vec3::X;
        let (together, narrow) = groups(&tiles, EYE);
        let sizes: Vec<usize> = together.iter().map(Vec::len).collect();
        assert_eq!((sizes, narrow.len()), (vec![4, 3, 1], 0));
    }

    /// Directions to what is so far away differ by at most half a radian between any two of the places.
    #[test]
    fn far_is_twice_a_groups_extent_and_the_same_for_groups_around() {
        let (groups, _) = groups(&seen(&[[0, 0]], 1.0, 0.5), EYE);
        let far = |places: [Vec3; 3]| beyond(&groups[0], places.into_iter());
        let places = [Vec3::ZERO, Vec3::new(3.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 4.0)];
        assert_eq!(far(places), 16.0);
        assert_eq!(far(places.map(|x| 1.5 * x)), 16.0);
        assert_eq!(far(places.map(|x| 1.7 * x)), 32.0);
        // A block is a thousandth of a kilometre wide.
        assert_eq!(far([Vec3::ZERO; 3]), 4.0);
    }

    /// Two blocks side by side, on one surface.
    #[test]
    fn fragments_take_of_the_groups_around_them_by_their_place_between() {
        let pixels: Vec<[u32; 2]> = (0..8).flat_map(|y| (0..16).map(move |x| [x, y])).collect();
        let followed = seen(&pixels, 1.0, 0.5);
        let of_block = |block: u32| -> Vec<Followed> {
            let inside = followed.iter().filter(|f| f.1[0] / 8 == block);
            inside.cloned().collect()
        };
        let group = |block| {
            let (mut groups, _) = groups(&of_block(block), EYE);
            let members: Vec<Member> = groups.remove(0).into_iter().map(|member| member.1).collect();
            vec![Group::new(members, 4.0)]
        };
        let blocks = Blocks {
            side: 8,
            across: 2,
            eye: EYE,
            fragments: [0, 1]
                .map(|block| of_block(block).iter().map(|f| (f.0, f.1)).collect())
                .to_vec(),
        };
        let all = shares(&blocks, &[group(0), group(1)]);
        let parts = |fragment: u32| {
            let at = all.fragments.iter().position(|f| f.0 == fragment).unwrap();
            let first = at.checked_sub(1).map_or(0, |before| all.fragments[before].2);
            let own = &all.parts[first as usize..all.fragments[at].2 as usize];
            [0, 1].map(|group| {
                own.iter()
                    .filter(|part| part.0 == group)
                    .map(|part| part.1)
                    .sum::<f32>()
            })
        };
        // The left border, the middle of a block, and the places left and right of the border between both.
        for (fragment, wanted) in [(0, 1.0), (3, 1.0), (7, 0.5625), (8, 0.4375), (15, 0.0)] {
            let [first, second] = parts(fragment);
            assert!((first - wanted).abs() < 1e-5, "{fragment}: {first} {wanted}");
            assert!((first + second - 1.0).abs() < 1e-5);
        }
    }
}
