//! Objects of classes that a user wrote in another language: a network, or a loss with its scores.
//!
//! | part | holds |
//! |---|---|
//! | [`Host`], [`Guest`] | where objects live, and how their methods are called: arrays in, arrays out |
//! | [`GuestTask`](crate::guest_task::GuestTask) | such an object as loss and scores of pictures |
//! | [`GuestNetwork`](crate::network::GuestNetwork) | such an object as a network behind the development |
//!
//! What an object gives back is checked here, whatever its host: shapes, and that every number is finite.

use std::sync::Arc;

use petzval_camera::tape::View;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A class of a user, with what its objects are made with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GuestClass {
    /// Module and class, such as `my_nets:Restorer`. Python looks for the module on its import path, never in a run folder.
    #[schemars(regex(pattern = r"^[^:]+:[^:]+$"))]
    pub class: String,
    /// Further keyword arguments of the class.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub options: Map<String, Value>,
}

/// What an object is for: it decides which methods its class must have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// `forward`, `backward`, `step`, `save` and `load`.
    Network,
    /// `loss`, `score` and `scores`.
    Task,
}

/// Where the objects of a run live.
pub trait Host: Send + Sync {
    /// Makes an object with these keyword arguments. Returns what it says of itself, too. Fails if its class cannot be found, has not the methods of
    /// the role, or cannot be made.
    fn make(
        &self,
        class: &str,
        role: Role,
        arguments: &Map<String, Value>,
    ) -> Result<(Arc<dyn Guest>, Value), GuestError>;
}

/// An object of a user's class.
pub trait Guest: Send + Sync {
    /// Calls a method. One call runs at a time.
    fn call(&self, call: &Call) -> Result<Answer, GuestError>;
}

/// A call of a method.
#[derive(Clone, Debug, Default)]
pub struct Call<'a> {
    /// The method.
    pub method: &'static str,
    /// Arrays that it takes.
    pub arrays: Vec<View<'a>>,
    /// The number that it takes, if it takes one.
    pub number: Option<f64>,
    /// The bytes that it takes, if it takes some.
    pub bytes: Option<&'a [u8]>,
}

/// What a method gives back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// Arrays.
    pub arrays: Vec<Array>,
    /// A number or an object of numbers; null if there is none.
    pub value: Value,
    /// Bytes.
    pub bytes: Vec<u8>,
}

/// An array of 32-bit floats, row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Array {
    /// As many values as the shape has elements.
    pub values: Vec<f32>,
    /// Length along each dimension.
    pub shape: Vec<usize>,
}

/// Why an object of a user's class could not be made, or did not do its work.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GuestError {
    /// The class cannot be used: it cannot be found or made, or lacks methods.
    #[error("{message}; hint: {hint}")]
    Unusable {
        /// What is wrong.
        message: String,
        /// What to do.
        hint: String,
    },
    /// The code of the class failed: `my_nets.py:12: ValueError: ...`.
    #[error("{0}")]
    Raised(String),
    /// A method gave back what it may not.
    #[error("`{class}.{method}` {problem}")]
    Answer {
        /// Module and class.
        class: String,
        /// The method.
        method: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// The process of the object has ended, or does not answer.
    #[error("{0}")]
    Gone(String),
    /// The job was cancelled while a method ran.
    #[error("`{0}` was stopped")]
    Stopped(String),
}

/// An object with its class, for messages.
pub(crate) struct Named {
    pub guest: Arc<dyn Guest>,
    pub class: String,
}

impl Named {
    /// Makes an object; `own` goes before the options of the user, which may not repeat it.
    pub fn make(
        host: &dyn Host,
        class: &GuestClass,
        role: Role,
        own: Map<String, Value>,
    ) -> Result<(Self, Value), GuestError> {
        let mut arguments = class.options.clone();
        for (name, value) in own {
            if arguments.insert(name.clone(), value).is_some() {
                return Err(GuestError::Unusable {
                    message: format!("`{}`: Petzval itself gives the argument `{name}`", class.class),
                    hint: "leave it out of its options".to_owned(),
                });
            }
        }
        let (guest, about) = host.make(&class.class, role, &arguments)?;
        Ok((Self { guest, class: class.class.clone() }, about))
    }

    pub(crate) fn wrong(&self, method: &'static str, problem: impl Into<String>) -> GuestError {
        GuestError::Answer { class: self.class.clone(), method, problem: problem.into() }
    }

    /// Calls a method that gives back one array of this shape, all of it finite.
    pub fn array(&self, call: &Call, shape: &[usize]) -> Result<Vec<f32>, GuestError> {
        let answer = self.guest.call(call)?;
        let [array] = &answer.arrays[..] else {
            return Err(self.wrong(call.method, format!("gives {} arrays, not one", answer.arrays.len())));
        };
        self.check(call.method, "", array, shape)?;
        Ok(answer.arrays.into_iter().next().unwrap_or_default().values)
    }

    /// Checks an array that a method gave; `what` says which.
    pub(crate) fn check(
        &self,
        method: &'static str,
        what: &str,
        array: &Array,
        shape: &[usize],
    ) -> Result<(), GuestError> {
        if array.shape != shape {
            let problem = format!("gives {what}an array of shape {:?}, not {shape:?}", array.shape);
            return Err(self.wrong(method, problem));
        }
        match array.values.iter().position(|value| !value.is_finite()) {
            Some(place) => {
                let value = array.values[place];
                Err(self.wrong(method, format!("gives {what}{value} at element {place}")))
            }
            None => Ok(()),
        }
    }
}
