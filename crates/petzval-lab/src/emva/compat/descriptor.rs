//! `EMVA1288descriptor.txt`: the list of captures of the EMVA 1288 Python library.
//!
//! One record a line: `v` version, `n` bits, width and height, `b` exposure time (ns) and photons per pixel of a flat
//! point, `d` exposure time (ns) of a dark one, `i` a frame of the point before. `#` begins a comment, paths may have
//! either separator. The format has one gain and no colour filters.

use std::path::Path;

use petzval_base::FileError;

use crate::emva::captures::{Captures, DESCRIPTOR, Kind, Point, SensorFacts};
use petzval_camera::sensor::CfaPattern;

/// Reads the text of a descriptor in `folder`.
pub fn parse(text: &str, folder: &Path) -> Result<Captures, FileError> {
    let mut points: Vec<Point> = Vec::new();
    let mut format: Option<(u32, usize, usize)> = None;
    for (i, whole) in text.lines().enumerate() {
        let line = i as u32 + 1;
        let record = whole.trim();
        if record.is_empty() || record.starts_with('#') {
            continue;
        }
        let wrong = |message: &str, hint: &str| FileError::at_line(line, record, message).hint(hint);
        let (letter, rest) = record.split_once(char::is_whitespace).unwrap_or((record, ""));
        let words: Vec<&str> = rest.split_whitespace().collect();
        let number = |word: &str, what: &str| match word.parse::<f64>() {
            Ok(v) if v.is_finite() && v >= 0.0 => Ok(v),
            _ => Err(wrong(&format!("`{word}` is no {what}"), "give a number, zero or positive")),
        };
        match (letter, &words[..]) {
            ("v", [version]) => {
                if !["3", "3.0", "3.1", "4", "4.0"].contains(version) {
                    return Err(wrong("an unknown version of the descriptor", "versions 3 and 4 are known"));
                }
            }
            ("n", [bits, width, height]) => {
                let bits = bits.parse::<u32>().ok().filter(|b| (1..=16).contains(b));
                let side = |word: &str| word.parse::<usize>().ok().filter(|n| (1..=65536).contains(n));
                let (Some(bits), Some(width), Some(height)) = (bits, side(width), side(height)) else {
                    return Err(wrong("no format of a frame", "write `n BITS WIDTH HEIGHT`, BITS 1 to 16"));
                };
                format = Some((bits, width, height));
            }
            ("b", [time, photons]) => points.push(Point {
                kind: Kind::Flat,
                linear_gain: 1.0,
                exposure_s: 1e-9 * number(time, "exposure time in ns")?,
                photons: Some(number(photons, "number of photons")?),
                black_level_dn: None,
                frames: Vec::new(),
                line,
            }),
            ("d", [time]) => points.push(Point {
                kind: Kind::Dark,
                linear_gain: 1.0,
                exposure_s: 1e-9 * number(time, "exposure time in ns")?,
                photons: Some(0.0),
                black_level_dn: None,
                frames: Vec::new(),
                line,
            }),
            ("i", [_, ..]) => {
                let Some(point) = points.last_mut() else {
                    return Err(wrong("a frame before the first point", "begin a point with `b` or `d`"));
                };
                point.frames.push(folder.join(rest.trim().replace('\\', "/")).into());
            }
            ("v" | "n" | "b" | "d" | "i", _) => {
                let hint = "`v VERSION`, `n BITS WIDTH HEIGHT`, `b NS PHOTONS`, `d NS`, `i FILE`";
                return Err(wrong("a record with the wrong number of words", hint));
            }
            _ => return Err(wrong("an unknown record", "records begin with v, n, b, d or i")),
        }
    }
    let Some((bits, width, height)) = format else {
        return Err(FileError::at_line(0, "", "no record `n`").hint("write `n BITS WIDTH HEIGHT`"));
    };
    Ok(Captures {
        folder: folder.to_owned(),
        list: folder.join(DESCRIPTOR),
        sensor: SensorFacts {
            name: folder.file_name().map_or_else(|| "sensor".into(), |n| n.to_string_lossy().into_owned()),
            bits,
            pixel_um: None,
            cfa: CfaPattern::MONO,
            black_level_dn: None,
            full_well_e: None,
            f_number: None,
            wavelength_um: None,
            temperature_c: None,
        },
        size: Some((height, width)),
        points,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_read_and_wrong_ones_are_reported() {
        let good = "v 4.0\nn 12 128 96\n# comment\nb 2500000.0 4062.396\ni images\\a.png\ni images\\b.png\nd 2500000.0\n";
        let captures = parse(good, Path::new("x")).unwrap();
        assert_eq!((captures.sensor.bits, captures.size), (12, Some((96, 128))));
        assert_eq!(captures.points[0].frames[1].path, Path::new("x/images/b.png"));
        assert_eq!((captures.points[1].kind, captures.points[1].exposure_s), (Kind::Dark, 0.0025));
        for (text, line, says) in [
            ("v 4.0\nn 12 128", 2, "wrong number of words"),
            ("n 40 128 96", 1, "format"),
            ("n 12 8 8\ni a.png", 2, "before the first point"),
            ("n 12 8 8\nb x 1", 2, "exposure time"),
            ("v 9", 1, "version"),
            ("q 9", 1, "unknown record"),
        ] {
            let error = parse(text, Path::new("")).unwrap_err();
            assert!(error.line == Some(line) && error.to_string().contains(says), "{error}");
        }
        assert!(parse("v 4.0", Path::new("")).unwrap_err().to_string().contains("record `n`"));
    }
}
