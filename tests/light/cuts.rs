//! At a site itself, visibility cuts are what shadow rays are. Truth: every direction by itself, with the BRDF and a
//! shadow ray from where the surface was hit, summed in f64.

use crate::stage::data;
use glam::{DVec3, Vec2, Vec3};
use relight_bake::cuts::light_samples::{LightLeaves, Lights, in_tree};
use relight_bake::cuts::visibility::site_cuts;
use relight_bake::params::CutParams;
use relight_bake::points::candidates::Candidate;
use relight_bake::units::Units;
use relight_format as format;
use relight_play::cuts::VisibilityCuts;
use relight_play::cuts::illumination::Illumination;
use relight_play::cuts::shade::{Fragments, shade};
use relight_play::cuts::sites::FragmentSites;
use relight_scene::bsdf;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::rays::Ray;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::cuts::{Selector, SiteCuts};
use relight_transport::random::Stream;
use std::sync::Arc;

const LIGHTS: u32 = 2048;
/// Pixels across and down.
const PIXELS: usize = 24;

/// What the box's camera sees in a few pixels: every other one glossy.
fn fragments(scene: &TracedScene) -> Vec<(SurfaceHit, ShadingPoint, Vec3)> {
    let camera = scene.scene().cameras[0].at(0.0);
    let mut seen = Vec::new();
    for pixel in 0..PIXELS * PIXELS {
        let place = Vec2::new((pixel % PIXELS) as f32 + 0.5, (pixel / PIXELS) as f32 + 0.5);
        let direction = camera.direction(place, Vec2::splat(PIXELS as f32));
        let ray = Ray {
            origin: camera.position,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let Some(hit) = scene.closest_hit(&ray) else {
            continue;
        };
        let matt = scene.shading_point(&hit);
        // Glossy lobes wide enough for directions 4° apart.
        let glossy = ShadingPoint {
            lambert: false,
            f0: Vec3::new(0.9, 0.6, 0.2),
            alpha: 0.1 + 0.4 * (pixel % 7) as f32 / 7.0,
            ..matt
        };
        let point = if pixel % 2 == 0 { matt } else { glossy }.facing(-direction);
        // The box is flat: what is below its horizon is below the shading normal's.
        if point.shading_normal == hit.geometric_normal {
            seen.push((hit, point, -direction));
        }
    }
    seen
}

/// Cuts of all leaves over a ray to every light: a bake casts fewer, which miss what falls between them.
fn cuts_of_every_light(scene: &TracedScene, sites: &[Candidate], leaves: &LightLeaves) -> SiteCuts {
    let lights = &leaves.lights;
    let mut cuts = SiteCuts {
        offsets: vec![0],
        ..SiteCuts::default()
    };
    for site in sites {
        let seen = |light| match lights.factor(site, light) {
            factor if factor > 0.0 && scene.occluded(&lights.ray(site, light)) => 0.0,
            factor => factor,
        };
        let seen: Vec<f32> = (0..lights.len()).map(seen).collect();
        Selector::default().select(&seen, 1e-6, usize::MAX, &mut cuts.heights, &mut cuts.values);
        cuts.offsets.push(cuts.heights.len() as u32);
    }
    cuts
}

#[test]
fn at_a_site_cuts_of_all_leaves_are_brute_force() {
    let scene = Arc::new(import(&data("cornell.glb"), &ImportOptions::default()).unwrap());
    let scene = TracedScene::new(scene, Shading::Full).unwrap();
    let fragments = fragments(&scene);
    assert!(fragments.len() > PIXELS * PIXELS / 2, "{}", fragments.len());
    let candidates: Vec<Candidate> = fragments.iter().map(|f| Candidate::at(&scene, &f.0, 0)).collect();
    let leaves = in_tree(&scene, &candidates, &Lights::directions(LIGHTS), 0.45);
    let Lights::Directions { directions, .. } = &leaves.lights else {
        unreachable!()
    };
    let made = cuts_of_every_light(&scene, &candidates, &leaves);
    let mut random = Stream::new(4, 0, 0);
    let flux: Vec<Vec3> = (0..LIGHTS)
        .map(|_| Vec3::new(random.uniform(), 0.5, random.uniform()) * random.uniform())
        .collect();

    let count = fragments.len() as u32;
    let sites = FragmentSites {
        order: (0..count).collect(),
        sites: (0..count).map(|i| [i, u32::MAX, u32::MAX]).collect(),
        weights: vec![[1.0, 0.0, 0.0]; count as usize],
        ..FragmentSites::default()
    };
    let points: Vec<Option<ShadingPoint>> = fragments.iter().map(|f| Some(f.1)).collect();
    let views: Vec<Vec3> = fragments.iter().map(|f| f.2).collect();
    let cuts = VisibilityCuts::of_directions(made, directions);
    let light = Illumination::of_directions(cuts.directions().unwrap(), &flux, LIGHTS as usize);
    let shaded = shade(
        &cuts,
        &light,
        &Fragments {
            sites: &sites,
            points: &points,
            views: &views,
            narrow: &[],
            matt: true,
        },
    );
    let mut shadowed = 0;
    for ((hit, point, view), found) in fragments.iter().zip(shaded.radiance) {
        let mut truth = DVec3::ZERO;
        for (&direction, flux) in directions.iter().zip(&flux) {
            let cosine = f64::from(point.shading_normal.dot(direction).max(0.0));
            if cosine > 0.0 && scene.occluded(&ray_from(hit, direction)) {
                shadowed += 1;
            } else {
                truth += bsdf::eval(point, *view, direction).as_dvec3() * flux.as_dvec3() * cosine;
            }
        }
        let error = (found.as_dvec3() - truth).abs().max_element() / truth.max_element();
        // f32 sums of two thousand terms.
        assert!(error < 1e-4, "{error} at {}", hit.position);
    }
    // The box hides most of the sky from all of them, but not the sky through its open side.
    let all = fragments.len() * LIGHTS as usize / 2;
    assert!(shadowed > all / 4 && shadowed < all, "{shadowed} of {all}");
}

/// What σ lets nodes scatter is more than what their means lose in the file. Truth: cuts of all leaves, by the same rays.
#[test]
fn bits_of_means_that_sigma_cannot_use_change_less_than_sigma_does() {
    let scene = Arc::new(import(&data("cornell.glb"), &ImportOptions::default()).unwrap());
    let scene = TracedScene::new(scene, Shading::Full).unwrap();
    let fragments = fragments(&scene);
    let candidates: Vec<Candidate> = fragments.iter().map(|f| Candidate::at(&scene, &f.0, 0)).collect();
    let leaves = in_tree(&scene, &candidates, &Lights::directions(LIGHTS), 0.45);
    let Lights::Directions { directions, .. } = &leaves.lights else {
        unreachable!()
    };
    let cuts_of = |sigma: f32| {
        let params = CutParams {
            lights: LIGHTS,
            sigma,
            ..CutParams::default()
        };
        let made = site_cuts(&scene, &candidates, &leaves, &params, (Units::none(), 0), |_| {
            Ok(())
        })
        .unwrap();
        (made.cuts, params.sigma())
    };
    let count = fragments.len() as u32;
    let sites = FragmentSites {
        order: (0..count).collect(),
        sites: (0..count).map(|i| [i, u32::MAX, u32::MAX]).collect(),
        weights: vec![[1.0, 0.0, 0.0]; count as usize],
        ..FragmentSites::default()
    };
    let points: Vec<Option<ShadingPoint>> = fragments.iter().map(|f| Some(f.1)).collect();
    let views: Vec<Vec3> = fragments.iter().map(|f| f.2).collect();
    // Light that varies within nodes, which is what σ bounds: means alone are right under even light.
    let mut random = Stream::new(5, 0, 0);
    let flux: Vec<Vec3> = (0..LIGHTS)
        .map(|_| Vec3::splat(random.uniform().powi(8)))
        .collect();
    let shaded = |cuts: SiteCuts| -> Vec<Vec3> {
        let fragments = Fragments {
            sites: &sites,
            points: &points,
            views: &views,
            narrow: &[],
            matt: true,
        };
        let cuts = VisibilityCuts::of_directions(cuts, directions);
        let light = Illumination::of_directions(cuts.directions().unwrap(), &flux, LIGHTS as usize);
        shade(&cuts, &light, &fragments).radiance
    };
    let difference = |a: &[Vec3], b: &[Vec3]| -> f64 {
        let squares = a
            .iter()
            .zip(b)
            .map(|(a, b)| f64::from((*a - *b).length_squared()));
        let size = b.iter().map(|b| f64::from(b.length_squared())).sum::<f64>();
        (squares.sum::<f64>() / size).sqrt()
    };
    // With so few lights the usual σ splits all that is neither lit nor dark: four times that.
    let (cuts, sigma) = cuts_of(4.0 * CutParams::default().sigma);
    let stored = format::quantised_cuts(&format::Cuts {
        sigma,
        unit: 1.0,
        row_offsets: cuts.offsets.clone(),
        heights: cuts.heights.clone(),
        values: cuts.values.clone(),
    });
    let truth = shaded(cuts_of(1e-4).0);
    let exact = shaded(cuts.clone());
    let short = shaded(SiteCuts {
        values: stored.values,
        ..cuts
    });
    let (lost, coarse) = (difference(&short, &exact), difference(&exact, &truth));
    assert!(lost > 0.0 && lost < coarse, "{lost} against {coarse}");
}
