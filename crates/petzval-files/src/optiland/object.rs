//! Objects of the file: values by key, of the wanted type, and errors that name their line.

use petzval_base::FileError;

use crate::draft::Record;
use crate::loss::{Effect, Losses};
use crate::yaml::{Node, Value};

/// An object of the file.
#[derive(Clone, Copy)]
pub(super) struct Object<'a> {
    node: &'a Node,
}

impl<'a> Object<'a> {
    /// The node as an object; `what` names it in the error.
    pub fn new(node: &'a Node, what: &str) -> Result<Self, FileError> {
        match node.value {
            Value::Map(_) => Ok(Self { node }),
            _ => Err(node.error(what, "expected an object in braces")),
        }
    }

    /// The node of a key; `None` if it is missing or null.
    fn get(&self, key: &str) -> Option<&'a Node> {
        self.node.get(key).filter(|node| node.text() != Some("null"))
    }

    /// The object of a key.
    pub fn object(&self, key: &str) -> Result<Option<Object<'a>>, FileError> {
        self.get(key).map(|node| Self::new(node, key)).transpose()
    }

    /// The object of a key that must be there.
    pub fn needed_object(&self, key: &str) -> Result<Object<'a>, FileError> {
        self.object(key)?.ok_or_else(|| self.missing(key))
    }

    /// The values of a list; none if it is missing.
    pub fn list(&self, key: &str) -> Result<&'a [Node], FileError> {
        match self.get(key).map(|node| (&node.value, node)) {
            None => Ok(&[]),
            Some((Value::List(nodes), _)) => Ok(nodes),
            Some((_, node)) => Err(node.error(key, "expected a list in square brackets")),
        }
    }

    /// A number; Python writes infinity as `Infinity`.
    pub fn number(&self, key: &str) -> Result<Option<f64>, FileError> {
        self.get(key).map(|node| number_of(node, key)).transpose()
    }

    /// A number that must be there.
    pub fn needed_number(&self, key: &str) -> Result<f64, FileError> {
        self.number(key)?.ok_or_else(|| self.missing(key))
    }

    /// A text.
    pub fn text(&self, key: &str) -> Result<Option<&'a str>, FileError> {
        let text = |node: &'a Node| node.text().ok_or_else(|| node.error(key, "expected a text"));
        self.get(key).map(text).transpose()
    }

    /// A text that must be there.
    pub fn needed_text(&self, key: &str) -> Result<&'a str, FileError> {
        self.text(key)?.ok_or_else(|| self.missing(key))
    }

    /// A truth value; false if it is missing.
    pub fn flag(&self, key: &str) -> Result<bool, FileError> {
        match self.get(key).map(|node| (node.text(), node)) {
            None | Some((Some("false"), _)) => Ok(false),
            Some((Some("true"), _)) => Ok(true),
            Some((_, node)) => Err(node.error(key, "expected true or false")),
        }
    }

    /// Whether a key has a value that is neither null nor an empty list or object.
    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some_and(|node| match &node.value {
            Value::Text(_) => true,
            Value::List(nodes) => !nodes.is_empty(),
            Value::Map(entries) => !entries.is_empty(),
        })
    }

    /// The object's place, for messages about it as a whole.
    pub fn record(&self, text: &str) -> Record {
        Record::new(u32::try_from(self.node.line).unwrap_or(0), text)
    }

    /// An error about the value of a key.
    pub fn error(&self, key: &str, message: impl Into<String>) -> FileError {
        self.node.get(key).unwrap_or(self.node).error(key, message)
    }

    /// The line of the value of a key, for losses.
    pub fn line(&self, key: &str) -> u32 {
        u32::try_from(self.node.get(key).unwrap_or(self.node).line).unwrap_or(0)
    }

    /// Reports keys with a value that are none of `known`.
    pub fn report_others(&self, known: &[&str], losses: &mut Losses) {
        let Value::Map(entries) = &self.node.value else { return };
        for (key, _) in entries.iter().filter(|(key, _)| !known.contains(&key.as_str()) && self.has(key)) {
            losses.add(self.line(key), key, Effect::NotUnderstood, "this key is not understood");
        }
    }

    fn missing(&self, key: &str) -> FileError {
        self.node.error(key, "the key is missing")
    }
}

/// The number that a node is.
pub(super) fn number_of(node: &Node, key: &str) -> Result<f64, FileError> {
    let value = match node.text() {
        Some("Infinity") => Some(f64::INFINITY),
        Some("-Infinity") => Some(f64::NEG_INFINITY),
        Some(text) => text.parse().ok().filter(|v: &f64| v.is_finite()),
        None => None,
    };
    value.ok_or_else(|| node.error(key, "expected a number"))
}
