//! Sun and sky of any weather: Perez, Seals and Michalsky 1993, "All-weather model for sky luminance distribution", Solar Energy 50(3),
//! equations 1 and 6 to 8 with table 1; illuminance of irradiance by Perez et al. 1990, "Modeling daylight availability and
//! irradiance components from direct and global irradiance", Solar Energy 44(5), equations 1 to 3, 7 and 8 with table 4.
//!
//! **Units.** As of [`crate::sky`]: radiance is luminance / 179 lm/W.
//!
//! **Deviations.** Those of Radiance's gendaymtx, with which results are compared: the sun's height is taken as 0 to 87° in the model, clearness
//! as 1 to 11.9, brightness as 0.01 to 0.6, and as at least 0.2 between clearness 1.065 and 2.8. The sky is a little bluish, the sun
//! white. Below the horizon there is nothing: the ground belongs to the scene.

use crate::environment::{direction_from_uv, luminance};
use crate::light::EnvironmentMap;
use crate::sky::{LUMENS_PER_WATT, SKY_SIZE, SUN_HALF_ANGLE, SunSky};
use crate::weather::Daylight;
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// Irradiance above the atmosphere, W/m², as in the papers.
const SOLAR_CONSTANT: f64 = 1367.0;

/// Lower ends of the classes of clearness ε, but the first, which is 1.
const CLEARNESS: [f64; 7] = [1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2];

/// Of each class: a, b, c, d, e, with four coefficients each (1993, table 1 with its erratum).
const DISTRIBUTION: [[[f64; 4]; 5]; 8] = [
    [
        [1.3525, -0.2576, -0.2690, -1.4366],
        [-0.7670, 0.0007, 1.2734, -0.1233],
        [2.8000, 0.6004, 1.2375, 1.0000],
        [1.8734, 0.6297, 0.9738, 0.2809],
        [0.0356, -0.1246, -0.5718, 0.9938],
    ],
    [
        [-1.2219, -0.7730, 1.4148, 1.1016],
        [-0.2054, 0.0367, -3.9128, 0.9156],
        [6.9750, 0.1774, 6.4477, -0.1239],
        [-1.5798, -0.5081, -1.7812, 0.1080],
        [0.2624, 0.0672, -0.2190, -0.4285],
    ],
    [
        [-1.1000, -0.2515, 0.8952, 0.0156],
        [0.2782, -0.1812, -4.5000, 1.1766],
        [24.7219, -13.0812, -37.7000, 34.8438],
        [-5.0000, 1.5218, 3.9229, -2.6204],
        [-0.0156, 0.1597, 0.4199, -0.5562],
    ],
    [
        [-0.5484, -0.6654, -0.2672, 0.7117],
        [0.7234, -0.6219, -5.6812, 2.6297],
        [33.3389, -18.3000, -62.2500, 52.0781],
        [-3.5000, 0.0016, 1.1477, 0.1062],
        [0.4659, -0.3296, -0.0876, -0.0329],
    ],
    [
        [-0.6000, -0.3566, -2.5000, 2.3250],
        [0.2937, 0.0496, -5.6812, 1.8415],
        [21.0000, -4.7656, -21.5906, 7.2492],
        [-3.5000, -0.1554, 1.4062, 0.3988],
        [0.0032, 0.0766, -0.0656, -0.1294],
    ],
    [
        [-1.0156, -0.3670, 1.0078, 1.4051],
        [0.2875, -0.5328, -3.8500, 3.3750],
        [14.0000, -0.9999, -7.1406, 7.5469],
        [-3.4000, -0.1078, -1.0750, 1.5702],
        [-0.0672, 0.4016, 0.3017, -0.4844],
    ],
    [
        [-1.0000, 0.0211, 0.5025, -0.5119],
        [-0.3000, 0.1922, 0.7023, -1.6317],
        [19.0000, -5.0000, 1.2438, -1.9094],
        [-4.0000, 0.0250, 0.3844, 0.2656],
        [1.0468, -0.3788, -2.4517, 1.4656],
    ],
    [
        [-1.0500, 0.0289, 0.4260, 0.3590],
        [-0.3250, 0.1156, 0.7781, 0.0025],
        [31.0625, -14.5000, -46.1148, 55.3750],
        [-7.2312, 0.4050, 13.3500, 0.6234],
        [1.5000, -0.6426, 1.8564, 0.5636],
    ],
];

