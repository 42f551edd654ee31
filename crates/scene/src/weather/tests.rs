//! Weather files right and wrong, and their skies against those of Radiance's gendaymtx for the same file.

use super::*;
use crate::environment::{luminance, uv_from_direction};
use crate::perez::weather_sky;

const TAPE: &str = "place Zurich_CHE
latitude 47.38
longitude -8.57
time_zone -15
site_elevation 569
weather_data_file_units 1
3 21 7.500 120 60
3 21 9.500 420 130
3 21 12.500 640 160
3 21 15.500 380 150
6 21 5.500 60 40
6 21 8.500 480 140
6 21 12.500 820 110
6 21 13.500 0 310
6 21 16.500 5 240
6 21 19.500 90 70
";

/// Altitude and azimuth (east of north) of some of the 2305 patches of Reinhart's sky, degrees.
const PATCHES: [(f64, f64); 6] = [
    (1.579, 21.0),
    (17.368, 297.0),
    (36.316, 191.25),
    (52.105, 355.0),
    (67.895, 262.5),
    (86.842, 345.0),
];

/// `gendaymtx -m 4 -s -c 1 1 1` (Radiance as in pyradiance 1.3.1) of the tape: radiance of these patches, hour by hour.
const RADIANCE: [[f64; 6]; 10] = [
    [18.70346, 13.9829, 10.56738, 7.85397, 6.37253, 6.21643],
    [34.78585, 25.37741, 25.93089, 14.55273, 13.65865, 14.98613],
    [44.66351, 28.8503, 146.09721, 16.44976, 24.35062, 22.17175],
    [33.8595, 38.57838, 51.44592, 17.1884, 29.60489, 18.0676],
    [24.30773, 9.84002, 6.1787, 5.58968, 3.77051, 3.71661],
    [42.15751, 27.37574, 19.95069, 17.58354, 14.39897, 18.84953],
    [41.19654, 17.99544, 33.01746, 11.43764, 23.74759, 24.90513],
    [34.4769, 48.72046, 70.12025, 64.80466, 81.15617, 78.35048],
    [27.80656, 51.15888, 47.46922, 48.45448, 63.30255, 53.24215],
    [13.68825, 86.03721, 10.43676, 12.471, 11.41098, 8.96547],
];

/// The same program's `-D`: direction of the sun (east, north, up) and radiance of its disc.
const SUNS: [([f64; 3], f64); 10] = [
    ([0.969338, -0.185520, 0.161140], 5.370e5),
    ([0.716657, -0.517953, 0.467042], 3.151e6),
    ([0.013623, -0.740545, 0.671869], 5.201e6),
    ([-0.697391, -0.532130, 0.480087], 2.861e6),
    ([0.889053, 0.435997, 0.139613], 2.778e5),
    ([0.788671, -0.075379, 0.610177], 3.872e6),
    ([-0.011518, -0.405552, 0.913999], 6.977e6),
    ([-0.248548, -0.380357, 0.890815], 0.0),
    ([-0.800189, -0.060698, 0.596668], 3.265e4),
    ([-0.883090, 0.452371, 0.124546], 3.758e5),
];

