//! An image signal processor that a network imitates, behind the interface of every ISP and with a gradient.

use burn::prelude::*;
use burn::tensor::TensorData;
use burn::tensor::ops::PadMode;
use petzval_base::parameter::Scale;
use petzval_camera::isp::{
    DifferentiableIsp, Isp, IspError, IspParameter, RawInput, RgbPicture, developed_without_gradient,
};
use petzval_camera::sensor::Colour;

use crate::network::IspProxy;

/// Bits of its pictures.
const BITS: u32 = 16;

/// How many numbers the network receives for each frame besides the parameters of the ISP: the strengths of shot noise and read noise.
pub const FRAME_NUMBERS: usize = 2;

/// The network sees small distances from the middle of its training this many times larger, because most of them are small, and large
/// ones as their logarithms.
const MAGNIFICATION: f32 = 15.0;

/// Light less than this share of that on the axis is amplified no further.
pub const LEAST_SHADE: f32 = 0.05;

/// A network in place of an ISP.
///
/// Only the parameters that varied while the network was trained may be changed; all others must keep the values that they had in training.
#[derive(Clone, Debug)]
pub struct ProxyIsp {
    name: String,
    parameters: Vec<IspParameter>,
    varied: Vec<usize>,
    fixed: Vec<f64>,
    /// The network.
    pub network: IspProxy,
}

impl ProxyIsp {
    /// A proxy of an ISP in its parameters at the places `varied`; the others keep the values of `fixed`, which holds one for each.
    /// The network takes `varied.len() + FRAME_NUMBERS` parameters.
    pub fn new(of: &dyn Isp, varied: Vec<usize>, fixed: Vec<f64>, network: IspProxy) -> Self {
        Self { name: format!("proxy of {}", of.name()), parameters: of.parameters(), varied, fixed, network }
    }

    /// The parameters that may vary.
    pub fn varied(&self) -> impl Iterator<Item = &IspParameter> {
        self.varied.iter().map(|i| &self.parameters[*i])
    }

    /// Where the varied ones among the values of all parameters lie in their ranges, 0..1.
    pub fn places(&self, values: &[f64]) -> Vec<f64> {
        self.varied.iter().map(|i| self.parameters[*i].about.unit_of(values[*i])).collect()
    }

    /// The values of all parameters from the places of the varied ones: the inverse of [`ProxyIsp::places`].
    pub fn values(&self, places: &[f64]) -> Vec<f64> {
        let mut values = self.fixed.clone();
        for (i, place) in self.varied.iter().zip(places) {
            values[*i] = self.parameters[*i].about.value_at(*place);
        }
        values
    }

    /// Develops frames of one size on the tape.
    ///
    /// Each comes with its [linear digital numbers](RawInput::linear_dn) `[1, 1, height, width]`, which may have a gradient. `places`:
    /// `[frames, varied parameters]`, in their ranges, 0..1. Returns sRGB-encoded pictures `[frames, 3, height, width]`, about 0..1.
    pub fn develop_batch(
        &self,
        frames: Vec<(Tensor<4>, &RawInput)>,
        places: Tensor<2>,
    ) -> Result<Tensor<4>, IspError> {
        let device = places.device();
        let row = |values: Vec<f32>, rows: usize| {
            let shape = [rows, values.len() / rows];
            Tensor::<2>::from_data(TensorData::new(values, shape), &device)
        };
        // The inputs of the network besides the light: the parameters, and the strength of the noise.
        let centre = row(self.places(&self.fixed).iter().map(|place| *place as f32).collect(), 1);
        let far = (places - centre) * MAGNIFICATION;
        let area_sine = (far.clone() + (far.square() + 1.0).sqrt()).log();
        let noise = row(frames.iter().flat_map(|(_, frame)| noise_of(frame)).collect(), frames.len());

        let shapes: Vec<_> =
            frames.iter().map(|(_, frame)| (red_of(frame), frame.height, frame.width)).collect();
        let light =
            frames.into_iter().map(|(dn, frame)| balanced_light(dn, frame)).collect::<Result<_, _>>()?;
        let pictures = self.network.forward(Tensor::cat(light, 0), Tensor::cat(vec![area_sine, noise], 1));
        let own = |(i, ((down, right), height, width)): (usize, ((usize, usize), usize, usize))| {
            pictures.clone().slice([i..i + 1, 0..3, down..down + height, right..right + width])
        };
        Ok(Tensor::cat(shapes.into_iter().enumerate().map(own).collect(), 0))
    }

    /// Where the varied ones among the values of all parameters lie in their ranges, on the tape: `[1, varied parameters]`.
    pub fn places_on_tape(&self, values: &Tensor<1>) -> Tensor<2> {
        let place = |i: &usize| {
            let about = &self.parameters[*i].about;
            let value = values.clone().narrow(0, *i, 1);
            match about.scale {
                Scale::Linear => (value - about.min) / (about.max - about.min),
                Scale::Log => (value / about.min).log() / (about.max / about.min).ln(),
            }
        };
        Tensor::cat(self.varied.iter().map(place).collect(), 0).unsqueeze()
    }

