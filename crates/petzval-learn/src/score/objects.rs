//! How well objects are found, over all windows of a score at once.

use petzval_files::coco::LIGHT_STATES;

use super::ScoreDescription;
use super::detection::{
    Bootstrap, COCO_LARGE_PX2, COCO_SMALL_PX2, FoundObject, Group, Interpolation, Picture, Protocol, Ranking,
    StateConfusion, StateOf, TrueObject, Xywh, bootstrap, drawn_scores, percentiles,
};
use crate::detection::{BBox, Detection, Truth};

/// The objects of a window whose first pixel is at `at` on the sensor, row and column, and what was found there, in pixels of the sensor.
/// A region that is not judged is one of its class, or one for each of the `classes`.
pub fn judged(truth: &Truth, found: &[Detection], at: [usize; 2], classes: usize) -> Picture {
    let bounds = |b: &BBox| -> Xywh {
        let [x, y] = [b.x1 + at[1] as f32, b.y1 + at[0] as f32].map(f64::from);
        [x, y, f64::from(b.width()), f64::from(b.height())]
    };
    let object = |bbox: &BBox, class: usize, crowd: bool| {
        let bounds = bounds(bbox);
        TrueObject { class, bounds, area: bounds[2] * bounds[3], crowd, ignore: crowd }
    };
    let all = truth.objects.iter().chain(&truth.beside);
    let mut objects: Vec<TrueObject> = all.map(|o| object(&o.bbox, o.class, false)).collect();
    // What is found in a region that is not judged is neither right nor wrong.
    for region in &truth.ignored {
        let of = (0..classes).filter(|class| region.is_of(*class));
        objects.extend(of.map(|class| object(&region.bbox, class, true)));
    }
    let detections = found
        .iter()
        .map(|d| FoundObject { class: d.class, bounds: bounds(&d.bbox), score: f64::from(d.score) })
        .collect();
    Picture { objects, detections }
}

/// The sensor on which windows lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Where the optical axis meets it, `[x, y]`, pixels.
    pub axis: [f64; 2],
    /// Distance of its corner from there, pixels.
    pub corner_px: f64,
}

/// A figure of merit over all windows.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectScore {
    /// Name, heading and definition.
    pub about: ScoreDescription,
    /// Why it has no value where it has none: `no object of the class car in the pictures`.
    pub why_none: String,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Average precision at some overlaps, of some objects.
    Ap(Overlaps, Objects),
    /// Share of the objects found whose class is right.
    Confusion,
}

/// Overlaps from which a detection is of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Overlaps {
    /// The mean over 0.5 to 0.95.
    All,
    /// One.
    At(f64),
}

/// Which objects count.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Objects {
    /// All.
    All,
    /// Those of one class.
    OfClass(usize),
    /// Those of some areas, px^2.
    OfArea(f64, f64),
    /// Those at some distances from the axis, as shares of the corner's.
    OfField(f64, f64),
}

/// Draws of windows for an interval.
const DRAWS: usize = 500;

/// Score from which a detection counts for the accuracy of classes.
const SURE: f64 = 0.5;

