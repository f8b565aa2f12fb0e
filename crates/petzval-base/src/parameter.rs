//! The one description of a number that a user may set: name, unit, range, scale, default, and a sentence.
//!
//! [`parameters!`](crate::parameters) declares the numbers of a configuration table once. That one declaration gives the struct that serde
//! reads from TOML, with a default for every key, and the check of its ranges, with hints. It also gives the JSON Schema, the commented
//! file that `--print-config` prints, and the bounds and scales of optimisers and sliders. Requests of jobs declare their numbers by it too.

use schemars::Schema;

/// How a number is best varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// By equal differences.
    Linear,
    /// By equal ratios.
    Log,
}

/// A number that a user may set, or an array of numbers with one range.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Key in the file.
    pub name: &'static str,
    /// Unit; empty for a plain number.
    pub unit: &'static str,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// How it is best varied.
    pub scale: Scale,
    /// Default: one value, or one for each element of an array or a list; none for a number that may be left out.
    pub default: Vec<f64>,
    /// What it is, in one sentence.
    pub sentence: String,
    /// What to write instead of a value out of range.
    pub hint: &'static str,
}

impl Parameter {
    /// Where a value lies in its range, 0..1: by equal differences, or by equal ratios if it is best varied so.
    pub fn unit_of(&self, value: f64) -> f64 {
        let at = match self.scale {
            Scale::Linear => (value - self.min) / (self.max - self.min),
            Scale::Log => (value / self.min).ln() / (self.max / self.min).ln(),
        };
        at.clamp(0.0, 1.0)
    }

    /// The value at a place 0..1 of its range: the inverse of [`Parameter::unit_of`].
    pub fn value_at(&self, unit: f64) -> f64 {
        let unit = unit.clamp(0.0, 1.0);
        let value = match self.scale {
            Scale::Linear => self.min + unit * (self.max - self.min),
            Scale::Log => self.min * (self.max / self.min).powf(unit),
        };
        value.clamp(self.min, self.max)
    }
}

/// The numbers of one table of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterTable {
    /// What the table is about, in one sentence.
    pub sentence: String,
    /// Its numbers, in the order of the file.
    pub parameters: Vec<Parameter>,
}

/// A value outside its range.
#[derive(Clone, Debug, PartialEq)]
pub struct OutOfRange {
    /// The parameter.
    pub parameter: Parameter,
    /// The value.
    pub value: f64,
}

impl OutOfRange {
    /// The message for a user, without the place in the file.
    pub fn message(&self) -> String {
        format!("must lie between {} and {}", self.parameter.min, self.parameter.max)
    }
}

/// A configuration table that was declared by [`parameters!`](crate::parameters).
pub trait Parameters {
    /// The description of its numbers.
    fn table() -> ParameterTable;

    /// Its present values, in the order of [`ParameterTable::parameters`].
    fn values(&self) -> Vec<Vec<f64>>;

    /// Sets its values, one list for each of [`ParameterTable::parameters`]; numbers that are missing stay as they are.
    fn set_values(&mut self, values: &[Vec<f64>]);

    /// The first value outside its range; a value that is no number is outside every range.
    fn out_of_range(&self) -> Option<OutOfRange> {
        let all = Self::table().parameters.into_iter().zip(self.values());
        let mut wrong = all.flat_map(|(parameter, values)| {
            values.into_iter().map(move |value| OutOfRange { parameter: parameter.clone(), value })
        });
        wrong.find(|o| !(o.value >= o.parameter.min && o.value <= o.parameter.max))
    }
}

/// Writes sentence, unit and range of each number into the JSON Schema of its table.
pub fn describe<P: Parameters>(schema: &mut Schema) {
    let Some(properties) = schema.get_mut("properties").and_then(|p| p.as_object_mut()) else { return };
    for p in P::table().parameters {
        let Some(property) = properties.get_mut(p.name).and_then(|v| v.as_object_mut()) else { continue };
        let unit = if p.unit.is_empty() { String::new() } else { format!(" Unit: {}.", p.unit) };
        property.insert("description".to_owned(), format!("{}{unit}", p.sentence).into());
        let numbers = match property.get_mut("items").and_then(|v| v.as_object_mut()) {
            Some(items) => items,
            None => property,
        };
        numbers.remove("format");
        for (key, value) in [("minimum", p.min), ("maximum", p.max)] {
            numbers.insert(key.to_owned(), value.into());
        }
    }
}

