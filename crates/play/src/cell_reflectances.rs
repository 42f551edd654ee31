//! What points reflect when materials are edited.
//!
//! A point reflects the mean over the places that it stands for (`relight_bake::points::reflectances`), of which a player knows one: its own.
//! What the others add to that one is taken to change as their material does in the mean over all its points: exact where an edit
//! scales a texture's colour, and nothing where a cell is all alike.

use crate::cuts::lights::reflectances;
use glam::{DVec3, Vec3};
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;

/// Reflectances of points as they were baked.
#[derive(Debug)]
pub(crate) struct CellReflectances {
    /// Of their cells.
    means: Vec<Vec3>,
    /// Of their own places.
    own: Vec<Vec3>,
}

impl CellReflectances {
    /// Of points at `hits` whose cells have `means`, while the scene has the materials that it was baked with.
    pub fn of(scene: &TracedScene, hits: &[Option<SurfaceHit>], means: &[Vec3]) -> CellReflectances {
        let mut own = means.to_vec();
        reflectances(scene, hits, &mut own, |_| true);
        CellReflectances {
            means: means.to_vec(),
            own,
        }
    }

    /// Sets those of `albedo` on `wanted` materials to what the scene's present ones make of them.
    pub fn edit(
        &self,
        scene: &TracedScene,
        hits: &[Option<SurfaceHit>],
        wanted: impl Fn(u32) -> bool + Sync,
        albedo: &mut [Vec3],
    ) {
        let materials: Vec<Option<u32>> = (hits.iter())
            .map(|hit| {
                let hit = hit.filter(|hit| (hit.primitive as usize) < scene.triangle_count())?;
                Some(scene.material_of(hit.primitive)).filter(|&material| wanted(material))
            })
            .collect();
        let mut new = self.own.clone();
        reflectances(scene, hits, &mut new, &wanted);
        let mut sums = vec![[DVec3::ZERO; 2]; scene.scene().materials.len()];
        for (material, (old, new)) in materials.iter().zip(self.own.iter().zip(&new)) {
            if let Some(sum) = material.and_then(|material| sums.get_mut(material as usize)) {
                sum[0] += old.as_dvec3();
                sum[1] += new.as_dvec3();
            }
        }
        for (i, material) in materials.iter().enumerate() {
            if let Some([old, new_sum]) = material.and_then(|material| sums.get(material as usize)) {
                let scale = DVec3::select(old.cmpgt(DVec3::ZERO), new_sum / old, DVec3::ONE).as_vec3();
                albedo[i] = edited(self.means[i], self.own[i], new[i], scale);
            }
        }
    }
}

/// The mean over a cell, `mean`, once its point's own reflectance is `new` instead of `own`, and its material's `scale` times what it was. What was
/// nearly black says nothing about what lies around it: the difference grows to no more than it was, or than there is.
fn edited(mean: Vec3, own: Vec3, new: Vec3, scale: Vec3) -> Vec3 {
    let around = mean - own;
    let most = around.abs().max(new);
    (new + (around * scale).clamp(-most, most)).clamp(Vec3::ZERO, Vec3::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_texture_that_is_scaled_scales_its_cells_and_nothing_changes_by_no_edit() {
        let (mean, own) = (Vec3::new(0.3, 0.2, 0.6), Vec3::new(0.2, 0.4, 0.6));
        assert_eq!(edited(mean, own, own, Vec3::ONE), mean);
        for factor in [0.0, 0.3, 1.5] {
            let found = edited(mean, own, own * factor, Vec3::splat(factor));
            assert!((found - mean * factor).length() < 1e-6, "{factor}: {found}");
        }
    }

    #[test]
    fn black_that_becomes_white_is_white_where_a_cell_is_all_alike_and_no_more_elsewhere() {
        let scale = Vec3::splat(1e6);
        assert_eq!(
            edited(Vec3::ZERO, Vec3::ZERO, Vec3::splat(0.8), scale),
            Vec3::splat(0.8)
        );
        let mixed = edited(Vec3::splat(0.3), Vec3::splat(1e-6), Vec3::splat(0.01), scale);
        assert!(mixed.cmple(Vec3::splat(0.32)).all(), "{mixed}");
    }
}
