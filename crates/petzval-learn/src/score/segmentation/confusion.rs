//! The confusion matrix of the classes of pixels.

use serde::{Deserialize, Serialize};

use crate::dataset::IGNORED;

/// How many pixels of each class were found as each class. Ignored pixels of the truth are not counted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PixelConfusion {
    classes: usize,
    /// Pixels, `[class of the truth, class that was found]`.
    pixels: Vec<u64>,
}

impl PixelConfusion {
    /// A matrix without pixels.
    pub fn new(classes: usize) -> Self {
        Self { classes, pixels: vec![0; classes * classes] }
    }

    /// The matrix of a frame from the class of each pixel, in the truth and as it was found.
    ///
    /// # Panics
    /// Panics if the two have not the same number of pixels, or if a class that is not [`IGNORED`] in the truth is not below `classes`.
    pub fn of(truth: &[u8], found: &[u8], classes: usize) -> Self {
        assert_eq!(truth.len(), found.len(), "truth and found have the same pixels");
        let mut confusion = Self::new(classes);
        for (truth, found) in truth.iter().zip(found).filter(|(truth, _)| **truth != IGNORED) {
            let [truth, found] = [*truth, *found].map(usize::from);
            assert!(truth < classes && found < classes, "class {truth} found as {found} of {classes}");
            confusion.pixels[truth * classes + found] += 1;
        }
        confusion
    }

    /// The sum over frames with as many classes, each counted as often as `counts` says.
    pub fn sum<'a>(classes: usize, frames: impl IntoIterator<Item = (&'a Self, u32)>) -> Self {
        let mut sum = Self::new(classes);
        for (frame, count) in frames {
            for (all, pixels) in sum.pixels.iter_mut().zip(&frame.pixels) {
                *all += u64::from(count) * pixels;
            }
        }
        sum
    }

    /// Whether it has this number of classes, and a count for each pair of them.
    pub fn is_of(&self, classes: usize) -> bool {
        self.classes == classes && self.pixels.len() == classes * classes
    }

    /// Pixels of class `truth` that were found as class `found`.
    pub fn count(&self, truth: usize, found: usize) -> u64 {
        self.pixels[truth * self.classes + found]
    }

    /// Pixels of a class in the truth.
    pub fn in_truth(&self, class: usize) -> u64 {
        (0..self.classes).map(|found| self.count(class, found)).sum()
    }

    /// Pixels that were found as a class.
    pub fn found(&self, class: usize) -> u64 {
        (0..self.classes).map(|truth| self.count(truth, class)).sum()
    }

    /// Intersection over union of a class, 0..1: its pixels that were found as such, over those that are of it or were found as such. None of
    /// a class that is neither in the truth nor found.
    pub fn iou(&self, class: usize) -> Option<f64> {
        let right = self.count(class, class);
        let union = self.in_truth(class) + self.found(class) - right;
        (union > 0).then(|| right as f64 / union as f64)
    }

    /// The classes that have an [`iou`](Self::iou), in their order.
    pub fn present(&self) -> Vec<usize> {
        (0..self.classes).filter(|class| self.iou(*class).is_some()).collect()
    }

    /// The mean of the IoU over some classes; none if there is no class, or if one of them is neither in the truth nor found.
    pub fn mean_iou(&self, of: &[usize]) -> Option<f64> {
        let sum: f64 = of.iter().map(|class| self.iou(*class)).sum::<Option<f64>>()?;
        (!of.is_empty()).then(|| sum / of.len() as f64)
    }

    /// Share of the labelled pixels whose class is right; none without a labelled pixel.
    pub fn accuracy(&self) -> Option<f64> {
        let right: u64 = (0..self.classes).map(|class| self.count(class, class)).sum();
        let all: u64 = self.pixels.iter().sum();
        (all > 0).then(|| right as f64 / all as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_those_of_a_matrix_that_was_made_by_hand() {
        // Class 0: 3 pixels, 2 right. Class 1: 4 pixels, 3 right. Class 2 is nowhere. Class 3 is found once, and in no truth.
        let truth = [0, 0, 0, 1, 1, 1, 1, IGNORED, IGNORED];
        let found = [0, 0, 1, 1, 1, 1, 3, 0, 2];
        let confusion = PixelConfusion::of(&truth, &found, 4);
        assert_eq!((confusion.count(0, 1), confusion.count(1, 3), confusion.count(1, 1)), (1, 1, 3));
        assert_eq!((confusion.in_truth(1), confusion.found(1), confusion.found(0)), (4, 4, 2));
        // Intersection over union: 2 of 3, 3 of 4 + 1, none, 0 of 1.
        let iou: Vec<Option<f64>> = (0..4).map(|class| confusion.iou(class)).collect();
        assert_eq!(iou, [Some(2.0 / 3.0), Some(0.6), None, Some(0.0)]);
        assert_eq!(confusion.present(), [0, 1, 3]);
        let mean = confusion.mean_iou(&confusion.present()).unwrap();
        assert!((mean - (2.0 / 3.0 + 0.6) / 3.0).abs() < 1e-15, "{mean}");
        assert_eq!(confusion.accuracy(), Some(5.0 / 7.0));
        // A class that is nowhere has no figure.
        assert_eq!((confusion.mean_iou(&[0, 2]), confusion.mean_iou(&[])), (None, None));
        assert_eq!(PixelConfusion::of(&[IGNORED], &[1], 4).accuracy(), None);
    }

    #[test]
    fn the_matrix_of_frames_is_their_sum_and_not_the_mean_of_their_figures() {
        let one = PixelConfusion::of(&[0, 0, 0, 0], &[0, 0, 0, 1], 2);
        let other = PixelConfusion::of(&[0, 1], &[1, 1], 2);
        let both = PixelConfusion::sum(2, [(&one, 1), (&other, 2)]);
        assert_eq!((both.count(0, 0), both.count(0, 1), both.count(1, 1)), (3, 3, 2));
        assert_eq!(both.iou(0), Some(0.5));
        assert_eq!(PixelConfusion::sum(2, [(&one, 1), (&other, 0)]), one);
    }
}
