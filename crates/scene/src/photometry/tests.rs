//! Lamps of known light, written as files and read again.

use super::*;

const HEAD: &str = "IESNA:LM-63-1995\n[TEST] a lamp of 100 lm\n[MANUFAC] nobody\nTILT=NONE\n";

/// A file of a type with these angles and `candela(vertical, horizontal)`.
fn file(kind: u8, vertical: &[f64], horizontal: &[f64], candela: impl Fn(f64, f64) -> f64) -> String {
    let list = |angles: &[f64]| angles.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let mut text = format!(
        "{HEAD}1 1000 2 {} {} {kind} 2 0.1 0.1 0\n0.5 1 60\n{}\n{}\n",
        vertical.len(),
        horizontal.len(),
        list(vertical),
        list(horizontal)
    );
    for &h in horizontal {
        let row: Vec<f64> = vertical.iter().map(|&v| candela(v, h)).collect();
        text += &format!("{}\n", list(&row).replace(' ', "\r\n"));
    }
    text
}

fn steps(from: f64, to: f64, step: f64) -> Vec<f64> {
    (0..=((to - from) / step).round() as u32)
        .map(|i| from + f64::from(i) * step)
        .collect()
}

/// The axes of EXT_lights_ies: aim −Z, planes from X.
fn axes() -> LampAxes {
    LampAxes::new(DVec3::NEG_Z, DVec3::X).unwrap()
}

/// From the aim by `theta` towards the plane `c`, degrees.
fn polar(theta: f64, c: f64) -> DVec3 {
    let (theta, c) = (theta.to_radians(), c.to_radians());
    DVec3::new(theta.sin() * c.cos(), theta.sin() * c.sin(), -theta.cos())
}

/// Truth: ∫ I dω, 4π of an even lamp, π of a cosine; the candela factors of the file, 2 and 0.5, are 1 together.
#[test]
fn lumens_are_the_integral_of_candela() {
    let even = Photometry::parse(&file(1, &[0.0, 180.0], &[0.0], |_, _| 100.0)).unwrap();
    assert!((even.lumens() / (400.0 * PI) - 1.0).abs() < 1e-4);
    assert_eq!(even.peak(), 100.0);
    let down = file(1, &steps(0.0, 90.0, 2.5), &[0.0], |v, _| {
        v.to_radians().cos() * 50.0
    });
    let down = Photometry::parse(&down).unwrap();
    assert!(
        (down.lumens() / (50.0 * PI) - 1.0).abs() < 1e-3,
        "{}",
        down.lumens()
    );
    assert!((down.candela(&axes(), polar(30.0, 77.0)) - 43.3).abs() < 0.05);
    assert_eq!(down.candela(&axes(), polar(91.0, 0.0)), 0.0);
    // Between angles it is a line.
    let line = Photometry::parse(&file(1, &[0.0, 60.0, 90.0], &[0.0], |v, _| 90.0 - v)).unwrap();
    assert!((line.candela(&axes(), polar(45.0, 0.0)) - 45.0).abs() < 1e-9);
}

/// Truth: the same lamp, measured all around. Each range's lamp has the symmetry that the range means.
#[test]
fn symmetric_ranges_mean_what_was_not_measured() {
    let vertical = steps(0.0, 180.0, 10.0);
    type Lamp = fn(f64, f64) -> f64;
    let quarter: Lamp = |v, h| 20.0 + (v * 0.1) * (2.0 * h.to_radians()).cos();
    let half: Lamp = |v, h| 20.0 + (v * 0.1) * h.to_radians().cos();
    let other: Lamp = |v, h| 20.0 + (v * 0.1) * h.to_radians().sin();
    for (range, lamp) in [
        (steps(0.0, 90.0, 5.0), quarter),
        (steps(0.0, 180.0, 5.0), half),
        (steps(90.0, 270.0, 5.0), other),
        // Without its last plane.
        (steps(0.0, 355.0, 5.0), half),
    ] {
        let part = Photometry::parse(&file(1, &vertical, &range, lamp)).unwrap();
        let whole = Photometry::parse(&file(1, &vertical, &steps(0.0, 360.0, 5.0), lamp)).unwrap();
        for i in 0..1000 {
            let direction = polar(f64::from(i % 37) * 4.9, f64::from(i) * 7.3);
            let [a, b] = [&part, &whole].map(|lamp| lamp.candela(&axes(), direction));
            assert!((a - b).abs() < 1e-9, "{range:?} {i}: {a} {b}");
        }
    }
}

