//! The shortest ISP: black level, white balance, exposure, bilinear demosaicing, display curve.

use petzval_base::parameter::{ParameterTable, Parameters};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::isp::{Isp, IspError, IspParameter, RawInput, RgbPicture, check_values};
use petzval_camera::{Placement, develop};

petzval_base::parameters! {
    /// Gains of the light.
    pub struct Gain {
        /// Factor of all colours.
        exposure: f64 = 1.0, "", 0.0625..16.0, Log, "1 leaves the light as it is";
        /// Factor of red beyond that of white light.
        red: f64 = 1.0, "", 0.25..4.0, Log, "1 leaves white light white";
        /// Factor of blue beyond that of white light.
        blue: f64 = 1.0, "", 0.25..4.0, Log, "1 leaves white light white";
    }
}

petzval_base::parameters! {
    /// The display curve.
    pub struct Tone {
        /// Exponent of the curve, beside that of sRGB: 1 is sRGB, more is brighter.
        gamma: f64 = 1.0, "", 0.5..2.0, Log, "1 is sRGB";
    }
}

/// An ISP of four numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlainIsp;

fn parameters_of(stage: &str, table: ParameterTable) -> Vec<IspParameter> {
    let named = |about: petzval_base::parameter::Parameter| IspParameter {
        name: format!("{stage}.{}", about.name),
        about,
    };
    table.parameters.into_iter().map(named).collect()
}

impl PlainIsp {
    /// The picture after each stage, with the name of the stage.
    pub fn develop_steps(
        &self,
        frame: &RawInput,
        values: &[f64],
    ) -> Result<Vec<(String, RgbPicture)>, IspError> {
        frame.validate()?;
        check_values(&self.parameters(), values)?;
        let about = &frame.about;
        let range = about.white_dn - about.black_dn;
        let expand = |dn: u32| about.companding.as_ref().map_or(dn, |c| c.expand(dn));
        let light = |gains: [f64; 3]| -> Vec<f32> {
            let one = |i: usize| {
                let colour = frame.cfa.colour(i / frame.width, i % frame.width).plane().unwrap_or(1);
                let light = (f64::from(expand(frame.dn[i])) - about.black_dn) / range;
                // Saturated pixels of the weaker colours would turn pink.
                (light * gains[colour] / about.response[colour]).min(about.saturation * gains[1]) as f32
            };
            (0..frame.dn.len()).map(one).collect()
        };
        let gray = |mosaic: Vec<f32>| {
            let data = mosaic.repeat(CHANNELS);
            encoded(&LinearImage { channels: CHANNELS, height: frame.height, width: frame.width, data }, 1.0)
        };
        let [exposure, red, blue, gamma] = [values[0], values[1], values[2], values[3]];
        let balanced = light([red, 1.0, blue].map(|gain| gain * exposure));
        let colour = develop::demosaic_bilinear(
            &balanced,
            frame.height,
            frame.width,
            frame.cfa,
            Placement { row: 0, col: 0 },
        )
        .map_err(|error| IspError::Input { what: "the mosaic", got: error.to_string(), need: "a Bayer array" })?;
        Ok(vec![
            ("black".to_owned(), gray(light([1.0; 3]))),
            ("gain".to_owned(), gray(balanced)),
            ("demosaic".to_owned(), encoded(&colour, 1.0)),
            ("tone".to_owned(), encoded(&colour, gamma)),
        ])
    }
}

/// The picture of linear light on a display.
fn encoded(light: &LinearImage, gamma: f64) -> RgbPicture {
    let code = |v: f32| (v.clamp(0.0, 1.0).powf(1.0 / gamma as f32) * 65535.0).round() as u16;
    let data = light.to_srgb().into_iter().map(code).collect();
    RgbPicture { height: light.height, width: light.width, bits: 16, data }
}

impl Isp for PlainIsp {
    fn name(&self) -> &str {
        "plain"
    }

    fn parameters(&self) -> Vec<IspParameter> {
        [parameters_of("gain", Gain::table()), parameters_of("tone", Tone::table())].concat()
    }

    fn develop(&self, frame: &RawInput, values: &[f64]) -> Result<RgbPicture, IspError> {
        let mut steps = self.develop_steps(frame, values)?;
        let (_, last) = steps.remove(steps.len() - 1);
        Ok(last)
    }
}
