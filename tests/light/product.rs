//! The operator of a real bake against a dense product, and against rays that know nothing of it.

use crate::stage::{bake_glb, through_file};
use glam::{DVec3, Vec2, Vec3};
use relight_bake::params::BakeParams;
use relight_data_generate::cornell;
use relight_scene::surface::{Surfaces, ray_from};
use relight_transport::links::{Links, SenderLinks};
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere, r2};

fn exact() -> BakeParams {
    BakeParams {
        levels: 3,
        sender_levels: 3,
        coarse_radius: Some(0.08),
        // Far below what any link carries: none that is found is dropped.
        epsilon: 1e-7,
        rays: 1024,
        bounces: Some(1),
        ..BakeParams::default()
    }
}

/// Truth: the dense product in f64. Tolerance: a row's sum of n products in f32 is off by at most n + 1
/// roundings of the sum of their magnitudes; dark senders add 1e-7 of the brightest each.
#[test]
fn the_sparse_product_is_the_dense_one() {
    let asset = bake_glb(
        &cornell(),
        &BakeParams {
            epsilon: 0.01,
            ..exact()
        },
    );
    let stored = asset.transfer.unwrap();
    let links = Links {
        receivers: stored.receivers,
        senders: stored.senders,
        row_offsets: stored.row_offsets,
        columns: stored.columns,
        vectors: stored.vectors.into_iter().map(Vec3::from).collect(),
    };
    let mut stream = Stream::new(5, 0, 0);
    let light: Vec<Vec3> = (0..links.senders)
        .map(|_| Vec3::new(stream.uniform(), stream.uniform(), stream.uniform()) - 0.25)
        .collect();
    let senders = links.senders as usize;
    let (sparse, used) = SenderLinks::new(&links).apply(&light);
    assert_eq!(used, links.len());
    for i in 0..links.receivers as usize {
        let mut row = vec![DVec3::ZERO; senders];
        links.row(i).for_each(|(j, v)| row[j as usize] = v.as_dvec3());
        let direction = Vec3::new(0.48, 0.6, 0.64);
        let (mut dense, mut magnitude) = (DVec3::ZERO, 0.0);
        for (vector, light) in row.iter().zip(&light) {
            dense += light.as_dvec3() * vector.dot(direction.as_dvec3());
            magnitude += vector.abs().element_sum();
        }
        let terms = links.row(i).count() + 4;
        let error = (sparse[i].irradiance(direction).as_dvec3() - dense)
            .abs()
            .max_element();
        assert!(
            error <= terms as f64 * f64::from(f32::EPSILON) * magnitude + 1e-12,
            "{i}: {error}"
        );
    }
}

/// Truth: irradiance gathered with cosine-distributed rays that read the radiosity where they arrive, in f64.
/// Light: the floor glows with a radiosity that varies in x and z. Tolerances: the rays' standard error
/// (16,384 of a radiosity within 0..2: 0.5 % of the mean), the bake's 1024 rays (3 % at a point, spread over
/// directions evenly, so less), and the smear of senders of 2 cm over a pattern of 55 cm (1 %): 4 % at each
/// point and 1 % for the mean of all.
#[test]
fn with_all_links_kept_the_bake_is_a_gather() {
    let player = through_file(&bake_glb(&cornell(), &exact()));
    let transfer = player.prepared.transfer.as_ref().unwrap();
    let radiosity = |x: Vec3, n: Vec3| if n.y > 0.9 { 1.0 + (x.x - x.z) / 0.56 } else { 0.0 };
    let direct: Vec<Vec3> = (0..transfer.finest.len())
        .map(|i| {
            let b = radiosity(transfer.finest.positions[i], transfer.finest.normals[i]);
            Vec3::splat(b) / transfer.albedo[i]
        })
        .collect();
    let (values, _) = transfer.indirect_from_direct(&direct);
    let brightest = values
        .iter()
        .zip(&transfer.finest.normals)
        .map(|(v, n)| v.irradiance(*n).x)
        .fold(0.0, f32::max);
    let (mut found_sum, mut truth_sum, mut worst, mut places) = (0.0, 0.0, 0.0f64, 0);
    for i in (0..transfer.finest.len()).step_by(transfer.finest.len() / 60) {
        let hit = player.prepared.points[i].unwrap();
        let frame = Frame::around(hit.normal);
        let rays = 16_384;
        let mut truth = 0.0;
        for k in 0..rays {
            let local = cosine_hemisphere(r2(k, Vec2::new(0.3, 0.7)));
            if let Some(met) = player
                .prepared
                .scene
                .closest_hit(&ray_from(&hit, frame.world_from_local(local)))
            {
                truth += f64::from(radiosity(met.position, met.normal));
            }
        }
        truth /= f64::from(rays);
        let found = f64::from(values[i].irradiance(hit.normal).x);
        found_sum += found;
        truth_sum += truth;
        // Against the brightest: a place that sees next to nothing has no relative error to speak of.
        worst = worst.max((found - truth).abs() / f64::from(brightest));
        places += 1;
    }
    let mean = found_sum / truth_sum - 1.0;
    println!("gather: {places} places, worst {worst:.4} of the brightest, mean {mean:.5}");
    assert!(worst < 0.04, "{worst}");
    assert!(mean.abs() < 0.01, "{mean}");
}
