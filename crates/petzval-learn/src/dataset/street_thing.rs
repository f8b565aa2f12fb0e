//! What a class may take of generated streets.

use petzval_street::{ObjectKind, SurfaceClass};
use serde::{Deserialize, Serialize};

/// Something in a street: an object, which has a box, a surface, which has pixels, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StreetThing {
    /// A person.
    Pedestrian,
    /// A car, van, truck or bus.
    Vehicle,
    /// The housing of a traffic light whose lamps face the camera's lane; an object alone.
    TrafficLight,
    /// A light for people on foot; an object alone.
    PedestrianLight,
    /// A traffic light for other lanes; an object alone.
    TurnedLight,
    /// A traffic light of any kind. Its surface has the backboard, too.
    Signal,
    /// The carriageway with its marks; a surface alone, as those below.
    Road,
    /// Pavement and kerb.
    Pavement,
    /// A house with everything that is fixed to it.
    Building,
    /// Trees, hedges and bushes.
    Vegetation,
    /// Masts, and lamps on them.
    Pole,
    /// The board of a traffic sign.
    Sign,
    /// Other things on the pavement.
    Furniture,
    /// The sky.
    Sky,
}

impl StreetThing {
    /// Everything, in the order above.
    pub const ALL: [Self; 14] = [
        Self::Pedestrian,
        Self::Vehicle,
        Self::TrafficLight,
        Self::PedestrianLight,
        Self::TurnedLight,
        Self::Signal,
        Self::Road,
        Self::Pavement,
        Self::Building,
        Self::Vegetation,
        Self::Pole,
        Self::Sign,
        Self::Furniture,
        Self::Sky,
    ];

    /// The objects that it is; none of a surface alone.
    pub fn objects(self) -> &'static [ObjectKind] {
        match self {
            Self::Pedestrian => &[ObjectKind::Pedestrian],
            Self::Vehicle => &[ObjectKind::Vehicle],
            Self::TrafficLight => &[ObjectKind::TrafficLight],
            Self::PedestrianLight => &[ObjectKind::PedestrianLight],
            Self::TurnedLight => &[ObjectKind::TurnedLight],
            Self::Signal => &[ObjectKind::TrafficLight, ObjectKind::PedestrianLight, ObjectKind::TurnedLight],
            _ => &[],
        }
    }

    /// The surface that it is; none of an object alone.
    pub fn surface(self) -> Option<SurfaceClass> {
        Some(match self {
            Self::Pedestrian => SurfaceClass::Pedestrian,
            Self::Vehicle => SurfaceClass::Vehicle,
            Self::TrafficLight | Self::PedestrianLight | Self::TurnedLight => return None,
            Self::Signal => SurfaceClass::Signal,
            Self::Road => SurfaceClass::Road,
            Self::Pavement => SurfaceClass::Pavement,
            Self::Building => SurfaceClass::Building,
            Self::Vegetation => SurfaceClass::Vegetation,
            Self::Pole => SurfaceClass::Pole,
            Self::Sign => SurfaceClass::Sign,
            Self::Furniture => SurfaceClass::Furniture,
            Self::Sky => SurfaceClass::Sky,
        })
    }

    /// Its name in experiments.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pedestrian => "pedestrian",
            Self::Vehicle => "vehicle",
            Self::TrafficLight => "traffic-light",
            Self::PedestrianLight => "pedestrian-light",
            Self::TurnedLight => "turned-light",
            Self::Signal => "signal",
            Self::Road => "road",
            Self::Pavement => "pavement",
            Self::Building => "building",
            Self::Vegetation => "vegetation",
            Self::Pole => "pole",
            Self::Sign => "sign",
            Self::Furniture => "furniture",
            Self::Sky => "sky",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_surface_has_one_name_which_is_that_of_the_experiment_file() {
        for class in SurfaceClass::ALL {
            let of = StreetThing::ALL.iter().filter(|thing| thing.surface() == Some(class)).count();
            assert_eq!(of, 1, "{class:?}");
        }
        for thing in StreetThing::ALL {
            assert_eq!(serde_json::to_string(&thing).unwrap(), format!("\"{}\"", thing.name()));
            assert!(thing.surface().is_some() || !thing.objects().is_empty());
        }
    }
}
