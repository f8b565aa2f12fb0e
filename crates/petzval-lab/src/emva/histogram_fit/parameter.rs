//! The parameters of the model that the fit varies: one table of names, units, steps, bounds and places in the model.

use std::ops::{Index, IndexMut};

use schemars::JsonSchema;
use serde::Serialize;

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

/// What the table says of a parameter.
struct Row {
    name: &'static str,
    unit: &'static str,
    step: Step,
    bound: Bound,
}

/// Declares the parameters that all histograms share, in their order in [`Numbers`]. A row is
/// `Parameter in field, "symbol", "unit", step, bound;`, where the field is its place in the model, if it has one.
macro_rules! shared_parameters {
    ($(
        #[doc = $about:literal]
        $parameter:ident $(in $field:ident)?, $name:literal, $unit:literal, $step:expr, $bound:ident;
    )*) => {
        /// Parameters of the model at the start or the end of the fit.
        #[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
        pub struct ModelParameters {
            $($(#[doc = $about] pub $field: f64,)?)*
            /// Full well, e-; always held.
            pub full_well_e: f64,
        }

        /// One number that the fit varies.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Parameter {
            $(#[doc = $about] $parameter,)*
            /// Electrons per unit of light, by the number of the light level.
            Light(usize),
        }

        /// The parameters that all histograms share. The light levels follow them.
        const SHARED: &[Parameter] = &[$(Parameter::$parameter),*];

        impl Parameter {
            fn row(self) -> Row {
                match self {
                    $(Self::$parameter => Row { name: $name, unit: $unit, step: $step, bound: Bound::$bound },)*
                    Self::Light(_) => Row {
                        name: "light",
                        unit: "e- per unit of light",
                        step: Step::Share(1e-5),
                        bound: Bound::Positive,
                    },
                }
            }

            /// Place among the numbers of a fit.
            pub fn index(self) -> usize {
                enum Place {
                    $($parameter),*
                }
                match self {
                    $(Self::$parameter => Place::$parameter as usize,)*
                    Self::Light(level) => SHARED.len() + level,
                }
            }

            /// The start of the fit: the number of the model, or zero where the model has none.
            fn read(self, model: &ModelParameters) -> f64 {
                match self {
                    $($(Self::$parameter => model.$field,)?)*
                    _ => 0.0,
                }
            }

            /// Puts a result into the model, where the model has a place for it.
            fn write(self, model: &mut ModelParameters, value: f64) {
                match self {
                    $($(Self::$parameter => model.$field = value,)?)*
                    _ => {}
                }
            }
        }
    };
}

shared_parameters! {
    /// K at linear gain 1, DN/e-.
    Gain in gain_dn_per_e, "K", "DN/e-", Step::Share(1e-5), Positive;
    /// mu_r, e-.
    ReadNoiseMean in read_noise_mean_e, "mu_r", "e-", Step::Units(1e-4), Any;
    /// BL + mu_el, DN.
    DarkOffset in dark_offset_dn, "BL + mu_el", "DN", Step::Units(1e-4), Any;
    /// sigma_el, DN.
    ElectronicsNoise in electronics_noise_dn, "sigma_el", "DN", Step::Units(1e-4), Positive;
    /// Signal of red over green, alpha.
    RedOverGreen in red_over_green, "alpha", "", Step::Share(1e-5), Positive;
    /// Signal of blue over green, beta.
    BlueOverGreen in blue_over_green, "beta", "", Step::Share(1e-5), Positive;
    /// sigma_r, e-. After a fit to histograms it is `sqrt(sigma_r^2 + DSNU^2)`, because they do not separate DSNU from read noise.
    DarkNoise in read_noise_e, "sigma_r with DSNU", "e-", Step::Units(1e-4), Positive;
    /// mu_I, e-/s.
    DarkCurrent in dark_current_e_per_s, "mu_I", "e-/s", Step::ShareAboveOne(1e-3), NotNegative;
    /// Square of the PRNU. The model has no PRNU: the fit starts at zero, and reports the PRNU separately.
    PrnuSquared, "PRNU^2", "", Step::ShareOfShotNoise(1e-4), Any;
}

impl Parameter {
    /// The parameters that all histograms share.
    pub fn shared() -> impl Iterator<Item = Self> {
        SHARED.iter().copied()
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
        Self(Parameter::shared().map(|parameter| parameter.read(model)).collect())
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
        Parameter::shared().zip(&self.0).for_each(|(parameter, value)| parameter.write(&mut model, *value));
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