/// Truth: the definitions of the angles, as rotations about fixed axes.
#[test]
fn types_a_and_b_turn_about_their_own_axes() {
    let angles = steps(-90.0, 90.0, 15.0);
    for kind in [2, 3] {
        let lamp = Photometry::parse(&file(kind, &angles, &angles, |v, h| 1000.0 + 3.0 * v + h)).unwrap();
        for (v, h) in [(0.0, 0.0), (30.0, 0.0), (-45.0, 15.0), (20.0, -70.0), (0.0, 60.0)] {
            let (sv, cv) = f64::to_radians(v).sin_cos();
            let (sh, ch) = f64::to_radians(h).sin_cos();
            // Forwards, up, right.
            let [f, u, r] = match kind {
                2 => [ch * cv, ch * sv, sh],
                _ => [cv * ch, sv, cv * sh],
            };
            let direction = DVec3::new(u, -r, -f);
            let found = lamp.candela(&axes(), direction);
            assert!(
                (found - (1000.0 + 3.0 * v + h)).abs() < 1e-6,
                "{kind} {v} {h}: {found}"
            );
        }
        assert_eq!(lamp.candela(&axes(), DVec3::Z), 0.0);
    }
    // Measured on one side only.
    let angles = steps(0.0, 90.0, 15.0);
    let lamp = Photometry::parse(&file(2, &angles, &angles, |v, h| v + 2.0 * h)).unwrap();
    let at = |v: f64, h: f64| lamp.at(v, h);
    assert_eq!([at(10.0, 20.0), at(-10.0, 20.0), at(-10.0, -20.0)], [50.0; 3]);
}

/// Truth: the factors as the file has them, on a line between, the nearest beyond.
#[test]
fn tilt_darkens_lamps_by_their_angle_from_straight_down() {
    let lamp = "TILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.5\n1 -1 1 2 1 1 1 0 0 0\n1 1 9\n0 180\n0\n7 7";
    let lamp = Photometry::parse(lamp).unwrap();
    assert!(lamp.has_tilt() && lamp.peak() == 7.0);
    for (degrees, factor) in [
        (0.0f64, 1.0),
        (45.0, 0.9),
        (60.0, 0.9 - 0.4 / 3.0),
        (90.0, 0.5),
        (150.0, 0.5),
    ] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        for (x, z) in [(1.0, 0.0), (-0.6, 0.8)] {
            let aim = DVec3::new(sin * x, -cos, sin * z);
            assert!((lamp.tilted(aim) - factor).abs() < 1e-9, "{degrees}");
        }
    }
    let plain = Photometry::parse(&file(1, &[0.0, 90.0], &[0.0], |_, _| 5.0)).unwrap();
    assert_eq!((plain.tilted(DVec3::X), plain.has_tilt()), (1.0, false));
}

