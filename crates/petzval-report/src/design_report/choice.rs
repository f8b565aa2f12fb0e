//! Which held-out pictures a report shows: by what is gained in them, by their place, and by their content.

use petzval_base::statistics::median;

use super::standing::{Place, Standing, places};
use super::view::{Report, Role};

/// Where the zone is, as a share of the half-diagonal: 0.7 of the field has half of the sensor's circle inside.
const ZONE: f64 = 0.7;

/// Where the photograph of the median picture is shown already, another is taken: from this share of the pictures, around the median.
const AROUND_MEDIAN: f64 = 0.2;

/// Pictures of a report by their roles, as places in [`Report::held_out`], each once.
///
/// Gains are those of the camera that scores highest over the baseline. Those of most and of least gain are exact; the others are of
/// photographs that are shown least so far, and of these the one with the most `detail`. Without a comparison there are no gains, and where nothing differs none is shown.
pub fn choice(report: &Report, detail: &dyn Fn(usize) -> f64) -> Vec<(usize, Role)> {
    let mut chosen: Vec<(usize, Role)> = Vec::new();
    let places = places(&report.held_out);
    let gains = Standing::of(report).map(|standing| {
        report.held_out.iter().map(|picture| standing.gain_in(picture)).collect::<Vec<f64>>()
    });
    if let Some(gains) = gains.filter(|gains| gains.iter().any(|gain| gain.is_finite() && *gain != 0.0)) {
        let by_gain = in_order(&gains);
        let most = most_gain(&places, &gains);
        chosen.extend(most.map(|i| (i, Role::MostGain)));
        let is_free = |i: &&usize| Some(**i) != most;
        chosen.extend(by_gain.iter().find(is_free).map(|i| (*i, Role::LeastGain)));
        let middle = around_median(&by_gain, &gains);
        let middle = least_shown(report, &chosen, &middle, &|i| -(gains[i] - median_of(&gains)).abs());
        chosen.extend(middle.map(|i| (i, Role::MedianGain)));
    }
    let zone = places
        .iter()
        .min_by(|a, b| (a.relative_field - ZONE).abs().total_cmp(&(b.relative_field - ZONE).abs()));
    let at = [(places.first(), Role::Axis), (places.last(), Role::Corner), (zone, Role::Zone)];
    // With few places the zone is the axis or the corner.
    let at = at.into_iter().take(places.len());
    for (place, role) in at.filter_map(|(place, role)| Some((place?, role))) {
        chosen.extend(least_shown(report, &chosen, &place.pictures, detail).map(|i| (i, role)));
    }
    chosen.sort_by_key(|(_, role)| *role as usize);
    chosen
}

/// Pictures with a gain, the least first.
fn in_order(gains: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..gains.len()).filter(|i| gains[*i].is_finite()).collect();
    order.sort_by(|a, b| gains[*a].total_cmp(&gains[*b]));
    order
}

fn median_of(gains: &[f64]) -> f64 {
    median(gains.iter().copied().filter(|gain| gain.is_finite()))
}

/// Chooses the place with the largest mean gain, and of its pictures the one with the largest gain.
fn most_gain(places: &[Place], gains: &[f64]) -> Option<usize> {
    let finite = |place: &Place| -> Vec<usize> {
        place.pictures.iter().copied().filter(|i| gains[*i].is_finite()).collect()
    };
    let mean = |of: &[usize]| of.iter().map(|i| gains[*i]).sum::<f64>() / of.len() as f64;
    let best = places.iter().map(finite).filter(|of| !of.is_empty());
    let best = best.max_by(|a, b| mean(a).total_cmp(&mean(b)))?;
    best.into_iter().max_by(|a, b| gains[*a].total_cmp(&gains[*b]))
}

/// The pictures around the median.
fn around_median(by_gain: &[usize], gains: &[f64]) -> Vec<usize> {
    let middle = median_of(gains);
    let mut near = by_gain.to_vec();
    near.sort_by(|a, b| (gains[*a] - middle).abs().total_cmp(&(gains[*b] - middle).abs()));
    near.truncate(((AROUND_MEDIAN * near.len() as f64) as usize).max(1));
    near
}

