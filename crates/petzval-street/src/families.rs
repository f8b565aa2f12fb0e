//! Families of shapes and textures, and which half of them a street uses.

use std::collections::BTreeSet;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Which families of shapes and textures a street is made of. A network that learns on one half and is scored on the other
/// cannot succeed by knowing the generator.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Families {
    /// All families.
    #[default]
    All,
    /// Every other family of each group, from the first.
    First,
    /// The families that [`Families::First`] leaves out.
    Second,
}

/// Draws families, and remembers which ones a street has used.
pub(crate) struct Drawer {
    families: Families,
    /// Names `group/family` of what was drawn.
    pub used: BTreeSet<String>,
}

impl Drawer {
    pub fn new(families: Families) -> Self {
        Self { families, used: BTreeSet::new() }
    }

    /// One family of a group; a group lists at least two families with their names.
    pub fn draw<F: Copy>(&mut self, rng: &mut ChaCha8Rng, group: &str, all: &[(F, &str)]) -> F {
        let half = all.len().div_ceil(2);
        let place = match self.families {
            Families::All => rng.random_range(0..all.len()),
            Families::First => 2 * rng.random_range(0..half),
            Families::Second => 2 * rng.random_range(0..all.len() / 2) + 1,
        };
        let (family, name) = all[place];
        self.used.insert(format!("{group}/{name}"));
        family
    }
}
