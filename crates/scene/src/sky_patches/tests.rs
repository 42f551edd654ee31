//! Patches by closed forms, and against those of Radiance's gendaymtx for the same hours.

use super::*;
use crate::environment::{luminance, uv_from_direction};
use crate::perez::weather_sky;
use crate::weather::{Daylight, Weather};

/// By gendaymtx; its head says how.
const GENDAYMTX: &str = include_str!("gendaymtx.txt");
/// The weather of its hours.
const TAPE: &str = "place Zurich_CHE\nlatitude 47.38\nlongitude -8.57\ntime_zone -15\nsite_elevation 569\nweather_data_file_units 1\n\
    3 21 7.500 120 60\n3 21 9.500 420 130\n3 21 12.500 640 160\n3 21 15.500 380 150\n6 21 5.500 60 40\n\
    6 21 8.500 480 140\n6 21 12.500 820 110\n6 21 13.500 0 310\n6 21 16.500 5 240\n6 21 19.500 90 70\n";
const COUNTS: [usize; 3] = [145, 577, 2305];

fn patches() -> [SkyPatches; 3] {
    COUNTS.map(|count| SkyPatches::new(count).unwrap())
}

/// A sky of a sun that shines into a hazy half of it.
fn sky(pixel: impl Fn(usize, usize) -> f32, sun: DVec3) -> SunSky {
    let (width, height) = SKY_SIZE;
    let lit = |i: usize| Vec3::new(0.5, 1.0, 2.0) * pixel(i % width, i / width);
    SunSky {
        sky: EnvironmentMap {
            width,
            height,
            pixels: (0..width * height)
                .map(|i| {
                    if i < width * height / 2 {
                        lit(i)
                    } else {
                        Vec3::ZERO
                    }
                })
                .collect(),
        },
        sun_direction: sun.normalize().as_vec3(),
        sun_radiance: Vec3::ZERO,
    }
}

fn weather(direct: f64, diffuse: f64, sun: DVec3) -> SunSky {
    let daylight = Daylight {
        direct_normal: direct,
        diffuse_horizontal: diffuse,
        in_lux: false,
        dew_point: 11.0,
        eccentricity: 1.0,
    };
    weather_sky(&daylight, sun.normalize())
}

/// Irradiance of the ground by patches of even radiance: π (sin² of the upper end − sin² of the lower) of each row.
fn of_ground(patches: &SkyPatches, radiance: &[Vec3]) -> f64 {
    let projected = (patches.rows.iter()).flat_map(|row| {
        (0..row.count).map(|_| PI * (row.sines[1].powi(2) - row.sines[0].powi(2)) / row.count as f64)
    });
    (projected.zip(radiance))
        .map(|(angle, radiance)| angle * f64::from(luminance(*radiance)))
        .sum()
}

/// The same by the pixels of a map.
fn of_map(map: &EnvironmentMap) -> f64 {
    let sines = |y: usize| line(y, map.height).map(|sine| sine.max(0.0));
    let sum = |y: usize| -> f64 {
        let row = &map.pixels[y * map.width..][..map.width];
        row.iter().map(|pixel| f64::from(luminance(*pixel))).sum()
    };
    (0..map.height)
        .map(|y| sum(y) * PI * (sines(y)[1].powi(2) - sines(y)[0].powi(2)) / map.width as f64)
        .sum()
}

#[test]
fn patches_are_as_many_as_they_are_said_to_be_and_tile_the_hemisphere() {
    for (patches, count) in patches().iter().zip(COUNTS) {
        assert_eq!((patches.len(), patches.solid_angles().count()), (count, count));
        let sum: f64 = patches.solid_angles().sum();
        assert!((sum / TAU - 1.0).abs() < 1e-12, "{sum}");
        // Tregenza's patches are of about one size; in finer ones' rows there are as many at their upper ends as at their lower ones.
        let mean = TAU / count as f64;
        assert!(
            count > COUNTS[0]
                || patches
                    .solid_angles()
                    .all(|angle| (0.7..1.3).contains(&(angle / mean)))
        );
        assert!(
            patches
                .middles()
                .iter()
                .all(|middle| (middle.length() - 1.0).abs() < 1e-12)
        );
    }
    for count in [0, 1, 144, 146, 1297, usize::MAX] {
        assert!(SkyPatches::new(count).is_none(), "{count}");
    }
}

#[test]
fn an_even_sky_gives_even_patches_and_the_maps_of_all_patches_an_even_sky() {
    let even = sky(|_, _| 3.0, DVec3::Y);
    for patches in patches() {
        for radiance in patches.radiance(&even) {
            // Sums of shares in f64, rounded once.
            assert!(
                (radiance - Vec3::new(1.5, 3.0, 6.0)).abs().max_element() < 1e-6,
                "{radiance}"
            );
        }
        let mut sum = vec![0.0f64; even.sky.pixels.len()];
        for (patch, solid_angle) in patches.solid_angles().enumerate() {
            let map = patches.map(patch);
            let mut all = 0.0;
            for (i, pixel) in map.pixels.iter().enumerate() {
                sum[i] += f64::from(pixel.x);
                let [low, high] = line(i / map.width, map.height);
                all += f64::from(pixel.x) * TAU * (high - low) / map.width as f64;
            }
            assert!(
                (all / solid_angle - 1.0).abs() < 1e-6,
                "{patch}: {all} of {solid_angle}"
            );
        }
        for (i, sum) in sum.iter().enumerate() {
            let upper = f64::from(u8::from(i < even.sky.pixels.len() / 2));
            assert!((sum - upper).abs() < 1e-6, "{i}: {sum}");
        }
        assert!(
            patches
                .map(patches.len())
                .pixels
                .iter()
                .all(|pixel| *pixel == Vec3::ZERO)
        );
    }
}

