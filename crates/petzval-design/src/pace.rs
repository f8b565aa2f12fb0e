//! The time that is left of a run at work: what moves in a step decides how long it takes, so that every part of a run has a pace of its own.

use std::collections::{BTreeMap, VecDeque};

use petzval_base::statistics::median;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::run::{Event, SCORE};

/// Units of a part whose median duration is its pace.
const PACE_UNITS: usize = 20;

/// Units of work that a camera has left in one of its stages: steps of a block, iterations of a lens that is improved alone, or its score.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnitsLeft {
    /// The camera.
    pub camera: String,
    /// The stage, from 0; the score is in a stage of its own behind the others.
    pub stage: usize,
    /// What moves, as events name it.
    pub block: String,
    /// Units that are left. A lens that is improved alone may need fewer.
    pub units: usize,
    /// Whether its units are iterations that are one step of the run together.
    pub is_one_step: bool,
}

/// How long the rest of a run will take.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeLeft {
    /// Wall-clock seconds, at the pace of the latest units of each part.
    pub seconds: f64,
    /// Whether it takes at least so long: parts of which no unit is done yet come on top, and no lens is improved alone, which may need fewer.
    pub is_least: bool,
}

/// The paces of the parts of a run, and what is left of each.
#[derive(Clone, Debug, Default)]
pub struct Pace {
    left: Vec<UnitsLeft>,
    /// Seconds of the latest units, by camera and block.
    latest: BTreeMap<(String, String), VecDeque<f64>>,
    /// Camera and block of the last event, its step, and how many events that step had.
    last: Option<((String, String), u64, usize)>,
    /// The part of the last event, as a place among those that are left.
    at: Option<usize>,
    /// The score that is at work, until its event.
    scoring: Option<Scoring>,
}

/// A score at work.
#[derive(Clone, Debug)]
struct Scoring {
    camera: String,
    /// Seconds since it began, and those of all its windows at their mean pace.
    seconds: f64,
    whole_s: f64,
}

impl Pace {
    /// The paces of a run of which this much is left, and whose steps until now were these.
    pub fn new(left: Vec<UnitsLeft>, events: &[Event]) -> Self {
        let mut pace = Self { left, ..Self::default() };
        for event in events {
            pace.time(event, event.seconds);
        }
        pace.end_step();
        pace.last = None;
        pace
    }

    /// Counts an event as a unit that took so many seconds.
    pub fn note(&mut self, event: &Event, seconds: f64) {
        let goes_on = self.time(event, seconds);
        self.scoring = self.scoring.take().filter(|_| event.block != SCORE);
        if !goes_on {
            self.at = self.place_of(event);
        }
        if let Some(part) = self.at.and_then(|at| self.left.get_mut(at)) {
            part.units = part.units.saturating_sub(1);
        }
    }

    /// Takes up how far the score of a camera is: `done` of its windows in so many seconds. From the first window on scores have a pace.
    pub fn note_scoring(&mut self, camera: &str, seconds: f64, done: usize, of: usize) {
        if done > 0 {
            let whole_s = seconds * of as f64 / done as f64;
            self.scoring = Some(Scoring { camera: camera.to_owned(), seconds, whole_s });
        }
    }

    /// The time that the rest takes; `None` before any unit of it is known, and at the end.
    pub fn time_left(&self) -> Option<TimeLeft> {
        let (mut seconds, mut has_unknown, mut may_need_fewer) = (0.0, false, false);
        for part in self.left.iter().filter(|part| part.units > 0) {
            let scoring = self.scoring.as_ref().filter(|_| part.block == SCORE);
            let unit = match scoring {
                Some(at_work) if at_work.camera == part.camera => Some(at_work.whole_s - at_work.seconds),
                at_work => self.seconds_of(part).or(at_work.map(|at_work| at_work.whole_s)),
            };
            match unit {
                Some(unit) => {
                    seconds += unit * part.units as f64;
                    may_need_fewer |= part.is_one_step;
                }
                None => has_unknown = true,
            }
        }
        (seconds > 0.0).then_some(TimeLeft { seconds, is_least: has_unknown && !may_need_fewer })
    }

    /// Adds to the pace of the part that moved; returns whether the event is one more of the same step.
    fn time(&mut self, event: &Event, seconds: f64) -> bool {
        let goes_on = self.last.as_ref().is_some_and(|(_, step, _)| *step == event.step);
        if !goes_on {
            self.end_step();
        }
        let key = (event.camera.clone(), event.block.clone());
        let latest = self.latest.entry(key.clone()).or_default();
        latest.push_back(seconds);
        if latest.len() > PACE_UNITS {
            latest.pop_front();
        }
        let count = self.last.take().filter(|_| goes_on).map_or(0, |(_, _, count)| count);
        self.last = Some((key, event.step, count + 1));
        goes_on
    }

    /// A step of several events was that of a lens alone. Its last event is the whole stage and no iteration.
    fn end_step(&mut self) {
        if let Some((key, _, count)) = &self.last
            && *count > 1
            && let Some(latest) = self.latest.get_mut(key)
        {
            latest.pop_back();
        }
    }

