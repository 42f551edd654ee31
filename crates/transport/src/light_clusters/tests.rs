use super::*;
use crate::point_light::{Emission, PointLight};
use crate::random::Stream;
use crate::test_random::direction;
use glam::Vec3;

/// Lights of all types, in a cube of 10 m.
fn mixed(n: u64, intensity: impl Fn(&mut Stream) -> f32) -> Vec<PointLight> {
    (0..n)
        .map(|i| {
            let mut s = Stream::new(1, 2, i);
            let emission = match i % 4 {
                0 => Emission::Omni,
                1 => Emission::Oriented,
                2 => Emission::Spot {
                    scale: 2.0,
                    offset: -1.0,
                },
                _ => Emission::Directional,
            };
            PointLight {
                emission,
                position: Vec3::new(s.uniform(), s.uniform(), s.uniform()) * 10.0,
                axis: direction(&mut s),
                intensity: Vec3::splat(intensity(&mut s)),
            }
        })
        .collect()
}

/// What every tree must be: all shining lights as leaves once, sums, boxes, cones and representatives of the children.
fn check(lights: &[PointLight], groups: &[u32], trees: &LightClusters) {
    let mut seen = vec![0; lights.len()];
    let mut reached = 0;
    for root in &trees.roots {
        let mut stack = vec![(root.node, Vec::<u32>::new())];
        while let Some((node, above)) = stack.pop() {
            reached += 1;
            let cluster = &trees.nodes[node as usize];
            match trees.children(node) {
                Some([a, b]) => {
                    let [l, r] = [a, b].map(|c| &trees.nodes[c as usize]);
                    let sum = l.intensity.as_dvec3() + r.intensity.as_dvec3();
                    let error = (sum - cluster.intensity.as_dvec3()).abs().max_element();
                    assert!(error <= 1e-6 * sum.max_element());
                    assert!(
                        cluster.representative == l.representative
                            || cluster.representative == r.representative
                    );
                    let mut above = above;
                    above.push(node);
                    stack.push((a, above.clone()));
                    stack.push((b, above));
                }
                None => {
                    let light = &lights[cluster.representative as usize];
                    seen[cluster.representative as usize] += 1;
                    assert_eq!(
                        groups.get(cluster.representative as usize).copied().unwrap_or(0),
                        root.group
                    );
                    for node in above {
                        let cluster = &trees.nodes[node as usize];
                        let place = match light.emission {
                            Emission::Directional => -light.axis,
                            _ => light.position,
                        };
                        assert!(place.cmpge(cluster.low).all() && place.cmple(cluster.high).all());
                        let emission = trees.emission(node);
                        if matches!(emission, ClusterEmission::Oriented | ClusterEmission::Spot(_)) {
                            assert!(light.axis.dot(cluster.axis) >= cluster.half_angle().1 - 1e-6);
                        }
                        assert_eq!(
                            emission,
                            match light.emission {
                                Emission::Omni => ClusterEmission::Omni,
                                Emission::Oriented | Emission::Patch(_) => ClusterEmission::Oriented,
                                Emission::Spot { scale, offset } =>
                                    ClusterEmission::Spot(Envelope::of(scale, offset)),
                                Emission::Measured { outer, .. } =>
                                    ClusterEmission::Spot(Envelope { outer, inner: outer }),
                                Emission::Directional => ClusterEmission::Directional,
                            }
                        );
                    }
                }
            }
        }
    }
    assert_eq!(reached, trees.nodes.len());
    for (light, seen) in lights.iter().zip(seen) {
        assert_eq!(seen, u32::from(light.intensity.max_element() > 0.0));
    }
}

fn both_ways() -> [BuildSettings; 2] {
    let exact = BuildSettings::default();
    [exact, BuildSettings { exact: 16, ..exact }]
}

#[test]
fn a_tree_holds_every_light_once_in_boxes_and_cones() {
    for settings in both_ways() {
        for n in [0, 1, 2, 3, 5, 33, 1000] {
            let lights = mixed(n, |s| s.uniform() + 0.01);
            check(&lights, &[], &build(&lights, &[], 17.0, &settings));
            let groups: Vec<u32> = (0..n as u32).map(|i| i % 3).collect();
            check(&lights, &groups, &build(&lights, &groups, 17.0, &settings));
        }
    }
}

#[test]
fn degenerate_lights_make_trees_too() {
    for settings in both_ways() {
        for n in [1, 2, 500] {
            let mut place = mixed(n, |s| s.uniform());
            place
                .iter_mut()
                .for_each(|light| light.position = Vec3::splat(-3.0));
            check(&place, &[], &build(&place, &[], 1.0, &settings));
            place.iter_mut().for_each(|light| light.axis = Vec3::X);
            check(&place, &[], &build(&place, &[], 0.0, &settings));
            let dark = mixed(n, |_| 0.0);
            let trees = build(&dark, &[], 1.0, &settings);
            assert!(trees.nodes.is_empty() && trees.roots.is_empty());
            let some_dark = mixed(n, |s| if s.uniform() < 0.5 { 0.0 } else { 1.0 });
            check(&some_dark, &[], &build(&some_dark, &[], 1.0, &settings));
            let extreme = mixed(n, |s| if s.uniform() < 0.5 { 1e-20 } else { 1e20 });
            check(&extreme, &[], &build(&extreme, &[], 1.0, &settings));
            let any = mixed(n, |s| 10f32.powf(40.0 * s.uniform() - 20.0));
            check(&any, &[], &build(&any, &[], 1.0, &settings));
            let mut far = mixed(n, |_| 1.0);
            far.iter_mut().for_each(|light| light.position *= 1e18);
            check(&far, &[], &build(&far, &[], 1.0, &settings));
        }
    }
}

