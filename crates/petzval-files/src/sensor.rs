//! Sensor files: the TOML form of a [`SensorModel`].

use petzval_base::FileError;
use petzval_camera::sensor::{NonUniformity, SensorModel};

/// Reads a sensor file and checks that every number is in its physical range.
pub fn parse_sensor(text: &str) -> Result<SensorModel, FileError> {
    let sensor: SensorModel = FileError::read_toml(text).map_err(|e| all_missing(text, in_its_table(e)))?;
    sensor.validate().map_err(|wrong| {
        let path: Vec<&str> = wrong.key.split('.').collect();
        FileError::at_key(text, &path, wrong.to_string()).hint(format!("give {}", wrong.meaning))
    })?;
    Ok(sensor)
}

/// The keys that a sensor file must have, with an example and what it is.
const NEEDED: [(&str, &str, &str); 15] = [
    ("name", "\"my sensor\"", "any text"),
    ("height", "1200", "rows"),
    ("width", "1920", "columns"),
    ("pixel_um", "5.86", "pixel pitch, um"),
    ("bits", "12", "of the converter, 1 to 16"),
    ("black_level_dn", "64.0", "DN without light, read noise and electronics"),
    ("gain_dn_per_e", "0.25", "system gain K, DN per electron"),
    ("full_well_e", "10000.0", "full well capacity, electrons"),
    ("dark_current_e_per_s", "5.0", "electrons per second; 0 for none"),
    ("read_noise_mean_e", "0.0", "electrons; usually 0"),
    ("read_noise_e", "2.5", "standard deviation, electrons"),
    ("electronics_mean_dn", "0.0", "DN; usually 0"),
    (
        "electronics_noise_dn",
        "0.0",
        "standard deviation behind the gain, DN; 0 if it is a part of the read noise",
    ),
    (
        "relative_qe",
        "[0.8, 1.0, 0.9]",
        "red, green and blue relative to green; [1.0, 1.0, 1.0] without filters",
    ),
    ("cfa", "\"RGGB\"", "\"RGGB\", \"GRBG\", \"GBRG\", \"BGGR\", \"mono\", or rows such as \"RG/GB\""),
];

/// An error about a missing key names all that are missing, with what each may be.
fn all_missing(text: &str, error: FileError) -> FileError {
    let Ok(table) = toml::from_str::<toml::Table>(text) else { return error };
    let missing: Vec<&(&str, &str, &str)> =
        NEEDED.iter().filter(|(key, ..)| !table.contains_key(*key)).collect();
    if !error.message.ends_with("is missing") || !missing.iter().any(|(key, ..)| *key == error.key) {
        return error;
    }
    let keys: Vec<String> = missing.iter().map(|(key, ..)| format!("`{key}`")).collect();
    let message = match &keys[..] {
        [one] => format!("the key {one} is missing"),
        several => format!("{} keys are missing: {}", several.len(), several.join(", ")),
    };
    let lines: Vec<String> =
        missing.iter().map(|(key, example, is)| format!("{key} = {example}   # {is}")).collect();
    let hint = format!("add, for example:\n{}", lines.join("\n"));
    FileError { message, ..error }.hint(hint)
}

/// Adds a hint to the error of a misplaced key that belongs to `[nonuniformity]`.
fn in_its_table(error: FileError) -> FileError {
    let known = toml::Table::try_from(NonUniformity::default()).unwrap_or_default();
    if known.contains_key(&error.key) && error.message.starts_with("no such key") {
        let hint = format!("`{}` belongs below a line `[nonuniformity]`", error.key);
        error.hint(hint)
    } else {
        error
    }
}

#[cfg(test)]
mod tests {
    use petzval_camera::sensor::Electronics;

    use super::*;

    const FITTED: &str = include_str!("../../petzval-data/data/sensors/imx249-fitted.toml");
    const CALIBRATED: &str = include_str!("../../petzval-data/data/sensors/imx249-calibrated.toml");

    #[test]
    fn the_shipped_sensors_read() {
        let fitted = parse_sensor(FITTED).unwrap();
        assert_eq!((fitted.gain_dn_per_e, fitted.max_dn(), fitted.read_noise_e), (0.14, 4095.0, 4.0));
        let calibrated = parse_sensor(CALIBRATED).unwrap();
        assert_eq!(calibrated.gain_dn_per_e, 0.122);
        assert_eq!(
            SensorModel {
                gain_dn_per_e: 0.14,
                name: fitted.name.clone(),
                source: fitted.source.clone(),
                ..calibrated
            },
            fitted
        );
    }

    #[test]
    fn writing_and_reading_a_sensor_gives_an_equal_sensor() {
        let sensor = parse_sensor(FITTED).unwrap();
        assert_eq!(parse_sensor(&toml::to_string(&sensor).unwrap()).unwrap(), sensor);
    }

    #[test]
    fn efficiencies_are_relative_to_green_in_whatever_unit_they_are_stated() {
        let with = |qe: &str| parse_sensor(&FITTED.replace("[0.82, 1.0, 1.25]", qe));
        for (stated, wanted) in [
            ("[0.82, 1.0, 1.25]", [0.82, 1.0, 1.25]),
            ("[0.4, 0.5, 0.45]", [0.8, 1.0, 0.9]),
            ("[80, 100, 90]", [0.8, 1.0, 0.9]),
        ] {
            let sensor = with(stated).unwrap();
            assert_eq!(sensor.relative_qe, wanted, "{stated}");
            assert_eq!(parse_sensor(&toml::to_string(&sensor).unwrap()).unwrap(), sensor);
        }
        for impossible in ["[0.4, 0.0, 0.4]", "[0.4, -0.5, 0.4]", "[1.0, nan, 1.0]", "[0.0001, 1.0, 1.0]"] {
            let error = with(impossible).unwrap_err();
            assert_eq!(error.key, "relative_qe", "{impossible}: {error}");
        }
    }

