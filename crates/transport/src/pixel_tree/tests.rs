use super::*;
use crate::point_light::{Emission, PointLight};
use crate::random::Stream;
use crate::test_random::direction;
use glam::{Mat3, Vec3};

fn pixels(n: usize) -> Vec<TreePixel> {
    let mut s = Stream::new(9, 0, 0);
    (0..n)
        .map(|i| TreePixel {
            position: Vec3::new(
                s.uniform() * 3.0,
                s.uniform(),
                if i % 2 == 0 { 0.0 } else { s.uniform() },
            ),
            normal: if i % 2 == 0 { Vec3::Z } else { direction(&mut s) },
            plain: i % 7 != 0,
            glossy: i % 11 == 0,
        })
        .collect()
}

fn turned() -> Mat3 {
    Mat3::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7)
}

fn lamp(emission: Emission) -> PointLight {
    PointLight {
        emission,
        position: Vec3::new(1.0, 0.4, 0.6),
        axis: Vec3::new(0.3, -0.2, -1.0).normalize(),
        intensity: Vec3::ONE,
    }
}

const SPOT: Emission = Emission::Spot {
    scale: 4.0,
    offset: -2.0,
};

#[test]
fn every_node_holds_its_pixels_and_nothing_else() {
    let pixels = pixels(20_000);
    let tree = PixelTree::new(&pixels, turned(), 0.2, 1);
    let mut seen = vec![false; pixels.len()];
    tree.order
        .iter()
        .for_each(|&i| assert!(!std::mem::replace(&mut seen[i as usize], true)));
    assert_eq!(tree.nodes[0].size as usize, tree.nodes.len());
    for (at, node) in tree.nodes.iter().enumerate() {
        let inside: Vec<&TreePixel> = (node.first..node.end)
            .map(|i| &pixels[tree.order[i as usize] as usize])
            .collect();
        for pixel in &inside {
            let p = turned() * pixel.position;
            assert!(p.cmpge(node.low).all() && p.cmple(node.high).all());
        }
        assert_eq!(node.glossy, inside.iter().any(|p| p.glossy));
        if node.flat {
            assert!(
                inside
                    .iter()
                    .all(|p| p.plain && p.normal.dot(inside[0].normal) > 0.999_99)
            );
        }
        if node.skip > 0 {
            let (l, r) = (&tree.nodes[at + 1], &tree.nodes[at + node.skip as usize]);
            assert_eq!((l.first, l.end, r.end), (node.first, r.first, node.end));
            assert_eq!(1 + l.size + r.size, node.size);
        } else {
            assert_eq!((node.size, node.end - node.first), (1, 1));
        }
    }
}

#[test]
fn cuts_take_every_pixel_once_in_order_and_keep_to_their_size() {
    let tree = PixelTree::new(&pixels(5000), turned(), 0.2, 1);
    let mut cut = Vec::new();
    for emission in [Emission::Omni, Emission::Oriented, SPOT, Emission::Directional] {
        for (clusters, most) in [(1, 10), (64, 640), (64, 70), (5000, 5000), (100_000, 1_000_000)] {
            for strength in [0.0, 0.01, 1.0, f32::INFINITY] {
                let light = CutLight::new(&lamp(emission), tree.rotation, strength);
                let limits = CutLimits {
                    clusters,
                    threshold: 0.01,
                    most,
                };
                choose_cut(&tree, &light, &limits, &mut Stream::new(1, 2, 3), &mut cut);
                let mut next = 0;
                for &at in &cut {
                    assert_eq!(tree.nodes[at as usize].first, next);
                    next = tree.nodes[at as usize].end;
                }
                assert_eq!(next, 5000);
                assert!(cut.len() as u32 >= clusters.min(5000));
                assert!(cut.len() as u32 <= most.max(clusters));
                if emission == Emission::Directional || strength == 0.0 {
                    assert_eq!(cut.len() as u32, clusters.min(5000));
                }
            }
        }
    }
}

#[test]
fn a_random_cut_refines_in_proportion_to_pixels() {
    // Half of all pixels lie in a hundredth of the space: they get half of the nodes.
    let mut pixels = pixels(8000);
    for pixel in &mut pixels[4000..] {
        pixel.position = Vec3::splat(5.0) + 0.01 * pixel.position;
        pixel.normal = Vec3::Z;
    }
    let tree = PixelTree::new(&pixels, Mat3::IDENTITY, 0.2, 1);
    let light = CutLight::new(&lamp(Emission::Directional), tree.rotation, 1.0);
    let limits = CutLimits {
        clusters: 400,
        threshold: 0.01,
        most: 4000,
    };
    let mut cut = Vec::new();
    for seed in 0..5 {
        choose_cut(&tree, &light, &limits, &mut Stream::new(seed, 0, 0), &mut cut);
        let crowded = cut
            .iter()
            .filter(|&&at| tree.nodes[at as usize].low.x > 4.0)
            .count();
        assert!((190..=210).contains(&crowded), "{crowded} of {}", cut.len());
    }
}

/// Truth: the light at random places of random boxes.
#[test]
fn what_is_sent_to_a_box_varies_by_no_more_than_is_said() {
    let mut s = Stream::new(4, 0, 0);
    for emission in [Emission::Omni, Emission::Oriented, SPOT] {
        let lamp = lamp(emission);
        let light = CutLight::new(&lamp, turned(), 0.05);
        for _ in 0..3000 {
            let size = 10f32.powf(-3.0 * s.uniform());
            let low = turned() * (direction(&mut s) * s.uniform() * 3.0);
            let high = low + Vec3::new(s.uniform(), s.uniform(), s.uniform()) * size;
            let node = PixelNode {
                low,
                high,
                first: 0,
                end: 1,
                skip: 0,
                size: 1,
                flat: false,
                glossy: false,
            };
            let said = light.variation(&node);
            assert!((0.0..=1.0).contains(&said), "{said}");
            let (mut least, mut most) = (f32::INFINITY, 0.0f32);
            for _ in 0..20 {
                let p = low + (high - low) * Vec3::new(s.uniform(), s.uniform(), s.uniform());
                let sent = lamp
                    .arrival(turned().transpose() * p)
                    .map_or(0.0, |a| (a.factor * 0.05).min(1.0));
                (least, most) = (least.min(sent), most.max(sent));
            }
            // Rounding of the rotation.
            assert!(
                most - least <= said + 1e-4,
                "{emission:?}: {} but said {said}",
                most - least
            );
        }
    }
}

#[test]
fn pixels_in_one_place_none_and_one_make_trees() {
    assert!(PixelTree::new(&[], Mat3::IDENTITY, 1.0, 1).nodes.is_empty());
    let one = pixels(1);
    for pixels in [one.clone(), vec![one[0]; 1000]] {
        let tree = PixelTree::new(&pixels, turned(), 1.0, 1);
        assert_eq!((tree.nodes.len(), tree.order.len()), (1, pixels.len()));
        let mut cut = Vec::new();
        let light = CutLight::new(&lamp(Emission::Omni), tree.rotation, 1.0);
        let limits = CutLimits {
            clusters: 2048,
            threshold: 0.01,
            most: 20_480,
        };
        choose_cut(&tree, &light, &limits, &mut Stream::new(0, 0, 0), &mut cut);
        assert_eq!(cut, [0]);
    }
}
