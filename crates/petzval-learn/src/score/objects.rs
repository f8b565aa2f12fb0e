//! How well objects are found, over all windows of a score at once.

use super::ScoreDescription;
use super::detection::{
    COCO_LARGE_PX2, COCO_SMALL_PX2, FoundObject, Group, Interpolation, LIGHT_STATES, Picture, Protocol,
    Ranking, StateConfusion, StateOf, TrueObject, Xywh,
};
use crate::detection::{BBox, Detection, Truth};

/// The objects of a window whose first pixel is at `at` on the sensor, row and column, and what was found there, in pixels of the sensor.
pub fn judged(truth: &Truth, found: &[Detection], at: [usize; 2]) -> Picture {
    let bounds = |b: &BBox| -> Xywh {
        let [x, y] = [b.x1 + at[1] as f32, b.y1 + at[0] as f32].map(f64::from);
        [x, y, f64::from(b.width()), f64::from(b.height())]
    };
    let object = |bbox: &BBox, class: usize, crowd: bool| {
        let bounds = bounds(bbox);
        TrueObject { class, bounds, area: bounds[2] * bounds[3], crowd, ignore: crowd }
    };
    let mut objects: Vec<TrueObject> =
        truth.objects.iter().map(|o| object(&o.bbox, o.class, false)).collect();
    // Whatever is found in a region that is not judged, of any class, is neither right nor wrong.
    for region in &truth.ignored {
        objects.extend((0..MOST_CLASSES).map(|class| object(region, class, true)));
    }
    let detections = found
        .iter()
        .map(|d| FoundObject { class: d.class, bounds: bounds(&d.bbox), score: f64::from(d.score) })
        .collect();
    Picture { objects, detections }
}

/// Classes that a task can have: for each of them a region that is not judged is one.
const MOST_CLASSES: usize = 8;

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
    kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    /// Over overlaps of 0.5 to 0.95.
    Ap,
    /// At one overlap.
    ApAt(f64),
    /// Of one class, at 0.5.
    OfClass(usize),
    /// Of objects of some areas, px^2, at 0.5.
    OfArea(f64, f64),
    /// Of objects at some distances from the axis, as shares of the corner's, at 0.5.
    OfField(f64, f64),
    /// Share of the lights found whose state is right.
    States,
}

/// Score from which a detection counts for the accuracy of states.
const SURE: f64 = 0.5;

/// Everything that is known to be computed, for the classes of a task.
pub fn object_scores(classes: &[&str]) -> Vec<ObjectScore> {
    let about = |name: &str, title: &str, definition: String| ScoreDescription {
        name: name.to_owned(),
        title: title.to_owned(),
        unit: String::new(),
        definition,
        decimals: 4,
        higher_is_better: true,
    };
    let at_half = "average precision at an overlap of 0.5 (COCO, 101 points), the mean over classes";
    let mut all = vec![
        (
            about(
                "ap",
                "AP",
                "average precision, the mean over overlaps of 0.5 to 0.95 and classes (COCO)".into(),
            ),
            Kind::Ap,
        ),
        (about("ap50", "AP50", at_half.to_owned()), Kind::ApAt(0.5)),
        (about("ap75", "AP75", at_half.replace("0.5", "0.75")), Kind::ApAt(0.75)),
    ];
    for (i, class) in classes.iter().enumerate() {
        let definition = format!("average precision at an overlap of 0.5 of the class {class}");
        all.push((about(&format!("ap50_{class}"), &format!("AP50 {class}"), definition), Kind::OfClass(i)));
    }
    let areas = [
        ("small", 0.0, COCO_SMALL_PX2, "below 32 x 32 pixels"),
        ("medium", COCO_SMALL_PX2, COCO_LARGE_PX2, "from 32 x 32 to 96 x 96 pixels"),
        ("large", COCO_LARGE_PX2, 1e10, "above 96 x 96 pixels"),
    ];
    for (name, low, high, words) in areas {
        let definition = format!("{at_half}, of objects {words}");
        all.push((
            about(&format!("ap50_{name}"), &format!("AP50 {name}"), definition),
            Kind::OfArea(low, high),
        ));
    }
    let fields = [
        ("centre", 0.0, 1.0 / 3.0, "up to a third of the way from the axis to the corner"),
        ("middle", 1.0 / 3.0, 2.0 / 3.0, "from one to two thirds of the way from the axis to the corner"),
        ("edge", 2.0 / 3.0, 1.01, "beyond two thirds of the way from the axis to the corner"),
    ];
    for (name, low, high, words) in fields {
        let definition = format!("{at_half}, of objects whose middle lies {words}");
        all.push((
            about(&format!("ap50_{name}"), &format!("AP50 {name}"), definition),
            Kind::OfField(low, high),
        ));
    }
    if classes == LIGHT_STATES {
        let definition = "share of the lights found (overlap 0.5, score 0.5) whose state is right".to_owned();
        all.push((about("state_accuracy", "state", definition), Kind::States));
    }
    all.into_iter().map(|(about, kind)| ObjectScore { about, kind }).collect()
}

impl ObjectScore {
    /// The figure over windows, how often each counts (once where `counts` is none); none where there is nothing to find.
    pub fn of(
        &self,
        windows: &[Picture],
        classes: usize,
        field: Field,
        counts: Option<&[u32]>,
    ) -> Option<f64> {
        const AREA: Interpolation = Interpolation::Points101;
        let half = Protocol::coco_at(0.5);
        let in_group =
            |group: &Group| Ranking::new(windows, classes, &half, group).average_precision(AREA, counts);
        match self.kind {
            Kind::Ap => Ranking::new(windows, classes, &Protocol::coco(), &Group::all())
                .average_precision(AREA, counts),
            Kind::ApAt(overlap) => {
                let protocol = Protocol::coco_at(overlap);
                Ranking::new(windows, classes, &protocol, &Group::all()).average_precision(AREA, counts)
            }
            Kind::OfClass(class) => {
                let ranking = Ranking::new(windows, classes, &half, &Group::all());
                ranking.classes.get(class)?.curve(0, counts).map(|curve| curve.area(AREA))
            }
            Kind::OfArea(low, high) => in_group(&Group::of_area(low, high)),
            Kind::OfField(low, high) => {
                let radius = |share: f64| share * field.corner_px;
                in_group(&Group::of_distance(field.axis, radius(low), radius(high)))
            }
            Kind::States => {
                let of = StateOf {
                    object: &|p, i| Some(windows[p].objects[i].class),
                    detection: &|p, d| Some(windows[p].detections[d].class),
                };
                StateConfusion::new(windows, classes, SURE, &of).accuracy()
            }
        }
    }
}
