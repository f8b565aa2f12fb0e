//! Pictures of a folder that hold no window.

use super::{List, Purpose};

/// Least side of a window for scores, `scoring.crop` of an experiment, pixels.
pub const LEAST_SCORED: usize = 64;

/// The pictures that are smaller than a window.
pub(super) struct SmallPictures {
    /// Side of a window, pixels.
    crop: usize,
    /// The list of each picture, and its shorter side, pixels.
    sides: Vec<(List, usize)>,
}

impl SmallPictures {
    /// None yet, for windows of `crop` x `crop` pixels.
    pub fn new(crop: usize) -> Self {
        Self { crop, sides: Vec::new() }
    }

    /// Whether a picture of a list is smaller than a window; it is noted then. Its size: rows and columns, pixels.
    pub fn notes(&mut self, list: List, [rows, columns]: [usize; 2]) -> bool {
        let side = rows.min(columns);
        if side < self.crop {
            self.sides.push((list, side));
        }
        side < self.crop
    }

    /// How many there are, in words; none where every picture holds a window.
    pub fn sentence(&self) -> Option<String> {
        let are = match self.sides.len() {
            0 => return None,
            1 => "1 picture is".to_owned(),
            count => format!("{count} pictures are"),
        };
        let crop = self.crop;
        Some(format!(
            "{are} smaller than a window of {crop} pixels, the larger of `training.crop` and `scoring.crop`"
        ))
    }

    /// What to change so that a list has a picture; none where no picture of it is too small.
    pub fn remedy(&self, list: List, purpose: Purpose) -> Option<String> {
        let largest = self.sides.iter().filter(|(of, _)| *of == list).map(|(_, side)| *side).max()?;
        // Windows of a colour mosaic have whole cells.
        let fits = largest - largest % 2;
        let larger = format!("give pictures whose shorter side has {} pixels or more", self.crop);
        Some(if purpose == Purpose::Scores {
            larger
        } else if fits < LEAST_SCORED {
            format!(
                "{larger}; the largest of these has {largest}, and `scoring.crop` takes {LEAST_SCORED} or more"
            )
        } else {
            format!("write {fits} or less for `training.crop` and for `scoring.crop`, or {larger}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remedy_has_keys_and_values_that_fit() {
        let mut small = SmallPictures::new(120);
        assert_eq!(small.sentence(), None);
        assert!(!small.notes(List::Training, [120, 400]));
        assert!(small.notes(List::Training, [101, 400]) && small.notes(List::Training, [300, 90]));
        assert!(small.notes(List::HeldOut, [40, 50]));
        assert!(small.sentence().is_some_and(|said| said.starts_with("3 pictures are smaller")));
        let remedy = |list, purpose| small.remedy(list, purpose).unwrap_or_default();
        let larger = "give pictures whose shorter side has 120 pixels or more";
        let lower = "write 100 or less for `training.crop` and for `scoring.crop`";
        assert_eq!(remedy(List::Training, Purpose::Training), format!("{lower}, or {larger}"));
        assert_eq!(
            remedy(List::HeldOut, Purpose::Training),
            format!("{larger}; the largest of these has 40, and `scoring.crop` takes 64 or more")
        );
        assert_eq!(remedy(List::HeldOut, Purpose::Scores), larger);
        assert_eq!(small.remedy(List::Validation, Purpose::Training), None);
    }
}