/// Truth: greedy joining of the best pair of all, from the metric's formula in f64.
#[test]
fn small_trees_are_those_of_greedy_joining() {
    let mut lights = mixed(240, |s| s.uniform() + 0.1);
    lights.retain(|light| light.emission == Emission::Omni);
    let trees = build(&lights, &[], 17.0, &BuildSettings::default());
    let mut clusters: Vec<(Vec<u32>, Vec3, Vec3, f64)> = (0..lights.len() as u32)
        .map(|i| {
            let light = &lights[i as usize];
            (
                vec![i],
                light.position,
                light.position,
                f64::from(light.intensity.x),
            )
        })
        .collect();
    let mut expected = Vec::new();
    while clusters.len() > 1 {
        let (mut best, mut at) = (f64::INFINITY, (0, 0));
        for i in 0..clusters.len() {
            for j in 0..i {
                let (a, b) = (&clusters[i], &clusters[j]);
                let extent = (a.2.max(b.2) - a.1.min(b.1)).as_dvec3();
                let cost = (a.3 + b.3) * extent.length_squared();
                if cost < best {
                    (best, at) = (cost, (i, j));
                }
            }
        }
        let a = clusters.remove(at.0);
        let b = &mut clusters[at.1];
        b.0.extend(&a.0);
        b.0.sort();
        (b.1, b.2, b.3) = (b.1.min(a.1), b.2.max(a.2), b.3 + a.3);
        expected.push(b.0.clone());
    }
    expected.sort();
    let mut found = Vec::new();
    for node in 0..trees.nodes.len() as u32 {
        if trees.children(node).is_some() {
            let (mut members, mut stack) = (Vec::new(), vec![node]);
            while let Some(node) = stack.pop() {
                match trees.children(node) {
                    Some(children) => stack.extend(children),
                    None => members.push(trees.nodes[node as usize].representative),
                }
            }
            members.sort();
            found.push(members);
        }
    }
    found.sort();
    assert_eq!(found, expected);
}

/// Truth: the paper's statement that a light represents a cluster with a chance in proportion to its intensity.
#[test]
fn lights_represent_their_cluster_as_often_as_they_are_bright() {
    let mut lights = mixed(32, |_| 1.0);
    lights.retain(|light| light.emission == Emission::Oriented);
    for (i, light) in lights.iter_mut().enumerate() {
        light.intensity = Vec3::splat((i + 1) as f32);
    }
    let runs = 4000;
    let mut count = vec![0.0; lights.len()];
    for seed in 0..runs {
        let settings = BuildSettings {
            seed,
            ..BuildSettings::default()
        };
        let trees = build(&lights, &[], 17.0, &settings);
        count[trees.nodes[trees.roots[0].node as usize].representative as usize] += 1.0;
    }
    let total: f64 = (1..=lights.len()).map(|i| i as f64).sum();
    for (i, count) in count.iter().enumerate() {
        let chance = (i + 1) as f64 / total;
        // Five standard errors of a share of 4000 draws.
        let bound = 5.0 * (chance * (1.0 - chance) / runs as f64).sqrt();
        assert!((count / runs as f64 - chance).abs() < bound, "{i}: {count}");
    }
}

#[test]
fn trees_do_not_depend_on_threads() {
    let lights = mixed(6000, |s| s.uniform());
    for settings in both_ways() {
        let one = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| build(&lights, &[], 17.0, &settings))
        };
        let (a, b) = (one(1), one(3));
        assert_eq!(a.nodes, b.nodes);
        assert_eq!(a.roots, b.roots);
    }
}

/// A million lights take at most 128 bytes each.
#[test]
fn nodes_are_a_cache_line() {
    assert_eq!(size_of::<ClusterNode>(), 64);
}

/// Truth: sums of what was given, and the trees' own layout.
#[test]
fn trees_over_lights_that_stand_still_are_lit_anew_and_appended() {
    let lights = mixed(64, |_| 1.0);
    let trees = build(&lights, &[], 10.0, &BuildSettings::default());
    let intensities: Vec<Vec3> = (0..64).map(|i| Vec3::splat((i % 5) as f32)).collect();
    let lit = trees.lit_by(&intensities, 1);
    let mut both = build(&lights, &[], 10.0, &BuildSettings::default());
    both.append(&lit, 64, 7);
    let first = trees.nodes.len() as u32;
    for node in 0..first {
        let (old, new) = (&trees.nodes[node as usize], &both.nodes[(first + node) as usize]);
        assert_eq!((old.low, old.high, old.axis), (new.low, new.high, new.axis));
        assert_eq!(trees.emission(node), both.emission(first + node));
        let children = both.children(first + node);
        assert_eq!(children, trees.children(node).map(|c| c.map(|c| c + first)));
        let light = new.representative - 64;
        let own = children.map_or(intensities[light as usize], |children| {
            children.map(|c| both.nodes[c as usize].intensity).iter().sum()
        });
        assert!(
            own.distance(new.intensity) <= 1e-6 * own.length(),
            "{own} {}",
            new.intensity
        );
        let is_lit = intensities[light as usize] != Vec3::ZERO;
        assert!(
            is_lit || own == Vec3::ZERO || children.is_none(),
            "no dark light stands for lit ones"
        );
    }
    for (old, new) in trees.roots.iter().zip(&both.roots[trees.roots.len()..]) {
        assert_eq!((old.node + first, 7), (new.node, new.group));
    }
}
