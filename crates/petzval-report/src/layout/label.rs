//! Labels: short texts in a drawing that must not overlap.

/// Width of a character and height of a line, px.
pub(super) const CHARACTER_PX: f64 = 7.6;
const LINE_PX: f64 = 15.0;

/// A text, centred on x, on the base line y, px.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    /// Text.
    pub text: String,
    /// Middle.
    pub x: f64,
    /// Base line.
    pub y: f64,
}

impl Label {
    /// A label at its preferred position.
    pub fn new(text: String, x: f64, y: f64) -> Self {
        Self { text, x, y }
    }

    fn overlaps(&self, other: &Self) -> bool {
        let width = 0.5 * CHARACTER_PX * (self.text.chars().count() + other.text.chars().count()) as f64;
        (self.x - other.x).abs() < width && (self.y - other.y).abs() < LINE_PX
    }
}

/// Moves labels up (`direction` -1) or down (+1) until none overlaps an earlier one.
pub(super) fn settle(labels: &mut [Label], direction: f64) {
    for i in 1..labels.len() {
        let (settled, rest) = labels.split_at_mut(i);
        // Each earlier label can overlap once or twice, so the loop ends.
        for _ in 0..4 * settled.len() {
            let Some(obstacle) = settled.iter().find(|l| rest[0].overlaps(l)) else { break };
            rest[0].y = obstacle.y + direction * LINE_PX;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_do_not_overlap() {
        let mut labels: Vec<Label> =
            (0..5).map(|i| Label::new("N-LASF44".into(), 20.0 * f64::from(i), 100.0)).collect();
        settle(&mut labels, 1.0);
        for i in 0..5 {
            for j in 0..i {
                assert!(!labels[i].overlaps(&labels[j]));
            }
        }
        assert_eq!(labels[0].y, 100.0);
    }
}