/// Everything that is known to be computed, for the classes of a task.
pub fn object_scores(classes: &[&str]) -> Vec<ObjectScore> {
    let at = |overlap: f64| {
        [
            format!("average precision at an overlap of {overlap} (COCO, 101 points), the mean over classes"),
            format!("average precision at an overlap of {overlap}"),
        ]
    };
    let over_all = [
        "average precision, the mean over overlaps of 0.5 to 0.95 and classes (COCO)",
        "average precision, the mean over overlaps of 0.5 to 0.95,",
    ];
    // Definitions of all classes together, and the beginning of those of one.
    let overlaps = [
        ("ap", "AP", over_all.map(str::to_owned), Overlaps::All),
        ("ap50", "AP50", at(0.5), Overlaps::At(0.5)),
        ("ap75", "AP75", at(0.75), Overlaps::At(0.75)),
    ];
    let groups = [
        ("small", "below 32 x 32 pixels", Objects::OfArea(0.0, COCO_SMALL_PX2)),
        ("medium", "from 32 x 32 to 96 x 96 pixels", Objects::OfArea(COCO_SMALL_PX2, COCO_LARGE_PX2)),
        ("large", "above 96 x 96 pixels", Objects::OfArea(COCO_LARGE_PX2, 1e10)),
        (
            "centre",
            "whose middle lies up to a third of the way from the axis to the corner",
            Objects::OfField(0.0, 1.0 / 3.0),
        ),
        (
            "middle",
            "whose middle lies from one to two thirds of the way from the axis to the corner",
            Objects::OfField(1.0 / 3.0, 2.0 / 3.0),
        ),
        (
            "edge",
            "whose middle lies beyond two thirds of the way from the axis to the corner",
            Objects::OfField(2.0 / 3.0, f64::INFINITY),
        ),
    ];
    let mut all = Vec::new();
    for (name, title, [of_all, of_one], overlaps) in overlaps {
        let mut add = |name: String, title: String, definition: String, which: &str, objects| {
            all.push(ObjectScore {
                about: ScoreDescription::of_share(name, title, definition),
                why_none: format!("no object{which} in the pictures"),
                kind: Kind::Ap(overlaps, objects),
            });
        };
        add(name.into(), title.into(), of_all.clone(), "", Objects::All);
        for (i, class) in classes.iter().enumerate() {
            let definition = format!("{of_one} of the class {class}");
            let which = format!(" of the class {class}");
            add(
                format!("{name}_{class}"),
                format!("{title} {class}"),
                definition,
                &which,
                Objects::OfClass(i),
            );
        }
        for (group, words, objects) in groups {
            let definition = format!("{of_all}, of objects {words}");
            let which = format!(" {words}");
            add(format!("{name}_{group}"), format!("{title} {group}"), definition, &which, objects);
        }
    }
    let of_found = |what: &str, class: &str| {
        format!("share of the {what} found (overlap 0.5, score 0.5) whose {class} is right")
    };
    let confusion = match classes {
        [] | [_] => None,
        states if states == LIGHT_STATES => Some(("state_accuracy", "state", of_found("lights", "state"))),
        _ => Some(("class_accuracy", "class", of_found("objects", "class"))),
    };
    all.extend(confusion.map(|(name, title, definition)| ObjectScore {
        about: ScoreDescription::of_share(name.into(), title.into(), definition),
        why_none: "no object is found (overlap 0.5, score 0.5)".to_owned(),
        kind: Kind::Confusion,
    }));
    all
}

impl ObjectScore {
    /// The figure over windows; none where there is nothing to find.
    pub fn of(&self, windows: &[Picture], classes: usize, field: Field) -> Option<f64> {
        match self.ranking(windows, classes, field) {
            Some(ranking) => self.area(&ranking, None),
            None => confusion(windows, classes).accuracy(),
        }
    }

    /// 95 % bootstrap interval of the figure over clusters of windows, low and high. `clusters`: the cluster of each window, see
    /// [`Bootstrap::clusters`].
    pub fn interval(
        &self,
        windows: &[Picture],
        clusters: &[usize],
        classes: usize,
        field: Field,
    ) -> Option<[f64; 2]> {
        self.with_figure(windows, classes, field, |figure| range_of(clusters, figure))
    }

    /// The figure of every draw of [`interval`](Self::interval); see [`drawn_scores`].
    pub fn draws(
        &self,
        windows: &[Picture],
        clusters: &[usize],
        classes: usize,
        field: Field,
    ) -> Vec<Option<f64>> {
        self.with_figure(windows, classes, field, |figure| draws_of(clusters, figure))
    }

    /// What follows from the figure by how often each window counts.
    fn with_figure<T>(
        &self,
        windows: &[Picture],
        classes: usize,
        field: Field,
        of: impl FnOnce(&(dyn Fn(&[u32]) -> Option<f64> + Sync)) -> T,
    ) -> T {
        if let Some(ranking) = self.ranking(windows, classes, field) {
            return of(&|counts| self.area(&ranking, Some(counts)));
        }
        let of_window = |window| {
            let found = confusion(std::slice::from_ref(window), classes);
            [found.right(), found.detected()]
        };
        let of_windows: Vec<[u64; 2]> = windows.iter().map(of_window).collect();
        of(&|counts| {
            let drawn = || of_windows.iter().zip(counts);
            let sum =
                |k: usize| -> u64 { drawn().map(|(window, count)| u64::from(*count) * window[k]).sum() };
            let [right, detected] = [0, 1].map(sum);
            (detected > 0).then(|| right as f64 / detected as f64)
        })
    }

    /// The detections of all windows, matched and in the order of their scores; none for the accuracy of classes.
    fn ranking(&self, windows: &[Picture], classes: usize, field: Field) -> Option<Ranking> {
        let Kind::Ap(overlaps, objects) = self.kind else { return None };
        let protocol = match overlaps {
            Overlaps::All => Protocol::coco(),
            Overlaps::At(overlap) => Protocol::coco_at(overlap),
        };
        let group = match objects {
            Objects::All | Objects::OfClass(_) => Group::all(),
            Objects::OfArea(low, high) => Group::of_area(low, high),
            Objects::OfField(low, high) => {
                let radius = |share: f64| share * field.corner_px;
                Group::of_distance(field.axis, radius(low), radius(high))
            }
        };
        Some(Ranking::new(windows, classes, &protocol, &group))
    }

