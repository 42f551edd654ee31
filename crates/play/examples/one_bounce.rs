//! Where one bounce loses light: of what a point lamp's light does in one reflection to what the first camera sees, step by
//! step from exact rays to what the asset answers.
//!
//! `cargo run --release -p relight-play --example one_bounce -- ASSET.relight X Y Z RAYS`
//!
//! Prints, for the sum over all pixels and for eight groups of them from the darkest on, how far each step is from rays that
//! ask the lamp itself: the nearest finest point instead of the place that a ray meets; its cluster's mean instead; T.
//! The last line is the same for the points nearest to the pixels. Groups are of pixels whose nearest points are alike bright,
//! by other rays: by their own, noise would sort them.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_play::transfer::Transfer;
use relight_play::{Player, PreparedScene};
use relight_render::expose::expose;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_between, ray_from};
use relight_transport::basis::NearestPoint;
use relight_transport::pyramid::VectorIrradiance;
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere, r2};

/// Green radiosity, up to the lamp's intensity, of a place lit by a lamp.
fn lit(player: &PreparedScene, hit: &SurfaceHit, lamp: Vec3) -> f32 {
    let way = lamp - hit.position;
    let direction = way.normalize_or_zero();
    let cosine = hit.normal.dot(direction);
    let above = cosine > 0.0 && hit.geometric_normal.dot(direction) > 0.0;
    if !above || player.scene.occluded(&ray_between(hit, lamp)) {
        return 0.0;
    }
    player.scene.albedo(hit).y * cosine / way.length_squared()
}

/// What a place on a surface receives of light that was reflected once: exactly, from the nearest points, and from their
/// clusters.
struct Received {
    exact: f32,
    points: f32,
    clusters: f32,
}

struct Scene<'a> {
    player: &'a PreparedScene,
    transfer: &'a Transfer,
    nearest: NearestPoint<'a>,
    lamp: Vec3,
    rays: u32,
    /// Radiosity of the finest points, and of each one's cluster on the finest sender level.
    at_points: Vec<f32>,
    of_cluster: Vec<f32>,
    /// What T makes of it at the points.
    answered: Vec<VectorIrradiance>,
}

impl Scene<'_> {
    fn received(&self, hit: &SurfaceHit, stream: &mut Stream) -> Received {
        let start = Vec2::new(stream.uniform(), stream.uniform());
        let frame = Frame::around(hit.normal);
        let mut sum = Received {
            exact: 0.0,
            points: 0.0,
            clusters: 0.0,
        };
        for i in 0..self.rays {
            let direction = frame.world_from_local(cosine_hemisphere(r2(i, start)));
            if direction.dot(hit.geometric_normal) <= 0.0 {
                continue;
            }
            let Some(there) = self.player.scene.closest_hit(&ray_from(hit, direction)) else {
                continue;
            };
            sum.exact += lit(self.player, &there, self.lamp);
            if let Some(point) = self.nearest.at(there.position, there.normal) {
                sum.points += self.at_points[point as usize];
                sum.clusters += self.of_cluster[point as usize];
            }
        }
        let mean = |sum: f32| sum / self.rays as f32;
        Received {
            exact: mean(sum.exact),
            points: mean(sum.points),
            clusters: mean(sum.clusters),
        }
    }

    fn answered_at(&self, hit: &SurfaceHit) -> f32 {
        let finest = &self.transfer.finest;
        let mut row = Vec::new();
        finest.functions_or_nearest_at(hit.position, hit.normal, &mut row);
        let mut value = VectorIrradiance::default();
        for &(j, weight) in &row {
            value.add_carried(
                &self.answered[j as usize],
                finest.normals[j as usize],
                hit.normal,
                weight,
            );
        }
        value.irradiance(hit.normal).y
    }
}

fn print(name: &str, of: &[[f64; 4]], whole: f64) {
    let sum = |i: usize| of.iter().map(|values| values[i]).sum::<f64>();
    let off = |i: usize| 100.0 * (sum(i) / sum(0) - 1.0);
    println!(
        "{name:26} {:5.1} % of the light: nearest points {:+.2} %, clusters {:+.2} %, T {:+.2} %",
        100.0 * sum(0) / whole,
        off(1),
        off(2),
        off(3)
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [asset, x, y, z, rays] = arguments.as_slice() else {
        return Err("usage: one_bounce ASSET.relight X Y Z RAYS".into());
    };
    let lamp = Vec3::new(x.parse()?, y.parse()?, z.parse()?);
    let opened = Player::open(asset)?;
    let player = &opened.prepared;
    let transfer = player.transfer.as_ref().ok_or("the asset has no operators")?;
    let camera = opened.scene().cameras.first().ok_or("the scene has no camera")?;
    let found = |hit: &&SurfaceHit| hit.primitive != u32::MAX;
    let at_points: Vec<f32> = (player.points.par_iter())
        .map(|hit| {
            hit.as_ref()
                .filter(found)
                .map_or(0.0, |hit| lit(player, hit, lamp))
        })
        .collect();
    let radiosity: Vec<Vec3> = at_points.iter().map(|&b| Vec3::splat(b)).collect();
    let senders = &transfer.senders;
    let last = senders.levels() - 1;
    let means = &senders.pulled(&radiosity)[last];
    let of_cluster = (senders.cluster_of_point(last).iter())
        .map(|&cluster| means[cluster as usize].y)
        .collect();
    let scene = Scene {
        player,
        transfer,
        nearest: NearestPoint::new(&transfer.finest),
        lamp,
        rays: rays.parse()?,
        at_points,
        of_cluster,
        answered: transfer.of_radiosity(&radiosity),
    };
    let seen = expose(&player.scene, &camera.at(0.0), 240, 135, 1);
    let hits: Vec<SurfaceHit> = seen.hits.iter().flatten().copied().collect();
    let weighed = |received: Received, answered: f32, albedo: f32| {
        [received.exact, received.points, received.clusters, answered].map(|v| f64::from(v * albedo))
    };
    let mut both: Vec<([f64; 4], [f64; 4])> = hits
        .par_iter()
        .enumerate()
        .map(|(i, hit)| {
            let mut stream = Stream::new(1, 0, i as u64);
            let albedo = player.scene.albedo(hit).y;
            let seen = weighed(scene.received(hit, &mut stream), scene.answered_at(hit), albedo);
            let nearest = scene.nearest.at(hit.position, hit.normal).map(|p| p as usize);
            let beside = nearest.and_then(|p| player.points[p].as_ref().filter(found).map(|hit| (p, hit)));
            let beside = beside.map_or([0.0; 4], |(p, hit)| {
                let answered = scene.answered[p].irradiance(hit.normal).y;
                weighed(scene.received(hit, &mut stream), answered, albedo)
            });
            (seen, beside)
        })
        .collect();
    both.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let (pixels, points): (Vec<_>, Vec<_>) = both.into_iter().unzip();
    let whole = pixels.iter().map(|values| values[0]).sum();
    print("all pixels", &pixels, whole);
    for (i, group) in pixels.chunks(pixels.len().div_ceil(8).max(1)).enumerate() {
        print(&format!("eighth {} from the darkest", i + 1), group, whole);
    }
    print("points nearest to pixels", &points, whole);
    Ok(())
}