    fn check_fixed(&self, values: &[f64]) -> Result<(), IspError> {
        for (i, p) in self.parameters.iter().enumerate() {
            let off = (p.about.unit_of(values[i]) - p.about.unit_of(self.fixed[i])).abs();
            if off > 1e-5 && !self.varied.contains(&i) {
                let (name, value, only) = (p.name.clone(), values[i], self.fixed[i]);
                return Err(IspError::Parameter { name, value, min: only, max: only });
            }
        }
        Ok(())
    }
}

impl Isp for ProxyIsp {
    fn name(&self) -> &str {
        &self.name
    }

    fn parameters(&self) -> Vec<IspParameter> {
        self.parameters.clone()
    }

    fn develop(&self, frame: &RawInput, values: &[f64]) -> Result<RgbPicture, IspError> {
        petzval_camera::isp::check_values(&self.parameters, values)?;
        developed_without_gradient(self, frame, values, BITS)
    }
}

impl DifferentiableIsp for ProxyIsp {
    fn develop_on_tape(
        &self,
        dn: Tensor<4>,
        frame: &RawInput,
        values: Tensor<1>,
    ) -> Result<Tensor<4>, IspError> {
        let host: Vec<f32> = (values.clone().detach().into_data().try_to_vec())
            .map_err(|e| IspError::External(format!("{e:?}")))?;
        if host.len() != self.parameters.len() {
            return Err(IspError::Count { expected: self.parameters.len(), got: host.len() });
        }
        self.check_fixed(&host.into_iter().map(f64::from).collect::<Vec<_>>())?;
        self.develop_batch(vec![(dn, frame)], self.places_on_tape(&values))
    }
}

/// The strengths of shot noise and read noise of a frame as inputs of the network, each about 0..1: the logarithms of the variances,
/// over 16 and 32 powers of two.
fn noise_of(frame: &RawInput) -> [f32; FRAME_NUMBERS] {
    let place =
        |variance: f64, powers: f64| (1.0 + variance.max(1e-30).log2() / powers).clamp(-1.0, 2.0) as f32;
    [place(frame.about.noise.shot, 16.0), place(frame.about.noise.read, 32.0)]
}

/// Light of a raw frame as the network takes it: 1 is white in every colour, and the shading of the lens is corrected.
///
/// Digital numbers `[1, 1, height, width]`, expanded if the frame is companded, become `[1, 4, height / 2 + 1, width / 2 + 1]`: red, green in
/// the rows of red, green in the rows of blue, and blue. The frame is extended by two rows and columns that mirror its outermost pixels, so
/// that every cell begins with red, whatever the array: the frame's first pixel lies at [`red_of`].
fn balanced_light(dn: Tensor<4>, frame: &RawInput) -> Result<Tensor<4>, IspError> {
    frame.validate()?;
    let (height, width, about) = (frame.height, frame.width, &frame.about);
    // How much light one digital number stands for, pixel by pixel.
    let per_dn = 1.0 / (about.white_dn - about.black_dn) as f32;
    let mut factors = Vec::with_capacity(height * width);
    for row in 0..height {
        for col in 0..width {
            let plane = frame.cfa.colour(row, col).plane().unwrap_or(1);
            let shade = about.shading.as_ref().map_or(1.0, |m| m.at(plane, (row, col), (height, width)));
            factors.push(per_dn / about.response[plane] as f32 / shade.max(LEAST_SHADE));
        }
    }
    let factors = Tensor::from_data(TensorData::new(factors, [1, 1, height, width]), &dn.device());
    let light = (dn - about.black_dn as f32) * factors;

    // Let every cell begin with red, and collect its pixels.
    let (down, right) = red_of(frame);
    let (height, width) = (height + 2, width + 2);
    let cells = light
        .pad([(down, 2 - down), (right, 2 - right)], PadMode::Reflect)
        .reshape([1, height / 2, 2, width / 2, 2])
        .permute([0, 2, 4, 1, 3]);
    Ok(cells.reshape([1, 4, height / 2, width / 2]))
}

/// Row and column of the first red pixel, 0 or 1 each.
fn red_of(frame: &RawInput) -> (usize, usize) {
    let place = (0..4).find(|place| frame.cfa.colour(place / 2, place % 2) == Colour::Red).unwrap_or(0);
    (place / 2, place % 2)
}

#[cfg(test)]
mod tests {
    use petzval_camera::isp::HardwareIsp;
    use petzval_camera::sensor::CfaPattern;

    use super::*;
    use crate::network::IspProxyConfig;

