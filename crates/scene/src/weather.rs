//! What the weather was, hour by hour: EnergyPlus weather files (`.epw`) and weather tapes of Radiance (`.wea`).
//!
//! Source: "Auxiliary EnergyPlus Programs", chapter on the weather file; Radiance's manual page of gendaymtx. Of each hour the sun's
//! irradiance on a surface that faces it and the sky's on the ground are read, and in `.epw` the dew point. An hour's values
//! are those of its middle: hour 1 of an `.epw` is half past midnight. Between middles they are interpolated; the sun stands where it
//! stands at the very time, in the file's time zone. Years are not looked at: files of typical years have months of different ones.
//! The 29th of February is left out. Weather tapes have irradiance (`weather_data_file_units 1`) or illuminance (2).
//!
//! The sun's place: Spencer 1971, "Fourier series representation of the position of the sun", within some hundredths of a degree of
//! declination and half a minute. No refraction.

use crate::lfs::{LFS_ADVICE, is_lfs_pointer};
use glam::DVec3;
use std::f64::consts::{PI, TAU};
use std::path::Path;
use thiserror::Error;

/// Most bytes of a file: a year in steps of five minutes takes some twenty million.
pub const MAX_BYTES: u64 = 64 << 20;
/// Hours of a year without its leap day.
pub const HOURS: f64 = 8760.0;
/// Values farther apart than this, hours, are not interpolated: one hour may be missing.
const MOST_APART: f64 = 2.01;
/// Largest irradiance, W/m²: beyond the sun's above the atmosphere, with what instruments exaggerate.
const MAX_IRRADIANCE: f64 = 2000.0;
/// Largest illuminance, lx: that of the largest irradiance at more lumens a watt than any daylight has.
const MAX_ILLUMINANCE: f64 = 400_000.0;
/// Share of the year's direct light that may come from below the horizon: hours around sunrise are told by their middles.
const BELOW_HORIZON: f64 = 0.02;
/// How far below the horizon counts, as a sine: two degrees.
const BELOW: f64 = -0.035;
/// Hours with direct light from which on it is looked at where the sun stands.
const ENOUGH_HOURS: usize = 24;
/// In `.epw`, values from here on mean that there is none.
const MISSING: f64 = 9999.0;
/// Dew point where a file has none, °C, as gendaymtx takes it.
const DEW_POINT: f64 = 11.0;
/// Lines before an `.epw`'s hours, and columns of an hour up to the last one that is read.
const EPW_HEAD: usize = 8;
const EPW_COLUMNS: usize = 16;
/// Days before each month.
const DAYS_BEFORE: [u32; 13] = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334, 365];

/// Why a weather file cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum WeatherError {
    /// It could not be read.
    #[error("{0}")]
    Read(String),
    /// It is neither of the two kinds.
    #[error(
        "begins neither with LOCATION, as .epw files do, nor with place, as .wea files do; is it a weather file?"
    )]
    Unknown,
    /// A line is wrong.
    #[error("line {line}: {message}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What was found, and what to do.
        message: String,
    },
    /// It has no hours with light.
    #[error(
        "holds no hour with direct and diffuse irradiance; the file is cut off, or all its values are missing: get it anew"
    )]
    Empty,
    /// The sun shines at night.
    #[error("has {percent} % of its direct light while the sun is below the horizon; {advice}")]
    Zone {
        /// Of the direct light.
        percent: f64,
        /// What to do.
        advice: &'static str,
    },
    /// Hours that are asked for are not there.
    #[error(
        "has nothing between {from} and {to}, but the sequence asks for that time; choose other hours, or a file without the gap"
    )]
    Gap {
        /// The last time before.
        from: String,
        /// The first time after.
        to: String,
    },
}

/// A time of the year and its light.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Record {
    /// Hours since the year began, local standard time.
    time: f64,
    direct: f64,
    diffuse: f64,
    dew_point: f64,
    line: usize,
}

/// What a weather station says of an hour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Daylight {
    /// Irradiance by the sun of a surface that faces it, W/m².
    pub direct_normal: f64,
    /// Irradiance by the sky of the ground, W/m².
    pub diffuse_horizontal: f64,
    /// Whether both are illuminance instead, lx.
    pub in_lux: bool,
    /// Dew point, °C.
    pub dew_point: f64,
    /// Irradiance above the atmosphere over its mean over the year.
    pub eccentricity: f64,
}

