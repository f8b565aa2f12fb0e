//! Numbers and strings of TOML files. Numbers are read from integers and floats, and written so that they read back as the
//! same bits.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Error, Visitor};
use toml_writer::{ToTomlValue, TomlStringBuilder};

/// A TOML number. Integers count, and `"inf"` in quotes is infinity.
#[derive(Clone, Copy, Debug, schemars::JsonSchema)]
#[schemars(with = "f64")]
pub(crate) struct Number(pub f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct AnyNumber;
        impl Visitor<'_> for AnyNumber {
            type Value = Number;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number")
            }
            fn visit_f64<E: Error>(self, v: f64) -> Result<Number, E> {
                Ok(Number(v))
            }
            fn visit_i64<E: Error>(self, v: i64) -> Result<Number, E> {
                Ok(Number(v as f64))
            }
            fn visit_u64<E: Error>(self, v: u64) -> Result<Number, E> {
                Ok(Number(v as f64))
            }
            fn visit_str<E: Error>(self, v: &str) -> Result<Number, E> {
                match v {
                    "inf" | "+inf" => Ok(Number(f64::INFINITY)),
                    "-inf" => Ok(Number(f64::NEG_INFINITY)),
                    _ => Err(E::invalid_type(serde::de::Unexpected::Str(v), &self)),
                }
            }
        }
        from.deserialize_any(AnyNumber)
    }
}

/// The shortest number whose reciprocal is the given number to the last bit; most but not all numbers have one.
pub(crate) fn exact_reciprocal(value: f64) -> Option<f64> {
    shortest(1.0 / value, |candidate| (1.0 / candidate).to_bits() == value.to_bits())
}

/// The shortest angle in degrees that converts to the given one in rad to the last bit.
pub(crate) fn exact_degrees(rad: f64) -> Option<f64> {
    shortest(rad.to_degrees(), |candidate| candidate.to_radians().to_bits() == rad.to_bits())
}

/// The shortest decimal among a number and its neighbours that passes the test.
pub(crate) fn shortest(near: f64, will_do: impl Fn(f64) -> bool) -> Option<f64> {
    let candidates = [near, near.next_down(), near.next_up()];
    candidates.into_iter().filter(|c| will_do(*c)).min_by_key(|c| number(*c).len())
}

/// The shortest decimal that reads back as the same bits.
pub(crate) fn number(value: f64) -> String {
    if value.is_nan() { "nan".into() } else { format!("{value:?}") }
}

pub(crate) fn numbers(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|v| number(*v)).collect();
    format!("[{}]", values.join(", "))
}

/// A one-line TOML string.
pub(crate) fn quoted(text: &str) -> String {
    TomlStringBuilder::new(text).as_basic().to_toml_value()
}