    #[test]
    fn errors_carry_line_key_value_and_hint() {
        let error = |from: &str, to: &str| parse_sensor(&FITTED.replace(from, to)).unwrap_err();
        let line = |key: &str| FITTED.lines().position(|l| l.starts_with(key)).map(|i| i as u32 + 1);

        let range = error("bits = 12", "bits = 40");
        assert_eq!((range.line, range.key.as_str()), (line("bits"), "bits"));
        assert!(range.value.contains("40") && range.hint.is_some());

        let unknown = error("bits = 12", "bitts = 12");
        assert_eq!((unknown.line, unknown.key.as_str()), (line("bits"), "bitts"));
        assert!(unknown.to_string().contains("`bits`"), "{unknown}");

        let missing = error("bits = 12", "");
        assert_eq!((missing.key.as_str(), missing.message.as_str()), ("bits", "the key `bits` is missing"));
        let hint = missing.hint.unwrap();
        assert_eq!(hint.lines().nth(1), Some("bits = 12   # of the converter, 1 to 16"), "{hint}");
        // All missing keys are named at once, and the examples of the hint make a sensor.
        let bare = parse_sensor("height = 100\n").unwrap_err();
        assert!(bare.message.starts_with("14 keys are missing: `name`, `width`, "), "{bare}");
        let hint = bare.hint.unwrap();
        let lines: Vec<&str> = hint.lines().skip(1).collect();
        let sensor = parse_sensor(&format!("height = 100\n{}\n", lines.join("\n"))).unwrap();
        assert_eq!((sensor.source.as_str(), sensor.electronics), ("", Electronics::BeforeAdc));
        // A key that is missing elsewhere is no key of the sensor.
        let curve = parse_sensor(&format!("{FITTED}[quantum_efficiency]\n")).unwrap_err();
        assert!(!curve.message.contains("keys are missing"), "{curve}");

        let kind = error("bits = 12", "bits = \"twelve\"");
        assert_eq!((kind.line, kind.key.as_str()), (line("bits"), "bits"));
        assert!(kind.to_string().contains("twelve"), "{kind}");

        let syntax = error("bits = 12", "bits = = 12");
        assert_eq!(syntax.line, line("bits"));
        assert!(error("0.14", "nan").to_string().contains("gain_dn_per_e"));
        assert!(error("RGGB", "RGX").to_string().contains("RGGB"));
    }

    #[test]
    fn errors_of_non_uniformity_gains_and_clear_pixels_carry_their_line() {
        let uneven = format!(
            "{FITTED}clear_response = [0.3, 0.4, 0.3]\ngain_steps = [1.0, 2.0]\n[nonuniformity]\nspecimen = 3\n\
             dsnu_pixel_e = 2.0\nhot_pixel_share = 0.01\n"
        );
        let sensor = parse_sensor(&uneven).unwrap();
        assert_eq!((sensor.gain_steps.len(), sensor.nonuniformity.specimen), (2, 3));
        assert_eq!(parse_sensor(&toml::to_string(&sensor).unwrap()).unwrap(), sensor);
        for (from, to, key) in [
            ("dsnu_pixel_e = 2.0", "dsnu_pixel_e = -2.0", "dsnu_pixel_e"),
            ("hot_pixel_share = 0.01", "hot_pixel_share = 1.5", "hot_pixel_share"),
            ("hot_pixel_share = 0.01", "prnu_row_percent = nan", "prnu_row_percent"),
            ("[1.0, 2.0]", "[1.0, 0.0]", "gain_steps"),
            ("[0.3, 0.4, 0.3]", "[0.3, -0.4, 0.3]", "clear_response"),
            ("[0.3, 0.4, 0.3]", "[0.0, 0.0, 0.0]", "clear_response"),
            ("dsnu_pixel_e = 2.0", "dsnu_pixels_e = 2.0", "dsnu_pixels_e"),
            ("hot_pixel_share = 0.01", "prnu_pixel = 1.0", "prnu_pixel"),
            ("gain_steps = ", "prnu_pixel_percent = 1.0\ngain_steps = ", "prnu_pixel_percent"),
        ] {
            let text = uneven.replace(from, to);
            let error = parse_sensor(&text).unwrap_err();
            let line = text.lines().position(|l| l.starts_with(key)).map(|i| i as u32 + 1);
            assert_eq!((error.line, error.key.as_str()), (line, key), "{error}");
            let says = match key {
                "prnu_pixel" => "did you mean `prnu_pixel_percent`?",
                "prnu_pixel_percent" => "belongs below a line `[nonuniformity]`",
                _ => continue,
            };
            assert_eq!(error.hint.as_deref().map(|hint| hint.contains(says)), Some(true), "{error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(line in 0usize..24, text in "\\PC{0,40}", newline in proptest::bool::ANY) {
            let mut lines: Vec<&str> = FITTED.lines().collect();
            let at = line.min(lines.len() - 1);
            if newline { lines.insert(at, &text) } else { lines[at] = &text }
            let _ = parse_sensor(&lines.join("\n"));
            let _ = parse_sensor(&text);
        }
    }
}
