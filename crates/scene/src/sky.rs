//! Sun and clear sky: Preetham, Shirley, Smits, *A Practical Analytic Model for Daylight*, SIGGRAPH 1999.
//!
//! Sky: appendix A.2 (Perez distribution of luminance and chromaticity over the hemisphere, zenith values from
//! turbidity and the sun's height). Sun: appendix A.1 (transmittance by Rayleigh scattering, aerosol and ozone),
//! over a disc of 0.53 degrees.
//!
//! **Units.** The model gives luminance; radiance here is luminance / 179 lm/W, the luminous efficacy of
//! daylight that the *Radiance* system uses, so that illuminance is 179 (0.2126 R + 0.7152 G + 0.0722 B) of
//! the RGB irradiance.
//!
//! **Deviations.** The extraterrestrial sun is a black body of 5778 K scaled to the solar constant instead of
//! a measured spectrum, and water vapour and mixed gases are left out (they absorb beyond 690 nm, where the eye
//! sees next to nothing). Colour matching functions are the analytic fits of Wyman, Sloan and Shirley 2013. Below the
//! horizon there is nothing: the ground belongs to the scene. With the sun below the horizon, where the model is
//! undefined, the sky of the setting sun fades linearly to black at −6° (the end of civil twilight); the disc shines by the share of
//! it that has not set, so that no frame of an evening jumps.

use crate::light::EnvironmentMap;
use glam::{DMat3, DVec3, Vec3};
use std::f64::consts::PI;

/// Half of the sun's apparent diameter of 0.53°, radians.
pub const SUN_HALF_ANGLE: f64 = 0.53 / 2.0 * PI / 180.0;

/// Luminous efficacy of daylight in lm/W (Ward, *Radiance*).
pub const LUMENS_PER_WATT: f64 = 179.0;

/// Size of the sky as an environment map. 1.4° a pixel is finer than anything in the Perez distribution but
/// the glow right at the sun.
pub const SKY_SIZE: (usize, usize) = (256, 128);

/// Radiance of sun and sky.
#[derive(Clone, Debug)]
pub struct SunSky {
    /// The sky without the sun; its lower half is black.
    pub sky: EnvironmentMap,
    /// Unit vector towards the middle of the sun.
    pub sun_direction: Vec3,
    /// Radiance of the sun's disc, W/(m² sr), RGB, evenly less where a part of it is below the horizon; zero when all of it is.
    pub sun_radiance: Vec3,
}

/// Perez coefficients A to E for Y, x and y as `[slope, offset]` in turbidity (A.2).
const PEREZ: [[[f64; 2]; 5]; 3] = [
    [
        [0.1787, -1.4630],
        [-0.3554, 0.4275],
        [-0.0227, 5.3251],
        [0.1206, -2.5771],
        [-0.0670, 0.3703],
    ],
    [
        [-0.0193, -0.2592],
        [-0.0665, 0.0008],
        [-0.0004, 0.2125],
        [-0.0641, -0.8989],
        [-0.0033, 0.0452],
    ],
    [
        [-0.0167, -0.2608],
        [-0.0950, 0.0092],
        [-0.0079, 0.2102],
        [-0.0441, -1.6537],
        [-0.0109, 0.0529],
    ],
];

/// Zenith chromaticity x and y: rows for T², T, 1; columns for θ³, θ², θ, 1 (A.2).
const ZENITH: [[[f64; 4]; 3]; 2] = [
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ],
    [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ],
];

/// Sun and sky for a turbidity (clamped to 2..=10, where the fit holds) and a direction towards the sun (any
/// length; straight up where it has none).
pub fn sun_sky(turbidity: f32, sun_direction: Vec3) -> SunSky {
    let turbidity = f64::from(turbidity.clamp(2.0, 10.0));
    let sun = sun_direction.try_normalize().unwrap_or(Vec3::Y);
    let height = f64::from(sun.y).clamp(-1.0, 1.0).asin();
    let theta_sun = (PI / 2.0 - height).clamp(0.0, PI / 2.0);
    let fade = (1.0 + height / 6f64.to_radians()).clamp(0.0, 1.0);
    let (width, the_height) = SKY_SIZE;
    let mut pixels = vec![Vec3::ZERO; width * the_height];
    if fade > 0.0 {
        let perez = PEREZ.map(|rows| rows.map(|[slope, offset]| slope * turbidity + offset));
        let zenith = zenith_yxy(turbidity, theta_sun);
        let at_zenith = [0, 1, 2].map(|k| distribution(&perez[k], 1.0, theta_sun));
        // The sun as high as the model knows it, for the angle to it.
        let level = Vec3::new(sun.x, sun.y.max(0.0), sun.z)
            .try_normalize()
            .unwrap_or(Vec3::Y)
            .as_dvec3();
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let uv = [
                ((i % width) as f32 + 0.5) / width as f32,
                ((i / width) as f32 + 0.5) / the_height as f32,
            ];
            let d = crate::environment::direction_from_uv(uv).as_dvec3();
            if d.y <= 0.0 {
                continue;
            }
            let gamma = d.cross(level).length().atan2(d.dot(level));
            let value = [0, 1, 2].map(|k| zenith[k] * distribution(&perez[k], d.y, gamma) / at_zenith[k]);
            // kcd/m² to W/(m² sr).
            let radiance = rgb_from_yxy(value) * (1000.0 / LUMENS_PER_WATT * fade);
            *pixel = radiance.max(DVec3::ZERO).as_vec3();
        }
    }
    let risen = risen(height);
    let sun_radiance = match risen > 0.0 {
        true => sun_disc(turbidity, theta_sun) * risen as f32,
        false => Vec3::ZERO,
    };
    SunSky {
        sky: EnvironmentMap {
            width,
            height: the_height,
            pixels,
        },
        sun_direction: sun,
        sun_radiance,
    }
}