    /// The area below precision over recall, where each window counts as often as `counts` says.
    fn area(&self, ranking: &Ranking, counts: Option<&[u32]>) -> Option<f64> {
        const AREA: Interpolation = Interpolation::Points101;
        match self.kind {
            Kind::Ap(_, Objects::OfClass(class)) => ranking.class_average_precision(class, AREA, counts),
            _ => ranking.average_precision(AREA, counts),
        }
    }
}

/// Where a score lies in 95 % of 500 draws of clusters of pictures, low and high; see [`bootstrap`].
pub fn range_of(clusters: &[usize], score: impl Fn(&[u32]) -> Option<f64> + Sync) -> Option<[f64; 2]> {
    bootstrap(&of_500_draws(clusters), score).map(|range| [range.low, range.high])
}

/// The scores of these draws; see [`drawn_scores`].
pub fn draws_of(clusters: &[usize], score: impl Fn(&[u32]) -> Option<f64> + Sync) -> Vec<Option<f64>> {
    drawn_scores(&of_500_draws(clusters), score)
}

/// Where the difference of two scores lies in 95 % of these draws, low and high, from the scores of both.
pub fn range_of_difference(ours: &[Option<f64>], theirs: &[Option<f64>]) -> Option<[f64; 2]> {
    let pairs = ours.iter().zip(theirs);
    let mut differences: Vec<f64> = pairs.filter_map(|(ours, theirs)| Some((*ours)? - (*theirs)?)).collect();
    percentiles(&mut differences, of_500_draws(&[]).confidence)
}

fn of_500_draws(clusters: &[usize]) -> Bootstrap {
    Bootstrap { draws: DRAWS, ..Bootstrap::of_clusters(clusters.to_vec(), 1) }
}