/// A value of a parameter: a number, an array or a list of numbers, or a number that may be left out.
pub trait Numbers {
    /// The numbers.
    fn numbers(&self) -> Vec<f64>;

    /// Takes as many values as it holds from the front of `values`.
    fn set_numbers(&mut self, values: &mut dyn Iterator<Item = f64>);
}

macro_rules! plain_numbers {
    ($($kind:ty),*) => {$(
        impl Numbers for $kind {
            fn numbers(&self) -> Vec<f64> {
                vec![*self as f64]
            }

            fn set_numbers(&mut self, values: &mut dyn Iterator<Item = f64>) {
                *self = values.next().map_or(*self, |value| value as $kind);
            }
        }
    )*};
}

plain_numbers!(f64, usize, u32, u64);

impl Numbers for f32 {
    /// The shortest decimal number that reads back to the same value.
    fn numbers(&self) -> Vec<f64> {
        vec![self.to_string().parse().unwrap_or(f64::from(*self))]
    }

    fn set_numbers(&mut self, values: &mut dyn Iterator<Item = f64>) {
        *self = values.next().map_or(*self, |value| value as f32);
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(Numbers::numbers).collect()
    }

    fn set_numbers(&mut self, values: &mut dyn Iterator<Item = f64>) {
        self.iter_mut().for_each(|number| number.set_numbers(values));
    }
}

impl<T: Numbers> Numbers for Vec<T> {
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(Numbers::numbers).collect()
    }

    fn set_numbers(&mut self, values: &mut dyn Iterator<Item = f64>) {
        self.iter_mut().for_each(|number| number.set_numbers(values));
    }
}

/// A number that is left out has no value, and stays left out.
impl<T: Numbers> Numbers for Option<T> {
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(Numbers::numbers).collect()
    }

    fn set_numbers(&mut self, values: &mut dyn Iterator<Item = f64>) {
        self.iter_mut().for_each(|number| number.set_numbers(values));
    }
}