#[test]
fn suns_and_skies_are_those_of_gendaymtx() {
    let weather = Weather::parse(TAPE).unwrap();
    assert_eq!(weather.records.len(), 10);
    for (i, record) in weather.records.iter().enumerate() {
        let (daylight, sun) = weather.at(record.time);
        let ([east, north, up], radiance) = SUNS[i];
        let apart = sun.angle_between(DVec3::new(east, up, -north)).to_degrees();
        // Radiance has the handbook's formula of the sun's declination, which is half a degree off in March.
        assert!(apart < 0.6, "{i}: the sun is {apart}° off");
        // The same sun, so that the sky's shape is what is compared.
        let found = weather_sky(&daylight, DVec3::new(east, up, -north).normalize());
        let disc = f64::from(luminance(found.sun_radiance));
        // Its disc is of 0.533° and this one of 0.53°, and its table knows the hour's water alike: four digits are printed.
        let area = (0.533f64 / 0.53).powi(2);
        assert!(
            (disc - radiance * area).abs() <= 2e-3 * radiance * area,
            "{i}: sun {disc}, {radiance}"
        );
        for ((altitude, azimuth), truth) in PATCHES.iter().zip(RADIANCE[i]) {
            let (sin, cos) = altitude.to_radians().sin_cos();
            let (east, north) = azimuth.to_radians().sin_cos();
            let direction = DVec3::new(east * cos, sin, -north * cos).as_vec3();
            let there = f64::from(luminance(found.sky.at(uv_from_direction(direction))));
            // Pixels of 1.4° are interpolated, at the horizon over the edge: there Perez's exponential is steep.
            let bound = if *altitude < 3.0 { 0.06 } else { 0.025 };
            assert!(
                (there / truth - 1.0).abs() < bound,
                "{i}: {altitude} {azimuth}: {there}, {truth}"
            );
        }
    }
}

/// Closed forms: at equinox the sun of the equator rises in the east and passes the zenith; a summer's noon at 47.38° north is 66° high.
#[test]
fn the_sun_stands_where_it_must() {
    let equator = Weather::parse(
        &TAPE
            .replace("47.38", "0")
            .replace("-8.57", "0")
            .replace("-15", "0"),
    )
    .unwrap();
    let spring = hours_before(3, 21).unwrap();
    // The sun's clock is 7 minutes late.
    let noon = equator.sun(spring + 12.0 + 7.4 / 60.0);
    assert!(noon.y > 0.9999, "{noon}");
    let morning = equator.sun(spring + 6.0 + 7.4 / 60.0);
    assert!(morning.x > 0.9999 && morning.y.abs() < 0.01, "{morning}");
    let weather = Weather::parse(TAPE).unwrap();
    let june = hours_before(6, 21).unwrap();
    let highest = (0..2400).map(|i| weather.sun(june + f64::from(i) / 100.0).y.asin().to_degrees());
    let highest = highest.fold(f64::MIN, f64::max);
    assert!((highest - (90.0 - 47.38 + 23.44)).abs() < 0.05, "{highest}");
}

#[test]
fn irradiance_of_the_sky_is_what_efficacy_makes_of_the_files() {
    let daylight = Daylight {
        direct_normal: 300.0,
        diffuse_horizontal: 200.0,
        in_lux: false,
        dew_point: 11.0,
        eccentricity: 1.0,
    };
    for altitude in [2.0f64, 30.0, 88.0] {
        let (sin, cos) = altitude.to_radians().sin_cos();
        let sky = weather_sky(&daylight, DVec3::new(cos, sin, 0.0)).sky;
        let (mut sum, width, height) = (0.0, sky.width, sky.height);
        for (i, pixel) in sky.pixels.iter().enumerate() {
            let theta = PI * ((i / width) as f64 + 0.5) / height as f64;
            let solid_angle = TAU / width as f64 * PI / height as f64 * theta.sin();
            sum += f64::from(luminance(*pixel)) * theta.cos().max(0.0) * solid_angle;
        }
        // Efficacies of skies are 90 to 150 lm/W.
        assert!(
            (90.0..150.0).contains(&(sum * 179.0 / 200.0)),
            "{altitude}: {sum}"
        );
        assert!(sky.pixels.iter().all(|p| p.is_finite() && p.min_element() >= 0.0));
    }
    let night = Daylight {
        direct_normal: 0.0,
        diffuse_horizontal: 0.0,
        ..daylight
    };
    let dark = weather_sky(&night, DVec3::Y);
    assert!(dark.sky.pixels.iter().all(|p| *p == glam::Vec3::ZERO) && dark.sun_radiance == glam::Vec3::ZERO);
    // Below the horizon the sun is dark whatever is said.
    assert_eq!(
        weather_sky(&daylight, DVec3::new(1.0, -0.01, 0.0)).sun_radiance,
        glam::Vec3::ZERO
    );
}

