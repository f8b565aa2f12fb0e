//! Writes paths for programs that read JSON, which holds nothing but UTF-8. Bytes of a path that are no UTF-8 become U+FFFD.
//!
//! serde itself fails with such a path. A result must not be lost by the name of its file: fields of results have
//! `#[serde(serialize_with = "petzval_base::lossy_path::serialize")]`. Paths that are read again, such as those in the request of a run, do not have it.
//! `cargo xtask layers` finds a result without it.

use std::path::{Path, PathBuf};

use serde::Serializer;
use serde::ser::SerializeSeq;

/// One path or several, or none.
pub trait Paths {
    /// Writes them: one as a text, several as a list, none as nothing.
    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error>;
}

/// Writes a field of paths.
pub fn serialize<P: Paths, S: Serializer>(paths: &P, serializer: S) -> Result<S::Ok, S::Error> {
    paths.write(serializer)
}

/// A path as text.
fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

impl Paths for PathBuf {
    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&text(self))
    }
}

impl Paths for Option<PathBuf> {
    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Some(path) => serializer.serialize_some(&text(path)),
            None => serializer.serialize_none(),
        }
    }
}

impl Paths for Vec<PathBuf> {
    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(self.len()))?;
        self.iter().try_for_each(|path| list.serialize_element(&text(path)))?;
        list.end()
    }
}

impl<T: serde::Serialize> Paths for Vec<(PathBuf, T)> {
    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(self.len()))?;
        self.iter().try_for_each(|(path, value)| list.serialize_element(&(text(path), value)))?;
        list.end()
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::ffi::OsStringExt;

    use super::*;

    #[derive(serde::Serialize)]
    struct Answer {
        #[serde(serialize_with = "serialize")]
        one: PathBuf,
        #[serde(serialize_with = "serialize")]
        maybe: Option<PathBuf>,
        #[serde(serialize_with = "serialize")]
        none: Option<PathBuf>,
        #[serde(serialize_with = "serialize")]
        several: Vec<PathBuf>,
        #[serde(serialize_with = "serialize")]
        failed: Vec<(PathBuf, String)>,
    }

    #[test]
    fn bytes_that_are_no_text_become_a_sign() {
        let path = || PathBuf::from(std::ffi::OsString::from_vec(b"a/b\xff.png".to_vec()));
        assert!(serde_json::to_string(&path()).is_err());
        let result = Answer {
            one: path(),
            maybe: Some(path()),
            none: None,
            several: vec![PathBuf::from("c"), path()],
            failed: vec![(path(), "why".to_owned())],
        };
        let found = serde_json::to_value(result).unwrap();
        let text = "a/b\u{fffd}.png";
        let wanted = serde_json::json!({
            "one": text, "maybe": text, "none": null, "several": ["c", text], "failed": [[text, "why"]]
        });
        assert_eq!(found, wanted);
    }
}
