//! The parameters of the model that the fit varies: one table of names, units, steps, bounds and places in the model.

use std::ops::{Index, IndexMut};

use serde::Serialize;

/// Parameters of the model at the start or the end of the fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelParameters {
    /// K at linear gain 1, DN/e-.
    pub gain_dn_per_e: f64,
    /// mu_r, e-.
    pub read_noise_mean_e: f64,
    /// BL + mu_el, DN.
    pub dark_offset_dn: f64,
    /// sigma_el, DN.
    pub electronics_noise_dn: f64,
    /// Signal of red over green.
    pub red_over_green: f64,
    /// Signal of blue over green.
    pub blue_over_green: f64,
    /// sigma_r, e-. After a fit to histograms it includes DSNU, which they do not separate from read noise.
    pub read_noise_e: f64,
    /// mu_I, e-/s.
    pub dark_current_e_per_s: f64,
    /// Full well, e-; always held.
    pub full_well_e: f64,
}

/// One number that the fit varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// K at linear gain 1.
    Gain,
    /// mu_r.
    ReadNoiseMean,
    /// BL + mu_el.
    DarkOffset,
    /// sigma_el.
    ElectronicsNoise,
    /// alpha.
    RedOverGreen,
    /// beta.
    BlueOverGreen,
    /// `sqrt(sigma_r^2 + DSNU^2)`.
    DarkNoise,
    /// mu_I.
    DarkCurrent,
    /// Square of the PRNU.
    PrnuSquared,
    /// Electrons per unit of light, by the number of the light level.
    Light(usize),
}

/// Step of the central differences of the distribution.
#[derive(Debug, Clone, Copy)]
enum Step {
    /// A number of units of the parameter.
    Units(f64),
    /// A share of the value.
    Share(f64),
    /// A share of the value, or of one unit if the value is smaller.
    ShareAboveOne(f64),
    /// A share of the variance of shot noise, in units of the squared light.
    ShareOfShotNoise(f64),
}

/// Values that a parameter may take; all of them are finite.
#[derive(Debug, Clone, Copy)]
enum Bound {
    Any,
    NotNegative,
    Positive,
}

/// A row of the table.
struct Row {
    parameter: Parameter,
    name: &'static str,
    unit: &'static str,
    step: Step,
    bound: Bound,
    /// The start of the fit.
    read: fn(&ModelParameters) -> f64,
    /// The place of the result in the model.
    write: fn(&mut ModelParameters, f64),
}

/// The parameters that all histograms share, in their order in [`Numbers`]. The light levels follow them.
const SHARED: [Row; 9] = [
    Row {
        parameter: Parameter::Gain,
        name: "K",
        unit: "DN/e-",
        step: Step::Share(1e-5),
        bound: Bound::Positive,
        read: |m| m.gain_dn_per_e,
        write: |m, v| m.gain_dn_per_e = v,
    },
    Row {
        parameter: Parameter::ReadNoiseMean,
        name: "mu_r",
        unit: "e-",
        step: Step::Units(1e-4),
        bound: Bound::Any,
        read: |m| m.read_noise_mean_e,
        write: |m, v| m.read_noise_mean_e = v,
    },
    Row {
        parameter: Parameter::DarkOffset,
        name: "BL + mu_el",
        unit: "DN",
        step: Step::Units(1e-4),
        bound: Bound::Any,
        read: |m| m.dark_offset_dn,
        write: |m, v| m.dark_offset_dn = v,
    },
    Row {
        parameter: Parameter::ElectronicsNoise,
        name: "sigma_el",
        unit: "DN",
        step: Step::Units(1e-4),
        bound: Bound::Positive,
        read: |m| m.electronics_noise_dn,
        write: |m, v| m.electronics_noise_dn = v,
    },
    Row {
        parameter: Parameter::RedOverGreen,
        name: "alpha",
        unit: "",
        step: Step::Share(1e-5),
        bound: Bound::Positive,
        read: |m| m.red_over_green,
        write: |m, v| m.red_over_green = v,
    },
    Row {
        parameter: Parameter::BlueOverGreen,
        name: "beta",
        unit: "",
        step: Step::Share(1e-5),
        bound: Bound::Positive,
        read: |m| m.blue_over_green,
        write: |m, v| m.blue_over_green = v,
    },
    Row {
        parameter: Parameter::DarkNoise,
        name: "sigma_r with DSNU",
        unit: "e-",
        step: Step::Units(1e-4),
        bound: Bound::Positive,
        read: |m| m.read_noise_e,
        write: |m, v| m.read_noise_e = v,
    },
    Row {
        parameter: Parameter::DarkCurrent,
        name: "mu_I",
        unit: "e-/s",
        step: Step::ShareAboveOne(1e-3),
        bound: Bound::NotNegative,
        read: |m| m.dark_current_e_per_s,
        write: |m, v| m.dark_current_e_per_s = v,
    },
    // The model has no PRNU: the fit starts at zero, and reports the PRNU separately.
    Row {
        parameter: Parameter::PrnuSquared,
        name: "PRNU^2",
        unit: "",
        step: Step::ShareOfShotNoise(1e-4),
        bound: Bound::Any,
        read: |_| 0.0,
        write: |_, _| (),
    },
];

