//! What a surface is to a segmentation of the picture.

use serde::{Deserialize, Serialize};

/// The class of a surface. Every surface of a street has one, given where it is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceClass {
    /// The carriageway with its marks.
    Road,
    /// Pavement and kerb.
    Pavement,
    /// A house with everything that is fixed to it.
    Building,
    /// A tree with its trunk, a hedge or a bush.
    Vegetation,
    /// A mast: of street lamps with the lamps, of signs, of traffic lights with the arm.
    Pole,
    /// A traffic light with its backboard, also one for people on foot or for other lanes.
    Signal,
    /// The board of a traffic sign.
    Sign,
    /// Another thing on the pavement, such as a bin, a bollard or a column.
    Furniture,
    /// A person.
    Pedestrian,
    /// A car, van, truck or bus.
    Vehicle,
    /// The sky.
    Sky,
}

impl SurfaceClass {
    /// Every class, in the order of its number.
    pub const ALL: [Self; 11] = [
        Self::Road,
        Self::Pavement,
        Self::Building,
        Self::Vegetation,
        Self::Pole,
        Self::Signal,
        Self::Sign,
        Self::Furniture,
        Self::Pedestrian,
        Self::Vehicle,
        Self::Sky,
    ];

    /// The class of most samples of a pixel, `counts` by number; of several the first in the order of [`Self::ALL`].
    pub(crate) fn of_most(counts: &[u16; Self::ALL.len()]) -> Self {
        let mut best = 0;
        for (number, count) in counts.iter().enumerate() {
            if *count > counts[best] {
                best = number;
            }
        }
        Self::ALL[best]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_in_the_order_of_their_numbers_and_the_majority_wins() {
        assert!(SurfaceClass::ALL.iter().enumerate().all(|(number, class)| *class as usize == number));
        let mut counts = [0; SurfaceClass::ALL.len()];
        counts[SurfaceClass::Sky as usize] = 2;
        counts[SurfaceClass::Pole as usize] = 2;
        assert_eq!(SurfaceClass::of_most(&counts), SurfaceClass::Pole);
        counts[SurfaceClass::Sky as usize] = 3;
        assert_eq!(SurfaceClass::of_most(&counts), SurfaceClass::Sky);
    }
}
