//! Coefficients and light of a frame that the registers of the automotive ISP cut off.
//!
//! Calibration and parameters together give each coefficient, such as `gain / response` of the white balance. The fixed-point form cuts it
//! off at the end of its register, as a chip does; the floating-point form does not.

use std::fmt;

use super::fixed::{GAIN, LINEAR, WEIGHT};
use super::{FrameData, HardwareIsp, RawInput};
use crate::sensor::Colour;

/// Share of a frame's pixels that may be brighter than the registers hold: lamps and reflections.
const BRIGHT_SHARE: f64 = 1e-3;

/// A coefficient, or light, that its register cuts off. [`Display`](fmt::Display) names the value, what fits, and the effect, on one
/// line that follows `its`.
#[derive(Clone, Debug, PartialEq)]
pub enum Clipped {
    /// A gain of the white balance.
    Gain {
        /// The colour.
        colour: Colour,
        /// The gain that calibration and parameters give.
        value: f64,
        /// The largest that fits.
        largest: f64,
    },
    /// A number of the colour matrix: the one furthest beyond its register.
    Matrix {
        /// Its row, from 0.
        row: usize,
        /// Its column, from 0.
        col: usize,
        /// Its value.
        value: f64,
        /// The nearest that fits.
        nearest: f64,
        /// Red, green and blue of white by the whole matrix.
        white: [f64; 3],
        /// Red, green and blue of white by the matrix in the registers.
        clipped_white: [f64; 3],
    },
    /// A displacement of the dewarp: the largest.
    Warp {
        /// Its size by rows or by columns, pixels.
        value_px: f64,
        /// The largest that fits, pixels.
        largest_px: f64,
    },
    /// The light of many pixels.
    Light {
        /// Share of the pixels, 0..1.
        share: f64,
        /// The brightest that fits, 1 = white.
        largest: f64,
    },
}

impl fmt::Display for Clipped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gain { colour, value, largest } => write!(
                f,
                "white balance multiplies {} by {value:.2}, and the registers of the automotive ISP hold {largest:.2} at most: {0} is too dark by a factor of {:.2}; check the answer to white, `response` of a calibration or `relative_qe` of a sensor",
                colour.name(),
                value / largest
            ),
            Self::Matrix { row, col, value, nearest, white, clipped_white } => {
                let [r, g, b] = clipped_white;
                let [wanted_r, wanted_g, wanted_b] = white;
                write!(
                    f,
                    "colour matrix has {value:.2} at row {}, column {}, and the nearest that the registers of the automotive ISP hold is {nearest:.2}: \
                     all colours are wrong, and white is {r:.2}, {g:.2}, {b:.2} in place of {wanted_r:.2}, {wanted_g:.2}, {wanted_b:.2}; \
                     develop without `colour_matrix`, or with one of smaller numbers",
                    row + 1,
                    col + 1
                )
            }
            Self::Warp { value_px, largest_px } => write!(
                f,
                "dewarp moves pixels by up to {value_px:.0}, and the registers of the automotive ISP hold {largest_px:.0} at most: distortion remains there; check `warp` in the calibration"
            ),
            Self::Light { share, largest } => write!(
                f,
                "light is more than {largest:.0} times white in {:.1} % of the pixels: the registers of the automotive ISP hold no more, and these pixels become \
                 equally bright; a higher `--white-dn` keeps them apart",
                100.0 * share
            ),
        }
    }
}

impl HardwareIsp {
    /// The coefficients that the registers cut off if a frame with this calibration is developed with the settings' own numbers; the worst
    /// of each kind. Cuts by less than a step of a register do not count.
    pub fn clipped(&self, about: &FrameData) -> Vec<Clipped> {
        let gains = self.clipped_gain(about);
        gains.into_iter().chain(self.clipped_matrix(about)).chain(self.clipped_warp(about)).collect()
    }

    /// The light of a frame that the registers cut off, if it is that of more than a thousandth of the pixels.
    pub fn clipped_light(frame: &RawInput) -> Option<Clipped> {
        let about = &frame.about;
        let largest = LINEAR.value(LINEAR.max);
        let most_dn = about.black_dn + largest * (about.white_dn - about.black_dn);
        let light_dn = |dn: u32| about.companding.as_ref().map_or(dn, |companding| companding.expand(dn));
        let brighter = frame.dn.iter().filter(|dn| f64::from(light_dn(**dn)) > most_dn).count();
        let share = brighter as f64 / frame.dn.len().max(1) as f64;
        (share > BRIGHT_SHARE).then_some(Clipped::Light { share, largest })
    }

    fn clipped_gain(&self, about: &FrameData) -> Option<Clipped> {
        let gains = [Colour::Red, Colour::Green, Colour::Blue]
            .into_iter()
            .zip(self.settings.white_balance.gains(about));
        let (colour, value) = gains.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        GAIN.cuts(value).then(|| Clipped::Gain { colour, value, largest: GAIN.nearest(value) })
    }

    fn clipped_matrix(&self, about: &FrameData) -> Option<Clipped> {
        let matrix = self.settings.colours.matrix(about.colour_matrix);
        let places = (0..9).map(|i| (i / 3, i % 3));
        let excess = |(row, col): (usize, usize)| {
            let value: f64 = matrix[row][col];
            (value - WEIGHT.nearest(value)).abs()
        };
        let (row, col) = places.max_by(|a, b| excess(*a).total_cmp(&excess(*b)))?;
        let value = matrix[row][col];
        WEIGHT.cuts(value).then(|| Clipped::Matrix {
            row,
            col,
            value,
            nearest: WEIGHT.nearest(value),
            white: matrix.map(|row| row.iter().sum()),
            clipped_white: matrix.map(|row| row.iter().map(|v| WEIGHT.nearest(*v)).sum()),
        })
    }

