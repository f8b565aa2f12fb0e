//! Which camera scores highest, by how much, and where on the sensor it is ahead and behind.
//!
//! All figures are those of the run: means over held-out pictures, with standard errors over photographs. Pictures of one photograph
//! share its content, so that they are no independent samples.

use super::view::{HeldOutScores, Report, Score, TableRow, baseline};
use crate::number;

/// A difference of a score between two cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Difference {
    /// Its mean over pictures.
    pub value: f64,
    /// Standard error over the photographs; NaN for less than two.
    pub error: f64,
}

impl Difference {
    /// Whether it is a number, is larger than its error, and does not round to nothing.
    pub fn is_resolved(self, decimals: usize) -> bool {
        self.value.is_finite()
            && !(number::is_nothing(self.value, decimals) || self.value.abs() <= self.error)
    }

    /// The mean of differences, each of a photograph. The error is that of the mean over clusters:
    /// `n / (n - 1) sum (w_k (m_k - m))^2` with the mean `m_k` and the share of pictures `w_k` of photograph `k`.
    fn mean<'a>(pictures: impl Iterator<Item = (&'a str, f64)>) -> Self {
        let mut photographs: Vec<(&str, f64, f64)> = Vec::new();
        for (name, value) in pictures.filter(|(_, value)| value.is_finite()) {
            match photographs.iter_mut().find(|known| known.0 == name) {
                Some((_, sum, count)) => (*sum, *count) = (*sum + value, *count + 1.0),
                None => photographs.push((name, value, 1.0)),
            }
        }
        let all: f64 = photographs.iter().map(|(_, _, count)| count).sum();
        let value = photographs.iter().map(|(_, sum, _)| sum).sum::<f64>() / all;
        let clusters = photographs.len() as f64;
        let squares = photographs.iter().map(|(_, sum, count)| ((sum - count * value) / all).powi(2));
        let error = if clusters > 1.0 {
            (clusters / (clusters - 1.0) * squares.sum::<f64>()).sqrt()
        } else {
            f64::NAN
        };
        Self { value, error }
    }
}

/// Pictures at one distance from the axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    /// The distance over that of the sensor's corner.
    pub relative_field: f64,
    /// The pictures, as places in [`Report::held_out`].
    pub pictures: Vec<usize>,
}

impl Place {
    /// Where it is, with its preposition.
    pub fn in_words(&self) -> String {
        place_in_words(self.relative_field)
    }
}

/// Pictures whose distances differ by less are at one place.
const SAME_PLACE: f64 = 0.005;

/// A place nearer to the axis than this is on it: half a window is further.
const ON_AXIS: f64 = 0.05;

/// What distances from the axis are shares of.
pub(super) const OF_WHAT: &str = " of the half-diagonal";

/// Where a picture is, by its distance from the axis over that of the corner.
pub(super) fn place_in_words(relative_field: f64) -> String {
    if relative_field < ON_AXIS {
        return "on the axis".to_owned();
    }
    format!("at {} %{OF_WHAT}", number::fixed(100.0 * relative_field, 0))
}

/// The places of pictures, from the axis outwards.
pub(super) fn places(pictures: &[HeldOutScores]) -> Vec<Place> {
    let mut order: Vec<usize> = (0..pictures.len()).collect();
    order.sort_by(|a, b| pictures[*a].relative_field.total_cmp(&pictures[*b].relative_field));
    let mut places: Vec<Place> = Vec::new();
    for i in order {
        let relative_field = pictures[i].relative_field;
        match places.last_mut().filter(|last| relative_field - last.relative_field < SAME_PLACE) {
            Some(place) => place.pictures.push(i),
            None => places.push(Place { relative_field, pictures: vec![i] }),
        }
    }
    places
}

/// The score by which cameras are compared in words: the one that is marked, else the first.
fn leading_score(scores: &[Score]) -> usize {
    scores.iter().position(|score| score.leads).unwrap_or(0)
}

