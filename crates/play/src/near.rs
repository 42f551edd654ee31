//! What brings indirect light to a place: the points whose functions cover it, and the links of these and of their parents.

use crate::prepared::PreparedScene;
use crate::reconstruct::weights_at;
use crate::transfer::Transfer;
use glam::Vec3;
use relight_transport::sparse::row;
use std::collections::BTreeMap;

/// What brings indirect light to a place.
#[derive(Clone, Debug, Default)]
pub struct Near {
    /// Finest points whose functions cover it, by their numbers on that level, and their weights, which sum to 1.
    pub points: Vec<(u32, f32)>,
    /// Links, summed by sender, strongest first.
    pub links: Vec<NearLink>,
}

/// A sender as a place takes it.
#[derive(Clone, Copy, Debug)]
pub struct NearLink {
    /// Its number over all levels.
    pub sender: usize,
    /// Its level, 0 the coarsest.
    pub level: usize,
    /// Weighted mean of its points' positions, metres.
    pub middle: Vec3,
    /// Irradiance at the place per unit of the sender's coefficient (radiosity, less that of its parent). Links of coarser receivers
    /// count as the place's points take them, with normals as if surfaces were flat.
    pub strength: f32,
}

/// What brings indirect light to a place (position and smooth normal); `None` for an asset without points.
pub fn near(prepared: &PreparedScene, place: (Vec3, Vec3)) -> Option<Near> {
    let transfer = prepared.transfer.as_ref()?;
    let weights = weights_at(
        &transfer.finest,
        &[Some(place)],
        transfer.separated(&prepared.scene),
        |asked| transfer.each_separated(&prepared.scene, asked),
        &(),
    );
    let points: Vec<(u32, f32)> = row(&weights, 0).collect();
    let mut links = links_of(transfer, &points);
    links.sort_by(|a, b| b.strength.abs().total_cmp(&a.strength.abs()));
    Some(Near { points, links })
}

/// Links of finest points, weighted, and of the coarser points that predict them.
fn links_of(transfer: &Transfer, points: &[(u32, f32)]) -> Vec<NearLink> {
    let (parents, ranges) = transfer.parents();
    let start = ranges.range(ranges.levels() - 1).start;
    let mut receivers: BTreeMap<usize, f32> = points.iter().map(|(j, w)| (start + *j as usize, *w)).collect();
    let mut strengths: BTreeMap<usize, f32> = BTreeMap::new();
    // A receiver's parents have smaller numbers.
    while let Some((receiver, weight)) = receivers.pop_last() {
        let normal = transfer.normal_of(receiver);
        for (sender, vector) in transfer.links_of(receiver) {
            *strengths.entry(sender as usize).or_default() += weight * vector.dot(normal);
        }
        for (parent, share) in row(parents, receiver) {
            *receivers.entry(parent as usize).or_default() += weight * share;
        }
    }
    let senders = &transfer.senders;
    let middles = senders.pulled(&transfer.finest.positions);
    let of_level = |level: usize| senders.ranges.range(level);
    (strengths.into_iter())
        .filter_map(|(sender, strength)| {
            let level = (0..senders.levels()).find(|level| of_level(*level).contains(&sender))?;
            Some(NearLink {
                sender,
                level,
                middle: middles[level][sender - of_level(level).start],
                strength,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::player::Player;
    use crate::reconstruct;
    use crate::separated::Separated;

    /// Truth: the product with T itself. On a wall all normals are alike, and light there is what its links sum to.
    #[test]
    fn light_of_a_place_is_the_sum_over_its_links() {
        let player = Player::open("tests/cornell.relight").unwrap();
        let prepared = &player.prepared;
        let transfer = prepared.transfer.as_ref().unwrap();
        let radiosity: Vec<Vec3> = (0..transfer.finest.len())
            .map(|i| Vec3::splat(1.0 + (i % 7) as f32))
            .collect();
        let values = transfer.of_radiosity(&radiosity);
        let coefficients = transfer
            .senders
            .coefficients(&transfer.senders.pulled(&radiosity));
        let mut compared = 0;
        for point in (0..transfer.finest.len()).step_by(5) {
            let place = (transfer.finest.positions[point], transfer.finest.normals[point]);
            let near = near(prepared, place).unwrap();
            assert!((near.points.iter().map(|p| p.1).sum::<f32>() - 1.0).abs() < 1e-4);
            assert!(
                near.links
                    .is_sorted_by(|a, b| a.strength.abs() >= b.strength.abs())
            );
            if (near.points.iter()).any(|(j, _)| transfer.finest.normals[*j as usize].dot(place.1) < 0.9999) {
                continue;
            }
            let nothing = |_: &[reconstruct::Asked]| Vec::new();
            let weights = weights_at(
                &transfer.finest,
                &[Some(place)],
                &Separated::default(),
                nothing,
                &(),
            );
            let components = reconstruct::components(&weights, &transfer.finest, &[(place.1, place.1)]);
            let expected = reconstruct::irradiance(&weights, &components, &values)[0].x;
            let summed: f32 = (near.links.iter())
                .map(|l| l.strength * coefficients[l.sender].x)
                .sum();
            if (summed / expected - 1.0).abs() < 1e-3 {
                compared += 1;
            }
        }
        // Coarser points may lie around a corner, whose normals differ: such places are told approximately.
        assert!(compared > 20, "{compared}");
    }

    /// Truth: the whole. Levels one after another end at it, and what each adds sums to it.
    #[test]
    fn levels_add_up_to_all_of_them() {
        use crate::transfer::LevelPart;
        let player = Player::open("tests/cornell.relight").unwrap();
        let transfer = player.prepared.transfer.as_ref().unwrap();
        let direct: Vec<Vec3> = (0..transfer.finest.len())
            .map(|i| Vec3::splat((i % 5) as f32))
            .collect();
        let whole = transfer.indirect_from_direct(&direct).0;
        let levels = transfer.parents().1.levels();
        assert!(levels > 1);
        let irradiance = |part| -> Vec<f32> {
            let values = transfer.indirect_of_levels(&direct, None, part).0;
            (values.iter().zip(&transfer.finest.normals))
                .map(|(v, n)| v.irradiance(*n).x)
                .collect()
        };
        let all: Vec<f32> = (whole.iter().zip(&transfer.finest.normals))
            .map(|(v, n)| v.irradiance(*n).x)
            .collect();
        let last = irradiance(LevelPart::UpTo(levels - 1));
        let parts: Vec<Vec<f32>> = (0..levels)
            .map(|level| irradiance(LevelPart::Only(level)))
            .collect();
        let most = all.iter().copied().fold(0.0, f32::max);
        for i in 0..all.len() {
            assert_eq!(last[i], all[i]);
            let sum: f32 = parts.iter().map(|part| part[i]).sum();
            assert!((sum - all[i]).abs() < 1e-5 * most, "{i}: {sum} {}", all[i]);
        }
        assert!(
            parts[1].iter().any(|v| v.abs() > 1e-3 * most),
            "a finer level adds nothing"
        );
        assert_eq!(irradiance(LevelPart::UpTo(0)), parts[0]);
    }
}
