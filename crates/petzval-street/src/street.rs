//! A street at a moment, ready to be seen.

use std::collections::BTreeSet;

use crate::contact::ContactGrid;
use crate::families::{Drawer, Families};
use crate::lamps::LampGrid;
use crate::light::{LampColours, Light};
use crate::object::Object;
use crate::plan::{Plan, Purpose, plan, stream};
use crate::pose::Pose;
use crate::road::Road;
use crate::shadow::SunGrid;
use crate::sky::Sky;

/// Which street, when, and in which light.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StreetSettings {
    /// The seed. Streets of different sequences have nothing in common, so data are split by it.
    pub sequence: u64,
    /// Seconds since the sequence began: people walk, cars drive, the camera drives forward up to 130 m.
    pub moment: u32,
    /// The time of day.
    pub light: Light,
    /// Which families of shapes and textures it is made of.
    pub families: Families,
    /// The colours of signal lamps in the camera's channels.
    pub lamp_colours: LampColours,
}

impl StreetSettings {
    /// The first moment of a sequence, of all families, with the default lamp colours.
    pub fn new(sequence: u64, light: Light) -> Self {
        Self { sequence, moment: 0, light, families: Families::All, lamp_colours: LampColours::default() }
    }
}

/// A street at a moment: everything that a camera can see of it.
pub struct Street {
    settings: StreetSettings,
    pose: Pose,
    families: BTreeSet<String>,
    pub(crate) sky: Sky,
    pub(crate) road: Road,
    pub(crate) objects: Vec<Object>,
    pub(crate) lamps: LampGrid,
    pub(crate) sun: SunGrid,
    pub(crate) contacts: ContactGrid,
}

impl Street {
    /// Builds a street. The same settings give the same street.
    pub fn new(settings: &StreetSettings) -> Self {
        let mut drawer = Drawer::new(settings.families);
        let sky = Sky::draw(&mut stream(settings.sequence, Purpose::Sky, 0), settings.light);
        let Plan { road, pose, objects, lights } = plan(settings, &mut drawer);
        Self {
            settings: *settings,
            pose,
            families: drawer.used,
            lamps: LampGrid::new(&lights),
            sun: SunGrid::new(&objects, &sky),
            contacts: ContactGrid::new(&objects),
            sky,
            road,
            objects,
        }
    }

    /// What it was made from.
    pub fn settings(&self) -> &StreetSettings {
        &self.settings
    }

    /// Where the street's own camera stands and looks: in its lane at about 1.4 m, with the tolerances of mounting and driving.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// The families of shapes and textures that it is made of, as `group/family`.
    pub fn families(&self) -> &BTreeSet<String> {
        &self.families
    }
}