/// The camera that scores highest, and those that it is compared with, as places in [`Report::table`].
#[derive(Clone, Debug)]
pub(super) struct Standing<'a> {
    pub report: &'a Report,
    /// The score, as a place in [`Report::scores`].
    pub score: usize,
    /// The first camera whose lens is no ceiling.
    pub baseline: usize,
    /// The camera with the highest score whose lens is no ceiling.
    pub best: usize,
    /// The camera that is compared with the baseline place by place: the best, or the second best where the baseline is the best.
    pub subject: usize,
    /// The highest of the others.
    pub runner_up: Option<usize>,
    /// The places, from the axis outwards.
    pub places: Vec<Place>,
}

impl<'a> Standing<'a> {
    /// The standing of the cameras; none for a run at work, or with less than two cameras whose lenses have aberrations.
    pub fn of(report: &'a Report) -> Option<Self> {
        let score = leading_score(&report.scores);
        let about = report.scores.get(score).filter(|_| report.progress.is_none())?;
        let value = |i: &usize| value_of(&report.table[*i], score);
        let mut ranked: Vec<usize> = (0..report.table.len())
            .filter(|i| !report.table[*i].is_ceiling && value(i).is_finite())
            .collect();
        let baseline = baseline(&report.table);
        if ranked.len() < 2 || !ranked.contains(&baseline) {
            return None;
        }
        let better = |i: &usize| if about.higher_is_better { value(i) } else { -value(i) };
        ranked.sort_by(|a, b| better(b).total_cmp(&better(a)));
        let best = ranked[0];
        let subject = if best == baseline { ranked[1] } else { best };
        let runner_up = ranked.into_iter().find(|i| *i != subject && *i != baseline);
        Some(Self { report, score, baseline, best, subject, runner_up, places: places(&report.held_out) })
    }

    /// The score.
    pub fn about(&self) -> &'a Score {
        &self.report.scores[self.score]
    }

    /// Name of a camera.
    pub fn name(&self, camera: usize) -> &'a str {
        &self.report.table[camera].camera
    }

    /// The score of a camera less that of another, over all pictures.
    pub fn difference(&self, camera: usize, against: usize) -> Difference {
        difference(self.report, self.score, camera, against)
    }

    /// The same over the pictures of a place.
    pub fn at(&self, place: usize, camera: usize, against: usize) -> Difference {
        let pictures = self.places[place].pictures.iter().map(|i| &self.report.held_out[*i]);
        over(pictures, self.score, camera, against)
    }

    /// By how much a difference is an improvement: positive where the camera is ahead.
    pub fn gain(&self, difference: Difference) -> f64 {
        if self.about().higher_is_better { difference.value } else { -difference.value }
    }

    /// By how much the subject is ahead of the baseline in a picture: in the score, or in objects found.
    pub fn gain_in(&self, picture: &HeldOutScores) -> f64 {
        let found = |camera: usize| picture.found.get(camera).map(|count| *count as f64);
        if let (Some(of), Some(than)) = (found(self.subject), found(self.baseline)) {
            return of - than;
        }
        self.gain(over([picture].into_iter(), self.score, self.subject, self.baseline))
    }

    /// The place at which a camera is most ahead of another, and by how much; none if it is nowhere.
    pub fn lead(&self, camera: usize, against: usize) -> Option<(usize, Difference)> {
        self.extreme(camera, against, 1.0)
    }

    /// The place at which a camera is most behind another, and by how much; none if it is nowhere.
    pub fn lag(&self, camera: usize, against: usize) -> Option<(usize, Difference)> {
        self.extreme(camera, against, -1.0)
    }

    /// The place with the most gain in the direction of a sign, beyond its error.
    fn extreme(&self, camera: usize, against: usize, sign: f64) -> Option<(usize, Difference)> {
        let all = (0..self.places.len()).map(|place| (place, self.at(place, camera, against)));
        all.filter(|(_, d)| sign * self.gain(*d) > 0.0 && d.is_resolved(self.about().decimals))
            .max_by(|a, b| (sign * self.gain(a.1)).total_cmp(&(sign * self.gain(b.1))))
    }
}

fn value_of(row: &TableRow, score: usize) -> f64 {
    row.scores.get(score).copied().unwrap_or(f64::NAN)
}

/// A score of a camera less that of another: the difference of their means, with its error over the held-out pictures.
pub(super) fn difference(report: &Report, score: usize, camera: usize, against: usize) -> Difference {
    let value = value_of(&report.table[camera], score) - value_of(&report.table[against], score);
    Difference { value, ..over(report.held_out.iter(), score, camera, against) }
}