    /// The part to which the first event of a step belongs. What its camera had left in earlier stages is not taken any more: their goal was
    /// reached before.
    fn place_of(&mut self, event: &Event) -> Option<usize> {
        if let Some(part) = self.at.and_then(|at| self.left.get_mut(at))
            && part.is_one_step
        {
            part.units = 0;
        }
        let is_it = |p: &UnitsLeft| p.units > 0 && p.camera == event.camera && p.block == event.block;
        let at = self.left.iter().position(is_it)?;
        let stage = self.left[at].stage;
        for part in self.left.iter_mut().filter(|p| p.camera == event.camera && p.stage < stage) {
            part.units = 0;
        }
        Some(at)
    }

    /// Seconds of a unit: the median of the same camera's or, before it has taken one, of all others'. A unit during which the computer was asleep
    /// does not count a thousand times.
    fn seconds_of(&self, part: &UnitsLeft) -> Option<f64> {
        let own = self.latest.get(&(part.camera.clone(), part.block.clone())).filter(|all| !all.is_empty());
        let seconds: Vec<f64> = match own {
            Some(own) => own.iter().copied().collect(),
            None => {
                let alike = self.latest.iter().filter(|((_, block), _)| *block == part.block);
                alike.flat_map(|(_, all)| all.iter().copied()).collect()
            }
        };
        (!seconds.is_empty()).then(|| median(seconds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(step: u64, camera: &str, block: &str, seconds: f64) -> Event {
        Event {
            step,
            camera: camera.to_owned(),
            block: block.to_owned(),
            losses: BTreeMap::new(),
            lowered: Vec::new(),
            learning_rate: 0.0,
            seconds,
        }
    }

    fn part(camera: &str, stage: usize, block: &str, units: usize) -> UnitsLeft {
        let is_one_step = block == "restored";
        UnitsLeft { camera: camera.to_owned(), stage, block: block.to_owned(), units, is_one_step }
    }

    /// A camera whose lens is restored in ten iterations and whose network takes a hundred steps, behind one that has a network alone.
    fn left() -> Vec<UnitsLeft> {
        vec![
            part("nominal", 0, "network", 100),
            part("nominal", 1, "score", 1),
            part("end-to-end", 0, "restored", 10),
            part("end-to-end", 1, "network", 100),
            part("end-to-end", 2, "score", 1),
        ]
    }

    #[test]
    fn every_part_has_a_pace_of_its_own() {
        let mut pace = Pace::new(left(), &[]);
        assert_eq!(pace.time_left(), None);
        for step in 1..=100 {
            pace.note(&event(step, "nominal", "network", 0.0), 2.0);
        }
        // The networks of both cameras; the lens and the scores are unknown.
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 200.0, is_least: true }));
        pace.note(&event(101, "nominal", "score", 0.0), 30.0);
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 230.0, is_least: true }));
        // Iterations of a minute say nothing about the steps of the network.
        for _ in 0..4 {
            pace.note(&event(102, "end-to-end", "restored", 0.0), 60.0);
        }
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 6.0 * 60.0 + 230.0, is_least: false }));
        // It converged; the event of the whole stage is no iteration. The network goes on at its own pace.
        pace.note(&event(102, "end-to-end", "restored", 0.0), 0.0);
        pace.note(&event(103, "end-to-end", "network", 0.0), 3.0);
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 99.0 * 3.0 + 30.0, is_least: false }));
    }

    #[test]
    fn a_score_at_work_counts_from_its_first_window() {
        let mut pace = Pace::new(left(), &[]);
        for step in 1..=100 {
            pace.note(&event(step, "nominal", "network", 0.0), 2.0);
        }
        pace.note_scoring("nominal", 0.0, 0, 40);
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 200.0, is_least: true }));
        // Ten of forty windows in 100 s: 300 s of this score, 400 s of the other one, 200 s of its network; the lens is unknown.
        pace.note_scoring("nominal", 100.0, 10, 40);
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 900.0, is_least: true }));
        // The score as a whole took longer than its windows.
        pace.note(&event(101, "nominal", "score", 0.0), 420.0);
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 620.0, is_least: true }));
    }

    #[test]
    fn a_run_that_goes_on_has_the_paces_of_its_events() {
        let mut events: Vec<Event> = (1..=11).map(|step| event(step, "nominal", "network", 2.0)).collect();
        let mut rest = left();
        rest[0].units = 89;
        let pace = Pace::new(rest.clone(), &events);
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 189.0 * 2.0, is_least: true }));

        // The last event of a lens alone has the seconds of all of its iterations.
        events.extend([60.0, 60.0, 120.0].map(|seconds| event(12, "end-to-end", "restored", seconds)));
        let pace = Pace::new(rest, &events);
        // The score comes on top, but the lens may need fewer than its ten iterations.
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 189.0 * 2.0 + 600.0, is_least: false }));
    }

    #[test]
    fn a_step_during_which_the_computer_slept_is_no_pace() {
        let mut pace = Pace::new(left(), &[]);
        for (step, seconds) in (1..=10).map(|step| (step, if step == 7 { 30_000.0 } else { 2.0 })) {
            pace.note(&event(step, "nominal", "network", 0.0), seconds);
        }
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 190.0 * 2.0, is_least: true }));
    }

    #[test]
    fn a_stage_that_ends_early_leaves_nothing() {
        let mut pace = Pace::new(left(), &[]);
        pace.note(&event(1, "nominal", "network", 0.0), 2.0);
        pace.note(&event(2, "nominal", "score", 0.0), 2.0);
        assert_eq!(pace.time_left(), Some(TimeLeft { seconds: 100.0 * 2.0 + 2.0, is_least: true }));
    }
}
