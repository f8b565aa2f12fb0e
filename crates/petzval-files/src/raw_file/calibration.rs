//! The calibration of a frame: what an image signal processor may know of it beside its digital numbers.
//!
//! A TOML file that the key `calibration` of a sidecar names. Its keys are those of [`FrameData`], each of which may be missing.

use petzval_camera::isp::{FrameData, Mesh, NoiseProfile};
use petzval_camera::spectral::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::info::BlackLevels;

/// The black level at a gain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlackAtGain {
    /// Linear gain, 1 = the sensor's system gain.
    pub linear_gain: f64,
    /// Black level, DN: one, or one for each pixel of the tile of the mosaic, row by row.
    pub black_dn: BlackLevels,
}

/// What is known of a frame; the rest is none, which TOML leaves out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameCalibration {
    /// Digital number of the dark, after expansion if the frame is companded.
    pub black_dn: Option<f64>,
    /// Black levels by gain, gains ascending: that of the frame's own `linear_gain` lies between those of the nearest two.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub black_at_gain: Vec<BlackAtGain>,
    /// Digital number of white light in a green pixel, after expansion.
    pub white_dn: Option<f64>,
    /// Answers of red, green and blue pixels to white light, relative to green.
    pub response: Option<[f64; 3]>,
    /// Light, 1 = white, at which the first colour saturates under white light.
    pub saturation: Option<f64>,
    /// Analog gain of the sensor, stops above its lowest.
    pub gain_ev: Option<f64>,
    /// Linear sRGB from white-balanced colours of the camera.
    #[schemars(with = "Option<[[f64; 3]; 3]>")]
    pub colour_matrix: Option<Matrix3>,
    /// Noise of a green pixel, as variances of light: `shot` for each unit of light, `read` in the dark.
    #[schemars(with = "Option<std::collections::BTreeMap<String, f64>>")]
    pub noise: Option<NoiseProfile>,
    /// How much light the lens takes away at each place: `rows` and `cols` of nodes, and `planes` with relative illuminations of red, green and blue.
    /// The outermost nodes lie on the centres of the outermost pixels; the values of a plane stand row by row.
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub shading: Option<Mesh>,
    /// Where to fetch each pixel of a picture without distortion: `rows` and `cols` of nodes, and `planes` with displacements of rows and columns in pixels.
    #[schemars(with = "Option<std::collections::BTreeMap<String, serde_json::Value>>")]
    pub warp: Option<Mesh>,
}

impl FrameCalibration {
    /// All that a simulation knows of a frame.
    pub fn of(about: &FrameData) -> Self {
        Self {
            black_dn: Some(about.black_dn),
            black_at_gain: Vec::new(),
            white_dn: Some(about.white_dn),
            response: Some(about.response),
            saturation: Some(about.saturation),
            gain_ev: Some(about.gain_ev),
            colour_matrix: about.colour_matrix,
            noise: Some(about.noise),
            shading: about.shading.clone(),
            warp: about.warp.clone(),
        }
    }

    /// Black levels at a gain: those of the table, on a line between its nearest two gains and constant beyond its ends. None without a table.
    pub fn black_at(&self, linear_gain: f64) -> Option<Vec<f64>> {
        let table = &self.black_at_gain;
        let next = table.partition_point(|at| at.linear_gain <= linear_gain);
        let high = table.get(next.min(table.len().checked_sub(1)?))?;
        let low = &table[next.saturating_sub(1)];
        let width = high.linear_gain - low.linear_gain;
        let share = if width > 0.0 { ((linear_gain - low.linear_gain) / width).clamp(0.0, 1.0) } else { 0.0 };
        let levels = low.black_dn.each_dn().iter().zip(high.black_dn.each_dn());
        Some(levels.map(|(a, b)| a + share * (b - a)).collect())
    }