    fn clipped_warp(&self, about: &FrameData) -> Option<Clipped> {
        let (value_px, largest_px) = self.settings.dewarp.furthest_px(about.warp.as_ref());
        (value_px > largest_px).then_some(Clipped::Warp { value_px, largest_px })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isp::{IspSettings, Mesh, NoiseProfile};
    use crate::sensor::CfaPattern;

    fn about() -> FrameData {
        FrameData {
            black_dn: 64.0,
            white_dn: 1000.0,
            response: [0.5, 1.0, 0.7],
            saturation: 1.0,
            noise: NoiseProfile { shot: 1e-4, read: 1e-7 },
            gain_ev: 0.0,
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: None,
        }
    }

    /// A matrix that keeps gray.
    fn neutral(diagonal: f64) -> Option<[[f64; 3]; 3]> {
        let beside = 0.5 * (1.0 - diagonal);
        let at = |row: usize, col: usize| if row == col { diagonal } else { beside };
        Some([0, 1, 2].map(|row| [0, 1, 2].map(|col| at(row, col))))
    }

    #[test]
    fn coefficients_that_fit_are_not_named() {
        let isp = HardwareIsp::default();
        let edge = FrameData {
            response: [1.0 / 16.0, 1.0, 1.0],
            colour_matrix: neutral(8.0),
            warp: Some(Mesh { rows: 2, cols: 2, planes: vec![vec![-1023.0; 4]; 2] }),
            ..about()
        };
        for about in [about(), edge] {
            assert!(isp.clipped(&about).is_empty(), "{about:?}");
        }
    }

    #[test]
    fn a_matrix_beyond_its_registers_is_named_with_what_becomes_of_white() {
        let isp = HardwareIsp::default();
        let found = isp.clipped(&FrameData { colour_matrix: neutral(8.5), ..about() });
        let [clipped @ Clipped::Matrix { value, clipped_white, .. }] = &found[..] else {
            panic!("{found:?}")
        };
        assert!((value - 8.5).abs() < 1e-9, "{value}");
        assert!(clipped_white.iter().all(|v| (v - 0.5).abs() < 1e-3), "{clipped_white:?}");
        let said = clipped.to_string();
        assert!(said.contains("has 8.50 at row") && said.contains("hold is 8.00"), "{said}");
        assert!(said.contains("white is 0.50, 0.50, 0.50 in place of 1.00, 1.00, 1.00"), "{said}");

        // Parameters alone can leave the registers, too.
        let mut settings = IspSettings::default();
        settings.colours.mixing = [-2.0, -2.0, 0.0, 0.0, 0.0, 0.0];
        settings.colours.saturation = 2.0;
        let found = HardwareIsp { settings }.clipped(&about());
        assert!(matches!(found[..], [Clipped::Matrix { row: 0, col: 0, .. }]), "{found:?}");
    }

    #[test]
    fn a_gain_beyond_its_register_is_named_with_its_colour() {
        let mut isp = HardwareIsp::default();
        let faint = FrameData { response: [0.02, 1.0, 0.7], ..about() };
        let said: Vec<String> = isp.clipped(&faint).iter().map(Clipped::to_string).collect();
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].contains("multiplies red by 50.00") && said[0].contains("hold 16.00"), "{said:?}");
        assert!(said[0].contains("red is too dark by a factor of 3.13"), "{said:?}");
        // The parameter counts with the calibration.
        isp.settings.white_balance.red = 0.25;
        assert!(isp.clipped(&faint).is_empty());
    }

    #[test]
    fn light_of_many_pixels_beyond_its_register_is_named() {
        let frame = |bright: usize| {
            let mut dn = vec![200; 64 * 64];
            dn[..bright].fill(1700);
            let about = FrameData { black_dn: 0.0, white_dn: 100.0, ..about() };
            RawInput { height: 64, width: 64, dn, bits: 12, cfa: CfaPattern::RGGB, about }
        };
        let found = HardwareIsp::clipped_light(&frame(41)).unwrap();
        assert_eq!(found, Clipped::Light { share: 41.0 / 4096.0, largest: LINEAR.value(LINEAR.max) });
        assert!(
            found.to_string().starts_with("light is more than 16 times white in 1.0 % of the pixels"),
            "{found}"
        );
        // A lamp of four pixels is no mistake, and white can be chosen.
        assert_eq!(HardwareIsp::clipped_light(&frame(4)), None);
        let mut chosen = frame(41);
        chosen.about.white_dn = 110.0;
        assert_eq!(HardwareIsp::clipped_light(&chosen), None);
    }

    #[test]
    fn a_displacement_beyond_its_register_is_named() {
        let mut isp = HardwareIsp::default();
        let planes = vec![vec![0.0; 4], vec![0.0, 0.0, 0.0, -1500.0]];
        let moved = FrameData { warp: Some(Mesh { rows: 2, cols: 2, planes }), ..about() };
        let found = isp.clipped(&moved);
        assert!(matches!(found[..], [Clipped::Warp { .. }]), "{found:?}");
        assert!(found[0].to_string().contains("by up to 1500,"), "{}", found[0]);
        isp.settings.dewarp.strength = 0.5;
        assert!(isp.clipped(&moved).is_empty());
    }
}
