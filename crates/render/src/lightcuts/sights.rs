//! What may lie between places and clusters of lights.
//!
//! Beyond Walter et al. 2005, where a cluster is as visible as its representative. Where few triangles lie in the shaft
//! from a place to a cluster's box ([`TriangleBvh::narrow`]), its *sight* is closed: shadow rays to all lights of the cluster
//! ask these triangles alone, and where there are none, no ray is needed. Clusters of a closed sight can be asked
//! light by light for the price of one ray through the scene.
//!
//! Sights are sought once for all places of a region, and kept for the clusters below.

use super::lit::{Lit, Receiver, Term};
use relight_scene::rays::{BvhPart, ShaftEnd, ShaftStart};
use relight_scene::surface::{SurfaceHit, ray_end};
use relight_transport::light_bounds::LightBox;

/// Most parts of a closed sight, of up to four triangles each: some 10 ns each and ray, where a ray through the scene
/// takes 270.
const MOST_PARTS: usize = 16;
/// Most boxes of boxes opened for a sight: as many as some three rays open.
const STEPS: usize = 32;
/// A sight that is not closed, or not empty, is sought again once boxes are this much smaller: two levels of a
/// tree farther down.
const NARROWER: f32 = 0.3;

/// What may lie between a region and the lights of a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    /// A run of [`Sights::parts`], if it is closed.
    first: u32,
    last: u32,
    /// Size over distance of the node's box when it was last sought.
    size: f32,
    /// Few triangles, and nothing else.
    pub closed: bool,
}

impl Sight {
    /// Anything.
    pub const OPEN: Sight = Sight {
        first: 0,
        last: 0,
        size: f32::INFINITY,
        closed: false,
    };

    /// Whether all of the node is seen for sure.
    pub fn is_clear(&self) -> bool {
        self.closed && self.first == self.last
    }
}

/// A node that was asked about.
#[derive(Clone, Copy, Debug)]
struct AskedNode {
    /// Where its first child is, the other one next to it; 0 if it is nowhere yet.
    children: u32,
    /// Whether the sight is the node's own, not that of the one above it.
    asked: bool,
    sight: Sight,
}

impl AskedNode {
    fn below(sight: Sight) -> AskedNode {
        AskedNode {
            children: 0,
            asked: false,
            sight,
        }
    }
}

/// Sights of the nodes that receivers near each other have asked about.
#[derive(Default)]
pub(crate) struct Sights {
    start: Option<ShaftStart>,
    /// The roots come first.
    places: Vec<AskedNode>,
    parts: Vec<BvhPart>,
    kept: Vec<BvhPart>,
}

impl Sights {
    /// Forgets all; from now on receivers at `places` ask. Without a limit on the uncertainty, as in the paper, all sights are
    /// open.
    pub fn begin<'h>(&mut self, lit: &Lit<'_>, places: impl Iterator<Item = &'h SurfaceHit> + Clone) {
        self.start =
            (lit.settings.uncertainty < f32::INFINITY).then(|| ShaftStart::around(places.map(ray_end)));
        self.parts.clear();
        self.places.clear();
        self.places
            .resize(lit.clusters.roots.len(), AskedNode::below(Sight::OPEN));
    }

    /// Where the first of a node's children is; anywhere if no sights are sought.
    pub fn children(&mut self, place: u32) -> u32 {
        if self.start.is_none() {
            return place;
        }
        let at = self.places[place as usize];
        if at.children > 0 {
            return at.children;
        }
        let below = AskedNode::below(at.sight);
        let first = self.places.len() as u32;
        self.places[place as usize].children = first;
        self.places.extend([below; 2]);
        first
    }

    /// The triangles of a closed sight.
    pub fn parts(&self, sight: Sight) -> &[BvhPart] {
        &self.parts[sight.first as usize..sight.last as usize]
    }

    /// The sight of `node`, whose place is `place`.
    pub fn of(&mut self, lit: &Lit<'_>, place: u32, node: u32) -> Sight {
        let Some(start) = &self.start else {
            return Sight::OPEN;
        };
        let AskedNode { asked, mut sight, .. } = self.places[place as usize];
        if asked || sight.is_clear() {
            return sight;
        }
        let emission = lit.clusters.emission(node);
        let seen = LightBox::new(&lit.clusters.nodes[node as usize], emission, start.centre);
        let size = seen.half.length() / seen.centre.length();
        if size <= NARROWER * sight.size {
            sight.size = size;
            let all = [BvhPart::ALL];
            let among = if sight.closed {
                &self.parts[sight.first as usize..sight.last as usize]
            } else {
                &all
            };
            let kept = &mut self.kept;
            kept.clear();
            let bvh = lit.scene.bvh();
            if bvh.narrow(start, &end(lit, &seen), among, STEPS, MOST_PARTS, kept)
                && kept.iter().all(|part| part.is_triangles())
            {
                sight.first = self.parts.len() as u32;
                self.parts.append(kept);
                sight.last = self.parts.len() as u32;
                sight.closed = true;
            }
        }
        let at = &mut self.places[place as usize];
        (at.asked, at.sight) = (true, sight);
        sight
    }
}

impl Lit<'_> {
    /// What light `i` of a node gives, with the node's sight.
    pub fn seen_from(
        &self,
        i: u32,
        receiver: &Receiver<'_>,
        sights: &Sights,
        sight: Sight,
        shadow_rays: &mut u64,
    ) -> Term {
        if sight.closed {
            self.term_among(i, receiver, sights.parts(sight), shadow_rays)
        } else {
            self.term(i, receiver, shadow_rays)
        }
    }
}

/// Where shadow rays to the lights of a box end.
fn end(lit: &Lit<'_>, seen: &LightBox) -> ShaftEnd {
    let (clearance, on_surfaces) = lit.points.ends();
    ShaftEnd {
        low: (seen.centre - seen.half).into(),
        high: (seen.centre + seen.half).into(),
        endless: seen.unit,
        clearance,
        on_surfaces,
    }
}