    /// What is known of a frame otherwise, with the values of the calibration in place of it.
    pub fn over(self, about: FrameData) -> FrameData {
        FrameData {
            black_dn: self.black_dn.unwrap_or(about.black_dn),
            white_dn: self.white_dn.unwrap_or(about.white_dn),
            response: self.response.unwrap_or(about.response),
            saturation: self.saturation.unwrap_or(about.saturation),
            noise: self.noise.unwrap_or(about.noise),
            gain_ev: self.gain_ev.unwrap_or(about.gain_ev),
            colour_matrix: self.colour_matrix.or(about.colour_matrix),
            shading: self.shading.or(about.shading),
            warp: self.warp.or(about.warp),
            companding: about.companding,
        }
    }

    /// The text of the file.
    pub fn to_toml(&self) -> String {
        // A table of numbers is always TOML.
        toml::to_string(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calibration() -> FrameCalibration {
        let mesh = |planes: usize| Mesh {
            rows: 2,
            cols: 3,
            planes: (0..planes).map(|p| (1..7).map(|i| i as f32 / (7.0 + p as f32)).collect()).collect(),
        };
        FrameCalibration {
            black_dn: Some(119.000_1),
            black_at_gain: Vec::new(),
            white_dn: Some(2360.2),
            response: Some([0.5, 1.0, 2.0 / 3.0]),
            saturation: Some(1.4),
            gain_ev: Some(-0.5),
            colour_matrix: Some([[1.5, -0.5, 0.0], [0.0, 1.0, 0.0], [0.1, 0.0, 0.9]]),
            noise: Some(NoiseProfile { shot: 1e-4, read: 1e-7 }),
            shading: Some(mesh(3)),
            warp: Some(mesh(2)),
        }
    }

    #[test]
    fn every_bit_is_kept_and_what_is_missing_stays_as_it_is() {
        let calibration = calibration();
        let text = calibration.to_toml();
        assert_eq!(FrameCalibration::from_toml(&text).unwrap(), calibration, "{text}");
        let about = calibration.clone().over(FrameCalibration::default().over(FrameData {
            black_dn: 1.0,
            white_dn: 2.0,
            response: [1.0; 3],
            saturation: 1.0,
            noise: NoiseProfile { shot: 0.0, read: 0.0 },
            gain_ev: 0.0,
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: None,
        }));
        assert_eq!(FrameCalibration::of(&about), calibration);
        let own = FrameCalibration { warp: calibration.warp.clone(), ..FrameCalibration::default() };
        assert_eq!(own.over(about.clone()), about);
    }

    #[test]
    fn black_levels_follow_the_gain() {
        let table = "[[black_at_gain]]\nlinear_gain = 1.0\nblack_dn = [60, 62, 62, 64]\n\
                     [[black_at_gain]]\nlinear_gain = 4.0\nblack_dn = [66, 62, 62, 64]\n";
        let calibration = FrameCalibration::from_toml(table).unwrap();
        assert_eq!(calibration.black_at(0.5), Some(vec![60.0, 62.0, 62.0, 64.0]));
        assert_eq!(calibration.black_at(2.0), Some(vec![62.0, 62.0, 62.0, 64.0]));
        assert_eq!(calibration.black_at(8.0), Some(vec![66.0, 62.0, 62.0, 64.0]));
        assert_eq!(FrameCalibration::default().black_at(1.0), None);
        for (from, to) in [("gain = 4.0", "gain = 0.5"), ("[66, 62, 62, 64]", "66"), ("[60,", "[-1,")] {
            let error = FrameCalibration::from_toml(&table.replace(from, to)).unwrap_err();
            assert!(error.key.starts_with("black_at_gain"), "{error}");
        }
    }

    #[test]
    fn a_wrong_number_is_quoted_with_what_it_must_be() {
        let text = calibration().to_toml();
        for (from, to, said) in [
            (
                "white_dn = 2360.2",
                "white_dn = 50.0",
                "`white_dn = 50.0`: must be a number above the black level, `black_dn = 119.0001`",
            ),
            ("black_dn = 119.0001", "black_dn = -1.0", "`black_dn = -1.0`: must be a number of 0 or more"),
            ("response = [0.5", "response = [0.0", "red is 0, and must lie between 0.01 and 100"),
            (
                "response = [0.5, 1.0, 0.6666666666666666]",
                "response = [50.0, 100.0, 70.0]",
                "green is 100, and must be 1: relative to green they are [0.5000, 1.0, 0.7000]; are they in percent?",
            ),
            (
                "[[1.5, -0.5, 0.0]",
                "[[0.0, 0.0, 0.0]",
                "`colour_matrix`: row 1 has the sum 0: the red of white becomes",
            ),
            (
                "[0.0, 1.0, 0.0]",
                "[0.0, 100.0, 0.0]",
                "row 2 has the sum 100: the green of white becomes so many times as bright; is it in percent?",
            ),
            ("shot = 0.0001", "shot = -0.0001", "`noise`: `shot = -0.0001` is no variance"),
            ("[1.5, -0.5, 0.0]", "[1.5, inf, 0.0]", "the number at row 1, column 2 is inf"),
            (
                "[shading]\nrows = 2",
                "[shading]\nrows = 3",
                "`shading`: plane 1 has 6 numbers for 3 x 3 nodes",
            ),
            ("[warp]\nrows = 2", "[warp]\nrows = 1", "`warp`: a mesh of 1 x 3 nodes, and the least is 2 x 2"),
        ] {
            let changed = text.replace(from, to);
            assert_ne!(changed, text, "{from}\n{text}");
            let error = FrameCalibration::from_toml(&changed).unwrap_err().to_string();
            assert!(error.contains(said) && error.contains("hint"), "{said}: {error}");
        }
        let fault = |text: &str| FrameCalibration::from_toml(text).unwrap_err().to_string();
        let dark = "[shading]\nrows = 2\ncols = 2\nplanes = [[1, 1, 1, 1], [1, 1, 1, 0], [1, 1, 1, 1]]\n";
        assert!(
            fault(dark).contains("plane 2 has 0 at row 2, column 2, and must be above 0"),
            "{}",
            fault(dark)
        );
        let percent = dark.replace("1, 0]", "1, 1]").replace("[[1, 1, 1, 1]", "[[81.5, 100, 99, 80]");
        let said = fault(&percent);
        assert!(
            said.contains("plane 1 has 81.5 at row 1, column 1, and 1 is all light; is it in percent?"),
            "{said}"
        );
        for brighter in ["1, 1.2]", "1, 2.5]"] {
            assert!(FrameCalibration::from_toml(&dark.replace("1, 0]", brighter)).is_ok(), "{brighter}");
        }
        let absolute = fault("response = [0.2, 0.5, 0.4]\n");
        assert!(
            absolute.contains("they are [0.4000, 1.0, 0.8000]") && !absolute.contains("percent"),
            "{absolute}"
        );
        let both = "black_dn = 3.0\n[[black_at_gain]]\nlinear_gain = 1.0\nblack_dn = 60\n";
        assert!(fault(both).contains("stands beside `black_dn = 3`"), "{}", fault(both));
    }

    #[test]
    fn what_is_no_calibration_is_refused_with_its_key() {
        let text = calibration().to_toml();
        for (from, to, key) in [
            ("white_dn = 2360.2", "white_dn = 119.5", "white_dn"),
            ("black_dn = 119.0001", "black_dn = -1.0", "black_dn"),
            ("response = [0.5", "response = [0.0", "response"),
            ("saturation = 1.4", "saturation = 0.0", "saturation"),
            ("gain_ev = -0.5", "gain_ev = nan", "gain_ev"),
            ("[1.5, -0.5, 0.0]", "[inf, -0.5, 0.0]", "colour_matrix"),
            ("shot = 0.0001", "shot = -0.0001", "noise"),
            ("[shading]\nrows = 2", "[shading]\nrows = 3", "shading"),
            ("[warp]\nrows = 2", "[warp]\nrows = 1", "warp"),
            ("saturation", "saturated", "saturated"),
        ] {
            let changed = text.replace(from, to);
            assert_ne!(changed, text, "{from}\n{text}");
            let error = FrameCalibration::from_toml(&changed).unwrap_err();
            assert_eq!(error.key, key, "{error}");
            assert!(error.hint.is_some() && error.line.is_some(), "{error}");
        }
    }
}
