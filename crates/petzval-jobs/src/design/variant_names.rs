//! Names of the variants that a run makes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Names of variants: one as a text, or several as a list.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "the name of a variant, or a list of names")]
pub enum VariantNames {
    /// One.
    One(String),
    /// Several.
    Several(Vec<String>),
}

impl VariantNames {
    /// Those of a list; none of an empty one. A single name is a text, as in calls of earlier versions.
    pub fn of(mut names: Vec<String>) -> Option<Self> {
        if names.len() > 1 { Some(Self::Several(names)) } else { names.pop().map(Self::One) }
    }

    /// The names.
    pub fn names(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::Several(names) => names,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_name_is_a_text_as_in_stored_calls() {
        let of = |names: &[&str]| VariantNames::of(names.iter().map(|name| (*name).to_owned()).collect());
        for (names, text) in [(&["a"][..], "\"a\""), (&["a", "b"], "[\"a\",\"b\"]"), (&[], "null")] {
            assert_eq!(serde_json::to_string(&of(names)).unwrap(), text);
            assert_eq!(serde_json::from_str::<Option<VariantNames>>(text).unwrap(), of(names));
            assert_eq!(of(names).map_or(0, |found| found.names().len()), names.len());
        }
        let error = serde_json::from_str::<VariantNames>("3").unwrap_err().to_string();
        assert!(error.contains("the name of a variant, or a list of names"), "{error}");
    }
}
