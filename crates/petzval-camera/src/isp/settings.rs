//! Every number of the automotive ISP, stage by stage, and presets that set them by the sensor's gain.

use std::collections::BTreeMap;

use petzval_base::parameter::Parameters;
use petzval_base::table::Interval;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::stage::bayer_denoise::BayerDenoise;
use super::stage::black_level::BlackLevel;
use super::stage::colour::Colours;
use super::stage::colour_denoise::{ChromaDenoise, LumaDenoise};
use super::stage::defects::Defects;
use super::stage::demosaic::FalseColour;
use super::stage::dewarp::Dewarp;
use super::stage::gain::Gain;
use super::stage::gamma::Gamma;
use super::stage::green_balance::GreenBalance;
use super::stage::output::Output;
use super::stage::purple_fringe::PurpleFringe;
use super::stage::shading::Shading;
use super::stage::sharpen::Sharpen;
use super::stage::stabilise::Stabilise;
use super::stage::tone_map::ToneMap;
use super::stage::white_balance::WhiteBalance;
use super::{IspError, IspParameter};
use crate::develop::{Demosaic, Domain};

/// Declares the settings from one list of stages, in the order of the light.
macro_rules! settings {
    ($($(#[doc = $doc:expr])+ $stage:ident: $table:ty,)*) => {
        /// The settings of the automotive ISP: methods, and one table of numbers for each stage.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct IspSettings {
            /// Method of demosaicing.
            pub demosaic: Demosaic,
            /// Values that are demosaiced: roots of light, or, for comparison, light itself.
            pub domain: Domain,
            /// Bits of the picture: 8, 10 or 16.
            pub bits: u32,
            $($(#[doc = $doc])+ pub $stage: $table,)*
        }

        impl Default for IspSettings {
            fn default() -> Self {
                Self {
                    demosaic: Demosaic::Malvar,
                    domain: Domain::Stabilised,
                    bits: 8,
                    $($stage: <$table>::default(),)*
                }
            }
        }

        impl IspSettings {
            /// Names of the stages, in the order of the light.
            pub const STAGES: &[&str] = &[$(stringify!($stage)),*];

            /// Every number: name, unit, range, default.
            pub fn parameters() -> Vec<IspParameter> {
                let mut all = Vec::new();
                $(add::<$table>(stringify!($stage), &mut all);)*
                all
            }

            /// The present values, in the order of [`IspSettings::parameters`].
            pub fn values(&self) -> Vec<f64> {
                let mut all = Vec::new();
                $(all.extend(self.$stage.values().concat());)*
                all
            }

            /// The settings with other values, in the order of [`IspSettings::parameters`]. Fails on a wrong number of values or a
            /// value out of range.
            pub fn with_values(&self, values: &[f64]) -> Result<Self, IspError> {
                super::check_values(&Self::parameters(), values)?;
                let (mut out, mut rest) = (self.clone(), values);
                $({
                    let mut lists = out.$stage.values();
                    for number in lists.iter_mut().flatten() {
                        (*number, rest) = (rest[0], &rest[1..]);
                    }
                    out.$stage.set_values(&lists);
                })*
                Ok(out)
            }
        }
    };
}

settings! {
    /// Black level.
    black_level: BlackLevel,
    /// Digital gain.
    gain: Gain,
    /// Variance stabilisation.
    stabilise: Stabilise,
    /// Green equalisation.
    green_balance: GreenBalance,
    /// Defect pixels.
    defects: Defects,
    /// Denoising of the mosaic.
    bayer_denoise: BayerDenoise,
    /// Lens shading.
    shading: Shading,
    /// White balance.
    white_balance: WhiteBalance,
    /// Local tone mapping.
    tone_map: ToneMap,
    /// False colours after demosaicing.
    false_colour: FalseColour,
    /// Purple fringes.
    purple_fringe: PurpleFringe,
    /// Denoising of the colours.
    chroma_denoise: ChromaDenoise,
    /// Denoising of the luma.
    luma_denoise: LumaDenoise,
    /// Colour matrix.
    colours: Colours,
    /// Gamma curve.
    gamma: Gamma,
    /// Sharpening.
    sharpen: Sharpen,
    /// Correction of distortion.
    dewarp: Dewarp,
    /// Brightness and contrast.
    output: Output,
}

/// Adds the numbers of a stage's table.
fn add<P: Parameters>(stage: &str, all: &mut Vec<IspParameter>) {
    for parameter in P::table().parameters {
        let count = parameter.default.len();
        for (i, default) in parameter.default.iter().enumerate() {
            let index = if count > 1 { format!("[{i}]") } else { String::new() };
            let mut about = parameter.clone();
            about.default = vec![*default];
            all.push(IspParameter { name: format!("{stage}.{}{index}", parameter.name), about });
        }
    }
}

/// Named settings that change with the gain of the sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IspPreset {
    /// What it is for, in one sentence.
    pub about: String,
    /// The settings, except for the numbers that the knots set.
    pub settings: IspSettings,
    /// Numbers by the gain of the sensor; between two knots they change in proportion to its stops.
    pub knot: Vec<GainKnot>,
}

/// Numbers at one gain.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GainKnot {
    /// Gain of the sensor above its lowest, EV.
    pub gain_ev: f64,
    /// Values by name, `stage.key`.
    pub set: BTreeMap<String, f64>,
}

impl IspPreset {
    /// The settings at a gain of the sensor, EV. Fails if a knot names an unknown number or sets it out of its range.
    pub fn at_gain(&self, gain_ev: f64) -> Result<IspSettings, IspError> {
        let parameters = IspSettings::parameters();
        let mut values = self.settings.values();
        let unknown = |name: &String| !parameters.iter().any(|p| p.name == *name);
        if let Some(name) = self.knot.iter().flat_map(|k| k.set.keys()).find(|name| unknown(name)) {
            let need = "the name of an ISP parameter, such as bayer_denoise.strength";
            return Err(IspError::Input { what: "name in a knot", got: format!("`{name}`"), need });
        }
        for (parameter, value) in parameters.iter().zip(&mut values) {
            let of = |k: &GainKnot| k.set.get(&parameter.name).map(|v| (k.gain_ev, *v));
            let mut points: Vec<(f64, f64)> = self.knot.iter().filter_map(of).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            *value = interpolated(&points, gain_ev).unwrap_or(*value);
        }
        self.settings.with_values(&values)
    }
}

/// The value at `x` between points in ascending order; beyond them that of the last; none without points.
fn interpolated(points: &[(f64, f64)], x: f64) -> Option<f64> {
    let (first, last) = (points.first()?, points.last()?);
    let around = Interval::around(x.clamp(first.0, last.0), points.len(), |i| points[i].0);
    Some(around.map_or(first.1, |around| around.mean(|i| points[i].1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_name_a_range_and_a_default_inside_it() {
        let parameters = IspSettings::parameters();
        assert!((45..=60).contains(&parameters.len()), "{}", parameters.len());
        let values = IspSettings::default().values();
        for (p, value) in parameters.iter().zip(&values) {
            assert_eq!(p.default_value(), *value, "{}", p.name);
            assert!(p.about.min < p.about.max && (p.about.min..=p.about.max).contains(value), "{}", p.name);
            assert!(!p.about.sentence.is_empty() && !p.about.hint.is_empty());
            assert!((p.about.value_at(p.about.unit_of(*value)) - value).abs() < 1e-12, "{}", p.name);
        }
        let mut names: Vec<&String> = parameters.iter().map(|p| &p.name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), parameters.len());
    }

    #[test]
    fn values_come_back_and_wrong_ones_are_refused_by_name() {
        let settings = IspSettings::default();
        let mut values = settings.values();
        let at = IspSettings::parameters().iter().position(|p| p.name == "sharpen.amount").unwrap();
        values[at] = 1.25;
        let changed = settings.with_values(&values).unwrap();
        assert_eq!((changed.sharpen.amount, changed.values()), (1.25, values.clone()));
        values[at] = 5.0;
        let message = settings.with_values(&values).unwrap_err().to_string();
        assert_eq!(message, "ISP parameter sharpen.amount is 5; it must lie between 0 and 4");
        assert!(settings.with_values(&values[1..]).is_err());
    }

    #[test]
    fn knots_set_numbers_by_the_gain() {
        let knot = |gain_ev, value| GainKnot {
            gain_ev,
            set: BTreeMap::from([("bayer_denoise.strength".to_owned(), value)]),
        };
        let preset = IspPreset { knot: vec![knot(4.0, 0.8), knot(0.0, 0.2)], ..IspPreset::default() };
        let at = |gain| preset.at_gain(gain).unwrap().bayer_denoise.strength;
        assert_eq!([at(-1.0), at(0.0), at(2.0), at(9.0)], [0.2, 0.2, 0.5, 0.8]);
        let wrong = IspPreset {
            knot: vec![GainKnot { gain_ev: 0.0, set: BTreeMap::from([("no.such".into(), 1.0)]) }],
            ..preset
        };
        assert!(wrong.at_gain(0.0).unwrap_err().to_string().contains("no.such"));
    }
}