/// Confusion matrix of classes: objects against detections of score 0.5 or more that overlap them by half.
pub fn confusion(windows: &[Picture], classes: usize) -> StateConfusion {
    let of = StateOf {
        object: &|p, i| Some(windows[p].objects[i].class),
        detection: &|p, d| Some(windows[p].detections[d].class),
    };
    StateConfusion::new(windows, classes, SURE, &of)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detection::{Ignored, Object};

    /// Twelve windows with one object each; the detector finds every second one, and none in the last four.
    fn windows() -> Vec<Picture> {
        let bbox = |x: f32| BBox::new(x, 10.0, x + 20.0, 40.0);
        (0..12)
            .map(|i| {
                let truth = Truth {
                    objects: vec![Object { bbox: bbox(5.0), class: i % 2 }],
                    ignored: vec![Ignored::of_all(bbox(60.0))],
                    ..Truth::default()
                };
                let x = if i % 3 == 0 || i >= 8 { 100.0 } else { 6.0 };
                let found = |x, score| Detection { bbox: bbox(x), class: i % 2, score };
                // What is found in a region that is not judged counts as nothing.
                judged(&truth, &[found(x, 0.5 + 0.03 * i as f32), found(61.0, 0.99)], [100 * i, 50], 2)
            })
            .collect()
    }

    #[test]
    fn a_crowd_hides_mistakes_of_its_own_class_alone() {
        let bbox = |x: f32| BBox::new(x, 10.0, x + 20.0, 40.0);
        let truth = Truth {
            objects: (0..2).map(|class| Object { bbox: bbox(5.0), class }).collect(),
            ignored: vec![Ignored { bbox: bbox(60.0), class: Some(0) }],
            ..Truth::default()
        };
        // The surest detection of either class is in the crowd of the first.
        let found = [(60.0, 0, 0.9), (5.0, 0, 0.8), (60.0, 1, 0.9), (5.0, 1, 0.8)]
            .map(|(x, class, score)| Detection { bbox: bbox(x), class, score });
        let windows = [judged(&truth, &found, [0, 0], 2)];
        let ranking = Ranking::new(&windows, 2, &Protocol::coco_at(0.5), &Group::all());
        let area = |class| ranking.class_average_precision(class, Interpolation::Points101, None).unwrap();
        assert!((area(0) - 1.0).abs() < 1e-12 && (area(1) - 0.5).abs() < 1e-12, "{} {}", area(0), area(1));
    }

    #[test]
    fn an_object_beside_the_picture_is_missed_at_the_edge_of_the_field() {
        let field = Field { axis: [0.0, 0.0], corner_px: 2000.0 };
        let bbox = BBox::new(5.0, 10.0, 25.0, 40.0);
        let object = Object { bbox, class: 0 };
        let found = [Detection { bbox, class: 0, score: 0.9 }];
        let beside = Object { bbox: bbox.moved([220.0, 0.0]), class: 0 };
        let truth =
            |beside: &[Object]| Truth { objects: vec![object], beside: beside.to_vec(), ..Truth::default() };
        let of = |name: &str, beside: &[Object]| {
            let windows = [judged(&truth(beside), &found, [0, 1900], 1)];
            object_scores(&["a"]).into_iter().find(|s| s.about.name == name).unwrap().of(&windows, 1, field)
        };
        assert!((of("ap50", &[]).unwrap() - 1.0).abs() < 1e-12);
        // One of two is found: 51 of the 101 points of recall are reached.
        let half = of("ap50", &[beside]).unwrap();
        assert!((half - 51.0 / 101.0).abs() < 1e-12, "{half}");
        // It lies beyond the corner, at the edge of the field.
        assert_eq!(of("ap50_edge", &[beside]), Some(half));
    }

    #[test]
    fn a_draw_without_a_class_is_no_draw_of_the_mean_over_classes() {
        let windows = windows();
        let ranking = Ranking::new(&windows, 3, &Protocol::coco_at(0.5), &Group::all());
        let area = |counts: &[u32]| ranking.average_precision(Interpolation::Points101, Some(counts));
        let each: Vec<u32> = vec![1; 12];
        assert_eq!(area(&each), ranking.average_precision(Interpolation::Points101, None));
        // The third class has no object at all and is left out; the second one has none in this draw.
        let without: Vec<u32> = (0..12).map(|i| 2 * u32::from(i % 2 == 0)).collect();
        assert_eq!(area(&without), None);
        assert!(ranking.class_average_precision(0, Interpolation::Points101, Some(&without)).unwrap() > 0.0);
    }

    #[test]
    fn figures_follow_their_groups_and_their_intervals_hold_them() {
        let field = Field { axis: [0.0, 0.0], corner_px: 2000.0 };
        let all = object_scores(&["a", "b"]);
        let alone: Vec<usize> = (0..windows().len()).collect();
        let of = |name: &str| {
            let score = all.iter().find(|s| s.about.name == name).unwrap();
            (score.of(&windows(), 2, field), score.interval(&windows(), &alone, 2, field))
        };
        let (half, interval) = of("ap50");
        let (half, [low, high]) = (half.unwrap(), interval.unwrap());
        assert!(low < half && half < high && low >= 0.0 && high <= 1.0, "{low} {half} {high}");
        // Windows of one film resemble each other: as if there were fewer.
        let films: Vec<usize> = (0..windows().len()).map(|i| i / 4).collect();
        let score = all.iter().find(|s| s.about.name == "ap50").unwrap();
        let [least, most] = score.interval(&windows(), &films, 2, field).unwrap();
        assert!(most - least > 1.1 * (high - low), "{least} {most} {low} {high}");
        // Objects of 600 square pixels are small, and all windows lie within two thirds of the way to the corner.
        assert_eq!(of("ap50_small").0, Some(half));
        assert_eq!(of("ap50_large"), (None, None));
        assert_eq!(of("ap50_edge"), (None, None));
        let why_none = |name: &str| &all.iter().find(|s| s.about.name == name).unwrap().why_none;
        assert_eq!(why_none("ap50_large"), "no object above 96 x 96 pixels in the pictures");
        assert_eq!(why_none("ap75_b"), "no object of the class b in the pictures");
        assert_eq!(why_none("ap"), "no object in the pictures");
        assert_eq!(why_none("class_accuracy"), "no object is found (overlap 0.5, score 0.5)");
        // Boxes overlap by 19 of 21 columns: from 0.5 to 0.9, nine of the ten overlaps.
        let all_overlaps = of("ap_small").0.unwrap();
        assert!((all_overlaps - 0.9 * half).abs() < 1e-12, "{all_overlaps} {half}");
        assert_eq!(of("ap75_medium"), (None, None));
        let by_class = [of("ap50_a").0.unwrap(), of("ap50_b").0.unwrap()];
        assert!((0.5 * (by_class[0] + by_class[1]) - half).abs() < 1e-12);
        let right = all.iter().find(|s| s.about.name == "class_accuracy").unwrap();
        assert_eq!(right.of(&windows(), 2, field), Some(1.0));
        assert!(object_scores(&["a"]).iter().all(|s| s.about.name != "class_accuracy"));
        let lights = object_scores(&LIGHT_STATES);
        let states = lights.iter().find(|s| s.about.name == "state_accuracy").unwrap();
        assert_eq!(
            (states.of(&windows(), 4, field), states.interval(&windows(), &alone, 4, field)),
            (Some(1.0), Some([1.0, 1.0]))
        );
    }
}