/// Declares a configuration table: the struct, its default, its reading by serde, its JSON Schema, and its
/// [`ParameterTable`](crate::parameter::ParameterTable).
///
/// Each line is `name: type = default, unit, least..greatest, scale, hint;`, with a documentation comment that becomes the
/// sentence. Keys that are no numbers follow after `also`, with their default. The crate that uses it depends on serde
/// and schemars.
///
/// ```
/// petzval_base::parameters! {
///     /// How a picture is exposed.
///     pub struct Exposure {
///         /// Exposure time.
///         time_s: f64 = 0.005, "s", 1e-6..1e4, Log, "5 ms is 0.005";
///     }
/// }
/// use petzval_base::parameter::Parameters;
///
/// assert_eq!(Exposure::default().time_s, 0.005);
/// assert_eq!(Exposure::table().parameters[0].unit, "s");
/// let wrong = Exposure { time_s: -1.0 }.out_of_range().unwrap();
/// assert_eq!(wrong.message(), "must lie between 0.000001 and 10000");
/// ```
#[macro_export]
macro_rules! parameters {
    (
        $(#[doc = $about:expr])+
        pub struct $table:ident {
            $(
                $(#[doc = $sentence:expr])+
                $name:ident: $kind:ty = $default:expr, $unit:literal, $min:literal..$max:literal, $scale:ident, $hint:literal;
            )*
        }
        $(also { $(
            $(#[doc = $other_doc:expr])+
            $other:ident: $other_kind:ty = $other_default:expr;
        )* })?
    ) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, PartialEq, ::serde::Serialize, ::serde::Deserialize, ::schemars::JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        #[schemars(transform = $crate::parameter::describe::<Self>)]
        pub struct $table {
            $(
                $(#[doc = $sentence])+
                #[doc = concat!("\nUnit: `", $unit, "`. Range: ", stringify!($min), " to ", stringify!($max), ".")]
                pub $name: $kind,
            )*
            $($(
                $(#[doc = $other_doc])+
                pub $other: $other_kind,
            )*)?
        }

        impl Default for $table {
            fn default() -> Self {
                Self { $($name: $default,)* $($($other: $other_default,)*)? }
            }
        }

        impl $crate::parameter::Parameters for $table {
            fn table() -> $crate::parameter::ParameterTable {
                let default = Self::default();
                $crate::parameter::ParameterTable {
                    sentence: [$($about),+].concat().trim().to_owned(),
                    parameters: vec![$($crate::parameter::Parameter {
                        name: stringify!($name),
                        unit: $unit,
                        min: f64::from($min),
                        max: f64::from($max),
                        scale: $crate::parameter::Scale::$scale,
                        default: $crate::parameter::Numbers::numbers(&default.$name),
                        sentence: [$($sentence),+].concat().trim().to_owned(),
                        hint: $hint,
                    }),*],
                }
            }

            fn values(&self) -> Vec<Vec<f64>> {
                vec![$($crate::parameter::Numbers::numbers(&self.$name)),*]
            }

            fn set_values(&mut self, values: &[Vec<f64>]) {
                let mut values = values.iter();
                $(if let Some(numbers) = values.next() {
                    $crate::parameter::Numbers::set_numbers(&mut self.$name, &mut numbers.iter().copied());
                })*
            }
        }
    };
    // No numbers in ranges.
    (
        $(#[doc = $about:expr])+
        pub struct $table:ident {
            $(
                $(#[doc = $other_doc:expr])+
                $other:ident: $other_kind:ty = $other_default:expr;
            )+
        }
    ) => {
        $crate::parameters! {
            $(#[doc = $about])+
            pub struct $table {}
            also { $(
                $(#[doc = $other_doc])+
                $other: $other_kind = $other_default;
            )+ }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    crate::parameters! {
        /// Numbers of every form.
        pub struct Forms {
            /// A list.
            list: Vec<f64> = vec![1.0, 2.0], "mm", 0..10, Linear, "one or more";
            /// A number that may be left out.
            choice: Option<usize> = None, "", 1..8, Linear, "1 to 8";
            /// A list that may be left out.
            times: Option<Vec<f64>> = None, "ms", 0.1..100, Log, "times";
        }
        also {
            /// A word.
            word: String = "a".to_owned();
        }
    }

    #[test]
    fn what_is_left_out_is_in_range_and_every_number_of_a_list_counts() {
        assert_eq!(Forms::default().out_of_range(), None);
        let wrong = |forms: Forms| {
            let found = forms.out_of_range().unwrap();
            (found.parameter.name, found.value)
        };
        assert_eq!(wrong(Forms { list: vec![1.0, 11.0], ..Forms::default() }), ("list", 11.0));
        assert_eq!(wrong(Forms { choice: Some(9), ..Forms::default() }), ("choice", 9.0));
        assert_eq!(wrong(Forms { times: Some(vec![1.0, 0.0]), ..Forms::default() }), ("times", 0.0));
        let mut changed = Forms { choice: Some(2), ..Forms::default() };
        changed.set_values(&[vec![3.0], vec![4.0], vec![5.0]]);
        assert_eq!((changed.list, changed.choice, changed.times), (vec![3.0, 2.0], Some(4), None));
    }

    #[test]
    fn the_schema_holds_ranges_beside_the_numbers_themselves() {
        let schema = schemars::schema_for!(Forms).to_value();
        let of = |key: &str| &schema["properties"][key];
        assert_eq!(of("list")["items"]["maximum"], 10.0);
        assert_eq!(of("choice")["minimum"], 1.0);
        assert_eq!(of("times")["items"]["minimum"], 0.1);
        assert_eq!(of("list")["description"], "A list. Unit: mm.");
        assert_eq!(of("word")["default"], "a");
    }
}