/// The weather of a year at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Weather {
    /// Degrees north.
    latitude: f64,
    /// Degrees east.
    longitude: f64,
    /// Hours that the clock is ahead of Greenwich.
    zone: f64,
    /// By rising time; at least one.
    records: Vec<Record>,
    /// Lines before the hours.
    head: usize,
    /// Whether it has illuminance, not irradiance.
    in_lux: bool,
}

/// Night at the equator.
impl Default for Weather {
    fn default() -> Weather {
        Weather {
            latitude: 0.0,
            longitude: 0.0,
            zone: 0.0,
            records: vec![Record {
                time: 0.0,
                direct: 0.0,
                diffuse: 0.0,
                dew_point: DEW_POINT,
                line: 0,
            }],
            head: 0,
            in_lux: false,
        }
    }
}

impl Weather {
    /// Reads a file; its text as UTF-8 or Latin-1.
    ///
    /// # Errors
    /// It cannot be read or is too large.
    pub fn text_of(path: &Path) -> Result<String, WeatherError> {
        let name = path.display();
        let fail = |error: std::io::Error| WeatherError::Read(format!("{name}: cannot be read: {error}"));
        let size = std::fs::metadata(path).map_err(fail)?.len();
        if size > MAX_BYTES {
            let message = format!("{name}: has {size} bytes; weather files of up to {MAX_BYTES} are read");
            return Err(WeatherError::Read(message));
        }
        let bytes = std::fs::read(path).map_err(fail)?;
        if is_lfs_pointer(&bytes) {
            return Err(WeatherError::Read(format!("{name}: this {LFS_ADVICE}")));
        }
        let latin1 = |bytes: &[u8]| bytes.iter().map(|&byte| char::from(byte)).collect();
        Ok(String::from_utf8(bytes).unwrap_or_else(|error| latin1(error.as_bytes())))
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// It is no such file, a value makes no sense, or an hour is there twice.
    pub fn parse(text: &str) -> Result<Weather, WeatherError> {
        let text = text.trim_start_matches('\u{feff}');
        let lines: Vec<(usize, &str)> = (1..).zip(text.lines()).collect();
        let first = lines.first().map_or("", |line| line.1).trim_start();
        let mut weather = if first
            .get(..8)
            .is_some_and(|word| word.eq_ignore_ascii_case("LOCATION"))
        {
            epw(&lines)?
        } else if first.starts_with("place") {
            wea(&lines)?
        } else {
            return Err(WeatherError::Unknown);
        };
        if weather.records.is_empty() {
            return Err(WeatherError::Empty);
        }
        weather.records.sort_by(|a, b| a.time.total_cmp(&b.time));
        for pair in weather.records.windows(2) {
            if pair[1].time - pair[0].time < 1e-6 {
                let line = pair[0].line.max(pair[1].line);
                let message = format!(
                    "{} is there already, on line {}: the file holds more than one year; keep one",
                    clock(pair[0].time),
                    pair[0].line.min(pair[1].line)
                );
                return Err(WeatherError::Line { line, message });
            }
        }
        weather.check_zone()?;
        Ok(weather)
    }

    /// Whether the sun is up when it shines: a longitude or a time zone with the wrong sign puts it hours away.
    fn check_zone(&self) -> Result<(), WeatherError> {
        let shares = |weather: &Weather| {
            let (mut all, mut below, mut hours) = (0.0, 0.0, 0);
            for record in weather.records.iter().filter(|record| record.direct > 0.0) {
                (all, hours) = (all + record.direct, hours + 1);
                if weather.sun(record.time).y < BELOW {
                    below += record.direct;
                }
            }
            (hours, if all > 0.0 { below / all } else { 0.0 })
        };
        let (hours, below) = shares(self);
        if hours < ENOUGH_HOURS || below <= BELOW_HORIZON {
            return Ok(());
        }
        let other = |weather: Weather| shares(&weather).1 <= BELOW_HORIZON;
        let advice = if other(Weather {
            zone: -self.zone,
            ..self.clone()
        }) {
            "with the other sign of the time zone it is up: turn that"
        } else if other(Weather {
            longitude: -self.longitude,
            ..self.clone()
        }) {
            "with the other sign of the longitude it is up: turn that"
        } else {
            "check longitude and time zone, west and east: in .epw files east is positive, in .wea files west, and hours are of standard time"
        };
        Err(WeatherError::Zone {
            percent: (100.0 * below).round(),
            advice,
        })
    }

    /// The two records around a time of the year, and the share of the later one.
    fn around(&self, time: f64) -> (&Record, &Record, f64) {
        let records = &self.records;
        let next = records.partition_point(|record| record.time <= time);
        let (Some(first), Some(last)) = (records.first(), records.last()) else {
            unreachable!("there is at least one record");
        };
        // Around the turn of the year.
        let before = if next == 0 { last } else { &records[next - 1] };
        let after = records.get(next).unwrap_or(first);
        let span = (after.time - before.time).rem_euclid(HOURS);
        let past = (time - before.time).rem_euclid(HOURS);
        (before, after, if span > 0.0 { past / span } else { 0.0 })
    }

    /// Light of a time, hours since the year began (of any number of years), and the direction towards the sun: x east, y up, z south.
    pub fn at(&self, hours: f64) -> (Daylight, DVec3) {
        let time = hours.rem_euclid(HOURS);
        let (before, after, share) = self.around(time);
        let mix = |of: fn(&Record) -> f64| of(before) + (of(after) - of(before)) * share;
        let angle = TAU * (time / 24.0).floor() / 365.0;
        let eccentricity = 1.00011
            + 0.034221 * angle.cos()
            + 0.00128 * angle.sin()
            + 0.000719 * (2.0 * angle).cos()
            + 0.000077 * (2.0 * angle).sin();
        let daylight = Daylight {
            direct_normal: mix(|r| r.direct),
            diffuse_horizontal: mix(|r| r.diffuse),
            in_lux: self.in_lux,
            dew_point: mix(|r| r.dew_point),
            eccentricity,
        };
        (daylight, self.sun(time))
    }

    /// Unit vector towards the sun: x east, y up, z south.
    fn sun(&self, time: f64) -> DVec3 {
        let g = TAU * time / HOURS;
        let declination = 0.006918 - 0.399912 * g.cos() + 0.070257 * g.sin() - 0.006758 * (2.0 * g).cos()
            + 0.000907 * (2.0 * g).sin()
            - 0.002697 * (3.0 * g).cos()
            + 0.00148 * (3.0 * g).sin();
        // Of the sun's clock before the even one, radians.
        let ahead = 0.000075 + 0.001868 * g.cos()
            - 0.032077 * g.sin()
            - 0.014615 * (2.0 * g).cos()
            - 0.040849 * (2.0 * g).sin();
        let even = (time.rem_euclid(24.0) - 12.0 - self.zone) * PI / 12.0 + self.longitude.to_radians();
        let (sin_hour, cos_hour) = (even + ahead).sin_cos();
        let (sin_place, cos_place) = self.latitude.to_radians().sin_cos();
        let (sin, cos) = declination.sin_cos();
        let north = cos_place * sin - sin_place * cos * cos_hour;
        DVec3::new(
            -cos * sin_hour,
            sin_place * sin + cos_place * cos * cos_hour,
            -north,
        )
        .normalize()
    }

    /// Whether there is something to interpolate at all times between two, hours since the year began.
    ///
    /// # Errors
    /// [`WeatherError::Gap`].
    pub fn check(&self, from: f64, to: f64) -> Result<(), WeatherError> {
        let year = to - from >= HOURS;
        let records = self.records.iter().zip(self.records.iter().cycle().skip(1));
        for (before, after) in records {
            let span = if self.records.len() == 1 {
                HOURS
            } else {
                (after.time - before.time).rem_euclid(HOURS)
            };
            // Where the gap begins, in the year in which the range does.
            let start = from + (before.time - from).rem_euclid(HOURS);
            let met = start < to || start - HOURS + span > from;
            if span > MOST_APART && (year || met) {
                return Err(WeatherError::Gap {
                    from: clock(before.time),
                    to: clock(after.time),
                });
            }
        }
        Ok(())
    }

    /// Of the text that was read, the lines for all times between two, hours since the year began.
    pub fn excerpt(&self, text: &str, from: f64, to: f64) -> String {
        let year = to - from >= HOURS;
        let wanted = |record: &Record| {
            let from = from - MOST_APART;
            year || (record.time - from).rem_euclid(HOURS) <= to + MOST_APART - from
        };
        let mut kept: Vec<usize> = self
            .records
            .iter()
            .filter(|r| wanted(r))
            .map(|r| r.line)
            .collect();
        kept.sort_unstable();
        let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
        let lines = lines.filter(|(i, _)| *i <= self.head || kept.binary_search(i).is_ok());
        lines.map(|(_, line)| format!("{}\n", line.trim_end())).collect()
    }
}

/// Hours before a day of the year; `None` where there is no such day. The leap day is none.
pub fn hours_before(month: u32, day: u32) -> Option<f64> {
    let month = month.checked_sub(1).filter(|&month| month < 12)? as usize;
    let first = DAYS_BEFORE[month];
    (1..=DAYS_BEFORE[month + 1] - first)
        .contains(&day)
        .then(|| f64::from(24 * (first + day - 1)))
}

/// A time of the year for people.
fn clock(time: f64) -> String {
    let minutes = (time.rem_euclid(HOURS) * 60.0).round() as u32;
    let (day, minute) = (minutes / 1440, minutes % 1440);
    let month = DAYS_BEFORE.partition_point(|&before| before <= day).clamp(1, 12);
    let day = day - DAYS_BEFORE[month - 1] + 1;
    format!("{month:02}-{day:02} {:02}:{:02}", minute / 60, minute % 60)
}

/// One line of a file, for its errors.
struct Line(usize);

impl Line {
    fn error(&self, message: String) -> WeatherError {
        WeatherError::Line {
            line: self.0,
            message,
        }
    }