fn epw(rows: &str, periods: &str) -> String {
    let head = "LOCATION,Nowhere,ZZ,CHE,TMY,066600,47.38,8.57,1.0,569.0\nDESIGN CONDITIONS,0\nTYPICAL/EXTREME PERIODS,0\n\
                GROUND TEMPERATURES,0\nHOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0\nCOMMENTS 1,\nCOMMENTS 2,\n";
    format!("{head}DATA PERIODS,{periods}\n{rows}")
}

fn row(year: u32, hour: u32, direct: &str, diffuse: &str) -> String {
    format!("{year},6,21,{hour},0,?9,18.0,11.0,60,95000,0,0,330,500,{direct},{diffuse},0\n")
}

#[test]
fn both_kinds_of_files_say_the_same() {
    let rows: String = [(9, "480", "140"), (13, "820", "110"), (14, "0", "310")]
        .iter()
        .map(|(hour, direct, diffuse)| row(2000 + hour, *hour, direct, diffuse))
        .collect();
    let typical = Weather::parse(&epw(&rows, "1,1,Data,Sunday,6/21,6/21")).unwrap();
    let tape = Weather::parse(TAPE).unwrap();
    let june = hours_before(6, 21).unwrap();
    for hour in [8.5, 12.5, 13.0, 13.5] {
        assert_eq!(typical.at(june + hour), tape.at(june + hour));
    }
    // Half way between two middles.
    assert!((tape.at(june + 13.0).0.diffuse_horizontal - 210.0).abs() < 1e-9);
    // Four records an hour, each of the quarter that ends at its minute.
    let quarters = "2001,6,21,9,15,?,1,11,1,1,1,1,1,1,100,10\n2001,6,21,9,30,?,1,11,1,1,1,1,1,1,200,20\n";
    let fine = Weather::parse(&epw(quarters, "1,4,Data,Sunday,6/21,6/21")).unwrap();
    assert_eq!(fine.at(june + 8.125).0.direct_normal, 100.0);
    assert_eq!(fine.at(june + 8.375).0.direct_normal, 200.0);
}

#[test]
fn what_is_wrong_is_told_with_its_line() {
    let said = |text: &str| Weather::parse(text).unwrap_err().to_string();
    let good = row(2001, 9, "480", "140");
    let typical = |rows: &str| said(&epw(rows, "1,1,Data,Sunday,1/1,12/31"));
    for (message, expected) in [
        (said(""), "is it a weather file?"),
        (said("{\"relight_sequence\": 1}"), "is it a weather file?"),
        (said(&TAPE.replace("longitude -8.57\n", "")), "say no longitude"),
        (
            said(&TAPE.replace("47.38", "97")),
            "latitude is 97; it must be from -90 to 90",
        ),
        (
            said(&TAPE.replace("units 1", "units 3")),
            "line 6: weather_data_file_units is 3; 1, direct normal and diffuse horizontal irradiance in W/m², and 2, illuminance in lx, are read",
        ),
        (
            said(&TAPE.replace("weather_data_file_units 1\n", "")),
            "say no weather_data_file_units",
        ),
        (
            said(
                &TAPE
                    .replace("units 1", "units 2")
                    .replace("420 130", "420000 130"),
            ),
            "line 8: direct normal illuminance is 420000; it must be from 0 to 400000 lx",
        ),
        (
            said(&TAPE.replace("420 130", "420")),
            "line 8: ends before diffuse horizontal irradiance",
        ),
        (
            said(&TAPE.replace("420 130", "-3 130")),
            "line 8: direct normal irradiance is -3; it must be from 0 to 2000 W/m²",
        ),
        (
            said(&TAPE.replace("420 130", "NaN 130")),
            "line 8: direct normal irradiance is \"NaN\", which is no number",
        ),
        (
            said(&TAPE.replace("3 21 9.5", "3 32 9.5")),
            "line 8: there is no day 32 in month 3",
        ),
        (
            said(&TAPE.replace("3 21 9.500", "3 21 7.500")),
            "line 8: 03-21 07:30 is there already, on line 7: the file holds more than one year",
        ),
        (said(TAPE.split("3 21").next().unwrap()), "holds no hour"),
        (
            typical(&(good.clone() + &row(2002, 9, "1", "1"))),
            "line 10: 06-21 08:30 is there already, on line 9",
        ),
        (
            typical(&good.replace(",9,", ",25,")),
            "line 9: the hour is 25; it must be from 0 to 24",
        ),
        (typical("2001,6,21"), "line 9: ends before the hour"),
        (typical(&row(2001, 9, "9999", "9999")), "holds no hour"),
        (
            typical(&row(2001, 9, "wet", "1")),
            "line 9: direct normal irradiance is \"wet\"",
        ),
        (
            said("LOCATION,a,b,c,d,e,here,8,1,5"),
            "line 1: the latitude is \"here\"",
        ),
    ] {
        assert!(message.contains(expected), "{message}\nlacks\n{expected}");
    }
    // What no hour needs is not looked at.
    assert!(Weather::parse(&TAPE.replace("place Zurich_CHE", "\u{feff}place Zürich")).is_ok());
    assert!(
        Weather::parse(&TAPE.replace("3 21 7.500", "2 29 7.500"))
            .unwrap()
            .records
            .len()
            == 9
    );
}

