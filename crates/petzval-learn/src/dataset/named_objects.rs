//! The objects of a data set in the classes of a detector, by the words of their names.

use std::collections::{BTreeMap, BTreeSet};

use petzval_files::coco::{Annotation, Attribute, Bounds, Category, DataSet, light_state};

use super::Wanted;
use crate::detection::{BBox, Object, Truth};

/// What the name of an annotation says.
enum Named {
    /// It is of this class.
    Class(usize),
    /// It is of a class that is looked for, but of which one it is not known: it is not judged.
    Unknown,
    /// It is something else.
    Other,
}

/// The class of an annotation, by the words of the name of its category and its attribute `state`.
fn class_of(wanted: Wanted, category: &str, annotation: &Annotation) -> Named {
    let in_words = in_words(category);
    let mut words: BTreeSet<String> = in_words.split(' ').map(str::to_owned).collect();
    let is_direction = |word: &&String| ["left", "right", "straight"].contains(&word.as_str());
    let other_words: Vec<&String> = words.iter().filter(|word| !is_direction(word)).collect();
    let is_state_alone = matches!(other_words[..], [word] if light_state(word).is_some());
    let of_one: Vec<String> =
        words.iter().filter_map(|word| Some(word.strip_suffix('s')?.to_owned())).collect();
    words.extend(of_one);
    let has = |names: &[&str]| names.iter().any(|name| words.contains(*name));
    match wanted {
        // Their names say for whom they are, or that they are a part of one or of the camera's own car.
        Wanted::PeopleAndVehicles
            if has(&[
                "light",
                "signal",
                "sign",
                "stop",
                "crossing",
                "crosswalk",
                "plate",
                "ego",
                "mount",
            ]) =>
        {
            Named::Other
        }
        Wanted::PeopleAndVehicles if has(&["person", "pedestrian", "people", "rider", "cyclist"]) => {
            Named::Class(0)
        }
        Wanted::PeopleAndVehicles if has(&["bicycle", "motorcycle"]) => Named::Other,
        Wanted::PeopleAndVehicles
            if has(&["vehicle", "car", "truck", "bus", "van", "minivan", "suv", "pickup", "tram"]) =>
        {
            Named::Class(1)
        }
        Wanted::PeopleAndVehicles => Named::Other,
        // Lights for people on foot, and lamps.
        Wanted::TrafficLights
            if has(&["pedestrian", "walk", "crosswalk", "street", "head", "tail", "brake"]) =>
        {
            Named::Other
        }
        Wanted::TrafficLights => {
            let state = annotation.attributes.get("state").and_then(Attribute::text);
            // A category is a light by its name, or if it is the name of a state alone, for all directions or for some.
            let is_light = has(&["light", "signal", "trafficlight"]) || is_state_alone;
            match state.and_then(light_state).or_else(|| light_state(&in_words)) {
                Some(state) if is_light => Named::Class(state),
                None if has(&["light", "signal", "trafficlight"]) => Named::Unknown,
                _ => Named::Other,
            }
        }
    }
}

/// The words of a name in small letters, one space between them: `TrafficLight-red` and `traffic_light red` are the same.
fn in_words(name: &str) -> String {
    let mut words = String::new();
    let mut was_small = false;
    for c in name.chars() {
        let is_start = was_small && c.is_uppercase();
        if (is_start || !c.is_alphanumeric()) && !words.ends_with(' ') {
            words.push(' ');
        }
        if c.is_alphanumeric() {
            words.extend(c.to_lowercase());
        }
        was_small = c.is_lowercase();
    }
    words.trim().to_owned()
}

