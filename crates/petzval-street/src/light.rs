//! Time of day, the colours of signal lamps, and lamps that light the street.

use crate::colour::{Rgb, scaled};
use crate::vector::Vec3;

/// The time of day.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Light {
    /// Sun and sky, or an overcast sky: 8,000 to 110,000 lx on level ground.
    Day,
    /// Sky after sunset: 10 to 100 lx.
    Dusk,
    /// Street lamps (5 to 30 lx below them), shop windows and head lamps.
    Night,
}

/// The colours of the three signal lamps in the channels of the camera.
///
/// Each triple has unit luminance: a lamp of luminance L in cd/m^2 gives L times its triple, where a white surface of luminance L
/// gives L in every channel. The filters of a sensor decide the triples, so a caller with a sensor supplies them.
///
/// The default is for channels of linear sRGB. It comes from the CIE 1931 colour matching functions at the dominant wavelengths
/// 625, 590 and 505 nm, (0.7514, 0.3210, 0.0001), (1.0263, 0.7570, 0.0011) and (0.0024, 0.4073, 0.2123), times the matrix of
/// IEC 61966-2-1. All three lie outside the gamut: negative channels are set to zero, and the triple is scaled back to unit
/// luminance.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LampColours {
    /// Red, about 625 nm.
    pub red: [f32; 3],
    /// Yellow, about 590 nm.
    pub yellow: [f32; 3],
    /// Green, about 505 nm.
    pub green: [f32; 3],
}

impl Default for LampColours {
    fn default() -> Self {
        let red = in_srgb([0.7514, 0.3210, 0.0001]);
        let yellow = in_srgb([1.0263, 0.7570, 0.0011]);
        let green = in_srgb([0.0024, 0.4073, 0.2123]);
        Self { red, yellow, green }
    }
}

/// Linear sRGB of unit luminance of a colour (X, Y, Z), with negative channels set to zero.
fn in_srgb([x, y, z]: [f32; 3]) -> Rgb {
    let rgb = [
        3.2406 * x - 1.5372 * y - 0.4986 * z,
        -0.9689 * x + 1.8758 * y + 0.0415 * z,
        0.0557 * x - 0.2040 * y + 1.0570 * z,
    ]
    .map(|channel| channel.max(0.0));
    let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
    scaled(rgb, 1.0 / luminance)
}

/// What a signal shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LampState {
    /// The red lamp is on.
    Red,
    /// The yellow lamp is on.
    Yellow,
    /// The green lamp is on.
    Green,
    /// All lamps are dark.
    Off,
}

/// A lamp that lights its surroundings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointLight {
    pub position: Vec3,
    /// Unit direction of the beam.
    pub beam: Vec3,
    /// Luminous intensity along the beam, cd per channel.
    pub intensity_cd: Rgb,
    /// The intensity falls with the angle from the beam as its cosine to this power.
    pub power: i32,
    /// Whether the beam is cut off above the lamp, as that of a dipped head lamp is.
    pub dipped: bool,
    /// Where its light has faded to nothing, m; this keeps the lists of lamps short without an edge.
    pub reach_m: f64,
}

impl PointLight {
    /// Illuminance in lx of a surface at a point with a unit normal: `I cos^n(angle) cos(incidence) / d^2`.
    #[inline]
    pub fn illuminance_lx(&self, point: Vec3, normal: Vec3) -> Rgb {
        let to = self.position - point;
        // A lamp is no point: its size of 0.2 m bounds the illuminance close to it.
        let square = to.dot(to) + 0.04;
        let faded = 1.0 - square / (self.reach_m * self.reach_m);
        if faded <= 0.0 {
            return [0.0; 3];
        }
        // Most lamps of a list give nothing: find out before the root.
        let (facing, ahead) = (normal.dot(to), -self.beam.dot(to));
        let narrow = self.power > 8 && ahead * ahead < 0.75 * square;
        if facing <= 0.0 || ahead <= 0.0 || narrow {
            return [0.0; 3];
        }
        let inverse = 1.0 / square.sqrt();
        let (incidence, along) = (facing * inverse, ahead * inverse);
        // Above its cut-off a dipped lamp keeps a few percent; the edge is a quarter of a degree wide on each side.
        let kept =
            if self.dipped { 0.03 + 0.97 * ((to.y * inverse + 0.004) / 0.008).clamp(0.0, 1.0) } else { 1.0 };
        scaled(self.intensity_cd, (along.powi(self.power) * incidence * kept * faded * faded / square) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::vec3;

    #[test]
    fn default_lamps_have_unit_luminance_and_their_colours() {
        let LampColours { red, yellow, green } = LampColours::default();
        for rgb in [red, yellow, green] {
            assert!((0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] - 1.0).abs() < 1e-6);
            assert!(rgb.iter().all(|channel| *channel >= 0.0));
        }
        assert!(red[0] > 4.0 && red[1] == 0.0);
        assert!(yellow[0] > 2.0 && yellow[1] > 0.4 && yellow[2] == 0.0);
        assert!(green[0] == 0.0 && green[1] > 1.2 && green[2] > 0.1);
    }

    #[test]
    fn light_falls_with_the_square_of_the_distance() {
        let down = vec3(0.0, -1.0, 0.0);
        let lamp = PointLight {
            position: vec3(0.0, 10.0, 0.0),
            beam: down,
            intensity_cd: [1000.0; 3],
            power: 2,
            dipped: false,
            reach_m: 1000.0,
        };
        let [below, ..] = lamp.illuminance_lx(vec3(0.0, 0.0, 0.0), -down);
        let [near, ..] = lamp.illuminance_lx(vec3(0.0, 5.0, 0.0), -down);
        assert!((below - 10.0).abs() < 0.05 && (near / below - 4.0).abs() < 0.05);
        assert_eq!(lamp.illuminance_lx(vec3(0.0, 11.0, 0.0), down), [0.0; 3]);
    }
}
