//! Numbers and names as a report prints them.

/// Three digits that count: `0.0123`, `12.3`, `1230`, `1.23e-7`. What is not finite is `–`.
pub(super) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let magnitude = value.abs();
    if magnitude == 0.0 {
        return "0".into();
    }
    // Of the rounded value, so that 0.9996 is 1.00.
    let exponent = format!("{magnitude:.2e}").split_once('e').and_then(|(_, e)| e.parse::<i32>().ok()).unwrap_or(0);
    let text = match exponent {
        -4..=4 => format!("{value:.*}", usize::try_from(2 - exponent).unwrap_or(0)),
        _ => format!("{value:.2e}"),
    };
    text.replacen('-', "−", usize::from(value < 0.0))
}

/// A number or `–`.
pub(super) fn maybe(value: Option<f64>) -> String {
    value.map_or_else(|| "–".into(), number)
}

/// A tick of an axis: as short as it can be, without the digits that binary fractions add.
pub(super) fn tick(value: f64) -> String {
    let trimmed = |digits: &str| digits.trim_end_matches('0').trim_end_matches('.').to_owned();
    let scientific = format!("{value:.6e}");
    let text = match scientific.split_once('e') {
        Some((digits, exponent)) if value != 0.0 && !(1e-3..1e6).contains(&value.abs()) => format!("{}e{exponent}", trimmed(digits)),
        _ => trimmed(&format!("{value:.9}")),
    };
    text.replacen('-', "−", usize::from(value < 0.0))
}

/// At most `most` characters, `…` for those in the middle that are left out: names of runs begin with the variant and end with settings.
pub(super) fn shorten(text: &str, most: usize) -> String {
    let characters: Vec<char> = text.chars().collect();
    if characters.len() <= most {
        return text.to_owned();
    }
    let kept = most.saturating_sub(1);
    let (head, tail) = (kept.div_ceil(2), kept / 2);
    characters[..head].iter().chain(&['…']).chain(&characters[characters.len() - tail..]).collect()
}

/// `1 run`, `2 runs`.
pub(super) fn count(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}

/// Without control characters, which XML does not know, whatever the names of a sweep hold.
pub(super) fn printable(text: &str) -> String {
    text.replace(|c: char| c.is_control() && c != '\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_count() {
        let cases = [
            (0.012345, "0.0123"),
            (0.9996, "1.00"),
            (12.345, "12.3"),
            (-1234.5, "−1234"),
            (1.2345e-7, "1.23e-7"),
            (1e6, "1.00e6"),
            (0.0, "0"),
            (f64::NAN, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn long_names_keep_both_ends() {
        assert_eq!(shorten("variant clusters=16", 9), "vari…s=16");
        assert_eq!(shorten("naïve", 5), "naïve");
        assert_eq!(shorten("naïve", 0), "…");
    }

    #[test]
    fn ticks_are_short() {
        for (value, text) in
            [(0.05, "0.05"), (0.1 + 0.2, "0.3"), (100.0, "100"), (3.0 * 1e-5, "3e-5"), (-2e7, "−2e7"), (-0.5, "−0.5"), (0.0, "0")]
        {
            assert_eq!(tick(value), text);
        }
    }
}
