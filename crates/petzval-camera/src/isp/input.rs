//! What an image signal processor receives with a frame: the mosaic, and what is known about sensor and lens.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::IspError;
use crate::develop::Electrons;
use crate::develop::{dark_mean_dn, white_capacity_e};
use crate::image::LinearImage;
use crate::sensor::{CfaPattern, Colour, Exposure, Raw, SensorError, SensorModel};
use crate::spectral::Matrix3;

/// Range of the bits of a raw pixel.
pub const BITS: std::ops::RangeInclusive<u32> = 8..=24;

/// A raw frame of a Bayer array as it comes out of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct RawInput {
    /// Rows, even, at least 16.
    pub height: usize,
    /// Columns, even, at least 16.
    pub width: usize,
    /// Digital numbers, row by row, below `2^bits`.
    pub dn: Vec<u32>,
    /// Bits of a digital number, 8 to 24.
    pub bits: u32,
    /// The array, as it starts at the first pixel of the frame.
    pub cfa: CfaPattern,
    /// What is known about it.
    pub about: FrameData,
}

/// What is known about a frame: the calibration of the camera that took it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameData {
    /// Digital number of the dark, after expansion if the frame is companded.
    pub black_dn: f64,
    /// Digital number of white light in a green pixel, after expansion.
    pub white_dn: f64,
    /// Answers of red, green and blue pixels to white light, relative to green.
    pub response: [f64; 3],
    /// Light, 1 = white, at which the first colour saturates under white light.
    pub saturation: f64,
    /// Noise of a green pixel.
    pub noise: NoiseProfile,
    /// Analog gain of the sensor, stops above its lowest.
    pub gain_ev: f64,
    /// Linear sRGB from white-balanced colours of the camera; none leaves the camera's own.
    #[serde(default)]
    pub colour_matrix: Option<Matrix3>,
    /// Expansion of companded digital numbers; none where they are linear in light.
    #[serde(default)]
    pub companding: Option<Companding>,
    /// How much light the lens takes away at each place.
    #[serde(default)]
    pub shading: Option<Mesh>,
    /// Where to fetch each pixel of a picture without distortion.
    #[serde(default)]
    pub warp: Option<Mesh>,
}

/// Variance of light, 1 = white: `shot * light + read`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseProfile {
    /// Variance for each unit of light: one over the electrons of white.
    pub shot: f64,
    /// Variance in the dark.
    pub read: f64,
}

/// Values at the nodes of a regular grid over the frame, whose outermost nodes lie on the outermost pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// Nodes from top to bottom.
    pub rows: usize,
    /// Nodes from left to right.
    pub cols: usize,
    /// One grid after the other: three relative illuminations (red, green, blue) of a shading mesh, or two displacements (rows,
    /// columns; pixels) of a warp.
    pub planes: Vec<Vec<f32>>,
}

impl Mesh {
    /// Bilinear value of a plane at a pixel of a frame of `height` x `width`.
    pub fn at(&self, plane: usize, (row, col): (usize, usize), (height, width): (usize, usize)) -> f32 {
        let place = |at: usize, len: usize, nodes: usize| {
            let x = at as f32 / (len.max(2) - 1) as f32 * (nodes - 1) as f32;
            let lo = (x as usize).min(nodes.max(2) - 2);
            (lo, x - lo as f32)
        };
        let ((r, y), (c, x)) = (place(row, height, self.rows), place(col, width, self.cols));
        let v =
            |r: usize, c: usize| self.planes[plane][r.min(self.rows - 1) * self.cols + c.min(self.cols - 1)];
        (1.0 - y) * ((1.0 - x) * v(r, c) + x * v(r, c + 1))
            + y * ((1.0 - x) * v(r + 1, c) + x * v(r + 1, c + 1))
    }

    /// The mesh of a picture, sampled at its nodes: of a map of the relative illumination, for instance.
    pub fn of_picture(picture: &LinearImage, rows: usize, cols: usize) -> Self {
        let at = |k: usize, nodes: usize, len: usize| (k * (len - 1) + (nodes - 1) / 2) / (nodes - 1).max(1);
        let plane = |c: usize| {
            let node = |i: usize| {
                picture.get(c, at(i / cols, rows, picture.height), at(i % cols, cols, picture.width))
            };
            (0..rows * cols).map(node).collect()
        };
        Self { rows, cols, planes: (0..picture.channels).map(plane).collect() }
    }

    /// Whether the mesh has so many planes, each with a finite value for every node.
    pub fn is_whole(&self, planes: usize) -> bool {
        let size = self.rows.saturating_mul(self.cols);
        self.rows >= 2
            && self.cols >= 2
            && self.planes.len() == planes
            && self.planes.iter().all(|p| p.len() == size && p.iter().all(|v| v.is_finite()))
    }
}

/// Piecewise linear compression of digital numbers, as sensors with a high dynamic range send them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Companding {
    /// Companded digital numbers of the knots, ascending from 0.
    pub companded_dn: Vec<u32>,
    /// Digital numbers proportional to light, ascending from 0, below 2^24.
    pub linear_dn: Vec<u32>,
}

impl Companding {
    /// The expanded digital number; beyond the last knot, that of the last.
    pub fn expand(&self, dn: u32) -> u32 {
        between_knots(&self.companded_dn, &self.linear_dn, dn)
    }

    /// The companded digital number of a linear one: what the sensor sends.
    pub fn compress(&self, linear: u32) -> u32 {
        between_knots(&self.linear_dn, &self.companded_dn, linear)
    }

    fn is_whole(&self) -> bool {
        let ascends = |v: &[u32]| v.first() == Some(&0) && v.windows(2).all(|p| p[0] < p[1]);
        self.companded_dn.len() == self.linear_dn.len()
            && self.linear_dn.len() >= 2
            && ascends(&self.companded_dn)
            && ascends(&self.linear_dn)
            && self.linear_dn[self.linear_dn.len() - 1] < 1 << 24
    }
}

