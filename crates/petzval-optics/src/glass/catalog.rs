//! A catalogue: glasses by name.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Glass;
use crate::format::{FileError, parse_catalog};

/// Glasses by name, without regard to upper and lower case. `AIR` is always among them.
#[derive(Clone, Debug, PartialEq)]
pub struct Catalog {
    /// By upper-case name.
    glasses: BTreeMap<String, Arc<Glass>>,
    /// Who makes them, where that is known; by upper-case name.
    makers: BTreeMap<String, String>,
}

/// There is no glass of that name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no glass is called `{name}`; the nearest names are {}", .nearest.join(", "))]
pub struct UnknownGlass {
    /// The name that was asked for.
    pub name: String,
    /// The nearest known names, best first. They are a hint, never a substitute.
    pub nearest: Vec<String>,
}

impl Default for Catalog {
    /// A catalogue of nothing but air.
    fn default() -> Self {
        Self { glasses: BTreeMap::from([("AIR".into(), Glass::air())]), makers: BTreeMap::new() }
    }
}

impl Catalog {
    /// A catalogue from the text of a glass file: one TOML table `[glass.NAME]` for each glass.
    pub fn parse(toml_text: &str) -> Result<Self, FileError> {
        parse_catalog(toml_text)
    }

    /// Add a glass under a name, which may be an alias. An earlier glass of that name gives way.
    pub fn insert(&mut self, name: &str, glass: Arc<Glass>) {
        self.makers.remove(&name.to_uppercase());
        self.glasses.insert(name.to_uppercase(), glass);
    }

    /// Say who makes the glass of that name.
    pub fn set_maker(&mut self, name: &str, maker: &str) {
        self.makers.insert(name.to_uppercase(), maker.into());
    }

    /// Who makes the glass of that name, where that is known.
    pub fn maker(&self, name: &str) -> Option<&str> {
        self.makers.get(&name.to_uppercase()).map(String::as_str)
    }

    /// Add all glasses of another catalogue. Where both know a name, the other's glass counts.
    pub fn merge(&mut self, other: Self) {
        self.makers.retain(|name, _| !other.glasses.contains_key(name) || name == "AIR");
        self.makers.extend(other.makers);
        self.glasses.extend(other.glasses);
    }

    /// The glass of that name.
    pub fn get(&self, name: &str) -> Result<Arc<Glass>, UnknownGlass> {
        const HINTS: usize = 3;
        let wanted = name.to_uppercase();
        if let Some(glass) = self.glasses.get(&wanted) {
            return Ok(glass.clone());
        }
        // Fewest edits first; among equals a name that contains the wanted one, then the alphabet.
        let mut nearest: Vec<&String> = self.glasses.keys().collect();
        nearest.sort_by_cached_key(|known| {
            (strsim::damerau_levenshtein(&wanted, known), !known.contains(&wanted))
        });
        let nearest = nearest.into_iter().take(HINTS).cloned().collect();
        Err(UnknownGlass { name: name.into(), nearest })
    }

    /// All names and aliases in upper case, in alphabetical order, with their glasses.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Arc<Glass>)> {
        self.glasses.iter().map(|(name, glass)| (name.as_str(), glass))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glass::Dispersion;

    fn catalog() -> Catalog {
        Catalog::parse("[glass.N-BK7]\nnd=1.5168\nvd=64.17\n[glass.F2]\nn=1.6\naliases=[\"Flint\"]\n")
            .unwrap()
    }

    #[test]
    fn names_and_aliases_ignore_case_and_air_is_always_there() {
        let catalog = catalog();
        assert_eq!(catalog.get("n-bk7").unwrap().name, "N-BK7");
        assert_eq!(catalog.get("FLINT").unwrap().name, "F2");
        assert!(catalog.get("air").unwrap().is_air());
    }

    #[test]
    fn an_unknown_name_gets_hints_and_no_glass() {
        let error = catalog().get("BK7").unwrap_err();
        assert_eq!(error.name, "BK7");
        assert_eq!(error.nearest, ["N-BK7", "AIR", "F2"]);
    }

    #[test]
    fn the_later_catalogue_counts() {
        let mut all = catalog();
        all.merge(Catalog::parse("[glass.f2]\nn = 1.7\n").unwrap());
        assert_eq!(all.get("F2").unwrap().dispersion, Dispersion::Constant(1.7));
        assert_eq!(all.iter().count(), 4);
    }
}
