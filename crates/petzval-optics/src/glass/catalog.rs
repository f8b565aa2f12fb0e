//! A catalogue: glasses by name.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::Glass;

/// Glasses by name, without regard to upper and lower case. `AIR` is always among them, and no other glass has this name.
///
/// Several makers may use one name. A name alone means the glass that was added last; `MAKER:NAME` means that maker's
/// glass. A glass that was refused counts like one that was added: no earlier glass stands in for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Catalog {
    /// By upper-case name, one for each maker; the last one is meant by the name alone.
    glasses: BTreeMap<String, Vec<Arc<Glass>>>,
    /// By upper-case name, at most one for each maker, none of whom has a glass of that name.
    refused: BTreeMap<String, Vec<Refusal>>,
}

/// A glass that was left out.
#[derive(Clone, Debug, PartialEq)]
struct Refusal {
    maker: String,
    reason: String,
    /// Whether the name alone means this glass.
    is_last: bool,
}

/// There is no glass of that name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownGlass {
    /// The requested name.
    pub name: String,
    /// Why a file's glass of that name was left out.
    pub refused: Option<String>,
    /// The nearest known names, best first. They are a hint, never a substitute.
    pub nearest: Vec<String>,
}

impl fmt::Display for UnknownGlass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; the nearest names are {}", self.reason(), self.nearest.join(", "))
    }
}

impl std::error::Error for UnknownGlass {}

impl UnknownGlass {
    /// The reason, without the nearest names.
    pub fn reason(&self) -> String {
        match &self.refused {
            Some(reason) => format!("the glass `{}` was left out: {reason}", self.name),
            None => format!("no glass is called `{}`", self.name),
        }
    }
}

const AIR: &str = "AIR";

/// Names that the error for an unknown glass suggests.
const HINTS: usize = 3;

impl Default for Catalog {
    /// A catalogue with air alone.
    fn default() -> Self {
        Self { glasses: BTreeMap::from([(AIR.into(), vec![Glass::air()])]), refused: BTreeMap::new() }
    }
}

impl Catalog {
    /// Adds a glass under a name, which may be an alias. It replaces an earlier glass of that name and maker; one of
    /// another maker stays available as `MAKER:NAME`. Air cannot be replaced.
    pub fn insert(&mut self, name: &str, glass: Arc<Glass>) {
        let name = name.to_uppercase();
        if name == AIR {
            return;
        }
        self.settle_refusals(&name, &glass.maker);
        let makers = self.glasses.entry(name).or_default();
        makers.retain(|known| !known.maker.eq_ignore_ascii_case(&glass.maker));
        makers.push(glass);
    }

    /// Notes why a glass of a file was left out. It takes the place of an earlier glass of that name and maker. A lookup of the name alone
    /// gives the reason until a glass of that name is added. Air cannot be refused.
    pub fn refuse(&mut self, name: &str, maker: &str, reason: String) {
        let name = name.to_uppercase();
        if name == AIR {
            return;
        }
        if let Some(makers) = self.glasses.get_mut(&name) {
            makers.retain(|known| !known.maker.eq_ignore_ascii_case(maker));
        }
        self.settle_refusals(&name, maker);
        let refusal = Refusal { maker: maker.to_owned(), reason, is_last: true };
        self.refused.entry(name).or_default().push(refusal);
    }

    /// Drops a maker's refusal of an upper-case name. Those of other makers no longer count for the name alone.
    fn settle_refusals(&mut self, name: &str, maker: &str) {
        if let Some(refusals) = self.refused.get_mut(name) {
            refusals.retain(|known| !known.maker.eq_ignore_ascii_case(maker));
            refusals.iter_mut().for_each(|known| known.is_last = false);
        }
    }

    /// Why the glass that an upper-case name alone means was left out; `None` if it was not.
    fn refusal_of_name_alone(&self, name: &str) -> Option<&Refusal> {
        self.refused.get(name)?.iter().find(|refusal| refusal.is_last)
    }