/// The mean difference over pictures.
fn over<'a>(
    pictures: impl Iterator<Item = &'a HeldOutScores>,
    score: usize,
    camera: usize,
    against: usize,
) -> Difference {
    let of = |picture: &HeldOutScores, camera: usize| {
        picture.scores.get(camera).and_then(|scores| scores.get(score)).copied().unwrap_or(f64::NAN)
    };
    Difference::mean(
        pictures.map(|picture| (&*picture.photograph, of(picture, camera) - of(picture, against))),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn the_error_of_a_mean_is_over_photographs_and_not_over_their_parts() {
        // Means 1 and 3 of two photographs: 2, with sqrt(2 * 2 * 0.5^2) = 1, whatever their parts scatter.
        let parts = [("a", 0.0), ("a", 2.0), ("b", 2.5), ("b", 3.5)];
        assert_eq!(Difference::mean(parts.into_iter()), Difference { value: 2.0, error: 1.0 });
        // One part a photograph: the standard error of the mean, here of 1, 2 and 3.
        let one = Difference::mean([("a", 1.0), ("b", 2.0), ("c", 3.0)].into_iter());
        assert!((one.error - (1.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{one:?}");
        assert!(Difference::mean([("a", 1.0), ("a", 3.0)].into_iter()).error.is_nan());
        assert!(Difference::mean(std::iter::empty()).value.is_nan());
    }

    #[test]
    fn a_difference_within_its_error_is_none() {
        let resolved = |value, error| Difference { value, error }.is_resolved(2);
        assert!(resolved(0.3, 0.2) && resolved(-0.3, 0.2) && resolved(0.3, f64::NAN));
        assert!(!resolved(0.1, 0.2) && !resolved(0.001, f64::NAN) && !resolved(f64::NAN, f64::NAN));
    }

    #[test]
    fn pictures_at_one_distance_are_one_place() {
        let places = places(&sample::held_out());
        let fields: Vec<f64> = places.iter().map(|place| place.relative_field).collect();
        assert_eq!(fields, [0.0, 0.7, 0.93]);
        assert!(places.iter().all(|place| place.pictures.len() == 3));
        assert_eq!([0.0002, 0.934].map(place_in_words), ["on the axis", "at 93 % of the half-diagonal"]);
    }

    #[test]
    fn the_best_camera_leads_in_one_place_and_lags_in_another() {
        let report = Report { held_out: sample::held_out(), ..sample::report() };
        let standing = Standing::of(&report).unwrap();
        assert_eq!([standing.baseline, standing.best, standing.subject], [0, 2, 2]);
        assert_eq!((standing.about().title.as_str(), standing.runner_up), ("PSNR", Some(1)));
        let (place, lead) = standing.lead(2, 0).unwrap();
        assert_eq!((place, number::fixed(lead.value, 2)), (2, "2.90".into()));
        let (place, lag) = standing.lag(2, 0).unwrap();
        assert_eq!((place, number::fixed(lag.value, 2)), (0, "\u{2212}1.00".into()));
        // Spots that are lost are a lag as well: for a score that falls, signs turn.
        let mut report = report.clone();
        report.scores[1].higher_is_better = false;
        let standing = Standing::of(&report).unwrap();
        assert_eq!([standing.best, standing.subject], [0, 1]);
        assert_eq!(standing.lead(2, 0).unwrap().0, 0);
    }

    #[test]
    fn the_first_score_leads_where_none_is_marked_though_another_has_a_unit() {
        let mut report = sample::report();
        assert_eq!(Standing::of(&report).unwrap().about().title, "PSNR");
        report.scores.iter_mut().for_each(|score| score.leads = false);
        assert_eq!(Standing::of(&report).unwrap().about().title, "1 − LPIPS");
    }

    #[test]
    fn one_camera_and_a_run_at_work_have_no_standing() {
        let mut report = sample::report();
        report.table.truncate(1);
        assert!(Standing::of(&report).is_none());
        let progress = Some(crate::design_report::Progress::default());
        assert!(Standing::of(&Report { progress, ..sample::report() }).is_none());
        assert!(Standing::of(&Report::default()).is_none());
    }
}
