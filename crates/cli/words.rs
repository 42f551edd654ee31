//! Numbers as people read them.

/// A count with thin groups: `1,234,567`.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// So many things a second: `0.76 M/s`.
pub fn rate(per_second: f64) -> String {
    match per_second {
        r if r >= 1e5 => format!("{:.2} M/s", r * 1e-6),
        r if r >= 1e3 => format!("{:.1} k/s", r * 1e-3),
        r => format!("{r:.1} /s"),
    }
}

/// Bytes in binary units: `3.4 MiB`.
pub fn bytes(n: u64) -> String {
    const UNITS: [&str; 5] = ["B", "KiB", "MiB", "GiB", "TiB"];
    let mut value = n as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 {
        format!("{n} B")
    } else {
        format!("{value:.1} {}", UNITS[unit])
    }
}

/// A noun with its number: `1 light`, `2 lights`.
pub fn plural(n: usize, noun: &str) -> String {
    format!("{} {noun}{}", count(n as u64), if n == 1 { "" } else { "s" })
}

/// Bytes a file would like to be per item; `-` of nothing.
pub fn per(total: u64, items: u64) -> String {
    if items == 0 {
        "-".into()
    } else {
        format!("{:.2}", total as f64 / items as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_scaled() {
        assert_eq!(
            (count(0), count(999), count(1000), count(1_234_567)),
            ("0".into(), "999".into(), "1,000".into(), "1,234,567".into())
        );
        assert_eq!(
            (rate(760_000.0), rate(12_340.0), rate(5.06)),
            ("0.76 M/s".into(), "12.3 k/s".into(), "5.1 /s".into())
        );
        assert_eq!(
            (bytes(1023), bytes(1536), bytes(5 << 30)),
            ("1023 B".into(), "1.5 KiB".into(), "5.0 GiB".into())
        );
    }
}