    /// Adds all glasses and refusals of another catalogue, which take precedence for common names.
    pub fn merge(&mut self, other: Self) {
        let (last, earlier): (Vec<_>, Vec<_>) = (other.refused.into_iter())
            .flat_map(|(name, refusals)| refusals.into_iter().map(move |refusal| (name.clone(), refusal)))
            .partition(|(_, refusal)| refusal.is_last);
        for (name, Refusal { maker, reason, .. }) in earlier {
            self.refuse(&name, &maker, reason);
        }
        for (name, makers) in other.glasses {
            for glass in makers {
                self.insert(&name, glass);
            }
        }
        // What each name alone means comes last.
        for (name, Refusal { maker, reason, .. }) in last {
            self.refuse(&name, &maker, reason);
        }
    }

    /// The glass of that name, or of `MAKER:NAME`.
    pub fn get(&self, name: &str) -> Result<Arc<Glass>, UnknownGlass> {
        let wanted = name.to_uppercase();
        if let Some(refusal) = self.refusal_of_name_alone(&wanted) {
            return Err(self.refused_glass(name, &wanted, refusal));
        }
        if let Some(glass) = self.all(&wanted).last() {
            return Ok(glass.clone());
        }
        let made_by = |maker: &str, glass: &Glass| glass.maker.to_uppercase() == maker;
        let qualified = wanted.split_once(':').map(|(maker, name)| (maker.trim(), name.trim()));
        if let Some((maker, name)) = qualified
            && let Some(glass) = self.all(name).iter().find(|glass| made_by(maker, glass))
        {
            return Ok(glass.clone());
        }
        // For a known maker, suggest names of that maker.
        let known: Vec<String> = match qualified {
            Some((maker, _)) if self.glasses().any(|glass| made_by(maker, glass)) => {
                let theirs =
                    self.glasses.iter().filter(|(_, all)| all.iter().any(|glass| made_by(maker, glass)));
                theirs.map(|(name, _)| format!("{maker}:{name}")).collect()
            }
            _ => self.names(),
        };
        let refusal = qualified.and_then(|(maker, name)| {
            self.refused.get(name)?.iter().find(|refusal| refusal.maker.to_uppercase() == maker)
        });
        let refused = refusal.map(|refusal| refusal.reason.clone());
        Err(UnknownGlass { name: name.into(), refused, nearest: nearest_names(&wanted, known) })
    }

    /// The error for a name whose glass was left out. Glasses of that name by other makers are the first hints.
    fn refused_glass(&self, name: &str, wanted: &str, refusal: &Refusal) -> UnknownGlass {
        let others = self.all(wanted).iter().rev();
        let mut nearest: Vec<String> =
            others.map(|glass| format!("{}:{wanted}", glass.maker.to_uppercase())).collect();
        let known = self.names().into_iter().filter(|known| known != wanted).collect();
        nearest.extend(nearest_names(wanted, known));
        nearest.truncate(HINTS);
        UnknownGlass { name: name.into(), refused: Some(refusal.reason.clone()), nearest }
    }

    /// Makers whose glass of that name was left out, each with the error for it.
    pub fn refusals(&self, name: &str) -> impl Iterator<Item = (&str, UnknownGlass)> {
        let wanted = name.to_uppercase();
        let refused = self.refused.get(&wanted).map_or(&[][..], Vec::as_slice).iter();
        refused.map(move |refusal| (refusal.maker.as_str(), self.refused_glass(&wanted, &wanted, refusal)))
    }

    /// Every name that alone means a glass, in upper case.
    fn names(&self) -> Vec<String> {
        self.iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// All glasses of a name, one for each maker; the last one is meant by the name alone.
    pub fn all(&self, name: &str) -> &[Arc<Glass>] {
        self.glasses.get(&name.to_uppercase()).map_or(&[], Vec::as_slice)
    }

    /// All names and aliases in upper case, in alphabetical order, with the glasses that they mean. A name whose glass was refused means none.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Arc<Glass>)> {
        let known = self.iter_all().filter(move |(name, _)| self.refusal_of_name_alone(name).is_none());
        known.filter_map(|(name, all)| Some((name, all.last()?)))
    }

