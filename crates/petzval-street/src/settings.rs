//! Which street to build.

use crate::families::Families;
use crate::light::{LampColours, Light};

/// Which street, when, and in which light.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StreetSettings {
    /// The seed. Streets of different sequences have nothing in common, so data are split by it.
    pub sequence: u64,
    /// Seconds since the sequence began: people walk, cars drive, the camera drives forward up to 130 m.
    pub moment: u32,
    /// The time of day.
    pub light: Light,
    /// Traffic and people, of those in a busy town, 0..1: the density of cars in the lanes and at the kerbs, and of people.
    pub busy: f64,
    /// Which families of shapes and textures it is made of.
    pub families: Families,
    /// The colours of signal lamps in the camera's channels.
    pub lamp_colours: LampColours,
}

impl StreetSettings {
    /// The first moment of a busy sequence, of all families, with the default lamp colours.
    pub fn new(sequence: u64, light: Light) -> Self {
        let (families, lamp_colours) = (Families::All, LampColours::default());
        Self { sequence, moment: 0, light, busy: 1.0, families, lamp_colours }
    }
}