/// A patch is lit by the pixels that look where its middle does.
#[test]
fn patches_are_where_their_middles_say() {
    for patches in patches() {
        for (patch, middle) in patches.middles().iter().enumerate() {
            let there = patches.map(patch).at(uv_from_direction(middle.as_vec3()));
            // The finest are two pixels wide, between which the map is interpolated.
            assert!(there.x > 0.6, "{patch} of {}: {there}", patches.len());
        }
    }
    let [coarse, ..] = patches();
    assert!(
        (coarse.middles()[0].x, coarse.middles()[0].z) == (0.0, coarse.middles()[0].z.min(-0.9)),
        "north first"
    );
    assert!(coarse.middles()[1].x > 0.1, "then by east");
}

/// Truth: the pixels' own. A patch forgets the altitude of its light: rows of 12° err by up to 1.5 % where a low sun makes the horizon bright, finer ones by
/// about the square of their height.
#[test]
fn the_ground_gets_what_the_sky_sends() {
    for sun in [
        DVec3::new(1.0, 0.03, 0.2),
        DVec3::new(-0.5, 0.7, 0.3),
        DVec3::new(0.02, 1.0, 0.0),
    ] {
        for (direct, diffuse) in [(0.0, 200.0), (600.0, 90.0)] {
            let sky = SunSky {
                sun_radiance: Vec3::ZERO,
                ..weather(direct, diffuse, sun)
            };
            let truth = of_map(&sky.sky);
            for (patches, bound) in patches().iter().zip([2.5e-2, 8e-3, 2.5e-3]) {
                let found = of_ground(patches, &patches.radiance(&sky));
                assert!(
                    (found / truth - 1.0).abs() < bound,
                    "{sun}, {}: {found}, {truth}",
                    patches.len()
                );
            }
        }
    }
}

#[test]
fn the_suns_irradiance_is_kept_and_stays_around_it() {
    let disc = TAU * 2.0 * (SUN_HALF_ANGLE / 2.0).sin().powi(2);
    for sun in [
        DVec3::new(1.0, 0.01, 0.2),
        DVec3::new(-0.5, 0.7, 0.3),
        DVec3::new(0.02, 1.0, 0.0),
        DVec3::Y,
    ] {
        let mut of = sky(|_, _| 0.0, sun);
        of.sun_radiance = Vec3::new(1e6, 9e5, 7e5);
        for patches in patches() {
            let radiance = patches.radiance(&of);
            let sum: DVec3 = (radiance.iter().zip(patches.solid_angles()))
                .map(|(radiance, angle)| radiance.as_dvec3() * angle)
                .sum();
            let truth = of.sun_radiance.as_dvec3() * disc;
            assert!((sum / truth - 1.0).abs().max_element() < 1e-6, "{sum} {truth}");
            let lit: Vec<usize> = (0..radiance.len())
                .filter(|&i| radiance[i] != Vec3::ZERO)
                .collect();
            assert_eq!(lit.len(), 4);
            // No farther than a patch and a half.
            let far = 1.6 * (TAU / patches.len() as f64).sqrt();
            let sun = sun.normalize();
            assert!(
                lit.iter().all(|&i| patches.middles()[i].angle_between(sun) < far),
                "{sun} {lit:?}"
            );
        }
    }
}

/// Half a turn takes each patch to the one opposite, for all rows have even numbers of patches, and pixels to pixels.
#[test]
fn a_turned_sky_has_turned_patches() {
    let pixel = |x: usize, y: usize| 1.0 + ((x * 7 + y * 3) % 31) as f32;
    let mut ahead = sky(pixel, DVec3::new(0.6, 0.5, -0.3));
    ahead.sun_radiance = Vec3::splat(1e5);
    let mut turned = sky(
        |x, y| pixel((x + SKY_SIZE.0 / 2) % SKY_SIZE.0, y),
        DVec3::new(-0.6, 0.5, 0.3),
    );
    turned.sun_radiance = Vec3::splat(1e5);
    for patches in patches() {
        let [one, other] = [&ahead, &turned].map(|sky| patches.radiance(sky));
        let mut first = 0;
        for row in &patches.rows {
            for j in 0..row.count {
                let opposite = (j + row.count / 2) % row.count;
                let (a, b) = (one[first + j], other[first + opposite]);
                assert!((a - b).abs().max_element() <= 1e-5 * a.max_element(), "{a} {b}");
            }
            first += row.count;
        }
    }
}