    fn frame(cfa: CfaPattern) -> RawInput {
        let (height, width) = (16, 20);
        let dn = (0..height * width).map(|i| 300 + (i * 37 % 900) as u32).collect();
        let about = petzval_camera::isp::FrameData {
            black_dn: 200.0,
            white_dn: 1200.0,
            response: [0.8, 1.0, 1.25],
            saturation: 3.0,
            noise: petzval_camera::isp::NoiseProfile { shot: 1e-4, read: 1e-6 },
            gain_ev: 0.0,
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: None,
        };
        RawInput { height, width, dn, bits: 12, cfa, about }
    }

    fn proxy(varied: Vec<usize>, device: &Device) -> ProxyIsp {
        let config = IspProxyConfig {
            parameters: varied.len() + FRAME_NUMBERS,
            base_channels: 8,
            levels: 2,
            ..Default::default()
        };
        let of = HardwareIsp::default();
        ProxyIsp::new(&of, varied, of.defaults(), config.init(3, device).unwrap())
    }

    #[test]
    fn light_is_balanced_and_ordered_by_colour_whatever_the_array() {
        let device = Device::flex();
        for cfa in ["RGGB", "GRBG", "GBRG", "BGGR"].map(|name| name.parse::<CfaPattern>().unwrap()) {
            let frame = frame(cfa);
            let dn = TensorData::new(frame.linear_dn(), [1, 1, frame.height, frame.width]);
            let light = balanced_light(Tensor::from_data(dn, &device), &frame).unwrap();
            let light: Vec<f32> = light.into_data().try_to_vec().unwrap();
            let (rows, columns) = (frame.height / 2 + 1, frame.width / 2 + 1);
            let (down, right) = red_of(&frame);
            for row in 0..frame.height {
                for col in 0..frame.width {
                    let colour = cfa.colour(row, col);
                    let red_row = cfa.colour(row, col + 1) == Colour::Red;
                    let plane = match colour {
                        Colour::Red => 0,
                        Colour::Blue => 3,
                        _ if red_row => 1,
                        _ => 2,
                    };
                    let response = frame.about.response[colour.plane().unwrap()];
                    let expected = (f64::from(frame.dn[row * frame.width + col]) - 200.0) / 1000.0 / response;
                    let got = light[(plane * rows + (row + down) / 2) * columns + (col + right) / 2];
                    assert!((f64::from(got) - expected).abs() < 1e-5, "{cfa} {row} {col}");
                }
            }
        }
    }

    #[test]
    fn frames_of_different_arrays_are_developed_together_as_alone() {
        let device = Device::flex();
        let of = HardwareIsp::default();
        let proxy = proxy(vec![0, 1], &device);
        let frames = ["RGGB", "GBRG"].map(|name| frame(name.parse().unwrap()));
        let dn = |frame: &RawInput| {
            let dn = TensorData::new(frame.linear_dn(), [1, 1, frame.height, frame.width]);
            Tensor::<4>::from_data(dn, &device)
        };
        let places: Vec<f32> = proxy.places(&of.defaults()).iter().map(|v| *v as f32).collect();
        let places =
            Tensor::<2>::from_data(TensorData::new([places.clone(), places].concat(), [2, 2]), &device);
        let both = frames.iter().map(|frame| (dn(frame), frame)).collect();
        let both: Vec<f32> = proxy.develop_batch(both, places).unwrap().into_data().try_to_vec().unwrap();
        let pixels = 3 * frames[0].height * frames[0].width;
        for (frame, picture) in frames.iter().zip(both.chunks(pixels)) {
            let alone = proxy.develop(frame, &of.defaults()).unwrap().encoded();
            assert!(alone.iter().zip(picture).all(|(a, b)| (a - b.clamp(0.0, 1.0)).abs() < 1e-4));
        }
    }

    #[test]
    fn only_varied_parameters_may_differ_and_values_come_back() {
        let device = Device::flex();
        let of = HardwareIsp::default();
        let at = |name: &str| of.parameters().iter().position(|p| p.name == name).unwrap();
        let proxy = proxy(vec![at("sharpen.amount"), at("gamma.exponent")], &device);
        let frame = frame("RGGB".parse().unwrap());
        let mut values = of.defaults();
        values[at("sharpen.amount")] = 1.5;
        let picture = proxy.develop(&frame, &values).unwrap();
        assert_eq!((picture.height, picture.width, picture.bits), (16, 20, 16));
        let back = proxy.values(&proxy.places(&values));
        assert!(back.iter().zip(&values).all(|(a, b)| (a - b).abs() < 1e-9));
        values[at("luma_denoise.strength")] = 0.9;
        let message = proxy.develop(&frame, &values).unwrap_err().to_string();
        assert!(message.contains("luma_denoise.strength"), "{message}");
    }

    #[test]
    fn the_noise_of_a_frame_is_an_input_of_the_network() {
        let mut noisy = frame("RGGB".parse().unwrap());
        let quiet = noise_of(&noisy);
        noisy.about.noise.shot = 1.0 / 500.0;
        assert!(noise_of(&noisy)[0] > quiet[0] + 0.1 && quiet[0] > 0.0);
    }
}