/// Luminous efficacy of the sky: constant, water, cosine of the zenith angle, logarithm of brightness (1990, table 4).
const OF_SKY: [[f64; 4]; 8] = [
    [97.24, -0.46, 12.00, -8.91],
    [107.22, 1.15, 0.59, -3.95],
    [104.97, 2.96, -5.53, -8.77],
    [102.39, 5.59, -13.95, -13.90],
    [100.71, 5.94, -22.75, -23.74],
    [106.42, 3.83, -36.15, -28.83],
    [141.88, 1.90, -53.24, -14.03],
    [152.23, 0.35, -45.27, -7.98],
];

/// Luminous efficacy of the sun: constant, water, exp(5.73 z − 5), brightness (1990, table 4).
const OF_SUN: [[f64; 4]; 8] = [
    [57.20, -4.55, -2.98, 117.12],
    [98.99, -3.46, -1.21, 12.38],
    [109.83, -4.90, -1.71, -8.81],
    [110.34, -5.84, -1.99, -4.56],
    [106.36, -3.97, -1.75, -6.16],
    [107.19, -1.25, -1.51, -26.73],
    [105.75, 0.77, -1.26, -34.44],
    [101.18, 1.58, -1.10, -8.29],
];

/// Colour of the sky, as gendaymtx has it.
const SKY_COLOR: Vec3 = Vec3::new(0.960, 1.004, 1.118);

/// Sun and sky of an hour; `sun` is the unit vector towards the sun. Night is black.
pub fn weather_sky(daylight: &Daylight, sun: DVec3) -> SunSky {
    let (width, height) = SKY_SIZE;
    let mut found = SunSky {
        sky: EnvironmentMap {
            width,
            height,
            pixels: vec![Vec3::ZERO; width * height],
        },
        sun_direction: sun.as_vec3(),
        sun_radiance: Vec3::ZERO,
    };
    let (direct, diffuse) = (
        daylight.direct_normal.max(0.0),
        daylight.diffuse_horizontal.max(0.0),
    );
    if direct + diffuse <= 1e-4 {
        return found;
    }
    let altitude = sun.y.clamp(-1.0, 1.0).asin();
    let zenith = PI / 2.0 - altitude.clamp(0.0, 87f64.to_radians());
    let hour = match daylight.in_lux {
        false => Hour::of_irradiance([direct, diffuse], daylight, zenith),
        true => Hour::of_illuminance([direct, diffuse], daylight, zenith),
    };
    let Hour {
        class,
        clearness,
        brightness,
        sun_lux,
        sky_lux,
    } = hour;
    if altitude > 0.0 {
        let cone = TAU * 2.0 * (SUN_HALF_ANGLE / 2.0).sin().powi(2);
        found.sun_radiance = Vec3::splat((sun_lux / LUMENS_PER_WATT / cone) as f32);
    }
    let parameters = parameters(class, clearness, brightness, zenith);
    // The sun where the model has it.
    let level = DVec3::new(sun.x, 0.0, sun.z).normalize_or(DVec3::X);
    let modelled = level * zenith.sin() + DVec3::Y * zenith.cos();
    let mut sum = 0.0;
    for (i, pixel) in found.sky.pixels.iter_mut().enumerate() {
        let place = [(i % width) as f32 + 0.5, (i / width) as f32 + 0.5];
        let direction = direction_from_uv([place[0] / width as f32, place[1] / height as f32]).as_dvec3();
        if direction.y <= 0.0 {
            continue;
        }
        let apart = direction.cross(modelled).length().atan2(direction.dot(modelled));
        let relative = relative(&parameters, direction.y, apart).max(0.0);
        *pixel = SKY_COLOR * relative as f32;
        let solid_angle = TAU / width as f64 * PI / height as f64 * (1.0 - direction.y.powi(2)).sqrt();
        sum += relative * direction.y * solid_angle;
    }
    if sum <= 0.0 {
        // No distribution: an even sky.
        let upper = &mut found.sky.pixels[..width * height / 2];
        upper.fill(SKY_COLOR);
        sum = PI;
    }
    let scale = (sky_lux / LUMENS_PER_WATT / sum / f64::from(luminance(SKY_COLOR))) as f32;
    found.sky.pixels.iter_mut().for_each(|pixel| *pixel *= scale);
    found
}