    fn number(&self, what: &str, text: Option<&&str>) -> Result<f64, WeatherError> {
        let text =
            text.ok_or_else(|| self.error(format!("ends before {what}; the file is cut off: get it anew")))?;
        let number = text
            .trim()
            .parse::<f64>()
            .ok()
            .filter(|number| number.is_finite());
        let shown: String = text.trim().chars().take(20).collect();
        number.ok_or_else(|| self.error(format!("{what} is {shown:?}, which is no number")))
    }

    fn within(&self, what: &str, text: Option<&&str>, low: f64, high: f64) -> Result<f64, WeatherError> {
        let number = self.number(what, text)?;
        if !(low..=high).contains(&number) {
            return Err(self.error(format!("{what} is {number}; it must be from {low} to {high}")));
        }
        Ok(number)
    }

    /// Irradiance in W/m²; `None` where it is missing.
    fn irradiance(&self, what: &str, text: Option<&&str>) -> Result<Option<f64>, WeatherError> {
        let number = self.number(what, text)?;
        if number >= MISSING {
            return Ok(None);
        }
        if !(0.0..=MAX_IRRADIANCE).contains(&number) {
            let advice = "and 9999 where it is missing; mend the file";
            let message = format!("{what} is {number}; it must be from 0 to {MAX_IRRADIANCE} W/m², {advice}");
            return Err(self.error(message));
        }
        Ok(Some(number))
    }

