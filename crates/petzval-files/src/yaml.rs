//! The part of YAML that pages of refractiveindex.info use, as a tree whose nodes have their line. Aliases are refused,
//! because a short text with aliases can expand exponentially; so is deep nesting.

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
    /// Keys and values in the order of the file.
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
    /// The entries so far, and the key whose value comes next.
    Map(Vec<(String, Node)>, Option<String>),
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
                open.push((line, Open::Map(Vec::new(), None)));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some((line, Open::List(nodes))) => Node { line, value: Value::List(nodes) },
                Some((line, Open::Map(entries, _))) => Node { line, value: Value::Map(entries) },
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
            Some((_, Open::Map(entries, key))) => match key.take() {
                Some(key) => entries.push((key, done)),
                None => match done.value {
                    Value::Text(text) => *key = Some(text),
                    _ => return Err(error(done.line, "", "", "a key is a word")),
                },
            },
        }
    }
    Err(error(1, "", "", "there is nothing in this file"))
}