/// How the categories of a data set are taken, if some of them are not looked for: else a misspelt one would be background without a word.
pub fn taken_as(data: &DataSet, wanted: Wanted, classes: &[&str]) -> Option<String> {
    let mut names: BTreeMap<String, BTreeSet<&str>> = BTreeMap::new();
    let mut background = BTreeSet::new();
    for annotation in &data.annotations {
        let Some(category) = data.category(annotation.category_id) else { continue };
        let taken = match class_of(wanted, &category.name, annotation) {
            Named::Class(class) => format!("as `{}`", classes[class]),
            Named::Unknown => "as places that are not judged".to_owned(),
            Named::Other => {
                background.insert(category.name.as_str());
                continue;
            }
        };
        names.entry(taken).or_default().insert(&category.name);
    }
    let list = |names: &BTreeSet<&str>| names.iter().copied().collect::<Vec<_>>().join(", ");
    let taken = names.iter().map(|(taken, names)| format!("; {taken}: {}", list(names)));
    (!background.is_empty()).then(|| {
        format!(
            "boxes of these categories are background: {}{}",
            list(&background),
            taken.collect::<String>()
        )
    })
}

/// The objects of a picture. Crowds, objects that are to be ignored, and boxes that are thinner than a pixel are regions that are not judged.
pub(super) fn truth(data: &DataSet, objects: &[usize], wanted: Wanted) -> Truth {
    let mut truth = Truth::default();
    for annotation in objects.iter().map(|k| &data.annotations[*k]) {
        let Some(category) = data.category(annotation.category_id) else { continue };
        let class = match class_of(wanted, &category.name, annotation) {
            Named::Class(class) => Some(class),
            Named::Unknown => None,
            Named::Other => continue,
        };
        let b = &annotation.bounds;
        let [x1, y1, x2, y2] = [b.x, b.y, b.x + b.width, b.y + b.height].map(|v| v as f32);
        let bbox = BBox::new(x1, y1, x2, y2);
        match class.filter(|_| !annotation.crowd && !annotation.ignore && !b.is_thin()) {
            Some(class) => truth.objects.push(Object { bbox, class }),
            None => truth.ignored.push(bbox),
        }
    }
    truth
}

/// The data set with the classes of a detector for categories: class `c` has the number `c + 1`. A region that is not judged is a crowd of
/// every class, and everything that is not looked for is left out.
pub fn in_classes(data: &DataSet, wanted: Wanted, classes: &[&str]) -> DataSet {
    let mut annotations: Vec<Annotation> = Vec::new();
    let mut add = |image_id: u64, bbox: &BBox, class: usize, crowd: bool| {
        let [x1, y1, x2, y2] = [bbox.x1, bbox.y1, bbox.x2, bbox.y2].map(f64::from);
        let bounds = Bounds::between(x1, y1, x2, y2);
        annotations.push(Annotation {
            id: annotations.len() as u64 + 1,
            image_id,
            category_id: class as u64 + 1,
            bounds,
            area: bounds.area(),
            crowd,
            ignore: false,
            attributes: BTreeMap::new(),
            unclipped: None,
        });
    };
    for (image, objects) in data.images.iter().zip(data.objects_of_images()) {
        let truth = truth(data, &objects, wanted);
        truth.objects.iter().for_each(|object| add(image.id, &object.bbox, object.class, false));
        for region in &truth.ignored {
            (0..classes.len()).for_each(|class| add(image.id, region, class, true));
        }
    }
    let category = |(i, name): (usize, &&str)| Category {
        id: i as u64 + 1,
        name: (*name).to_owned(),
        ..Category::default()
    };
    DataSet {
        images: data.images.clone(),
        categories: classes.iter().enumerate().map(category).collect(),
        annotations,
        ..DataSet::default()
    }
}

#[cfg(test)]
mod tests {
    use petzval_files::coco::Image;

    use super::*;

    fn annotation() -> Annotation {
        Annotation {
            id: 1,
            image_id: 1,
            category_id: 1,
            bounds: Bounds { x: 0.0, y: 0.0, width: 4.0, height: 8.0 },
            area: 32.0,
            crowd: false,
            ignore: false,
            attributes: BTreeMap::new(),
            unclipped: None,
        }
    }