/// The row of the light levels, which are not part of the model.
const LIGHT: Row = Row {
    parameter: Parameter::Light(0),
    name: "light",
    unit: "e- per unit of light",
    step: Step::Share(1e-5),
    bound: Bound::Positive,
    read: |_| f64::NAN,
    write: |_, _| (),
};

impl Parameter {
    /// The parameters that all histograms share.
    pub fn shared() -> impl Iterator<Item = Self> {
        SHARED.iter().map(|row| row.parameter)
    }

    fn row(self) -> &'static Row {
        match self {
            Self::Light(_) => &LIGHT,
            shared => &SHARED[shared.index()],
        }
    }

    /// Place among the numbers of a fit.
    pub fn index(self) -> usize {
        match self {
            Self::Gain => 0,
            Self::ReadNoiseMean => 1,
            Self::DarkOffset => 2,
            Self::ElectronicsNoise => 3,
            Self::RedOverGreen => 4,
            Self::BlueOverGreen => 5,
            Self::DarkNoise => 6,
            Self::DarkCurrent => 7,
            Self::PrnuSquared => 8,
            Self::Light(level) => SHARED.len() + level,
        }
    }

    /// Symbol of the parameter.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Unit of the parameter; empty for pure numbers.
    pub fn unit(self) -> &'static str {
        self.row().unit
    }

    /// Whether a value is possible.
    pub fn allows(self, value: f64) -> bool {
        value.is_finite()
            && match self.row().bound {
                Bound::Any => true,
                Bound::NotNegative => value >= 0.0,
                Bound::Positive => value > 0.0,
            }
    }

    /// Step of central differences at a value, in a histogram with a given number of electrons of light. The distribution is smooth and
    /// good to 1e-11.
    pub fn step(self, value: f64, light_e: f64) -> f64 {
        match self.row().step {
            Step::Units(units) => units,
            Step::Share(share) => share * value.abs(),
            Step::ShareAboveOne(share) => share * value.abs().max(1.0),
            Step::ShareOfShotNoise(share) => share / light_e.max(1.0),
        }
    }
}

/// A value of every parameter: those that all histograms share, then the light levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Numbers(Vec<f64>);

impl Numbers {
    /// The shared parameters of a model, no light level yet.
    pub fn of(model: &ModelParameters) -> Self {
        Self(SHARED.iter().map(|row| (row.read)(model)).collect())
    }

    /// Adds a light level.
    pub fn push_light(&mut self, electrons: f64) -> Parameter {
        self.0.push(electrons);
        Parameter::Light(self.0.len() - 1 - SHARED.len())
    }

    /// Number of parameters.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// All parameters in their order.
    pub fn parameters(&self) -> impl Iterator<Item = Parameter> {
        Parameter::shared().chain((0..self.0.len() - SHARED.len()).map(Parameter::Light))
    }

    /// The model with these values; everything else stays.
    pub fn model(&self, start: &ModelParameters) -> ModelParameters {
        let mut model = start.clone();
        SHARED.iter().zip(&self.0).for_each(|(row, value)| (row.write)(&mut model, *value));
        model
    }
}

impl Index<Parameter> for Numbers {
    type Output = f64;

    fn index(&self, parameter: Parameter) -> &f64 {
        &self.0[parameter.index()]
    }
}

impl IndexMut<Parameter> for Numbers {
    fn index_mut(&mut self, parameter: Parameter) -> &mut f64 {
        &mut self.0[parameter.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_the_order_of_the_numbers() {
        for (place, parameter) in Parameter::shared().enumerate() {
            assert_eq!(parameter.index(), place, "{}", parameter.name());
        }
        let model = ModelParameters {
            gain_dn_per_e: 1.0,
            read_noise_mean_e: 2.0,
            dark_offset_dn: 3.0,
            electronics_noise_dn: 4.0,
            red_over_green: 5.0,
            blue_over_green: 6.0,
            read_noise_e: 7.0,
            dark_current_e_per_s: 8.0,
            full_well_e: 9.0,
        };
        let mut numbers = Numbers::of(&model);
        assert_eq!(numbers.model(&ModelParameters { gain_dn_per_e: 0.0, ..model.clone() }), model);
        let light = numbers.push_light(11.0);
        assert_eq!((numbers[light], numbers.parameters().last()), (11.0, Some(light)));
        assert!(light.allows(1e-3) && !light.allows(0.0) && !Parameter::DarkOffset.allows(f64::NAN));
    }
}