#[test]
fn one_missing_hour_is_interpolated_and_more_are_refused_where_they_are_asked_for() {
    let weather = Weather::parse(TAPE).unwrap();
    let at = |month, day, hour: f64| hours_before(month, day).unwrap() + hour;
    // Records at 7.5 and 9.5 are two hours apart, those at 9.5 and 12.5 three.
    assert_eq!(weather.check(at(3, 21, 7.5), at(3, 21, 9.5)), Ok(()));
    assert_eq!(weather.check(at(6, 21, 12.5), at(6, 21, 13.5)), Ok(()));
    assert_eq!(weather.check(at(3, 21, 9.5), at(3, 21, 9.5)), Ok(()));
    let said = weather
        .check(at(3, 21, 8.0), at(3, 21, 10.0))
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("has nothing between 03-21 09:30 and 03-21 12:30"),
        "{said}"
    );
    for (from, to) in [
        ((6, 21, 19.5), (6, 21, 20.0)),
        ((1, 1, 3.0), (1, 1, 3.0)),
        ((1, 1, 0.0), (12, 31, 24.0)),
    ] {
        let (from, to) = (at(from.0, from.1, from.2), at(to.0, to.1, to.2));
        assert!(weather.check(from, to).is_err(), "{from} {to}");
    }
    // Around the turn of the year.
    let turn = TAPE
        .replace("6 21 19.500", "12 31 23.500")
        .replace("3 21 7.500", "1 1 0.500");
    let turn = Weather::parse(&turn).unwrap();
    assert_eq!(turn.check(at(12, 31, 23.5), at(12, 31, 24.5)), Ok(()));
    assert!((turn.at(at(12, 31, 24.0)).0.direct_normal - 105.0).abs() < 1e-9);
    assert_eq!(turn.at(HOURS), turn.at(0.0));
}

#[test]
fn an_excerpt_says_what_the_whole_file_does() {
    let weather = Weather::parse(TAPE).unwrap();
    let june = hours_before(6, 21).unwrap();
    let excerpt = weather.excerpt(TAPE, june + 12.75, june + 13.25);
    // The places, and the hours around.
    assert_eq!(excerpt.lines().count(), 6 + 2, "{excerpt}");
    let again = Weather::parse(&excerpt).unwrap();
    assert_eq!(again.at(june + 13.0), weather.at(june + 13.0));
    assert_eq!(again.excerpt(&excerpt, june + 12.75, june + 13.25), excerpt);
    assert_eq!(weather.excerpt(TAPE, 0.0, HOURS), TAPE);
}