    /// Illuminance in lx; `None` where it is missing, as in irradiance.
    fn illuminance(&self, what: &str, text: Option<&&str>) -> Result<Option<f64>, WeatherError> {
        let number = self.number(what, text)?;
        if number == 999_900.0 || number == 999_999.0 {
            return Ok(None);
        }
        if !(0.0..=MAX_ILLUMINANCE).contains(&number) {
            let advice = "and 999900 where it is missing; mend the file";
            let message = format!("{what} is {number}; it must be from 0 to {MAX_ILLUMINANCE} lx, {advice}");
            return Err(self.error(message));
        }
        Ok(Some(number))
    }

    /// Hours before a day; `None` on the leap day.
    fn day(&self, month: Option<&&str>, day: Option<&&str>) -> Result<Option<f64>, WeatherError> {
        let (month, day) = (self.number("the month", month)?, self.number("the day", day)?);
        if (month, day) == (2.0, 29.0) {
            return Ok(None);
        }
        let whole = month.fract() == 0.0 && day.fract() == 0.0 && month >= 0.0 && day >= 0.0;
        let before = whole.then(|| hours_before(month as u32, day as u32)).flatten();
        match before {
            Some(before) => Ok(Some(before)),
            None => Err(self.error(format!("there is no day {day} in month {month}"))),
        }
    }
}

fn epw(lines: &[(usize, &str)]) -> Result<Weather, WeatherError> {
    let head: Vec<&str> = lines.first().map_or("", |line| line.1).split(',').collect();
    let place = Line(1);
    let mut weather = Weather {
        latitude: place.within("the latitude", head.get(6), -90.0, 90.0)?,
        longitude: place.within("the longitude", head.get(7), -180.0, 180.0)?,
        zone: place.within("the time zone", head.get(8), -14.0, 14.0)?,
        records: Vec::new(),
        head: EPW_HEAD,
        in_lux: false,
    };
    let (mut per_hour, line) = (1.0, Line(EPW_HEAD));
    if let Some((_, periods)) = lines.get(EPW_HEAD - 1) {
        let fields: Vec<&str> = periods.split(',').collect();
        per_hour = line.within("the number of records per hour", fields.get(2), 1.0, 60.0)?;
    }
    for (number, text) in lines
        .iter()
        .skip(EPW_HEAD)
        .filter(|line| !line.1.trim().is_empty())
    {
        let line = Line(*number);
        let fields: Vec<&str> = text.split(',').take(EPW_COLUMNS).collect();
        let Some(day) = line.day(fields.get(1), fields.get(2))? else {
            continue;
        };
        let hour = line.within("the hour", fields.get(3), 0.0, 24.0)?;
        let minute = line.within("the minute", fields.get(4), 0.0, 60.0)?;
        let dew_point = line.number("the dew point", fields.get(7))?;
        let direct = line.irradiance("direct normal irradiance", fields.get(14))?;
        let diffuse = line.irradiance("diffuse horizontal irradiance", fields.get(15))?;
        // Records of one hour carry minute 0, 30 or 60, whichever they mean; they are of the hour that ends then.
        let end = if per_hour > 1.0 {
            hour - 1.0 + minute / 60.0
        } else {
            hour
        };
        if let (Some(direct), Some(diffuse)) = (direct, diffuse) {
            weather.records.push(Record {
                time: (day + end - 0.5 / per_hour).rem_euclid(HOURS),
                direct,
                diffuse,
                dew_point: if dew_point.abs() < 99.0 {
                    dew_point
                } else {
                    DEW_POINT
                },
                line: *number,
            });
        }
    }
    Ok(weather)
}

fn wea(lines: &[(usize, &str)]) -> Result<Weather, WeatherError> {
    let mut head = [None; 3];
    let names = ["latitude", "longitude", "time_zone"];
    let mut units = false;
    let mut weather = Weather {
        records: Vec::new(),
        ..Weather::default()
    };
    for (number, text) in lines.iter().filter(|line| !line.1.trim().is_empty()) {
        let line = Line(*number);
        let words: Vec<&str> = text.split_whitespace().collect();
        let starts_with_letter = words[0].starts_with(|c: char| c.is_ascii_alphabetic());
        if starts_with_letter && weather.records.is_empty() {
            weather.head = *number;
            if let Some(i) = names.iter().position(|name| *name == words[0]) {
                head[i] = Some(line.within(names[i], words.get(1), -210.0, 210.0)?);
            }
            if words[0] == "weather_data_file_units" {
                weather.in_lux = match words.get(1) {
                    Some(&"1") => false,
                    Some(&"2") => true,
                    other => {
                        let found = other.unwrap_or(&"nothing");
                        let advice = "1, direct normal and diffuse horizontal irradiance in W/m², and 2, illuminance in lx, are read: make \
                                      the file with epw2wea";
                        return Err(line.error(format!("weather_data_file_units is {found}; {advice}")));
                    }
                };
                units = true;
            }
            continue;
        }
        let Some(day) = line.day(words.first(), words.get(1))? else {
            continue;
        };
        let hour = line.within("the hour", words.get(2), 0.0, 24.0)?;
        let (direct, diffuse) = match weather.in_lux {
            false => (
                line.irradiance("direct normal irradiance", words.get(3))?,
                line.irradiance("diffuse horizontal irradiance", words.get(4))?,
            ),
            true => (
                line.illuminance("direct normal illuminance", words.get(3))?,
                line.illuminance("diffuse horizontal illuminance", words.get(4))?,
            ),
        };
        if let (Some(direct), Some(diffuse)) = (direct, diffuse) {
            weather.records.push(Record {
                time: (day + hour).rem_euclid(HOURS),
                direct,
                diffuse,
                dew_point: DEW_POINT,
                line: *number,
            });
        }
    }
    let line = Line(weather.head.max(1));
    for (name, value) in names.iter().zip(head) {
        if value.is_none() {
            return Err(line.error(format!(
                "the lines before the hours say no {name}; the file is cut off: get it anew"
            )));
        }
    }
    if !units {
        let message =
            "the lines before the hours say no weather_data_file_units; the file is cut off: get it anew";
        return Err(line.error(message.into()));
    }
    // West counts as positive in these files, and a time zone is its meridian.
    let [latitude, longitude, meridian] = head.map(|value| value.unwrap_or(0.0));
    if latitude.abs() > 90.0 {
        return Err(line.error(format!("latitude is {latitude}; it must be from -90 to 90")));
    }
    (weather.latitude, weather.longitude, weather.zone) = (latitude, -longitude, -meridian / 15.0);
    Ok(weather)
}

#[cfg(test)]
mod tests;