/// Truth: the same factors in the file itself.
#[test]
fn tilt_may_be_in_another_file() {
    let lamp = "A lamp\nTILT=SUB\\lamp.tlt\n1,-1,1,2,1,1,1,0,0,0 1 1 9 0 180 0 7 8 and what follows";
    let included = |factors: &str| {
        with_tilt(lamp.to_owned(), |name| {
            assert_eq!(name, "SUB/lamp.tlt");
            Ok(factors.as_bytes().to_vec())
        })
    };
    let text = included("tilt=include\r\n2\r\n2\r\n0 90\r\n1 0.8\r\n").unwrap();
    let found = Photometry::parse(&text).unwrap();
    assert_eq!((found.peak(), found.tilted(DVec3::Z)), (8.0, 0.8));
    // Already there, or none.
    for text in [text.as_str(), "TILT=NONE\n1"] {
        assert_eq!(with_tilt(text.to_owned(), |_| panic!()), Ok(text.to_owned()));
    }
    for (factors, said) in [
        (
            "4 1 0 1",
            "TILT=SUB\\lamp.tlt: line 1: the lamp's place in the luminaire",
        ),
        ("1\n0", "line 2: the number of tilt angles is 0"),
        ("1\n1.5", "line 2: the number of tilt angles is 1.5"),
        ("1\n2\n0 190\n1 1", "line 3: a tilt angle is 190"),
        ("1\n2\n90 0\n1 1", "line 3: a tilt angle is 0; angles rise"),
        ("1\n2\n0 90\n1 -1", "line 4: a factor of TILT is -1"),
        (
            "1\n2\n0 90\n1 x",
            "line 4: a factor of TILT is \"x\", which is no number",
        ),
        ("1\n2\n0 90\n1", "ends before a factor of TILT"),
        ("1\n1\n0\n1 1", "more behind the factors"),
    ] {
        let said_so = included(factors).unwrap_err().to_string();
        assert!(said_so.contains(said), "{factors:?}: {said_so}");
        assert!(said_so.contains("or write TILT=NONE"), "{said_so}");
    }
    // Read without the other file, nothing is made up.
    let said = Photometry::parse(lamp).unwrap_err().to_string();
    assert!(
        said.contains("TILT=SUB\\lamp.tlt: ") && said.contains("TILT=NONE"),
        "{said}"
    );
    let said = with_tilt(lamp.to_owned(), |name| read_beside(Path::new("nowhere"), name));
    let said = said.unwrap_err().to_string();
    assert!(said.contains("lamp.tlt: cannot be read"), "{said}");
}

#[test]
fn old_files_are_latin1() {
    assert!(text(b"[MANUFAC] K\xfcche").ends_with("Küche"));
}

#[test]
fn what_is_wrong_is_said() {
    let good = file(1, &[0.0, 90.0], &[0.0], |_, _| 5.0);
    let said = |text: &str| Photometry::parse(text).unwrap_err().to_string();
    for (from, to, expected) in [
        ("TILT=NONE", "no such line", "TILT="),
        (" 2 1 1 2 ", " 0 1 1 2 ", "the number of vertical angles is 0"),
        (" 2 1 1 2 ", " 2 0 1 2 ", "the number of horizontal angles is 0"),
        (" 2 1 1 2 ", " 2 1 4 2 ", "the photometric type is 4"),
        (" 2 1 1 2 ", " 1048576 1048576 1 2 ", "at most 1048576"),
        ("5\r\n5", "5\r\n-5", "a candela value is -5"),
        ("5\r\n5", "5\r\n1e300", "a candela value is"),
        ("5\r\n5", "5\r\nnan", "\"nan\", which is no number"),
        ("5\r\n5", "5", "the last candela value: the file is cut off"),
        ("\n0 90\n", "\n90 0\n", "angles rise"),
        ("\n0 90\n", "\n0 190\n", "between 0 and 180"),
        ("0.5 1 60", "-0.5 1 60", "the ballast factor is -0.5"),
    ] {
        let text = good.replace(from, to);
        assert_ne!(text, good, "{from:?}");
        assert!(said(&text).contains(expected), "{to}: {}", said(&text));
    }
    let text = file(1, &[0.0, 90.0], &[0.0, 45.0], |_, _| 5.0);
    assert!(
        said(&text).contains("or go from 0 to 90, 180 or 360"),
        "{}",
        said(&text)
    );
    // The place, too: the line of the value.
    let text = good.replace("0.5 1 60", "-0.5 1 60");
    assert!(said(&text).starts_with("line 6: "), "{}", said(&text));
    // Cut off anywhere.
    for end in 0..good.trim_end().len() - 1 {
        assert!(Photometry::parse(&good[..end]).is_err(), "{end}");
    }
}
