//! Presets of the built-in ISP.

use petzval_base::FileError;
use petzval_camera::isp::{IspPreset, IspSettings};
use toml::{Table, Value};

use super::settings::{key_path, stages_toml};

/// Reads a preset and checks every number of it.
pub fn parse_isp_preset(text: &str) -> Result<IspPreset, FileError> {
    let preset: IspPreset = FileError::read_toml(text)?;
    let parameters = IspSettings::parameters();
    if ![8, 10, 16].contains(&preset.settings.bits) {
        let error = FileError::at_key(text, &["settings", "bits"], "must be 8, 10 or 16");
        return Err(error.hint("8 is that of displays"));
    }
    for (parameter, value) in parameters.iter().zip(preset.settings.values()) {
        let about = &parameter.about;
        if !(about.min..=about.max).contains(&value) {
            let (stage, key) = key_path(&parameter.name);
            let message = format!("must lie between {} and {}", about.min, about.max);
            return Err(FileError::at_key(text, &["settings", stage, key], message).hint(about.hint));
        }
    }
    for (i, knot) in preset.knot.iter().enumerate() {
        let place = i.to_string();
        if !knot.gain_ev.is_finite() {
            let error = FileError::at_key(text, &["knot", &place, "gain_ev"], "is no number");
            return Err(error.hint("stops above the lowest gain of the sensor"));
        }
        for (name, value) in &knot.set {
            let wrong = |message: String, hint: &str| {
                Err(FileError::at_key(text, &["knot", &place, "set", name], message).hint(hint))
            };
            let Some(parameter) = parameters.iter().find(|p| p.name == *name) else {
                let distance =
                    |p: &&petzval_camera::isp::IspParameter| strsim::damerau_levenshtein(&p.name, name);
                let near = parameters.iter().min_by_key(distance).map_or("", |p| &p.name);
                let hint = format!("did you mean \"{near}\"?");
                return wrong("the ISP has no such parameter".to_owned(), &hint);
            };
            let about = &parameter.about;
            if !(about.min..=about.max).contains(value) {
                return wrong(format!("must lie between {} and {}", about.min, about.max), about.hint);
            }
        }
    }
    Ok(preset)
}

/// The text of a preset with every number, each below its sentence, and without knots. `about` says what it is for.
pub fn preset_toml(about: &str, settings: &IspSettings) -> String {
    // IspSettings serialises to a table. Its top-level strings and integers are the methods (demosaic, domain, bits).
    let all = Table::try_from(settings).unwrap_or_default();
    let methods: Table = all.into_iter().filter(|(_, value)| !value.is_table()).collect();
    let methods = toml::to_string(&methods).unwrap_or_default();
    let stages = stages_toml(&IspSettings::parameters(), &settings.values());
    format!("about = {}\n\n[settings]\n{methods}{stages}", Value::from(about))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_presets_read() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/isp");
        for name in ["real-time", "quality", "automotive", "low-light"] {
            let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
            let preset = parse_isp_preset(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!(preset.about.ends_with('.'), "{name}");
            for gain_ev in [0.0, 1.5, 4.0, 20.0] {
                preset.at_gain(gain_ev).unwrap();
            }
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let parameters = IspSettings::parameters();
        let values: Vec<f64> =
            parameters.iter().enumerate().map(|(i, p)| p.about.value_at(i as f64 / 60.0)).collect();
        let settings = IspSettings { bits: 16, ..IspSettings::default() }.with_values(&values).unwrap();
        let text = preset_toml("A \"test\".", &settings);
        let read = parse_isp_preset(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!((read.about.as_str(), read.knot.len()), ("A \"test\".", 0));
        assert_eq!(read.settings.bits, 16);
        for ((p, a), b) in parameters.iter().zip(read.settings.values()).zip(settings.values()) {
            assert!((a - b).abs() <= 1e-6 * b.abs(), "{}: {a} {b}", p.name);
        }
        assert!(parameters.iter().all(|p| text.contains(&p.about.sentence.replace(['\n', '\r'], " "))));
    }

    #[test]
    fn errors_name_line_key_and_hint() {
        for (text, line, key, says) in [
            ("[settings.gain]\nev = 99.0", Some(2), "ev", ""),
            ("[settings.sharpen]\namount = 99.0", Some(2), "amount", "between"),
            ("[settings.sharpen]\namonut = 1.0", Some(2), "amonut", "amount"),
            ("[settings]\nbits = 9", Some(2), "bits", "8, 10 or 16"),
            ("[settings]\ndemosaic = \"menno\"", Some(2), "demosaic", "menon"),
            (
                "[[knot]]\ngain_ev = 0.0\n[knot.set]\n\"sharpen.amonut\" = 1.0",
                Some(4),
                "sharpen.amonut",
                "sharpen.amount",
            ),
            (
                "[[knot]]\ngain_ev = 0.0\n[knot.set]\n\"sharpen.amount\" = 99.0",
                Some(4),
                "sharpen.amount",
                "between",
            ),
            ("[[knot]]\ngain_ev = nan\nset = {}", Some(2), "gain_ev", "no number"),
        ] {
            let error = parse_isp_preset(text).unwrap_err();
            assert_eq!((error.line, error.key.as_str()), (line, key), "{error}");
            assert!(error.to_string().contains(says), "{error}");
        }
    }
}
