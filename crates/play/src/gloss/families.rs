//! Clusters of one parent.

use super::clusters::NONE;
use glam::Vec3;
use relight_transport::senders::SenderTree;

/// Senders of one parent each, or one of the coarsest level; children without siblings, which have no coefficient, are in none.
pub(super) struct Families {
    /// Of each sender its family, [`NONE`] if it has none.
    of: Vec<u32>,
    families: Vec<Family>,
    /// Of each sender its parent, [`NONE`] on the coarsest level.
    parents: Vec<u32>,
    /// Of each sender its children.
    children: Vec<Vec<u32>>,
}

/// Senders of one parent.
pub(super) struct Family {
    /// `None` on the coarsest level.
    pub parent: Option<u32>,
    /// Senders, ascending, and their parts of the parent.
    pub members: Vec<(u32, f32)>,
}

impl Families {
    /// Those of all levels.
    pub fn new(senders: &SenderTree) -> Families {
        let count = senders.ranges.total();
        let mut all = Families {
            of: vec![NONE; count],
            families: Vec::new(),
            parents: vec![NONE; count],
            children: vec![Vec::new(); count],
        };
        for sender in senders.ranges.range(0) {
            all.add(None, vec![(sender as u32, 1.0)]);
        }
        for level in 1..senders.levels() {
            let start = senders.ranges.range(level).start as u32;
            for (at, parent) in senders.ranges.range(level - 1).enumerate() {
                let children: Vec<u32> = senders
                    .children(level - 1, at)
                    .iter()
                    .map(|child| start + child)
                    .collect();
                for &child in &children {
                    all.parents[child as usize] = parent as u32;
                }
                if children.len() > 1 {
                    let member = |&child: &u32| (child, senders.shares[child as usize]);
                    all.add(Some(parent as u32), children.iter().map(member).collect());
                }
                all.children[parent] = children;
            }
        }
        all
    }

    fn add(&mut self, parent: Option<u32>, members: Vec<(u32, f32)>) {
        for &(sender, _) in &members {
            self.of[sender as usize] = self.families.len() as u32;
        }
        self.families.push(Family { parent, members });
    }

    /// A sender's children, ascending.
    pub fn children(&self, sender: u32) -> &[u32] {
        &self.children[sender as usize]
    }

    /// A sender's parent, its parent and so on.
    pub fn ancestors(&self, sender: u32) -> impl Iterator<Item = u32> + '_ {
        let parent = |&sender: &u32| Some(self.parents[sender as usize]).filter(|&parent| parent != NONE);
        std::iter::successors(parent(&sender), parent)
    }

    /// Calls for each family that links go to: with the family and its links.
    pub fn each_family(
        &self,
        links: impl Iterator<Item = (u32, Vec3)>,
        mut each: impl FnMut(&Family, &[(u32, Vec3)]),
    ) {
        let family_of = |link: &(u32, Vec3)| self.of[link.0 as usize];
        let mut links: Vec<(u32, Vec3)> = links.filter(|link| family_of(link) != NONE).collect();
        links.sort_by_key(family_of);
        for run in links.chunk_by(|a, b| family_of(a) == family_of(b)) {
            each(&self.families[family_of(&run[0]) as usize], run);
        }
    }
}
