//! The part of YAML that pages of refractiveindex.info use, as a tree whose nodes have their line. Aliases are refused,
//! because a short text with aliases can expand exponentially; so are deep nesting and a key that a map has twice.

use std::collections::HashMap;

use saphyr_parser::{Event, Parser};

use petzval_base::FileError;

/// A node of the tree.
pub(crate) struct Node {
    /// Line of the node, from 1.
    pub line: usize,
    pub value: Value,
}

pub(crate) enum Value {
    Text(String),
    List(Vec<Node>),
    /// Keys and values in the order of the file; no key is there twice.
    Map(Vec<(String, Node)>),
}

impl Node {
    /// The value of a key; `None` if it is missing or this is not a map.
    pub fn get(&self, key: &str) -> Option<&Node> {
        match &self.value {
            Value::Map(entries) => entries.iter().find(|(known, _)| known == key).map(|(_, node)| node),
            _ => None,
        }
    }

    /// The scalar text; `None` if this is a list or a map.
    pub fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(text) => Some(text.trim()),
            _ => None,
        }
    }

    /// The nodes of a list; a single node counts as a list of one.
    pub fn list(&self) -> &[Node] {
        match &self.value {
            Value::List(nodes) => nodes,
            _ => std::slice::from_ref(self),
        }
    }

    pub fn error(&self, key: &str, message: impl Into<String>) -> FileError {
        error(self.line, key, self.text().unwrap_or(""), message)
    }
}

pub(crate) fn error(line: usize, key: &str, value: &str, message: impl Into<String>) -> FileError {
    FileError { key: key.into(), ..FileError::at_line(u32::try_from(line).unwrap_or(0), value, message) }
}

/// A list or map that is being read.
enum Open {
    List(Vec<Node>),
    Map(OpenMap),
}

/// A map that is being read.
#[derive(Default)]
struct OpenMap {
    /// The entries so far.
    entries: Vec<(String, Node)>,
    /// The key whose value comes next.
    key: Option<String>,
    /// The line of each key, from 1.
    lines: HashMap<String, usize>,
}

impl OpenMap {
    /// Takes a key or the value of the last key. Fails on a key that is no text, or that was there before.
    fn take(&mut self, node: Node) -> Result<(), FileError> {
        if let Some(key) = self.key.take() {
            self.entries.push((key, node));
            return Ok(());
        }
        let Value::Text(key) = node.value else {
            return Err(error(node.line, "", "", "a key is a word"));
        };
        if let Some(first) = self.lines.insert(key.clone(), node.line) {
            let message = format!("this key is there twice, first in line {first}");
            return Err(error(node.line, &key, "", message).hint("keep one of the two"));
        }
        self.key = Some(key);
        Ok(())
    }
}

/// Parses the first document of a text.
pub(crate) fn parse(text: &str) -> Result<Node, FileError> {
    // Pages have 6 levels.
    const DEEPEST: usize = 32;
    let mut open: Vec<(usize, Open)> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, span) = event.map_err(|e| {
            let mark = e.marker();
            let mut found = error(mark.line(), "", "", format!("this is not YAML: {}", e.info()));
            found.column = u32::try_from(mark.col() + 1).ok();
            found
        })?;
        let line = span.start.line();
        let done = match event {
            Event::Scalar(text, ..) => Node { line, value: Value::Text(text.into_owned()) },
            Event::SequenceStart(..) | Event::MappingStart(..) if open.len() == DEEPEST => {
                return Err(error(line, "", "", format!("this is nested deeper than {DEEPEST} levels")));
            }
            Event::SequenceStart(..) => {
                open.push((line, Open::List(Vec::new())));
                continue;
            }
            Event::MappingStart(..) => {
                open.push((line, Open::Map(OpenMap::default())));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some((line, Open::List(nodes))) => Node { line, value: Value::List(nodes) },
                Some((line, Open::Map(map))) => Node { line, value: Value::Map(map.entries) },
                None => break,
            },
            Event::Alias(_) => {
                return Err(error(line, "", "", "aliases are not read").hint("write the values out"));
            }
            Event::DocumentEnd | Event::StreamEnd => break,
            Event::Nothing | Event::StreamStart | Event::DocumentStart(_) => continue,
        };
        match open.last_mut() {
            None => return Ok(done),
            Some((_, Open::List(nodes))) => nodes.push(done),
            Some((_, Open::Map(map))) => map.take(done)?,
        }
    }
    Err(error(1, "", "", "there is nothing in this file"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_a_map_has_twice_is_refused() {
        for (text, line, key, first) in [
            ("names: [a]\nnc: 1\nnames: [b]\n", 3, "names", 1),
            ("names:\n  0: a\n  1: b\n  0: c\n", 4, "0", 2),
            ("names: {0: a, 0: b}\n", 1, "0", 1),
            ("- x: 1\n  y: 2\n  \"x\": 3\n", 3, "x", 1),
        ] {
            let Err(error) = parse(text) else { panic!("{text}") };
            assert_eq!((error.line, error.key.as_str()), (Some(line), key), "{text}");
            assert!(error.message.ends_with(&format!("first in line {first}")), "{error}");
            assert!(error.hint.is_some(), "{text}");
        }
        // Maps beside and below each other may have the same keys.
        assert!(parse("- x: 1\n- x: 2\n").is_ok() && parse("x:\n  x: 1\ny:\n  x: 1\n").is_ok());
    }
}
