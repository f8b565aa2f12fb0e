//! A street at a moment, ready to be seen.

use std::collections::BTreeSet;

use crate::contact::ContactGrid;
use crate::families::Drawer;
use crate::lamps::LampGrid;
use crate::object::Object;
use crate::plan::{Plan, Purpose, plan, stream};
use crate::pose::Pose;
use crate::road::Road;
use crate::settings::StreetSettings;
use crate::shadow::SunGrid;
use crate::sky::Sky;

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