    #[test]
    fn names_of_many_data_sets_are_understood() {
        let annotation = annotation();
        let class = |wanted: Wanted, name: &str| match class_of(wanted, name, &annotation) {
            Named::Class(class) => Some(class as i32),
            Named::Unknown => Some(-1),
            Named::Other => None,
        };
        for (name, expected) in [
            ("Pedestrians", Some(0)),
            ("human--person--individual", Some(0)),
            ("Person_sitting", Some(0)),
            ("object--vehicle--car", Some(1)),
            ("PickupTruck", Some(1)),
            ("void--ego-vehicle", None),
            ("void--car-mount", None),
            ("Vehicle registration plate", None),
            ("bus stop", None),
            ("bicycle", None),
        ] {
            assert_eq!(class(Wanted::PeopleAndVehicles, name), expected, "{name}");
        }
        for (name, expected) in [
            ("red", Some(0)),
            ("RedLeft", Some(0)),
            ("GreenStraightRight", Some(2)),
            ("off", Some(3)),
            ("TrafficLightYellow", Some(1)),
            ("traffic light", Some(-1)),
            ("red car", None),
            ("pedestrian light red", None),
            ("object--street-light", None),
            ("tail light red", None),
        ] {
            assert_eq!(class(Wanted::TrafficLights, name), expected, "{name}");
        }
    }

    #[test]
    fn a_state_makes_a_light_of_nothing_else() {
        let mut annotation = annotation();
        annotation.attributes.insert("state".to_owned(), Attribute::Text("off".to_owned()));
        let class = |name: &str| class_of(Wanted::TrafficLights, name, &annotation);
        assert!(matches!(class("vehicle"), Named::Other));
        assert!(matches!(class("traffic light"), Named::Class(3)));
    }

    #[test]
    fn objects_get_the_classes_of_a_detector_and_crowds_are_of_all_of_them() {
        let names = ["Pedestrians", "tree", "car", "traffic light"];
        let category = |(i, name): (usize, &&str)| Category {
            id: 10 * i as u64 + 7,
            name: (*name).to_owned(),
            ..Category::default()
        };
        let annotation = |category_id: u64, x: f64, crowd: bool, ignore: bool| Annotation {
            id: 1,
            image_id: 5,
            category_id,
            bounds: Bounds { x, y: 2.0, width: 4.0, height: 8.0 },
            // That of an outline.
            area: 20.0,
            crowd,
            ignore,
            attributes: BTreeMap::new(),
            unclipped: None,
        };
        let data = DataSet {
            images: vec![Image { id: 5, ..Image::default() }],
            categories: names.iter().enumerate().map(category).collect(),
            annotations: vec![
                annotation(7, 1.0, false, false),
                annotation(17, 2.0, false, false),
                annotation(27, 3.0, false, false),
                annotation(27, 4.0, true, false),
                annotation(37, 5.0, false, false),
                annotation(7, 6.0, false, true),
            ],
            ..DataSet::default()
        };
        let ours = in_classes(&data, Wanted::PeopleAndVehicles, &["pedestrian", "vehicle"]);
        let seen: Vec<_> =
            ours.annotations.iter().map(|a| (a.id, a.image_id, a.category_id, a.bounds.x, a.crowd)).collect();
        let expected = [
            (1, 5, 1, 1.0, false),
            (2, 5, 2, 3.0, false),
            (3, 5, 1, 4.0, true),
            (4, 5, 2, 4.0, true),
            (5, 5, 1, 6.0, true),
            (6, 5, 2, 6.0, true),
        ];
        assert_eq!(seen, expected);
        assert!(ours.annotations.iter().all(|a| a.area == 32.0 && !a.ignore));
        assert_eq!(
            ours.categories.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(),
            ["pedestrian", "vehicle"]
        );
        // What is background is said.
        let note = taken_as(&data, Wanted::PeopleAndVehicles, &["pedestrian", "vehicle"]).unwrap();
        assert!(note.contains("background: traffic light, tree; as `pedestrian`: Pedestrians"), "{note}");
    }
}