/// Of candidates that are not chosen yet, that of the photograph which is shown least, and of these the one with the highest value; the
/// first of equals.
fn least_shown(
    report: &Report,
    chosen: &[(usize, Role)],
    candidates: &[usize],
    value: &dyn Fn(usize) -> f64,
) -> Option<usize> {
    let photograph = |i: usize| report.held_out.get(i).map(|picture| &picture.photograph);
    let shown = |i: usize| chosen.iter().filter(|(other, _)| photograph(*other) == photograph(i)).count();
    let free = candidates.iter().copied().filter(|i| !chosen.iter().any(|(taken, _)| taken == i));
    let rated: Vec<(usize, usize)> = free.map(|i| (i, shown(i))).collect();
    let least = rated.iter().map(|(_, shown)| *shown).min()?;
    let rated = rated.into_iter().filter(|(_, shown)| *shown == least).map(|(i, _)| (i, value(i)));
    rated.reduce(|best, next| if next.1 > best.1 { next } else { best }).map(|(i, _)| i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn report() -> Report {
        Report { held_out: sample::held_out(), ..sample::report() }
    }

    #[test]
    fn best_median_and_worst_are_by_gain_and_the_others_by_place_and_photograph() {
        let report = report();
        // Pictures are a, b, c at 0, 0.7, 0.93; gains of the last camera 0.9 to 3.0, those on the axis negative, c the most.
        let chosen = choice(&report, &|i| i as f64);
        let of = |role: Role| chosen.iter().find(|(_, other)| *other == role).map(|(i, _)| *i);
        assert_eq!(of(Role::MostGain), Some(8), "{chosen:?}");
        assert_eq!(of(Role::LeastGain), Some(0), "{chosen:?}");
        assert_eq!(of(Role::MedianGain), Some(4), "{chosen:?}");
        // The photographs with most detail among those that are shown once: c on the axis, and then b.
        assert_eq!(of(Role::Axis), Some(6), "{chosen:?}");
        assert_eq!(of(Role::Corner), Some(5), "{chosen:?}");
        assert_eq!(of(Role::Zone), Some(1), "{chosen:?}");
        assert_eq!(chosen[0].1, Role::MostGain);
        let mut pictures: Vec<usize> = chosen.iter().map(|(i, _)| *i).collect();
        pictures.sort_unstable();
        pictures.dedup();
        assert_eq!(pictures.len(), 6, "each picture once");
        for name in ["a", "b", "c"] {
            let shown = chosen.iter().filter(|(i, _)| report.held_out[*i].photograph == name).count();
            assert_eq!(shown, 2, "{name} of {chosen:?}");
        }
        assert_eq!(chosen, choice(&report, &|i| i as f64), "the same twice");
    }

    #[test]
    fn detail_decides_between_photographs_that_are_shown_as_often() {
        let mut report = report();
        report.table.truncate(1);
        let roles = |detail: &dyn Fn(usize) -> f64| choice(&report, detail);
        assert_eq!(roles(&|i| i as f64), [(6, Role::Axis), (5, Role::Corner), (1, Role::Zone)]);
        assert_eq!(roles(&|i| -(i as f64)), [(0, Role::Axis), (5, Role::Corner), (7, Role::Zone)]);
    }

    #[test]
    fn one_place_has_one_picture_of_it_and_none_has_none() {
        let mut report = report();
        report.held_out.retain(|picture| picture.relative_field == 0.7);
        let roles: Vec<Role> = choice(&report, &|_| 0.0).into_iter().map(|(_, role)| role).collect();
        assert_eq!(roles, [Role::MostGain, Role::MedianGain, Role::LeastGain]);
        report.held_out.clear();
        assert!(choice(&report, &|_| 0.0).is_empty());
    }

    #[test]
    fn where_objects_are_looked_for_the_gain_is_in_those_that_are_found() {
        let mut report = report();
        for (i, picture) in report.held_out.iter_mut().enumerate() {
            picture.found = vec![2, 2, if i == 4 { 5 } else { 2 }];
        }
        assert_eq!(choice(&report, &|_| 0.0)[0], (4, Role::MostGain));
    }
}