/// Of one hour by gendaymtx.
#[derive(Default)]
struct Hour {
    sun: DVec3,
    sky: Vec<f64>,
    /// Numbers of patches from 1 and their radiance, of 145, 577 and 2305.
    direct: Vec<Vec<(usize, f64)>>,
}

fn gendaymtx() -> Vec<Hour> {
    let mut hours: Vec<Hour> = Vec::new();
    for line in GENDAYMTX.lines().filter(|line| !line.starts_with('#')) {
        let (kind, rest) = line.split_once(' ').unwrap();
        let numbers = || rest.split(' ').map(|word| word.parse::<f64>().unwrap());
        if kind == "sun" {
            let [east, north, up] = numbers().collect::<Vec<_>>()[..] else {
                panic!("{line}")
            };
            hours.push(Hour {
                sun: DVec3::new(east, up, -north).normalize(),
                ..Hour::default()
            });
            continue;
        }
        let hour = hours.last_mut().unwrap();
        if kind == "sky" {
            hour.sky = numbers().collect();
            continue;
        }
        let pairs = rest.split(' ').skip(1).filter_map(|pair| pair.split_once('='));
        let pairs = pairs.map(|(patch, radiance)| (patch.parse().unwrap(), radiance.parse().unwrap()));
        hour.direct.push(pairs.collect());
    }
    hours
}

/// What gendaymtx makes of a sky: its radiance at the middles of patches, by which the ground gets what the whole sky sends.
fn at_middles(patches: &SkyPatches, sky: &EnvironmentMap) -> Vec<f64> {
    // A map is interpolated along its lines: at the zenith, where these are points, their mean is what is there.
    let top = &sky.pixels[..sky.width];
    let zenith = top.iter().map(|pixel| f64::from(luminance(*pixel))).sum::<f64>() / sky.width as f64;
    let at = |middle: &DVec3| match *middle == DVec3::Y {
        true => zenith,
        false => f64::from(luminance(sky.at(uv_from_direction(middle.as_vec3())))),
    };
    let middles: Vec<f64> = patches.middles().iter().map(at).collect();
    let of_ground: f64 = (middles.iter().zip(patches.middles()).zip(patches.solid_angles()))
        .map(|((radiance, middle), angle)| radiance * middle.y * angle)
        .sum();
    let factor = of_map(sky) / of_ground;
    middles.into_iter().map(|radiance| radiance * factor).collect()
}

/// Truth: gendaymtx, with its sun's place, which is up to half a degree off in March.
#[test]
fn patches_are_those_of_gendaymtx() {
    let weather = Weather::parse(TAPE).unwrap();
    let times = [
        1903.5, 1905.5, 1908.5, 1911.5, 4109.5, 4112.5, 4116.5, 4117.5, 4120.5, 4123.5,
    ];
    let all = patches();
    let hours = gendaymtx();
    assert_eq!(hours.len(), times.len());
    for (hour, time) in hours.iter().zip(times) {
        let found = weather_sky(&weather.at(time).0, hour.sun);
        for ((found, truth), middle) in at_middles(&all[0], &found.sky)
            .iter()
            .zip(&hour.sky)
            .zip(all[0].middles())
        {
            // Pixels of 1.4° are interpolated; around the sun Perez's exponential is steep.
            let near = middle.angle_between(hour.sun).to_degrees() < 5.0;
            let bound = if near { 0.06 } else { 0.025 };
            assert!(
                (found / truth - 1.0).abs() < bound,
                "{time}: {middle}: {found}, {truth}"
            );
        }
        let sky = SunSky {
            sun_radiance: Vec3::ZERO,
            ..found.clone()
        };
        let means = all[0].radiance(&sky);
        let (mut off, mut sum) = (0.0, 0.0);
        for ((found, truth), angle) in means.iter().zip(&hour.sky).zip(all[0].solid_angles()) {
            off += (f64::from(luminance(*found)) - truth).abs() * angle;
            sum += truth * angle;
        }
        // A mean over 12° is not the middle: most where the sun stands on the middle of a patch, which then takes light from all others.
        assert!(off < 0.05 * sum, "{time}: {}", off / sum);
        let sun = SunSky {
            sky: EnvironmentMap {
                pixels: vec![Vec3::ZERO; found.sky.pixels.len()],
                ..found.sky.clone()
            },
            ..found
        };
        for (patches, truth) in all.iter().zip(&hour.direct) {
            let radiance = patches.radiance(&sun);
            let lit: Vec<usize> = (0..radiance.len())
                .filter(|&i| radiance[i] != Vec3::ZERO)
                .map(|i| i + 1)
                .collect();
            assert_eq!(lit, truth.iter().map(|pair| pair.0).collect::<Vec<_>>(), "{time}");
            for &(patch, truth) in truth {
                let found = f64::from(luminance(radiance[patch - 1]));
                // Six digits are kept.
                assert!(
                    (found / truth - 1.0).abs() < 1e-4,
                    "{time}, {patch}: {found}, {truth}"
                );
            }
        }
    }
}
