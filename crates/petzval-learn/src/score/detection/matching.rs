//! Matches the detections of one class in one picture with its objects.

use super::overlap::overlap;
use super::picture::{FoundObject, TrueObject};
use super::protocol::{Protocol, Rule};

/// Thresholds that fit in the bits of a [`Fate`].
pub(super) const MOST_THRESHOLDS: usize = 32;

/// What became of a detection; bit `t` is that of the threshold `t`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Fate {
    /// It matches an object.
    pub matched: u32,
    /// It counts neither as right nor as wrong.
    pub ignored: u32,
}

/// The fates of detections, which come best first. `objects` pairs each object with whether it is ignored.
pub(super) fn match_picture(
    objects: &[(&TrueObject, bool)],
    detections: &[&FoundObject],
    protocol: &Protocol,
) -> Vec<Fate> {
    assert!(protocol.thresholds.len() <= MOST_THRESHOLDS, "too many thresholds");
    // Objects that count come first, so that a detection takes one of them before an ignored one.
    let mut objects = objects.to_vec();
    objects.sort_by_key(|(_, is_ignored)| *is_ignored);
    let overlap_of = |found: &&FoundObject| -> Vec<f64> {
        objects.iter().map(|(object, _)| overlap(found.bounds, object.bounds, object.crowd)).collect()
    };
    let overlaps: Vec<Vec<f64>> = detections.iter().map(overlap_of).collect();
    let mut fates = vec![Fate::default(); detections.len()];
    for (t, threshold) in protocol.thresholds.iter().enumerate() {
        let mut is_taken = vec![false; objects.len()];
        for (fate, overlaps) in fates.iter_mut().zip(&overlaps) {
            let chosen = match protocol.rule {
                Rule::BestFree => best_free(&objects, overlaps, &is_taken, *threshold),
                Rule::Best => best(&objects, overlaps, *threshold),
            };
            let Some(chosen) = chosen else { continue };
            let (object, is_ignored) = objects[chosen];
            if is_ignored {
                fate.ignored |= 1 << t;
            }
            if is_ignored || object.crowd || !is_taken[chosen] {
                fate.matched |= 1 << t;
            }
            is_taken[chosen] = true;
        }
    }
    fates
}

/// The free object with the largest overlap; the last of equals, as in pycocotools. An ignored one only if no other reaches the threshold.
fn best_free(
    objects: &[(&TrueObject, bool)],
    overlaps: &[f64],
    is_taken: &[bool],
    threshold: f64,
) -> Option<usize> {
    let (mut chosen, mut least) = (None, threshold.min(1.0 - 1e-10));
    for (i, (object, is_ignored)) in objects.iter().enumerate() {
        if is_taken[i] && !object.crowd {
            continue;
        }
        if *is_ignored && chosen.is_some_and(|c: usize| !objects[c].1) {
            break;
        }
        if overlaps[i] >= least {
            (chosen, least) = (Some(i), overlaps[i]);
        }
    }
    chosen
}

/// The object with the largest overlap, taken or not; the first of equals. A crowd, whose overlap is a share of the detection alone, only if no
/// object reaches the threshold.
fn best(objects: &[(&TrueObject, bool)], overlaps: &[f64], threshold: f64) -> Option<usize> {
    let best_of = |is_crowd: bool| {
        let mut chosen: Option<usize> = None;
        for i in (0..overlaps.len()).filter(|i| objects[*i].0.crowd == is_crowd) {
            if overlaps[i] > chosen.map_or(0.0, |c| overlaps[c]) {
                chosen = Some(i);
            }
        }
        chosen.filter(|c| overlaps[*c] >= threshold)
    };
    best_of(false).or_else(|| best_of(true))
}
