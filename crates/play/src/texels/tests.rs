use super::*;
use relight_transport::random::Stream;

fn square(low: f32, high: f32) -> [[Vec2; 3]; 2] {
    let [a, b, c, d] = [[low, low], [high, low], [high, high], [low, high]].map(Vec2::from);
    [[a, b, c], [a, c, d]]
}

fn random(stream: &mut Stream) -> Vec2 {
    Vec2::new(stream.uniform(), stream.uniform())
}

/// Where a place lies in the map, texels.
fn place_in(atlas: &Atlas, place: &OnTriangle) -> Vec2 {
    let [a, b, c] = atlas.corners[place.triangle as usize];
    let [v, w] = place.barycentric;
    (a + (b - a) * v + (c - a) * w) * atlas.size as f32
}

/// Truth: a square of 20 × 20 texels covers 400 of them, and its two triangles meet without lying over each other.
#[test]
fn a_square_covers_its_area_once() {
    let atlas = Atlas {
        size: 32,
        corners: square(0.125, 0.75).to_vec(),
    };
    let texels = Texels::of(&atlas);
    assert_eq!((texels.covered, texels.covered_twice), (400.0, 0.0));
    assert!(texels.overlapping.is_empty());
    let inside = |i: usize| (4..24).contains(&(i % 32)) && (4..24).contains(&(i / 32));
    for i in 0..texels.len() {
        // Texels beside the border touch it at a side or a corner, and may have the nearest point.
        if inside(i) {
            assert_eq!(texels.places_of(i).len(), PLACES as usize);
        }
    }
}

/// Random triangles, thin ones among them. Truth: the texel that a point of a triangle lies in shows some triangle; every place lies in
/// the texel that it is of, or on its border.
#[test]
fn all_that_a_triangle_touches_has_a_place_of_it() {
    for seed in 0..40 {
        let mut stream = Stream::new(seed, 0, 0);
        let size = 16 + seed as u32;
        let start = random(&mut stream);
        let thin = if seed % 2 == 0 { 1.0 } else { 0.002 };
        let end = random(&mut stream);
        let third = start.lerp(end, stream.uniform()) + thin * (random(&mut stream) - 0.5);
        let atlas = Atlas {
            size,
            corners: vec![[start, end, third.clamp(Vec2::ZERO, Vec2::ONE)]],
        };
        let texels = Texels::of(&atlas);
        for _ in 0..2000 {
            let (v, w) = (stream.uniform(), stream.uniform());
            let (v, w) = if v + w > 1.0 { (1.0 - v, 1.0 - w) } else { (v, w) };
            let on = OnTriangle {
                triangle: 0,
                barycentric: [v, w],
            };
            let at = place_in(&atlas, &on)
                .floor()
                .as_uvec2()
                .min(glam::UVec2::splat(size - 1));
            let texel = (at.y * size + at.x) as usize;
            // Points on a border belong to two texels.
            let fraction = place_in(&atlas, &on).fract();
            let clear = fraction.min_element() > 1e-3 && fraction.max_element() < 1.0 - 1e-3;
            assert!(!clear || !texels.places_of(texel).is_empty(), "seed {seed}, {at}");
        }
        for texel in 0..texels.len() {
            let middle = Vec2::new((texel % size as usize) as f32, (texel / size as usize) as f32) + 0.5;
            for place in texels.places_of(texel) {
                let off = (place_in(&atlas, place) - middle).abs().max_element();
                assert!(off < 0.501, "seed {seed}, texel {texel}: {off}");
            }
        }
    }
}

/// Truth: of the nearest point, brute force over the triangle.
#[test]
fn a_texel_beside_its_triangle_takes_the_nearest_point() {
    let atlas = Atlas {
        size: 4,
        corners: vec![[[0.27, 0.26], [0.27, 0.95], [0.26, 0.6]].map(Vec2::from)],
    };
    let texels = Texels::of(&atlas);
    let middle = Vec2::new(1.5, 1.5);
    let [place] = texels.places_of(5) else {
        panic!("{:?}", texels.places_of(5))
    };
    let found = place_in(&atlas, place).distance(middle);
    let steps = 400;
    let brute = (0..=steps)
        .flat_map(|i| (0..=steps - i).map(move |j| [i as f32, j as f32].map(|n| n / steps as f32)))
        .map(|barycentric| {
            place_in(
                &atlas,
                &OnTriangle {
                    triangle: 0,
                    barycentric,
                },
            )
            .distance(middle)
        })
        .fold(f32::INFINITY, f32::min);
    assert!((found - brute).abs() < 1e-3, "{found} {brute}");
}

/// Truth: two squares of 16 × 16 texels whose common part has 8 × 8. Places on the diagonal, which both have, or near it, count as within
/// none of the triangles: three of each of its eight texels at most.
#[test]
fn triangles_over_each_other_are_counted() {
    let corners = [square(0.0, 0.5), square(0.25, 0.75)].concat();
    let texels = Texels::of(&Atlas { size: 32, corners });
    assert_eq!(texels.covered, 256.0 + 256.0 - 64.0);
    assert!(
        (61.0..64.0).contains(&texels.covered_twice),
        "{}",
        texels.covered_twice
    );
    assert_eq!(texels.overlapping, [0, 1, 2, 3]);
}

#[test]
fn what_has_no_area_or_no_place_is_in_no_map() {
    let line = [[0.1, 0.1], [0.5, 0.5], [0.9, 0.9]].map(Vec2::from);
    let corners = vec![[Vec2::NAN; 3], [Vec2::splat(0.3); 3], line];
    let texels = Texels::of(&Atlas { size: 8, corners });
    assert_eq!((texels.len(), texels.places.len()), (64, 0));
    assert!(Texels::of(&Atlas::default()).is_empty());
}

/// Truth: brute force over all lit texels, in steps to the eight texels around.
#[test]
fn what_is_empty_takes_the_nearest_light() {
    let size = 40usize;
    let mut stream = Stream::new(3, 0, 0);
    let lit: Vec<bool> = (0..size * size).map(|_| stream.uniform() < 0.01).collect();
    let mut values: Vec<usize> = (0..size * size).collect();
    fill(size as u32, &lit, &mut values);
    let steps = |a: usize, b: usize| (a % size).abs_diff(b % size).max((a / size).abs_diff(b / size));
    for (i, &from) in values.iter().enumerate() {
        let nearest = (0..size * size).filter(|&j| lit[j]).map(|j| steps(i, j)).min();
        assert!(lit[from]);
        assert_eq!(Some(steps(i, from)), nearest, "{i}");
    }
    let mut dark = vec![7; 16];
    fill(4, &[false; 16], &mut dark);
    assert_eq!(dark, [7; 16]);
}
