//! Names of units, of the keys that vary and their values: `grid=64,steps=400,seed=1`.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::expand::Expansion;

/// Letters of the longest name; folders and files are named by it.
const LONGEST: usize = 100;

/// Letters of the longest text within a name.
const LONGEST_TEXT: usize = 24;

/// The name of a sweep of a single unit in which nothing varies.
const ONLY: &str = "only";

/// A name for each combination, all different, of letters that folders and shells take as they are.
///
/// A key is called by its last words, as many as distinguish it from the others. A number is written as it is. Of a text its last part is taken, of a list
/// or a table its place among the values; values that would read the same have their place added.
pub fn names(expansion: &Expansion) -> Vec<String> {
    let keys: Vec<String> = expansion.keys.iter().map(|key| key.key.clone()).collect();
    let short = short_keys(&keys);
    let labels: Vec<Vec<(Value, String)>> = (0..keys.len())
        .map(|k| labels(expansion.combinations.iter().map(|combination| &combination.values[k])))
        .collect();
    let name = |place: usize| {
        let combination = &expansion.combinations[place];
        let values = combination.values.iter().enumerate().map(|(k, value)| {
            let label = labels[k].iter().find(|(known, _)| known == value).map_or("", |(_, label)| label);
            format!("{}={label}", short[k])
        });
        let variant = combination.variant.clone();
        let seed = combination.seed.map(|seed| format!("seed={seed}"));
        let name = values.chain(variant).chain(seed).collect::<Vec<_>>().join(",");
        match name.len() {
            0 => ONLY.to_owned(),
            length if length <= LONGEST => name,
            _ => {
                let digest = petzval_base::hex(&Sha256::digest(&name)[..4]);
                let end = (0..=LONGEST - 9).rev().find(|end| name.is_char_boundary(*end)).unwrap_or(0);
                format!("{}-{digest}", &name[..end])
            }
        }
    };
    let mut known = BTreeSet::new();
    let own = |place: usize| {
        let name = name(place);
        // On some systems names that differ in capitals alone are one folder.
        if known.insert(name.to_ascii_lowercase()) { name } else { format!("{name}.{}", place + 1) }
    };
    (0..expansion.combinations.len()).map(own).collect()
}

/// The last words of each key path, as few as distinguish it from the others.
pub fn short_keys(keys: &[String]) -> Vec<String> {
    let last = |key: &str, words: usize| {
        let parts: Vec<&str> = key.split('.').collect();
        parts[parts.len().saturating_sub(words)..].join(".")
    };
    let short = |key: &String| {
        let most = key.split('.').count();
        let is_own = |words: &usize| {
            !keys.iter().any(|other| other != key && last(other, *words) == last(key, *words))
        };
        let words = (1..=most).find(is_own).unwrap_or(most);
        clean(&last(key, words))
    };
    keys.iter().map(short).collect()
}

/// A label for every different value, all different.
fn labels<'v>(values: impl Iterator<Item = &'v Value>) -> Vec<(Value, String)> {
    let mut different: Vec<Value> = Vec::new();
    let mut known = BTreeSet::new();
    for value in values {
        if known.insert(value.to_string()) {
            different.push(value.clone());
        }
    }
    let plain: Vec<String> = different.iter().enumerate().map(|(place, value)| label(value, place)).collect();
    let label = |place: usize| {
        let is_alone = plain.iter().filter(|other| other.eq_ignore_ascii_case(&plain[place])).count() == 1;
        if is_alone { plain[place].clone() } else { format!("{}-{}", plain[place], place + 1) }
    };
    let labels: Vec<String> = (0..different.len()).map(label).collect();
    different.into_iter().zip(labels).collect()
}

/// A value in a few letters.
fn label(value: &Value, place: usize) -> String {
    let text = match value {
        Value::String(text) => {
            // Of a path the name of the file says most.
            let path = Path::new(text);
            let stem = path.file_stem().map_or_else(|| text.as_str().into(), |stem| stem.to_string_lossy());
            let is_ending = |ending: &std::ffi::OsStr| {
                ending.to_str().is_some_and(|ending| ending.chars().all(|c| c.is_ascii_alphabetic()))
            };
            let is_path = text.contains(['/', '\\']) || path.extension().is_some_and(is_ending);
            let short = clean(if is_path { &stem } else { text });
            short.chars().take(LONGEST_TEXT).collect()
        }
        Value::Bool(_) | Value::Number(_) => clean(&value.to_string()),
        Value::Null | Value::Array(_) | Value::Object(_) => String::new(),
    };
    if text.is_empty() { format!("v{}", place + 1) } else { text }
}

/// A text with letters only that folders and shells take as they are.
fn clean(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-+".contains(c);
    text.trim().chars().map(|c| if is_plain(c) { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::expand::expand;
    use crate::sweep::file::parse;

    fn named(text: &str) -> Vec<String> {
        names(&expand(&parse(text).unwrap(), text).unwrap())
    }

    #[test]
    fn names_are_short_and_all_different() {
        let text = "seeds = [1, 2]\n[grid]\n\"psf.grid\" = [64]\n\"training.steps\" = [1e-3, 400]\n";
        assert_eq!(named(text)[..2], ["grid=64,steps=0.001,seed=1", "grid=64,steps=400,seed=1"]);
        assert_eq!(named(""), ["only"]);
        assert_eq!(named("variants = [\"a\"]\n"), ["a"]);
        let text = "[grid]\n\"optics.steps\" = [1]\n\"training.steps\" = [2]\n\"isp.x.steps\" = [3]\n";
        assert_eq!(named(text), ["x.steps=3,optics.steps=1,training.steps=2"]);
        let text = "[grid]\nlens = [\"a/b.toml\", \"c/b.toml\", \"c/b c.zmx\", \"B\"]\nscores = [[1], [2]]\n";
        let found = named(text);
        assert_eq!(found[0], "lens=b-1,scores=v1");
        assert_eq!(found[4], "lens=b-c,scores=v1");
        let different: BTreeSet<String> = found.iter().map(|name| name.to_ascii_lowercase()).collect();
        assert_eq!(different.len(), found.len());
    }

    #[test]
    fn a_long_name_is_cut_and_stays_the_only_one() {
        let keys: String = (0..12)
            .map(|i| {
                format!(
                    "\"table{i}.a_long_name_of_a_key\" = [\"{}\", \"{}\"]\n",
                    "x".repeat(40),
                    "y".repeat(40)
                )
            })
            .take(3)
            .collect();
        let found = named(&format!("[grid]\n{keys}"));
        assert!(found.iter().all(|name| name.len() <= LONGEST), "{found:?}");
        let different: BTreeSet<&String> = found.iter().collect();
        assert_eq!((found.len(), different.len()), (8, 8));
    }
}