    /// All names and aliases in upper case, in alphabetical order, each with its glasses of every maker.
    pub fn iter_all(&self) -> impl Iterator<Item = (&str, &[Arc<Glass>])> {
        self.glasses.iter().map(|(name, all)| (name.as_str(), all.as_slice()))
    }

    /// Every glass of every maker in alphabetical order, each once, without aliases and air.
    pub fn glasses(&self) -> impl Iterator<Item = &Arc<Glass>> {
        self.glasses.iter().flat_map(|(name, all)| {
            all.iter().filter(move |glass| *name == glass.name.to_uppercase() && !glass.is_air())
        })
    }
}

/// The three known names most similar to the requested one. Only letters and digits are compared, because programs
/// differ in punctuation. The similarity of Jaro and Winkler gives the beginning of a name more weight than its end.
/// Equally similar names are in alphabetical order.
fn nearest_names(wanted: &str, mut known: Vec<String>) -> Vec<String> {
    // Limit the length: the time to compare grows with it, and no glass has such a long name.
    const LONGEST: usize = 64;
    // Compare the name without its maker.
    let plain = |name: &str| -> String {
        let bare = name.rsplit(':').next().unwrap_or(name);
        bare.chars().filter(|c| c.is_alphanumeric()).take(LONGEST).collect()
    };
    let wanted = plain(wanted);
    // Similarity from 0 to 1, as a whole number for sorting.
    let likeness = |known: &str| (1e9 * strsim::jaro_winkler(&wanted, &plain(known))) as u32;
    known.sort_by_cached_key(|known| std::cmp::Reverse(likeness(known)));
    known.truncate(HINTS);
    known
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glass::Dispersion;

    fn catalog() -> Catalog {
        let mut catalog = Catalog::default();
        catalog.insert("N-BK7", Arc::new(Glass::new("N-BK7", Dispersion::NdVd { nd: 1.5168, vd: 64.17 })));
        let flint = Arc::new(Glass::new("F2", Dispersion::Constant(1.6)));
        catalog.insert("F2", flint.clone());
        catalog.insert("Flint", flint);
        catalog
    }

    fn of(maker: &str, name: &str, n: f64) -> Catalog {
        let mut catalog = Catalog::default();
        let glass = Glass { maker: maker.into(), ..Glass::new(name, Dispersion::Constant(n)) };
        catalog.insert(name, Arc::new(glass));
        catalog
    }

    #[test]
    fn names_and_aliases_ignore_case_and_air_is_always_there() {
        let catalog = catalog();
        assert_eq!(catalog.get("n-bk7").unwrap().name, "N-BK7");
        assert_eq!(catalog.get("FLINT").unwrap().name, "F2");
        assert!(catalog.get("air").unwrap().is_air());
        assert_eq!(catalog.glasses().count(), 2);
    }

    #[test]
    fn an_unknown_name_gets_hints_and_no_glass() {
        let error = catalog().get("BK7").unwrap_err();
        assert_eq!(error.name, "BK7");
        assert_eq!(error.nearest, ["N-BK7", "AIR", "F2"]);
        assert_eq!(catalog().get(&"x".repeat(1_000_000)).unwrap_err().nearest.len(), 3);
    }

    #[test]
    fn names_that_begin_alike_are_nearest_and_punctuation_does_not_count() {
        let known =
            ["AIR", "BK7", "GE", "H-K9L", "H-ZK9", "K9", "LASF9", "N-BK10", "N-BK7", "N-LASF9", "TIFN5"];
        for (wanted, first) in [
            ("GERMANIUM", "GE"),
            ("NBK7", "N-BK7"),
            ("M-BK7", "BK7"),
            ("HK9L", "H-K9L"),
            ("N_LASF9", "N-LASF9"),
        ] {
            let nearest = nearest_names(wanted, known.map(str::to_owned).to_vec());
            assert_eq!((nearest.len(), nearest[0].as_str()), (3, first), "{wanted}: {nearest:?}");
        }
    }

    #[test]
    fn air_has_no_dispersion() {
        assert_eq!(Glass::air().abbe_vd(), f64::INFINITY);
    }

    #[test]
    fn the_later_catalogue_counts() {
        let mut all = catalog();
        all.merge(of("", "f2", 1.7));
        assert_eq!(all.get("F2").unwrap().dispersion, Dispersion::Constant(1.7));
        assert_eq!(all.iter().count(), 4);
    }

    #[test]
    fn a_name_of_several_makers_is_distinguished_by_the_maker() {
        let mut all = of("Schott", "F2", 1.62);
        all.merge(of("Hoya", "F2", 1.61));
        all.merge(of("Hoya", "F5", 1.60));
        let index = |name: &str| all.get(name).map(|glass| glass.index(0.5));
        assert_eq!((index("F2"), index("SCHOTT:F2"), index("hoya: f2")), (Ok(1.61), Ok(1.62), Ok(1.61)));
        assert_eq!(all.all("f2").len(), 2);
        assert_eq!(index("HOYA:F3").unwrap_err().nearest, ["HOYA:F2", "HOYA:F5"]);
        assert_eq!(index("Nobody:F2").unwrap_err().nearest.len(), 3);
        // A newer catalogue of the same maker takes the place of the older one.
        all.merge(of("SCHOTT", "F2", 1.63));
        assert_eq!((all.all("F2").len(), all.get("F2").unwrap().index(0.5)), (2, 1.63));
    }

    #[test]
    fn no_other_glass_stands_in_for_a_refused_one() {
        let index = |all: &Catalog, name: &str| all.get(name).map(|glass| glass.index(0.5));
        let refused = |maker: &str| {
            let mut catalog = Catalog::default();
            catalog.refuse("f2", maker, "misprinted".to_owned());
            catalog
        };
        let built_in = of("Schott", "F2", 1.62);
        // Of another maker: its own glass is left, by the name of the maker.
        let mut all = built_in.clone();
        all.merge(refused("mine"));
        let unknown = all.get("F2").unwrap_err();
        assert_eq!(
            (unknown.refused.as_deref(), unknown.nearest[0].as_str()),
            (Some("misprinted"), "SCHOTT:F2")
        );
        assert_eq!(index(&all, "Schott:F2"), Ok(1.62));
        assert_eq!(index(&all, "mine:F2").unwrap_err().refused.as_deref(), Some("misprinted"));
        assert!(all.iter().all(|(name, _)| name != "F2"));
        // Of the same maker: nothing is left.
        let mut all = built_in.clone();
        all.merge(refused("SCHOTT"));
        assert_eq!((index(&all, "Schott:F2").is_ok(), all.glasses().count()), (false, 0));
        // The later glass counts, and the refusal stays that of its maker alone.
        let mut chosen = refused("Schott");
        chosen.merge(of("Hoya", "F2", 1.61));
        let mut all = built_in;
        all.merge(chosen);
        assert_eq!((index(&all, "F2"), index(&all, "Schott:F2").is_ok()), (Ok(1.61), false));
        all.merge(of("Schott", "F2", 1.63));
        assert_eq!((index(&all, "F2"), index(&all, "Schott:F2")), (Ok(1.63), Ok(1.63)));
    }

    #[test]
    fn nothing_takes_the_place_of_air() {
        let mut all = Catalog::default();
        all.refuse("Air", "", "misprinted".to_owned());
        all.insert("Air", Arc::new(Glass::new("Air", Dispersion::Constant(1.5))));
        assert!(all.get("AIR").unwrap().is_air());
    }
}
