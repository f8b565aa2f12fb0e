//! Inputs of requests: a built-in name, a path, or the thing itself.
//!
//! What a request holds itself is put into the library of its context under the name `lens (inline)`, `sensor (inline)` or
//! `experiment (inline)`, so that a job reads it as it reads a file, and errors name it with its line.

use std::borrow::Cow;
use std::fmt;

use petzval_camera::sensor::SensorModel;
use petzval_design::error::DesignError;
use petzval_design::experiment::Experiment;
use petzval_design::library::Library;
use petzval_files::LensFile;
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use crate::context::Context;
use crate::error::{INLINE, JobError, Result, TABLES};

/// An input of a request: a built-in name or a path as text, or the thing itself as an object.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Input<T> {
    /// A built-in name, or the path of a file. A file that exists wins.
    Name(String),
    /// The thing itself.
    Inline(T),
}

/// A lens: a built-in name, the path of a file, `{"toml": TEXT}`, or `{"text": TEXT, "format": "zmx"}`.
pub type LensInput = Input<LensText>;

/// A sensor: a built-in name, the path of a file, or `{"toml": TEXT}`.
pub type SensorInput = Input<TomlText>;

/// An experiment: a built-in name, the path of a file, `{"toml": TEXT}`, or the object of its tables. Where a lens stands for an
/// experiment, TEXT may be that of a lens.
pub type ExperimentInput = Input<ExperimentText>;

/// The text of a lens file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum LensText {
    /// Petzval's own format.
    Toml {
        /// The text.
        toml: String,
    },
    /// Any format that is read.
    Other {
        /// The text.
        text: String,
        /// Its format.
        format: LensFormat,
    },
}

/// The format of a lens file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LensFormat {
    /// Petzval's own.
    Toml,
    /// Zemax OpticStudio.
    Zmx,
    /// CODE V.
    Seq,
    /// Optiland's JSON.
    Json,
}

impl<'de> Deserialize<'de> for LensText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Keys {
            toml: Option<String>,
            text: Option<String>,
            format: Option<LensFormat>,
        }
        match Keys::deserialize(deserializer)? {
            Keys { toml: Some(toml), text: None, format: None } => Ok(Self::Toml { toml }),
            Keys { toml: None, text: Some(text), format: Some(format) } => Ok(Self::Other { text, format }),
            _ => Err(serde::de::Error::custom(
                "a lens is a name, a path, {\"toml\": TEXT}, or {\"text\": TEXT, \"format\": \"toml\", \"zmx\", \"seq\" or \"json\"}",
            )),
        }
    }
}

/// The text of a file in TOML.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TomlText {
    /// The text.
    pub toml: String,
}

/// The text of an experiment, or its tables.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum ExperimentText {
    /// The text of its file.
    Toml(TomlText),
    /// Its tables as JSON; what is left out has its default.
    Tables(Map<String, Value>),
}

impl<'de> Deserialize<'de> for ExperimentText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut tables = Map::deserialize(deserializer)?;
        match (tables.len(), tables.remove("toml")) {
            (1, Some(Value::String(toml))) => Ok(Self::Toml(TomlText { toml })),
            (_, Some(_)) => Err(serde::de::Error::custom(
                "`toml` holds the text of the whole experiment, and no other key stands beside it",
            )),
            (_, None) => Ok(Self::Tables(tables)),
        }
    }
}

/// What a request may hold itself.
pub trait Inline {
    /// What it is, in one word.
    const KIND: &'static str;

    /// Where it is.
    fn place(&self) -> &'static str {
        INLINE
    }

    /// How its name ends beside `KIND (inline)`: the format, none for TOML.
    fn ending(&self) -> &'static str {
        ""
    }

    /// The text of its file.
    fn text(&self) -> Result<Cow<'_, str>>;
}

impl Inline for LensText {
    const KIND: &'static str = "lens";

    fn ending(&self) -> &'static str {
        match self {
            Self::Toml { .. } | Self::Other { format: LensFormat::Toml, .. } => "",
            Self::Other { format: LensFormat::Zmx, .. } => ".zmx",
            Self::Other { format: LensFormat::Seq, .. } => ".seq",
            Self::Other { format: LensFormat::Json, .. } => ".json",
        }
    }

    fn text(&self) -> Result<Cow<'_, str>> {
        let (Self::Toml { toml: text } | Self::Other { text, .. }) = self;
        Ok(text.into())
    }
}

/// In a request that takes them, TOML alone is a sensor.
impl Inline for TomlText {
    const KIND: &'static str = "sensor";

    fn text(&self) -> Result<Cow<'_, str>> {
        Ok((&self.toml).into())
    }
}

impl Inline for ExperimentText {
    const KIND: &'static str = "experiment";

    fn place(&self) -> &'static str {
        match self {
            Self::Toml(_) => INLINE,
            Self::Tables(_) => TABLES,
        }
    }

    fn text(&self) -> Result<Cow<'_, str>> {
        match self {
            Self::Toml(text) => Ok((&text.toml).into()),
            Self::Tables(tables) => toml::to_string(tables).map(Cow::Owned).map_err(|error| {
                JobError::input(
                    format!("experiment ({TABLES}): {error}"),
                    "tables hold texts, numbers, true, false and lists; leave a key out in place of null",
                )
            }),
        }
    }
}

