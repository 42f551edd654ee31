//! How tight the bounds are where they are used.

use glam::{Vec2, Vec3};
use relight_render::direct::reflected;
use relight_render::layers::RenderSize;
use relight_render::lightcuts::cluster_bound;
use relight_render::many_lights::PointLights;
use relight_scene::camera::Camera;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::TracedScene;
use relight_transport::light_clusters::LightClusters;
use relight_transport::random::Stream;
use std::fmt;

/// True largest value over bound, of random clusters at random pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tightness {
    /// Sorted; 1 is a bound that is met, more would be wrong.
    pub shares: Vec<f32>,
    /// Pairs whose bound is above zero though nothing is reflected.
    pub idle: u64,
    /// Pairs whose bound is infinite: points within a cluster's box.
    pub infinite: u64,
    /// Pairs in which a light exceeds the bound: there must be none.
    pub violated: u64,
}

impl fmt::Display for Tightness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = |share: f64| {
            let place = (share * (self.shares.len().max(1) - 1) as f64) as usize;
            self.shares.get(place).copied().unwrap_or(f32::NAN)
        };
        write!(
            f,
            "{} pairs; true / bound: 5 % of them below {:.3}, 25 % {:.3}, median {:.3}, 75 % {:.3}, 95 % {:.3}; bound \
             above 0 but nothing reflected: {}; infinite: {}; violated: {}",
            self.shares.len(),
            at(0.05),
            at(0.25),
            at(0.5),
            at(0.75),
            at(0.95),
            self.idle,
            self.infinite,
            self.violated
        )
    }
}

/// Stage of the random numbers.
const STAGE: u32 = 0x4c44;
/// Largest cluster whose lights are looked at one by one.
const MOST: usize = 4096;

/// Measures at every pixel's middle with `per_pixel` clusters each, drawn by walking down from a root: half of the steps
/// go on.
pub fn bound_tightness(
    scene: &TracedScene,
    points: &PointLights,
    clusters: &LightClusters,
    camera: &Camera,
    size: RenderSize,
    per_pixel: u32,
) -> Tightness {
    let mut found = Tightness::default();
    let (mut members, mut stack) = (Vec::new(), Vec::new());
    for pixel in 0..size.width * size.height {
        let place = Vec2::new(
            (pixel % size.width) as f32 + 0.5,
            (pixel / size.width) as f32 + 0.5,
        );
        let eye = Ray {
            origin: camera.position,
            direction: camera.direction(place, Vec2::new(size.width as f32, size.height as f32)),
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let Some(hit) = scene.closest_hit(&eye) else {
            continue;
        };
        let wo = -eye.direction;
        let point = scene.shading_point(&hit).facing(wo);
        for k in 0..per_pixel {
            let mut random = Stream::new(pixel as u64, STAGE, k.into());
            let root = (random.uniform() * clusters.roots.len() as f32) as usize;
            let Some(root) = clusters.roots.get(root) else {
                return found;
            };
            let mut node = root.node;
            // A depth up to some 20 levels, evenly.
            for _ in 0..(random.uniform() * 20.0) as u32 {
                let Some(children) = clusters.children(node) else {
                    break;
                };
                node = children[usize::from(random.uniform() < 0.5)];
            }
            members.clear();
            stack.clear();
            stack.push(node);
            while let Some(at) = stack.pop() {
                match clusters.children(at) {
                    Some(children) => stack.extend(children),
                    None => members.push(clusters.nodes[at as usize].representative),
                }
                if members.len() > MOST {
                    break;
                }
            }
            if members.len() > MOST || members.len() < 2 {
                continue;
            }
            let intensity = clusters.nodes[node as usize].intensity;
            let most = (members.iter())
                .map(|&i| {
                    let arrival = points.lights[i as usize].arrival(hit.position);
                    arrival.map_or(Vec3::ZERO, |a| reflected(&point, wo, a.direction) * a.factor)
                })
                .fold(0.0f32, |most, term| most.max((term * intensity).max_element()));
            let bound = cluster_bound(clusters, node, &hit, &point, wo);
            found.violated += u64::from(most > bound);
            if bound == f32::INFINITY {
                found.infinite += 1;
            } else if most > 0.0 {
                found.shares.push(most / bound);
            } else if bound > 0.0 {
                found.idle += 1;
            }
        }
    }
    found.shares.sort_by(f32::total_cmp);
    found
}
