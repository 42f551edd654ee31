//! Between which sites a fragment interpolates visibility.

use super::lights::VisibilityCuts;
use rayon::prelude::*;
use relight_transport::cuts::{Cut, SiteCuts, merge};
use relight_transport::sparse::{SparseMatrix, row};

/// Sites of a fragment: three. Four gave the same errors, 5 % more nodes and a
/// fifth cut to traverse (docs/notebook/cuts.md).
pub const SITES: usize = 3;

/// The sites of every fragment, fragments with the same ones side by side.
#[derive(Clone, Debug, Default)]
pub struct FragmentSites {
    /// Fragments in order of their sites.
    pub order: Vec<u32>,
    /// Sites of the fragment `order[i]`, rising; unused ones are `u32::MAX`.
    pub sites: Vec<[u32; SITES]>,
    /// Their weights, which sum to 1; 0 for unused ones.
    pub weights: Vec<[f32; SITES]>,
    /// Cuts of sites that follow the asset's: those of single fragments ([`super::own_sites`]).
    pub own: SiteCuts,
}

impl FragmentSites {
    /// Takes the heaviest functions of each fragment's row. Less the weight of the heaviest that is left out, so that a
    /// site enters and leaves with weight 0 and shading stays continuous. Fragments without functions are left out.
    pub fn new(functions: &SparseMatrix) -> FragmentSites {
        let mut found: Vec<([u32; SITES], [f32; SITES], u32)> = (0..functions.rows())
            .into_par_iter()
            .with_min_len(1024)
            .filter_map(|fragment| {
                let (sites, weights) = heaviest(row(functions, fragment))?;
                Some((sites, weights, fragment as u32))
            })
            .collect();
        found.par_sort_unstable_by_key(|entry| (entry.0, entry.2));
        FragmentSites {
            order: found.iter().map(|e| e.2).collect(),
            sites: found.iter().map(|e| e.0).collect(),
            weights: found.iter().map(|e| e.1).collect(),
            own: SiteCuts::default(),
        }
    }

    /// The cuts of a fragment's sites; `asset` has those that are not its own. A site that is not there sees nothing, and costs
    /// nothing.
    pub fn cuts<'a>(&'a self, asset: &'a VisibilityCuts, sites: [u32; SITES]) -> [Cut<'a>; SITES] {
        sites.map(|site| match (site as usize).checked_sub(asset.cuts.sites()) {
            _ if site == u32::MAX => Cut::nothing(asset.lights.height()),
            None => asset.cuts.cut(site as usize),
            Some(own) => self.own.cut(own),
        })
    }

    /// Nodes of the merged cut of each fragment's sites, of so many fragments; 0 without sites.
    pub fn cut_sizes(&self, asset: &VisibilityCuts, fragments: usize) -> Vec<u32> {
        let same: Vec<&[[u32; SITES]]> = self.sites.chunk_by(|a, b| a == b).collect();
        let counted: Vec<u32> = (same.par_iter())
            .map(|run| {
                let mut nodes = 0;
                merge(self.cuts(asset, run[0]), |_, _| nodes += 1);
                nodes
            })
            .collect();
        let mut sizes = vec![0; fragments];
        let each = (same.iter().zip(&counted)).flat_map(|(run, nodes)| run.iter().map(|_| *nodes));
        for (&fragment, nodes) in self.order.iter().zip(each) {
            sizes[fragment as usize] = nodes;
        }
        sizes
    }
}

fn heaviest(row: impl Iterator<Item = (u32, f32)>) -> Option<([u32; SITES], [f32; SITES])> {
    let mut row: Vec<(u32, f32)> = row.filter(|e| e.1 > 0.0).collect();
    row.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let floor = row.get(SITES).map_or(0.0, |e| e.1);
    // Equal weights, as on a regular grid, leave nothing above the floor: then there is nothing to be continuous about.
    let floor = if floor < row.first()?.1 { floor } else { 0.0 };
    row.truncate(SITES);
    let mut chosen: Vec<(u32, f32)> = row
        .into_iter()
        .map(|(j, w)| (j, w - floor))
        .filter(|e| e.1 > 0.0)
        .collect();
    chosen.sort_unstable_by_key(|e| e.0);
    let total: f32 = chosen.iter().map(|e| e.1).sum();
    let (mut sites, mut weights) = ([u32::MAX; SITES], [0.0; SITES]);
    for (k, (site, weight)) in chosen.into_iter().enumerate() {
        sites[k] = site;
        weights[k] = weight / total;
    }
    Some((sites, weights))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_sites_come_and_go_with_weight_zero() {
        let before = heaviest([(9, 0.3), (2, 0.25), (5, 0.2), (7, 0.150001), (1, 0.15)].into_iter()).unwrap();
        let after = heaviest([(9, 0.3), (2, 0.25), (5, 0.2), (7, 0.15), (1, 0.150001)].into_iter()).unwrap();
        for (sites, weights) in [before, after] {
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            assert!(sites.is_sorted());
        }
        let weight = |(sites, weights): ([u32; SITES], [f32; SITES]), site| {
            sites.iter().position(|&s| s == site).map_or(0.0, |k| weights[k])
        };
        for site in [1, 2, 5, 7, 9] {
            assert!((weight(before, site) - weight(after, site)).abs() < 1e-4);
        }
        assert_eq!(heaviest([].into_iter()), None);
        assert_eq!(heaviest([(3, 0.5)].into_iter()).unwrap().1[0], 1.0);
    }
}