/// Perez et al. 1993 in Preetham's form, eq. 3: (1 + A e^(B/cos θ)) (1 + C e^(Dγ) + E cos² γ).
fn distribution([a, b, c, d, e]: &[f64; 5], cos_theta: f64, gamma: f64) -> f64 {
    (1.0 + a * (b / cos_theta).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
}

/// Luminance in kcd/m² and chromaticity of the zenith (A.2).
fn zenith_yxy(t: f64, theta: f64) -> [f64; 3] {
    let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * theta);
    let luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
    let chromaticity = ZENITH.map(|rows| {
        let cubic = rows.map(|c| ((c[0] * theta + c[1]) * theta + c[2]) * theta + c[3]);
        (cubic[0] * t + cubic[1]) * t + cubic[2]
    });
    [luminance.max(0.0), chromaticity[0], chromaticity[1]]
}

fn rgb_from_yxy([luminance, x, y]: [f64; 3]) -> DVec3 {
    rgb_from_xyz(DVec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance)
}

/// Rec. 709 primaries, D65 (ITU-R BT.709; the matrix of IEC 61966-2-1).
fn rgb_from_xyz(xyz: DVec3) -> DVec3 {
    DMat3::from_cols_array(&[
        3.2404542, -0.9692660, 0.0556434, -1.5371385, 1.8760108, -0.2040259, -0.4985314, 0.0415560, 1.0572252,
    ]) * xyz
}

/// Ozone absorption (1/cm) at 450..=700 nm in steps of 50 nm, Preetham's table 2 thinned: the Chappuis band.
const OZONE: [f64; 6] = [0.003, 0.03, 0.085, 0.12, 0.067, 0.023];

/// Share of the sun's disc above the horizon when its middle is at `height`, radians: the area of a circle above a chord.
fn risen(height: f64) -> f64 {
    let x = (height / SUN_HALF_ANGLE).clamp(-1.0, 1.0);
    0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / PI
}

/// Radiance of the sun's disc through the atmosphere (A.1).
fn sun_disc(turbidity: f64, theta: f64) -> Vec3 {
    // Relative optical mass (Kasten's formula as Preetham prints it), θ in degrees inside the power.
    let mass = 1.0 / (theta.cos() + 0.15 * (93.885 - theta.to_degrees()).powf(-1.253));
    // Ångström turbidity, α = 1.3; 0.35 cm of ozone.
    let (beta, ozone_cm) = (0.04608 * turbidity - 0.04586, 0.35);
    let step = 5.0;
    let mut xyz = DVec3::ZERO;
    for i in 0..=((780.0 - 380.0) / step) as usize {
        let nm = 380.0 + step * i as f64;
        let um = nm / 1000.0;
        let rayleigh = (-0.008735 * um.powf(-4.08) * mass).exp();
        let aerosol = (-beta * um.powf(-1.3) * mass).exp();
        let place = ((nm - 450.0) / 50.0).clamp(0.0, 4.999);
        let (k, f) = (place as usize, place.fract());
        let ozone = (-(OZONE[k] * (1.0 - f) + OZONE[k + 1] * f) * ozone_cm * mass).exp();
        let radiance = solar_radiance(nm) * rayleigh * aerosol * ozone;
        xyz += color_matching(nm) * radiance * step;
    }
    // 683 lm/W at the peak of the eye's sensitivity, by definition of the candela.
    (rgb_from_xyz(xyz) * (683.0 / LUMENS_PER_WATT))
        .max(DVec3::ZERO)
        .as_vec3()
}

/// Radiance of the sun's disc above the atmosphere, W/(m² sr nm): Planck at 5778 K, scaled so that the whole
/// spectrum over the disc gives the solar constant of 1361 W/m².
fn solar_radiance(nm: f64) -> f64 {
    let (h, c, k, t) = (6.62607015e-34, 2.99792458e8, 1.380649e-23, 5778.0);
    let m = nm * 1e-9;
    let planck = 2.0 * h * c * c / m.powi(5) / ((h * c / (m * k * t)).exp() - 1.0) * 1e-9;
    let total = 5.670374419e-8 * f64::powi(t, 4) / PI;
    planck / total * 1361.0 / (PI * SUN_HALF_ANGLE.sin().powi(2))
}

