//! Values of options: `NAME=VALUE`, `WxH`, `RESOURCE=FILE`. A fault here is a fault of usage (exit code 2).

use std::path::PathBuf;

/// The largest side of a picture: the largest texture that WebGPU adapters of today hold.
pub const MAX_SIDE: u32 = 16384;

/// `--set NAME=VALUE`.
pub fn assignment(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, for example `clusters=128`")?;
    let (name, value) = (name.trim(), value.trim());
    if name.is_empty() {
        return Err("there is no name before `=`: expected NAME=VALUE, for example `clusters=128`".to_owned());
    }
    if value.is_empty() {
        return Err(format!("there is no value after `{name}=`: expected NAME=VALUE, for example `clusters=128`"));
    }
    Ok((name.to_owned(), value.to_owned()))
}

/// `--size WxH`.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let expected = "expected WIDTHxHEIGHT in pixels, for example `640x360`";
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or(expected)?;
    let side = |text: &str| text.trim().parse::<u64>().map_err(|_| expected.to_owned());
    let (width, height) = (side(width)?, side(height)?);
    let range = 1..=u64::from(MAX_SIDE);
    if !range.contains(&width) || !range.contains(&height) {
        return Err(format!("width and height lie between 1 and {MAX_SIDE}"));
    }
    Ok((width as u32, height as u32))
}

/// `--dump RESOURCE=FILE`.
pub fn dump(text: &str) -> Result<(String, PathBuf), String> {
    let expected = "expected RESOURCE=FILE, for example `clusters=clusters.json` or `ism=ism.exr`";
    let (resource, file) = text.split_once('=').ok_or(expected)?;
    if resource.trim().is_empty() || file.is_empty() {
        return Err(expected.to_owned());
    }
    Ok((resource.trim().to_owned(), PathBuf::from(file)))
}

/// A finite number of seconds.
pub fn seconds(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("expected a number of seconds, for example `1.5`".to_owned()),
    }
}

/// Frames a second, above zero.
pub fn rate(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected frames a second, above 0, for example `30`".to_owned()),
    }
}

/// `--shard I/N`: a part, from 1, and the number of parts.
pub fn share(text: &str) -> Result<(usize, usize), String> {
    let expected = "expected I/N, for example `1/4` for the first of four parts";
    let (part, parts) = text.split_once('/').ok_or(expected)?;
    let number = |text: &str| text.trim().parse::<usize>().map_err(|_| expected.to_owned());
    let (part, parts) = (number(part)?, number(parts)?);
    if (1..=parts).contains(&part) { Ok((part, parts)) } else { Err(format!("there is no part {part} of {parts}: {expected}")) }
}

/// `--budget 16ms`: milliseconds; also `0.1s` and `60fps`.
pub fn milliseconds(text: &str) -> Result<f64, String> {
    let expected = "expected a time above 0, for example `16ms`, `0.5s` or `60fps`";
    let text = text.trim();
    let split = text.find(|c: char| c.is_alphabetic()).ok_or(expected)?;
    let value: f64 = text[..split].trim().parse().map_err(|_| expected.to_owned())?;
    let milliseconds = match &text[split..] {
        "ms" => value,
        "s" => 1e3 * value,
        "fps" => 1e3 / value,
        _ => return Err(expected.to_owned()),
    };
    if milliseconds.is_finite() && milliseconds > 0.0 { Ok(milliseconds) } else { Err(expected.to_owned()) }
}

/// `--error 0.1`: at least 0.
pub fn error(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("expected an error of at least 0, for example `0.1` for 10 % of the mean".to_owned()),
    }
}

