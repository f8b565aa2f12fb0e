//! The scores of a segmentation by name.

use super::PixelConfusion;
use crate::score::{ScoreDescription, draws_of, range_of};

/// A figure of merit over all frames.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentScore {
    /// Name, heading and definition.
    pub about: ScoreDescription,
    /// Why it has no value where it has none: `the class road is neither in the pictures nor found in them`.
    pub why_none: String,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// The mean of the IoU over classes.
    MeanIou,
    /// The IoU of a class.
    Iou(usize),
    /// Share of the pixels whose class is right.
    Accuracy,
}

/// Everything that is known to be computed, for these classes.
pub fn segment_scores(classes: &[&str]) -> Vec<SegmentScore> {
    let score = |name: String, title: String, definition: String, why_none: String, kind| SegmentScore {
        about: ScoreDescription::of_share(name, title, definition),
        why_none,
        kind,
    };
    let over_all = "over all labelled pixels of all windows";
    let mean = format!(
        "intersection over union {over_all}, the mean over classes; a class that is neither in the truth nor found is left out"
    );
    let right = format!("share of right classes {over_all}");
    let unlabelled = || "no labelled pixel in the pictures".to_owned();
    let mut all = vec![
        score("miou".into(), "mIoU".into(), mean, unlabelled(), Kind::MeanIou),
        score("pixel_accuracy".into(), "pixel accuracy".into(), right, unlabelled(), Kind::Accuracy),
    ];
    all.extend(classes.iter().enumerate().map(|(number, class)| {
        let definition = format!("intersection over union {over_all} of the class {class}");
        let absent = format!("the class {class} is neither in the pictures nor found in them");
        score(format!("iou_{class}"), format!("IoU {class}"), definition, absent, Kind::Iou(number))
    }));
    all
}

impl SegmentScore {
    /// The figure over frames of so many classes; none where there is nothing to find.
    pub fn of(&self, frames: &[PixelConfusion], classes: usize) -> Option<f64> {
        let all = PixelConfusion::sum(classes, frames.iter().map(|frame| (frame, 1)));
        self.of_sum(&all, &all.present())
    }

    /// 95 % bootstrap interval of the figure over clusters of frames, low and high. `clusters`: the cluster of each frame, see
    /// [`Bootstrap::clusters`](crate::score::detection::Bootstrap::clusters). A draw without one of the classes is no draw of the mean.
    pub fn interval(
        &self,
        frames: &[PixelConfusion],
        clusters: &[usize],
        classes: usize,
    ) -> Option<[f64; 2]> {
        let present = PixelConfusion::sum(classes, frames.iter().map(|frame| (frame, 1))).present();
        range_of(clusters, |counts| self.of_drawn(frames, counts, classes, &present))
    }

    /// The figure of every draw of [`interval`](Self::interval); see [`drawn_scores`](crate::score::detection::drawn_scores).
    pub fn draws(&self, frames: &[PixelConfusion], clusters: &[usize], classes: usize) -> Vec<Option<f64>> {
        let present = PixelConfusion::sum(classes, frames.iter().map(|frame| (frame, 1))).present();
        draws_of(clusters, |counts| self.of_drawn(frames, counts, classes, &present))
    }

    /// The figure where each frame counts as often as `counts` says, and the mean is over the classes `present`.
    pub fn of_drawn(
        &self,
        frames: &[PixelConfusion],
        counts: &[u32],
        classes: usize,
        present: &[usize],
    ) -> Option<f64> {
        let drawn = PixelConfusion::sum(classes, frames.iter().zip(counts.iter().copied()));
        self.of_sum(&drawn, present)
    }

    fn of_sum(&self, all: &PixelConfusion, present: &[usize]) -> Option<f64> {
        match self.kind {
            Kind::MeanIou => all.mean_iou(present),
            Kind::Iou(class) => all.iou(class),
            Kind::Accuracy => all.accuracy(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of 100 pixels of class 0, of which 50 to 99 are found as such, the others as class 1.
    fn frames() -> Vec<PixelConfusion> {
        let frame = |right: usize| {
            let found: Vec<u8> = (0..100).map(|i| u8::from(i >= right)).collect();
            PixelConfusion::of(&[0; 100], &found, 3)
        };
        (0..50).map(|i| frame(50 + i)).collect()
    }

    #[test]
    fn scores_are_those_of_the_sum_and_their_intervals_those_of_frames() {
        let scores = segment_scores(&["road", "car", "sky"]);
        let names: Vec<&str> = scores.iter().map(|score| score.about.name.as_str()).collect();
        assert_eq!(names, ["miou", "pixel_accuracy", "iou_road", "iou_car", "iou_sky"]);
        let (frames, alone): (_, Vec<usize>) = (frames(), (0..50).collect());
        let of = |k: usize| (scores[k].of(&frames, 3), scores[k].interval(&frames, &alone, 3));
        let (accuracy, range) = of(1);
        assert_eq!(accuracy, Some(0.745));
        // The mean of 50 values from 0.50 to 0.99: a deviation of 0.1443 / sqrt(50) = 0.0204, twice 1.96 times that is 0.08.
        let [low, high] = range.unwrap();
        assert!(low < 0.745 && 0.745 < high && (high - low - 0.08).abs() < 0.015, "{low} {high}");
        // Class 1 is found and in no truth, class 2 nowhere: it is left out of the mean.
        assert_eq!((of(2).0, of(3).0, of(4)), (Some(0.745), Some(0.0), (None, None)));
        assert_eq!(of(0).0, Some(0.3725));
        // A single cluster says nothing of others.
        assert_eq!(scores[1].interval(&frames, &[7; 50], 3), None);
    }
}