/// CIE 1931 colour matching functions, the multi-lobe fits of Wyman et al. 2013 (their listing 1).
fn color_matching(nm: f64) -> DVec3 {
    let lobe = |height: f64, mean: f64, left: f64, right: f64| {
        let t = (nm - mean) * if nm < mean { left } else { right };
        height * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(0.362, 442.0, 0.0624, 0.0374)
            + lobe(1.056, 599.8, 0.0264, 0.0323)
            + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::luminance;

    fn sun_illuminance(sky: &SunSky) -> f64 {
        let cone = PI * SUN_HALF_ANGLE.sin().powi(2);
        f64::from(luminance(sky.sun_radiance)) * cone * LUMENS_PER_WATT
    }

    /// Truth: measured daylight (IES Lighting Handbook, clear sky): the sun at half height gives some 70 to
    /// 110 klx on a perpendicular surface (133 klx above the atmosphere), a clear sky some 8 to 30 klx on the
    /// ground; the low sun is redder and weaker.
    #[test]
    fn sun_and_sky_are_as_bright_as_measured_daylight() {
        let noon = sun_sky(3.0, Vec3::new(1.0, 1.0, 0.0));
        let lux = sun_illuminance(&noon);
        assert!((70e3..110e3).contains(&lux), "{lux}");
        let mut sky_lux = 0.0;
        for (i, pixel) in noon.sky.pixels.iter().enumerate() {
            let theta = PI * ((i / SKY_SIZE.0) as f64 + 0.5) / SKY_SIZE.1 as f64;
            let pixel_angle = 2.0 * PI * PI / (SKY_SIZE.0 * SKY_SIZE.1) as f64 * theta.sin();
            sky_lux += f64::from(luminance(*pixel)) * pixel_angle * theta.cos().max(0.0) * LUMENS_PER_WATT;
        }
        assert!((8e3..30e3).contains(&sky_lux), "{sky_lux}");
        let evening = sun_sky(3.0, Vec3::new(1.0, 0.1, 0.0));
        assert!(sun_illuminance(&evening) < 0.6 * lux);
        let redness = |s: &SunSky| s.sun_radiance.x / s.sun_radiance.z;
        assert!(redness(&evening) > 2.0 * redness(&noon));
    }

    /// Truth: a circle halved by its diameter; and no step of a sun that sets takes more than steps of that length must.
    #[test]
    fn the_sun_sets_without_a_jump() {
        assert_eq!(
            [-1.0, 0.0, 1.0].map(|x| risen(x * SUN_HALF_ANGLE)),
            [0.0, 0.5, 1.0]
        );
        let radiance = |height: f64| {
            let sun = Vec3::new(height.cos() as f32, height.sin() as f32, 0.0);
            f64::from(luminance(sun_sky(2.0, sun).sun_radiance))
        };
        let full = radiance(SUN_HALF_ANGLE);
        let steps = 40;
        let by_step: Vec<f64> = (0..=steps)
            .map(|k| radiance(SUN_HALF_ANGLE * (1.0 - 2.1 * f64::from(k) / f64::from(steps))))
            .collect();
        for pair in by_step.windows(2) {
            // The widest part of the disc is 4/π of the mean, and lower suns are fainter.
            assert!(
                pair[0] >= pair[1] && pair[0] - pair[1] < 2.0 * full / f64::from(steps),
                "{by_step:?}"
            );
        }
        assert_eq!(by_step.last(), Some(&0.0));
    }

    #[test]
    fn every_sky_is_finite_non_negative_and_dark_below_the_horizon() {
        for turbidity in [0.0, 2.0, 3.0, 6.0, 10.0, 50.0] {
            for height in [-1.0, -0.05, -1e-9, 0.0, 1e-6, 0.1, 0.5, 1.0] {
                let model = sun_sky(turbidity, Vec3::new(0.3, height, -0.2));
                let all = model.sky.pixels.iter().chain([&model.sun_radiance]);
                assert!(all.clone().all(|p| p.is_finite() && p.min_element() >= 0.0));
                assert!(
                    model.sky.pixels[SKY_SIZE.0 * SKY_SIZE.1 / 2..]
                        .iter()
                        .all(|p| *p == Vec3::ZERO)
                );
                if height == -1.0 {
                    assert!(all.clone().all(|p| *p == Vec3::ZERO), "night is dark");
                }
            }
        }
    }

    /// Truth: Preetham's figure: with the sun high in a clear sky, the zenith is blue and the sky is brightest
    /// around the sun.
    #[test]
    fn sky_is_blue_overhead_and_brightest_near_the_sun() {
        let model = sun_sky(2.5, Vec3::new(1.0, 1.0, 0.0));
        let zenith = model.sky.at([0.0, 0.0]);
        assert!(zenith.z > 1.5 * zenith.x, "{zenith}");
        let near = model
            .sky
            .at(crate::environment::uv_from_direction(model.sun_direction));
        let far = model.sky.at(crate::environment::uv_from_direction(
            Vec3::new(-1.0, 1.0, 0.0).normalize(),
        ));
        assert!(luminance(near) > 3.0 * luminance(far));
    }
}