/// Truth: the same hours in irradiance, turned to illuminance by the model's own efficacies. These jump by a tenth from one class of skies to the next,
/// so that an hour at the edge of its class, as one of these, has two answers, whose light is the same and whose shape is not.
#[test]
fn tapes_of_illuminance_give_the_skies_of_irradiance() {
    let tape = Weather::parse(TAPE).unwrap();
    let lux = |sky: &crate::sky::SunSky| {
        let (mut sum, width, height) = (0.0, sky.sky.width, sky.sky.height);
        for (i, pixel) in sky.sky.pixels.iter().enumerate() {
            let theta = PI * ((i / width) as f64 + 0.5) / height as f64;
            let solid_angle = TAU / width as f64 * PI / height as f64 * theta.sin();
            sum += f64::from(luminance(*pixel)) * theta.cos().max(0.0) * solid_angle;
        }
        let cone = TAU * 2.0 * (crate::sky::SUN_HALF_ANGLE / 2.0).sin().powi(2);
        [f64::from(luminance(sky.sun_radiance)) * cone * 179.0, sum * 179.0]
    };
    let mut text: String = TAPE.lines().take(6).map(|line| format!("{line}\n")).collect();
    text = text.replace("units 1", "units 2");
    for (record, line) in tape.records.iter().zip(TAPE.lines().skip(6)) {
        let (daylight, sun) = tape.at(record.time);
        let [direct, diffuse] = lux(&weather_sky(&daylight, sun));
        let time: Vec<&str> = line.split(' ').take(3).collect();
        text += &format!("{} {direct} {diffuse}\n", time.join(" "));
    }
    let illuminance = Weather::parse(&text).unwrap();
    let mut apart = Vec::new();
    for record in &tape.records {
        let [a, b] = [&tape, &illuminance].map(|weather| {
            let (daylight, sun) = weather.at(record.time);
            weather_sky(&daylight, sun)
        });
        let [la, lb] = [&a, &b].map(lux);
        for (a, b) in la.iter().zip(lb) {
            assert!((a - b).abs() <= 1e-3 * a, "{record:?}: {a} {b}");
        }
        let (mut off, mut sum) = (0.0, 0.0);
        for (a, b) in a.sky.pixels.iter().zip(&b.sky.pixels) {
            off += f64::from((*a - *b).abs().y);
            sum += f64::from(a.y);
        }
        apart.push(off / sum);
    }
    assert!(
        apart.iter().filter(|&&apart| apart > 0.02).count() <= 1,
        "{apart:?}"
    );
}

/// Truth: a clear day of the same place, turned by hand.
#[test]
fn a_zone_with_the_wrong_sign_is_told() {
    // An equinox under a sun that shines from 6 to 18 by the sun's clock: three days' hours.
    let day = |zone: &str, longitude: &str, ahead: f64| {
        let mut text = format!(
            "place Nowhere\nlatitude 35\nlongitude {longitude}\ntime_zone {zone}\nsite_elevation 0\nweather_data_file_units 1\n"
        );
        for day in 20..23 {
            for hour in 6..18 {
                text += &format!("3 {day} {} 500 100\n", f64::from(hour) + 0.5 + ahead);
            }
        }
        Weather::parse(&text).map_err(|error| error.to_string())
    };
    // Tokyo: 139.7° east, clock of 135°.
    assert!(day("-135", "-139.7", -0.2).is_ok());
    let said = day("135", "-139.7", -0.2).unwrap_err();
    assert!(
        said.contains(
            "of its direct light while the sun is below the horizon; with the other sign of the time zone"
        ),
        "{said}"
    );
    let said = day("-135", "139.7", -0.2).unwrap_err();
    assert!(said.contains("with the other sign of the longitude"), "{said}");
    let said = day("0", "-139.7", -0.2).unwrap_err();
    assert!(said.contains("check longitude and time zone"), "{said}");
}