/// `--interval 5min`: a time above zero in seconds; s, min or h.
pub fn duration(text: &str) -> Result<f64, String> {
    let expected = "expected a time above 0, for example `90s`, `5min` or `24h`";
    let text = text.trim();
    let split = text.find(|c: char| c.is_alphabetic()).ok_or(expected)?;
    let value: f64 = text[..split].trim().parse().map_err(|_| expected.to_owned())?;
    let seconds = match &text[split..] {
        "s" => value,
        "min" => 60.0 * value,
        "h" => 3600.0 * value,
        _ => return Err(expected.to_owned()),
    };
    if seconds.is_finite() && seconds > 0.0 { Ok(seconds) } else { Err(expected.to_owned()) }
}

/// `--variance 0.986`: above 0, at most 1.
pub fn share_of_one(text: &str) -> Result<f64, String> {
    let found = text.trim().parse::<f64>().ok().filter(|value| *value > 0.0 && *value <= 1.0);
    found.ok_or_else(|| "expected a share above 0, at most 1, for example `0.986`".to_owned())
}

/// A finite number.
pub fn finite(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("expected a number, for example `0.5`".to_owned()),
    }
}

/// A finite number above zero.
pub fn positive(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|value| *value > 0.0).ok_or_else(|| "expected a number above 0, for example `0.5`".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("640x360"), Ok((640, 360)));
        assert_eq!(size("16384X1"), Ok((16384, 1)));
        for wrong in ["0x0", "0x1", "1x0", "16385x1", "1x99999999999999999999999", "-1x1", "640", "x", "axb", "", "1x2x3", "1.5x2"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
        assert!(size("0x0").expect_err("empty picture").contains("between 1 and 16384"));
    }

    #[test]
    fn assignments() {
        assert_eq!(assignment("clusters=128"), Ok(("clusters".into(), "128".into())));
        assert_eq!(assignment("map.window = 64"), Ok(("map.window".into(), "64".into())));
        for wrong in ["clusters", "=1", "clusters=", " = ", ""] {
            assert!(assignment(wrong).expect_err("malformed").contains("NAME=VALUE"), "{wrong}");
        }
    }

    #[test]
    fn dumps() {
        assert_eq!(dump("ism=a=b.exr"), Ok(("ism".into(), "a=b.exr".into())));
        for wrong in ["ism", "=x.exr", "ism="] {
            assert!(dump(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn shares() {
        assert_eq!(share("1/1"), Ok((1, 1)));
        assert_eq!(share("2 / 3"), Ok((2, 3)));
        for wrong in ["0/2", "3/2", "1/0", "1", "a/b", "", "-1/2"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn budgets() {
        assert_eq!(milliseconds("16ms"), Ok(16.0));
        assert_eq!(milliseconds("0.5 s"), Ok(500.0));
        assert_eq!(milliseconds("50fps"), Ok(20.0));
        for wrong in ["16", "0ms", "-1s", "0fps", "ms", "16 minutes", "1e999s", ""] {
            assert!(milliseconds(wrong).is_err(), "{wrong}");
        }
        assert!(error("0.1") == Ok(0.1) && error("-0.1").is_err() && error("NaN").is_err());
    }

    #[test]
    fn durations() {
        assert_eq!((duration("90s"), duration("5 min"), duration("24h")), (Ok(90.0), Ok(300.0), Ok(86_400.0)));
        for wrong in ["5", "0min", "-1h", "min", "5 minutes", "1e999s", ""] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
        assert!(share_of_one("1") == Ok(1.0) && share_of_one("0").is_err() && share_of_one("1.1").is_err() && share_of_one("x").is_err());
    }

    #[test]
    fn numbers() {
        assert_eq!(seconds("-1.5"), Ok(-1.5));
        assert!(seconds("NaN").is_err() && seconds("inf").is_err() && seconds("soon").is_err());
        assert!(finite("-0.5") == Ok(-0.5) && finite("NaN").is_err() && finite("1e99").is_err());
        assert!(positive("0.5") == Ok(0.5) && positive("0").is_err());
        assert!(rate("0").is_err() && rate("-30").is_err() && rate("30").is_ok());
    }
}