/// The value at `at` of the curve through the knots `[x, y]`, rounded; beyond its ends that of the end.
fn between_knots(x: &[u32], y: &[u32], at: u32) -> u32 {
    let k = x.partition_point(|knot| *knot <= at);
    if k == 0 || k == x.len() {
        return y[k.saturating_sub(1)];
    }
    let (run, rise) = (u64::from(x[k] - x[k - 1]), u64::from(y[k] - y[k - 1]));
    y[k - 1] + ((u64::from(at - x[k - 1]) * rise + run / 2) / run) as u32
}

impl NoiseProfile {
    /// The noise of green pixels of a sensor at an exposure (EMVA 1288, equation of the photon transfer).
    pub fn of_sensor(sensor: &SensorModel, exposure: &Exposure) -> Self {
        let white_e = f64::from(exposure.white_e) * sensor.response(Colour::Green).iter().sum::<f64>();
        Self { shot: 1.0 / white_e, read: Electrons::of_sensor(sensor, exposure).dark / white_e.powi(2) }
    }
}

impl FrameData {
    /// What the model of a sensor says about frames at an exposure: levels, answers to white, noise. Lens and colours stay open.
    pub fn of_sensor(sensor: &SensorModel, exposure: &Exposure) -> Result<Self, SensorError> {
        sensor.validate()?;
        exposure.validate()?;
        let response = |colour: Colour| sensor.response(colour).iter().sum::<f64>();
        let green = response(Colour::Green);
        let black_dn = dark_mean_dn(sensor, exposure);
        let dn_per_e = sensor.gain_dn_per_e * f64::from(exposure.linear_gain);
        let white_e = f64::from(exposure.white_e);
        let capacity_e = white_capacity_e(sensor, exposure.time_s.into(), exposure.linear_gain.into())?;
        Ok(Self {
            black_dn,
            white_dn: black_dn + dn_per_e * white_e * green,
            response: [Colour::Red, Colour::Green, Colour::Blue].map(|c| response(c) / green),
            saturation: capacity_e / white_e,
            noise: NoiseProfile::of_sensor(sensor, exposure),
            gain_ev: f64::from(exposure.linear_gain).log2(),
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: None,
        })
    }
}

impl RawInput {
    /// A simulated frame of a sensor.
    pub fn from_raw(raw: &Raw, sensor: &SensorModel) -> Result<Self, SensorError> {
        let highest = (1_u64 << sensor.bits) as f32 - 1.0;
        Ok(Self {
            height: raw.height,
            width: raw.width,
            dn: raw.dn.iter().map(|v| v.round().clamp(0.0, highest) as u32).collect(),
            bits: sensor.bits.max(*BITS.start()),
            cfa: sensor.cfa.starting_at(raw.capture.placement.row, raw.capture.placement.col),
            about: FrameData::of_sensor(sensor, &raw.capture.exposure)?,
        })
    }

    /// Digital numbers proportional to light: expanded if the frame is companded.
    pub fn linear_dn(&self) -> Vec<f32> {
        let companding = self.about.companding.as_ref();
        self.dn.iter().map(|dn| companding.map_or(*dn, |c| c.expand(*dn)) as f32).collect()
    }

    /// Checks shape, values and calibration, so that no stage needs to.
    pub fn validate(&self) -> Result<(), IspError> {
        let bad =
            |what: &'static str, got: String, need: &'static str| Err(IspError::Input { what, got, need });
        let Self { height, width, about, .. } = self;
        if height % 2 != 0 || width % 2 != 0 || *height < 16 || *width < 16 {
            let need = "even in rows and columns, and at least 16 x 16";
            return bad("size of the frame", format!("{width} x {height}"), need);
        }
        if self.dn.len() != height * width {
            return bad("number of pixels", self.dn.len().to_string(), "height x width");
        }
        if !self.cfa.is_bayer() {
            return bad("colour filter array", self.cfa.to_string(), "RGGB, GRBG, GBRG or BGGR");
        }
        if !BITS.contains(&self.bits) {
            return bad("bits of a pixel", self.bits.to_string(), "8 to 24");
        }
        if let Some(dn) = self.dn.iter().find(|dn| **dn >> self.bits != 0) {
            return bad("a digital number", dn.to_string(), "below 2^bits");
        }
        let levels = [
            about.black_dn,
            about.white_dn - about.black_dn,
            about.saturation,
            about.noise.shot,
            about.noise.read,
        ];
        if !levels.iter().all(|v| v.is_finite() && *v >= 0.0) || levels[1] < 1.0 || levels[2] <= 0.0 {
            let need = "black below white, saturation above 0, noise not negative";
            return bad("calibration", format!("{levels:?}"), need);
        }
        if !about.response.iter().all(|v| (0.01..=100.0).contains(v)) || !about.gain_ev.is_finite() {
            let need = "0.01 to 100, relative to green";
            return bad("response to white", format!("{:?}", about.response), need);
        }
        if about.companding.as_ref().is_some_and(|c| !c.is_whole()) {
            let need = "two ascending lists of equal length from 0, below 2^24";
            return bad("companding", "its knots".to_owned(), need);
        }
        if about.shading.as_ref().is_some_and(|m| !m.is_whole(3)) {
            return bad("shading mesh", "its planes".to_owned(), "three planes of rows x cols finite values");
        }
        if about.warp.as_ref().is_some_and(|m| !m.is_whole(2)) {
            return bad("warp mesh", "its planes".to_owned(), "two planes of rows x cols finite values");
        }
        Ok(())
    }
}