/// What the model knows of an hour.
struct Hour {
    class: usize,
    clearness: f64,
    brightness: f64,
    /// Of a surface that faces the sun.
    sun_lux: f64,
    /// Of the ground.
    sky_lux: f64,
}

/// Rounds in which irradiance of an illuminance is looked for: efficacies hardly depend on it, so that each takes a digit.
const ROUNDS: usize = 20;

impl Hour {
    /// Of irradiance by sun and sky, W/m².
    fn of_irradiance([direct, diffuse]: [f64; 2], daylight: &Daylight, zenith: f64) -> Hour {
        let cubed = 1.041 * zenith.powi(3);
        let clearness = ((diffuse + direct) / diffuse.max(1e-9) + cubed) / (1.0 + cubed);
        let clearness = clearness.clamp(1.0, 11.9);
        let mass = 1.0 / (zenith.cos() + 0.15 * (93.885 - zenith.to_degrees()).powf(-1.253));
        let brightness = diffuse * mass / (SOLAR_CONSTANT * daylight.eccentricity);
        let brightness = brightness.clamp(0.01, 0.6);
        let class = CLEARNESS.partition_point(|&low| low <= clearness);
        let water = (0.07 * daylight.dew_point - 0.075).exp();
        let [a, b, c, d] = OF_SKY[class];
        let sky_lux = diffuse * (a + b * water + c * zenith.cos() + d * brightness.ln()).max(0.0);
        let [a, b, c, d] = OF_SUN[class];
        let sun_lux = direct * (a + b * water + c * (5.73 * zenith - 5.0).exp() + d * brightness).max(0.0);
        Hour {
            class,
            clearness,
            brightness,
            sun_lux,
            sky_lux,
        }
    }

    /// Of illuminance by sun and sky, lx: the class is that of the irradiance which would make it.
    fn of_illuminance(lux: [f64; 2], daylight: &Daylight, zenith: f64) -> Hour {
        let mut irradiance = lux.map(|lux| lux / 110.0);
        let mut hour = Hour::of_irradiance(irradiance, daylight, zenith);
        for _ in 0..ROUNDS {
            for ((irradiance, lux), found) in irradiance.iter_mut().zip(lux).zip([hour.sun_lux, hour.sky_lux])
            {
                // Within what daylight may have, were a sun so low that the model lets none through.
                if found > 0.0 {
                    *irradiance = (*irradiance * lux / found).clamp(lux / 250.0, lux / 20.0);
                }
            }
            hour = Hour::of_irradiance(irradiance, daylight, zenith);
        }
        Hour {
            sun_lux: lux[0],
            sky_lux: lux[1],
            ..hour
        }
    }
}

/// a to e of the hour (1993, equations 6 to 8).
fn parameters(class: usize, clearness: f64, brightness: f64, zenith: f64) -> [f64; 5] {
    let brightness = if clearness > 1.065 && clearness < 2.8 {
        brightness.max(0.2)
    } else {
        brightness
    };
    let mut found = DISTRIBUTION[class].map(|[p, q, r, s]| p + q * zenith + brightness * (r + s * zenith));
    if class == 0 {
        let [_, _, c, d, _] = DISTRIBUTION[0];
        found[2] = (brightness * (c[0] + c[1] * zenith)).powf(c[2]).exp() - c[3];
        found[3] = -(brightness * (d[0] + d[1] * zenith)).exp() + d[2] + brightness * d[3];
    }
    found
}

/// Relative luminance at this cosine with the zenith and angle from the sun (1993, equation 1).
fn relative([a, b, c, d, e]: &[f64; 5], cos_zenith: f64, apart: f64) -> f64 {
    (1.0 + a * (b / cos_zenith).exp()) * (1.0 + c * (d * apart).exp() + e * apart.cos().powi(2))
}