impl<T: Inline> Input<T> {
    /// The name under which a job finds it in the context of [`Input::placed`].
    pub fn name(&self) -> Cow<'_, str> {
        match self {
            Self::Name(name) => name.into(),
            Self::Inline(inline) => format!("{} ({}){}", T::KIND, inline.place(), inline.ending()).into(),
        }
    }

    /// How it is called in names of results: `lens` if it is in no file.
    pub fn short_name(&self) -> &str {
        match self {
            Self::Name(name) => name,
            Self::Inline(_) => T::KIND,
        }
    }

    /// The name, and the context in which it is found: a thing that the request holds itself is added to the library.
    pub fn placed(&self, context: &Context) -> Result<(String, Context)> {
        let name = self.name().into_owned();
        let context = context.clone();
        match self {
            Self::Name(_) => Ok((name, context)),
            Self::Inline(inline) => {
                let assets = context.assets.clone().with_text(name.clone(), inline.text()?.into_owned());
                Ok((name, context.with_assets(assets)))
            }
        }
    }
}

impl<T: Inline> Input<T> {
    /// What `read` finds under the name, in the library with what the request holds itself.
    fn read_from<R>(
        &self,
        library: &Library,
        read: impl FnOnce(&Library, &str) -> Result<R, DesignError>,
    ) -> Result<R> {
        let name = self.name();
        match self {
            Self::Name(_) => Ok(read(library, &name)?),
            Self::Inline(inline) => {
                let text = inline.text()?.into_owned();
                Ok(read(&library.clone().with_text(name.to_string(), text), &name)?)
            }
        }
    }
}

impl LensInput {
    /// The lens, checked to be possible. What its file loses and what is odd about its glasses is reported.
    pub fn read(&self, library: &Library) -> Result<LensFile> {
        self.read_from(library, |library, name| library.lens(name))
    }
}

impl SensorInput {
    /// The sensor.
    pub fn read(&self, library: &Library) -> Result<SensorModel> {
        self.read_from(library, |library, name| library.sensor(name))
    }
}

impl ExperimentInput {
    /// The experiment.
    pub fn read(&self, library: &Library) -> Result<Experiment> {
        self.read_from(library, Library::experiment)
    }
}

/// The empty name, which stands for nothing.
impl<T> Default for Input<T> {
    fn default() -> Self {
        Self::Name(String::new())
    }
}

impl<T> From<String> for Input<T> {
    fn from(name: String) -> Self {
        Self::Name(name)
    }
}

impl<T> From<&str> for Input<T> {
    fn from(name: &str) -> Self {
        Self::Name(name.to_owned())
    }
}

impl<T: Inline> fmt::Display for Input<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name())
    }
}

impl<'de, T: Inline + Deserialize<'de>> Deserialize<'de> for Input<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// Tells a text from an object, so that an error inside the object names its key.
        struct Either<T>(std::marker::PhantomData<T>);

        impl<'de, T: Inline + Deserialize<'de>> Visitor<'de> for Either<T> {
            type Value = Input<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "the name of a {0}, a path, or the {0} itself as an object", T::KIND)
            }

            fn visit_str<E>(self, name: &str) -> Result<Input<T>, E> {
                Ok(Input::Name(name.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Input<T>, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Input::Inline)
            }
        }
        deserializer.deserialize_any(Either(std::marker::PhantomData))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_text_is_a_name_and_an_object_the_thing_itself() {
        let read = |value: Value| serde_json::from_value::<LensInput>(value);
        assert_eq!(read(json!("a.zmx")).unwrap(), "a.zmx".into());
        let inline = read(json!({"text": "x", "format": "zmx"})).unwrap();
        assert_eq!((inline.to_string().as_str(), inline.short_name()), ("lens (inline).zmx", "lens"));
        for value in [json!("a"), json!({"toml": "x"}), json!({"text": "x", "format": "seq"})] {
            assert_eq!(serde_json::to_value(read(value.clone()).unwrap()).unwrap(), value);
        }
        for (wrong, says) in [
            (json!(5), "the name of a lens, a path, or the lens itself"),
            (json!({"text": "x"}), "a lens is a name, a path"),
            (json!({"tomll": "x"}), "unknown field `tomll`"),
            (json!({"text": "x", "format": "zemax"}), "unknown variant `zemax`"),
        ] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn an_experiment_is_its_text_or_its_tables() {
        let read = |value: Value| serde_json::from_value::<ExperimentInput>(value);
        let Input::Inline(tables) = read(json!({"name": "x", "psf": {"grid": 64}})).unwrap() else {
            panic!("an object is no name")
        };
        assert_eq!(tables.text().unwrap(), "name = \"x\"\n\n[psf]\ngrid = 64\n");
        let Input::Inline(null) = read(json!({"name": null})).unwrap() else {
            panic!("an object is no name")
        };
        assert!(null.text().is_err());
        assert!(read(json!({"toml": "x", "name": "y"})).unwrap_err().to_string().contains("no other key"));
    }
}
