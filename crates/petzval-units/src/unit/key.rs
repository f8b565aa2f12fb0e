//! The key of a unit: SHA-256 of all that decides its result.

use std::fmt;
use std::str::FromStr;

use petzval_design::run::hex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::Sha256;

/// The key of a unit: 64 hexadecimal digits, the name of its folder in a store.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Key(String);

impl Key {
    /// The key whose digits are those of a digest.
    pub(super) fn of(digest: Sha256) -> Self {
        Self(hex(digest))
    }

    /// All digits.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The first digits, which suffice for people.
    pub fn short(&self) -> &str {
        &self.0[..12]
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for Key {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_digit = |c: char| c.is_ascii_digit() || ('a'..='f').contains(&c);
        if text.len() == 64 && text.chars().all(is_digit) {
            Ok(Self(text.to_owned()))
        } else {
            Err(format!("\"{text}\" is no key of a unit: 64 hexadecimal digits"))
        }
    }
}
