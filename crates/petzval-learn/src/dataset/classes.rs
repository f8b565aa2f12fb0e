//! The classes of objects or pixels that a task looks for, and what of a data set or a street is of them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;
use std::sync::Arc;

use petzval_base::FileError;
use petzval_files::coco::{Annotation, Attribute, Category, DataSet, LIGHT_STATES, light_state};
use petzval_street::{LampState, ObjectKind, SurfaceClass};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{IGNORED, StreetThing};
use crate::detection::{BBox, Ignored, Object, Truth};

/// A class of objects or pixels, and what of data sets and streets is of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectClass {
    /// Its name in scores, tables and pictures.
    pub name: String,
    /// Names of categories of a data set that are of this class: words of a name. Capitals and regular plurals (`-s`, `-es`, `-ies`) do not count;
    /// write other plurals, such as `mice`, beside the singular. Without names, and without `categories`, its own name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub from: Vec<String>,
    /// Words in the name of a category that make it something else.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not: Vec<String>,
    /// Categories of a data set that are of this class, by their numbers there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub categories: Vec<u64>,
    /// What a traffic light of this class shows: `red`, `yellow`, `green` or `off`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state: Option<String>,
    /// Objects of generated streets that are of this class: `pedestrian`, `vehicle`, `signal`, or one kind of these lights: `traffic-light`,
    /// `pedestrian-light`, `turned-light`. For a segmentation surfaces: `road`, `pavement`, `building`, `vegetation`, `pole`, `signal`, `sign`,
    /// `furniture`, `pedestrian`, `vehicle`, `sky`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(with = "Vec<String>")]
    pub street: Vec<StreetThing>,
    /// For a segmentation: the indices in pictures of labels that are of this class. 255, and 65535 in pictures of 16 bits, are always ignored.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<u16>,
    /// For a segmentation: whether pixels of this class are ignored. The network does not look for it, and it has no score.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub ignored: bool,
    /// For a segmentation: how much a pixel of this class counts in the loss, beside one of a class without a weight, which counts 1. Above 0, at most
    /// 1000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub weight: Option<f64>,
    /// The number in COCO of what is most like it, from whose weights a detector may start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coco: Option<usize>,
}

/// The classes of a task, in the order of their numbers. Cheap to clone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Classes(Arc<[ObjectClass]>);

/// What an annotation is.
#[derive(Debug, PartialEq, Eq)]
enum Named {
    /// It is of this class.
    Class(usize),
    /// It is a traffic light whose state is not known: it is not judged.
    Unknown,
    /// It is something else.
    Other,
}

impl Deref for Classes {
    type Target = [ObjectClass];

    fn deref(&self) -> &[ObjectClass] {
        &self.0
    }
}

impl From<Vec<ObjectClass>> for Classes {
    fn from(classes: Vec<ObjectClass>) -> Self {
        Self(classes.into())
    }
}

/// The part of a file that holds classes.
#[derive(Deserialize)]
struct ClassTables {
    class: Vec<ObjectClass>,
}

impl Classes {
    /// The tables `[[class]]` of a text.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let tables: ClassTables = FileError::read_toml(text)?;
        Ok(tables.class.into())
    }

    /// Their names.
    pub fn names(&self) -> Vec<&str> {
        self.iter().map(|class| class.name.as_str()).collect()
    }

    /// The class of an object of a street with this lamp; none for what is not looked for.
    pub fn of_street(&self, kind: ObjectKind, lamp: Option<LampState>) -> Option<usize> {
        let shows = |state: &String| lamp.is_some_and(|lamp| *state == LIGHT_STATES[lamp as usize]);
        let is_of = |class: &ObjectClass| class.street.iter().any(|thing| thing.objects().contains(&kind));
        self.iter().position(|class| is_of(class) && class.state.as_ref().is_none_or(shows))
    }

    /// The first word or number of categories that an earlier class takes wherever a later one names it. Classes may share it if the earlier one is of
    /// another state of a light, or refuses words that the later one does not.
    pub fn repeated_claim(&self) -> Option<RepeatedClaim> {
        for (second, later) in self.iter().enumerate() {
            for (first, earlier) in self[..second].iter().enumerate() {
                if earlier.state.is_some() && earlier.state != later.state {
                    continue;
                }
                let number = later.categories.iter().find(|id| earlier.categories.contains(id));
                let is_refused_there = earlier.not.iter().any(|word| !later.not.contains(word));
                let has = |word: &&str| earlier.names().any(|other| are_one_name(word, other));
                let word = later.names().find(has).filter(|_| !is_refused_there);
                let of_words = if later.from.is_empty() { "name" } else { "from" };
                let claim = number
                    .map(|id| ("categories", format!("category {id}")))
                    .or_else(|| word.map(|word| (of_words, format!("`{word}`"))));
                if let Some((key, what)) = claim {
                    return Some(RepeatedClaim { first, second, key, what });
                }
            }
        }
        None
    }

    /// Those whose pixels count: they have numbers in maps of classes, and logits.
    pub fn counted(&self) -> Self {
        self.iter().filter(|class| !class.ignored).cloned().collect::<Vec<_>>().into()
    }

    /// How much a pixel of each class counts in a loss.
    pub fn weights(&self) -> Vec<f64> {
        self.iter().map(|class| class.weight.unwrap_or(1.0)).collect()
    }

    /// The class of each surface of a street, in the order of [`SurfaceClass::ALL`], as a number of [`Classes::counted`]; a surface that no such
    /// class takes is [`IGNORED`].
    pub fn of_surfaces(&self) -> [u8; SurfaceClass::ALL.len()] {
        let counted = self.counted();
        SurfaceClass::ALL.map(|surface| {
            let takes =
                |class: &ObjectClass| class.street.iter().any(|thing| thing.surface() == Some(surface));
            counted.iter().position(takes).map_or(IGNORED, |number| number as u8)
        })
    }

    /// The class of each index of pictures of labels, as a number of [`Classes::counted`], or [`IGNORED`]; an index that is not there is unknown.
    pub fn of_values(&self) -> BTreeMap<u16, u8> {
        let mut of = BTreeMap::new();
        let mut number = 0;
        for class in self.iter() {
            let class_number = if class.ignored { IGNORED } else { number };
            for value in &class.values {
                of.entry(*value).or_insert(class_number);
            }
            number += u8::from(!class.ignored);
        }
        of
    }

    /// What an annotation of a category is: of the first class that takes the category by its number, or by its name.
    fn of_annotation(&self, category: &Category, annotation: &Annotation) -> Named {
        self.of_category(category, annotation.attributes.get("state").and_then(Attribute::text))
    }

    /// What an object of a category is. `attribute` is the state that its annotation gives to a traffic light.
    fn of_category(&self, category: &Category, attribute: Option<&str>) -> Named {
        let name = Name::of(&category.name);
        let state = attribute.and_then(light_state).or_else(|| light_state(&name.in_words()));
        let mut named = Named::Other;
        for (number, class) in self.iter().enumerate() {
            let by_number = class.categories.contains(&category.id);
            if !by_number && class.not.iter().any(|word| name.has(word)) {
                continue;
            }
            let is_named = by_number || class.names().any(|word| name.has(word));
            match (&class.state, state) {
                (None, _) if is_named => return Named::Class(number),
                (Some(wanted), Some(found))
                    if *wanted == LIGHT_STATES[found] && (is_named || name.is_state_alone()) =>
                {
                    return Named::Class(number);
                }
                (Some(_), None) if is_named => named = Named::Unknown,
                _ => {}
            }
        }
        named
    }
}

impl ObjectClass {
    /// Whether a category can be of this class: by its number, or by its name, also by the bare state of a light.
    fn may_take(&self, category: &Category) -> bool {
        let name = Name::of(&category.name);
        let shows = || light_state(&name.in_words()).map(|state| LIGHT_STATES[state]);
        let is_state =
            || name.is_state_alone() && self.state.as_deref().is_some_and(|own| shows() == Some(own));
        let is_refused = || self.not.iter().any(|word| name.has(word));
        self.categories.contains(&category.id)
            || !is_refused() && (self.names().any(|word| name.has(word)) || is_state())
    }

    /// Names of categories that are of this class.
    fn names(&self) -> impl Iterator<Item = &str> {
        let own = self.from.is_empty() && self.categories.is_empty();
        self.from.iter().map(String::as_str).chain(own.then_some(self.name.as_str()))
    }
}

/// What two classes name, so that the second one never has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RepeatedClaim {
    /// The class that has it, by its place.
    pub first: usize,
    /// The class that does not.
    pub second: usize,
    /// The key of the second class: `name` where its own name is the word.
    pub key: &'static str,
    /// The word or number in a sentence.
    pub what: String,
}

/// The name of a category in words.
struct Name(Vec<String>);

impl Name {
    /// Words in small letters: `TrafficLight-red` and `traffic_light red` are the same.
    fn of(name: &str) -> Self {
        let mut words = vec![String::new()];
        let mut was_small = false;
        for c in name.chars() {
            if (was_small && c.is_uppercase()) || !c.is_alphanumeric() {
                words.push(String::new());
            }
            if let (true, Some(word)) = (c.is_alphanumeric(), words.last_mut()) {
                word.extend(c.to_lowercase());
            }
            was_small = c.is_lowercase();
        }
        words.retain(|word| !word.is_empty());
        Self(words)
    }

    fn in_words(&self) -> String {
        self.0.join(" ")
    }

    /// Whether the words of another name stand in this one, one after the other, each in the singular or the plural.
    fn has(&self, other: &str) -> bool {
        let words = Self::of(other).0;
        let are_alike = |(a, b): (&String, &String)| a == b || is_plural(a, b) || is_plural(b, a);
        !words.is_empty() && self.0.windows(words.len()).any(|part| part.iter().zip(&words).all(are_alike))
    }

    /// True for the bare name of a traffic-light state, with or without directions: `red`, `RedLeft`.
    fn is_state_alone(&self) -> bool {
        let is_direction = |word: &&String| ["left", "right", "straight"].contains(&word.as_str());
        let others: Vec<&String> = self.0.iter().filter(|word| !is_direction(word)).collect();
        matches!(others[..], [word] if light_state(word).is_some())
    }
}

/// Whether two names stand for the same categories.
fn are_one_name(one: &str, other: &str) -> bool {
    Name::of(one).has(other) && Name::of(other).has(one)
}

/// Whether a word in small letters is the regular plural of another: `cars`, `buses`, `lorries`.
fn is_plural(one: &str, many: &str) -> bool {
    let hisses = || ["s", "x", "z", "ch", "sh", "o"].iter().any(|end| one.ends_with(end));
    let before_y = || one.strip_suffix('y').filter(|stem| !stem.ends_with(['a', 'e', 'i', 'o', 'u']));
    many.strip_suffix('s') == Some(one)
        || many.strip_suffix("es") == Some(one) && hisses()
        || many.strip_suffix("ies").is_some_and(|stem| before_y() == Some(stem))
}

/// Which annotations of a data set classes take.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Taken {
    /// Each class, in their order.
    pub classes: Vec<TakenClass>,
    /// Categories of lights whose state is not known, of which boxes are not judged.
    pub not_judged: BTreeSet<String>,
    /// Categories that no class takes.
    pub background: BTreeSet<String>,
}

/// What a class takes of a data set.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct TakenClass {
    /// The class.
    pub class: String,
    /// Names of the categories.
    pub categories: BTreeSet<String>,
    /// Number of boxes, also of those that are not judged.
    pub boxes: usize,
}

impl Taken {
    /// What classes take of a data set.
    pub fn of(data: &DataSet, classes: &Classes) -> Self {
        let class = |class: &ObjectClass| TakenClass { class: class.name.clone(), ..TakenClass::default() };
        let mut taken = Self { classes: classes.iter().map(class).collect(), ..Self::default() };
        for annotation in &data.annotations {
            let Some(category) = data.category(annotation.category_id) else { continue };
            let names = match classes.of_annotation(category, annotation) {
                Named::Class(number) => {
                    taken.classes[number].boxes += 1;
                    &mut taken.classes[number].categories
                }
                Named::Unknown => &mut taken.not_judged,
                Named::Other => &mut taken.background,
            };
            if !names.contains(&category.name) {
                names.insert(category.name.clone());
            }
        }
        taken
    }
}

/// What classes name that a data set does not have, in a sentence for each such class: numbers of categories, and its words where no category is of
/// the class.
pub(super) fn missing_claims(data: &DataSet, classes: &Classes) -> Vec<String> {
    const SHOWN: usize = 8;
    let named = |category: &Category| match &category.text_id {
        Some(id) => format!("{id:?} `{}`", category.name),
        None => format!("{} `{}`", category.id, category.name),
    };
    let mut known: Vec<String> = data.categories.iter().take(SHOWN).map(named).collect();
    if data.categories.len() > SHOWN {
        known.push(format!("{} more", data.categories.len() - SHOWN));
    }
    let known = known.join(", ");
    let sentence = |class: &ObjectClass| {
        let is_missing = |id: &&u64| data.category(**id).is_none();
        let numbers = class.categories.iter().filter(is_missing).map(|id| format!("category {id}"));
        let mut missing: Vec<String> = numbers.collect();
        if !data.categories.iter().any(|category| class.may_take(category)) {
            missing.extend(class.names().map(|word| format!("`{word}`")));
        }
        let missing = Some(missing.join(", ")).filter(|missing| !missing.is_empty())?;
        Some(format!(
            "the class `{}` takes {missing}, which is not here; the categories are {known}",
            class.name
        ))
    };
    classes.iter().filter_map(sentence).collect()
}

/// How the categories of a data set are taken, if some of them are not looked for: else a misspelt one would be background without a word.
pub fn taken_as(data: &DataSet, classes: &Classes) -> Option<String> {
    let Taken { classes, not_judged, background } = Taken::of(data, classes);
    let list = |names: &BTreeSet<String>| names.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
    let of_class = |taken: &TakenClass| (format!("as `{}`", taken.class), list(&taken.categories));
    let mut taken: Vec<(String, String)> = classes.iter().map(of_class).collect();
    taken.push(("as places that are not judged".to_owned(), list(&not_judged)));
    taken.retain(|(_, names)| !names.is_empty());
    let taken: String = taken.iter().map(|(taken, names)| format!("; {taken}: {names}")).collect();
    (!background.is_empty())
        .then(|| format!("boxes of these categories are background: {}{taken}", list(&background)))
}

/// The objects of a picture. Crowds, objects that are to be ignored, and boxes that are thinner than a pixel are regions in which their class is
/// not judged; where a traffic light of unknown state is, none is.
pub(super) fn truth(data: &DataSet, objects: &[usize], classes: &Classes) -> Truth {
    let mut truth = Truth::default();
    for annotation in objects.iter().map(|k| &data.annotations[*k]) {
        let Some(category) = data.category(annotation.category_id) else { continue };
        let class = match classes.of_annotation(category, annotation) {
            Named::Class(class) => Some(class),
            Named::Unknown => None,
            Named::Other => continue,
        };
        let b = &annotation.bounds;
        let [x1, y1, x2, y2] = [b.x, b.y, b.x + b.width, b.y + b.height].map(|v| v as f32);
        let bbox = BBox::new(x1, y1, x2, y2);
        match class.filter(|_| !annotation.crowd && !annotation.ignore && !b.is_thin()) {
            Some(class) => truth.objects.push(Object { bbox, class }),
            None => truth.ignored.push(Ignored { bbox, class }),
        }
    }
    truth
}

/// Which objects of a data set are judged. All others are regions in which no detection of their class is a mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    /// All but crowds, objects to be ignored and boxes thinner than a pixel.
    Clear,
    /// All but crowds: pycocotools looks at `iscrowd` alone.
    AllButCrowds,
}

/// The data set with the classes of a detector for categories: class `c` has the number `c + 1`. Boxes and areas stay. What is not judged is a crowd
/// of its class; a traffic light of unknown state is one of every class. Everything that is not looked for is left out.
pub fn in_classes(data: &DataSet, classes: &Classes, judged: Judged) -> DataSet {
    let mut annotations: Vec<Annotation> = Vec::new();
    for annotation in data.objects_of_images().iter().flatten().map(|k| &data.annotations[*k]) {
        let Some(category) = data.category(annotation.category_id) else { continue };
        let (taken, is_unknown) = match classes.of_annotation(category, annotation) {
            Named::Class(class) => (class..class + 1, false),
            Named::Unknown => (0..classes.len(), true),
            Named::Other => continue,
        };
        let is_unclear = judged == Judged::Clear && (annotation.ignore || annotation.bounds.is_thin());
        annotations.extend(taken.map(|class| Annotation {
            category_id: class as u64 + 1,
            crowd: is_unknown || annotation.crowd || is_unclear,
            ignore: false,
            attributes: BTreeMap::new(),
            unclipped: None,
            ..annotation.clone()
        }));
    }
    annotations.iter_mut().zip(1..).for_each(|(annotation, id)| annotation.id = id);
    let category = |(i, class): (usize, &ObjectClass)| Category {
        id: i as u64 + 1,
        name: class.name.clone(),
        ..Category::default()
    };
    let categories = classes.iter().enumerate().map(category).collect();
    DataSet { images: data.images.clone(), categories, annotations, ..DataSet::default() }
}

/// The classes as categories with the ids of a data set: each class has the id of the one category of whose boxes it is. A class without boxes
/// has the id of the one category that its name fits, else a number that the data set does not use. None where a class takes boxes of several
/// categories, where classes share a category, or where a class would need an id beside ids that are texts.
pub fn own_categories(data: &DataSet, classes: &Classes) -> Option<Vec<Category>> {
    let (mut boxed, mut named) = (vec![BTreeSet::new(); classes.len()], vec![BTreeSet::new(); classes.len()]);
    for annotation in &data.annotations {
        let Some(category) = data.category(annotation.category_id) else { continue };
        if let Named::Class(number) = classes.of_annotation(category, annotation) {
            boxed[number].insert(category.id);
        }
    }
    for category in &data.categories {
        if let Named::Class(number) = classes.of_category(category, None) {
            named[number].insert(category.id);
        }
    }
    let mut used: BTreeSet<u64> = data.categories.iter().map(|category| category.id).collect();
    let has_texts = data.categories.iter().any(|category| category.text_id.is_some());
    let mut own: Vec<Category> = Vec::new();
    for ((class, boxed), named) in classes.iter().zip(boxed).zip(named) {
        let taken = if boxed.is_empty() && named.len() == 1 { named } else { boxed };
        let (id, text_id) = match Vec::from_iter(taken)[..] {
            [id] => (id, data.category(id)?.text_id.clone()),
            [] if !has_texts => ((1..).find(|id| !used.contains(id))?, None),
            _ => return None,
        };
        used.insert(id);
        own.push(Category { id, text_id, name: class.name.clone(), ..Category::default() });
    }
    let ids: BTreeSet<u64> = own.iter().map(|category| category.id).collect();
    (ids.len() == own.len()).then_some(own)
}

#[cfg(test)]
mod tests {
    use petzval_files::coco::{Bounds, Image};

    use super::*;

    fn people_and_vehicles() -> Classes {
        Classes::parse(include_str!("../../../petzval-data/data/tasks/pedestrian-vehicle.toml")).unwrap()
    }

    fn traffic_lights() -> Classes {
        Classes::parse(include_str!("../../../petzval-data/data/tasks/traffic-light.toml")).unwrap()
    }

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

    fn class(classes: &Classes, name: &str, annotation: &Annotation) -> Named {
        let category = Category { id: 1, name: name.to_owned(), ..Category::default() };
        classes.of_annotation(&category, annotation)
    }

    #[test]
    fn names_of_many_data_sets_are_understood() {
        let annotation = annotation();
        let [people, lights] = [people_and_vehicles(), traffic_lights()];
        let class = |classes: &Classes, name: &str| match class(classes, name, &annotation) {
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
            assert_eq!(class(&people, name), expected, "{name}");
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
            assert_eq!(class(&lights, name), expected, "{name}");
        }
    }

    #[test]
    fn a_state_makes_a_light_of_nothing_else() {
        let mut annotation = annotation();
        annotation.attributes.insert("state".to_owned(), Attribute::Text("off".to_owned()));
        let lights = traffic_lights();
        assert_eq!(class(&lights, "vehicle", &annotation), Named::Other);
        assert_eq!(class(&lights, "traffic light", &annotation), Named::Class(3));
    }

    #[test]
    fn classes_of_ones_own_take_categories_by_name_words_and_number() {
        let own: Classes = vec![
            ObjectClass { name: "cyclist".to_owned(), ..ObjectClass::default() },
            ObjectClass {
                name: "van".to_owned(),
                from: vec!["Delivery van".to_owned(), "pick-up".to_owned()],
                not: vec!["toy".to_owned()],
                ..ObjectClass::default()
            },
            ObjectClass { name: "drone".to_owned(), categories: vec![7], ..ObjectClass::default() },
        ]
        .into();
        let annotation = annotation();
        for (id, name, expected) in [
            (1, "Cyclists", Named::Class(0)),
            (1, "delivery_vans", Named::Class(1)),
            (1, "PickUp", Named::Class(1)),
            (1, "van", Named::Other),
            (1, "toy delivery van", Named::Other),
            (7, "class_7", Named::Class(2)),
            // With numbers, the name of the class says nothing.
            (8, "drone", Named::Other),
        ] {
            let category = Category { id, name: name.to_owned(), ..Category::default() };
            assert_eq!(own.of_annotation(&category, &annotation), expected, "{id} {name}");
        }
        assert_eq!(own.of_street(ObjectKind::Vehicle, None), None);
        let lights = traffic_lights();
        assert_eq!(lights.of_street(ObjectKind::TrafficLight, Some(LampState::Green)), Some(2));
        assert_eq!(lights.of_street(ObjectKind::TurnedLight, Some(LampState::Green)), None);
    }

    #[test]
    fn regular_plurals_are_taken_both_ways() {
        for (one, many) in [
            ("car", "Cars"),
            ("bus", "buses"),
            ("box", "boxes"),
            ("coach", "coaches"),
            ("lorry", "lorries"),
            ("tram way", "tram ways"),
        ] {
            assert!(Name::of(many).has(one) && Name::of(one).has(many), "{one} {many}");
        }
        for (one, other) in
            [("car", "cares"), ("mouse", "mice"), ("tray", "traies"), ("bus", "busines"), ("y", "ie")]
        {
            assert!(!Name::of(other).has(one) && !Name::of(one).has(other), "{one} {other}");
        }
    }

    #[test]
    fn surfaces_and_values_are_of_the_classes_that_count() {
        let class = |name: &str, street: &[StreetThing], values: &[u16], ignored| ObjectClass {
            name: name.to_owned(),
            street: street.to_vec(),
            values: values.to_vec(),
            ignored,
            ..ObjectClass::default()
        };
        let classes: Classes = vec![
            class("ground", &[StreetThing::Road, StreetThing::Pavement], &[7, 8], false),
            class("void", &[StreetThing::Furniture], &[0, 9], true),
            class("light", &[StreetThing::Signal], &[24_001], false),
        ]
        .into();
        assert_eq!(classes.counted().names(), ["ground", "light"]);
        let surfaces = classes.of_surfaces();
        let of = |surface: SurfaceClass| surfaces[surface as usize];
        let named = [SurfaceClass::Road, SurfaceClass::Pavement, SurfaceClass::Signal].map(of);
        assert_eq!(named, [0, 0, 1]);
        assert_eq!([SurfaceClass::Furniture, SurfaceClass::Sky].map(of), [IGNORED; 2]);
        let values = BTreeMap::from([(7, 0), (8, 0), (0, IGNORED), (9, IGNORED), (24_001, 1)]);
        assert_eq!(classes.of_values(), values);
        // A surface that is an object, too, is found by windows that lie on objects.
        for kind in [ObjectKind::TrafficLight, ObjectKind::TurnedLight] {
            assert_eq!(classes.of_street(kind, None), Some(2));
        }
    }

    #[test]
    fn classes_have_the_ids_of_a_data_set_where_each_is_of_one_category() {
        let own = |categories: &[(u64, &str)], boxes: &[u64]| {
            let category = |(id, name): &(u64, &str)| Category {
                id: *id,
                name: (*name).to_owned(),
                ..Category::default()
            };
            let data = DataSet {
                categories: categories.iter().map(category).collect(),
                annotations: boxes.iter().map(|id| Annotation { category_id: *id, ..annotation() }).collect(),
                ..DataSet::default()
            };
            let own = own_categories(&data, &people_and_vehicles())?;
            Some(own.into_iter().map(|category| (category.id, category.name)).collect::<Vec<_>>())
        };
        let expected =
            |ids: [u64; 2]| Some(vec![(ids[0], "pedestrian".to_owned()), (ids[1], "vehicle".to_owned())]);
        assert_eq!(own(&[(3, "car"), (7, "person")], &[7, 3, 3]), expected([7, 3]));
        // A class without boxes: by its one name, or with a number of its own.
        assert_eq!(own(&[(3, "car"), (7, "person")], &[3]), expected([7, 3]));
        assert_eq!(own(&[(1, "car"), (2, "tree")], &[1]), expected([3, 1]));
        // Where no id says which category was found, there is none.
        assert_eq!(own(&[(3, "car"), (4, "bus"), (7, "person")], &[3, 4, 7]), None);
        assert_eq!(own(&[(3, "car"), (4, "bus"), (7, "person")], &[3, 7]), expected([7, 3]));
        // All states of lights may be of one category.
        let of_states: Vec<Annotation> = ["red", "green"]
            .map(|state| Annotation {
                attributes: BTreeMap::from([("state".to_owned(), Attribute::Text(state.to_owned()))]),
                ..annotation()
            })
            .into();
        let category = Category { id: 1, name: "traffic light".to_owned(), ..Category::default() };
        let data = DataSet { categories: vec![category], annotations: of_states, ..DataSet::default() };
        assert_eq!(own_categories(&data, &traffic_lights()), None);
    }

    #[test]
    fn what_two_classes_name_is_found_unless_both_can_have_it() {
        let claim = |text: &str| {
            let claim = Classes::parse(text).unwrap().repeated_claim();
            claim.map(|RepeatedClaim { first, second, key, what }| (first, second, key, what))
        };
        let two = |first: &str, second: &str| {
            claim(&format!("[[class]]\nname = \"car\"\n{first}\n[[class]]\nname = \"b\"\n{second}\n"))
        };
        assert_eq!(
            two("categories = [3]", "categories = [4, 3]"),
            Some((0, 1, "categories", "category 3".to_owned()))
        );
        // The own name is a word of a class without others, and capitals and plurals do not count.
        assert_eq!(two("", "from = [\"van\", \"Cars\"]"), Some((0, 1, "from", "`Cars`".to_owned())));
        assert_eq!(two("from = [\"b\"]", ""), Some((0, 1, "name", "`b`".to_owned())));
        assert_eq!(two("from = [\"car\"]", "from = [\"sports car\"]"), None);
        // The police cars are left for the second class.
        let cars = "from = [\"car\"]";
        assert_eq!(two(&format!("{cars}\nnot = [\"police\"]"), cars), None);
        let lights = |state: &str| format!("state = \"{state}\"\nfrom = [\"light\"]");
        assert_eq!(two(&lights("red"), &lights("green")), None);
        assert!(two(&lights("red"), &lights("red")).is_some());
        for classes in [people_and_vehicles(), traffic_lights()] {
            assert_eq!(classes.repeated_claim(), None);
        }
    }

    #[test]
    fn what_a_data_set_does_not_have_is_named_beside_what_it_has() {
        let category =
            |(id, name): (u64, &str)| Category { id, name: name.to_owned(), ..Category::default() };
        let with = |categories: &[(u64, &str)]| DataSet {
            categories: categories.iter().copied().map(category).collect(),
            ..DataSet::default()
        };
        let data = with(&[(1, "person"), (3, "car")]);
        let of = |text: &str| missing_claims(&data, &Classes::parse(text).unwrap());
        let has = "which is not here; the categories are 1 `person`, 3 `car`";
        assert_eq!(
            of("[[class]]\nname = \"a\"\ncategories = [3, 99]\n[[class]]\nname = \"walker\"\nfrom = []\n"),
            [
                format!("the class `a` takes category 99, {has}"),
                format!("the class `walker` takes `walker`, {has}")
            ]
        );
        // Words of which one is there are other spellings.
        assert!(missing_claims(&data, &people_and_vehicles()).is_empty());
        let states = with(&[(1, "red"), (2, "yellow"), (3, "green"), (4, "off")]);
        assert!(missing_claims(&states, &traffic_lights()).is_empty());
        let without = missing_claims(&with(&[(3, "car")]), &people_and_vehicles());
        assert_eq!(without.len(), 1);
        assert!(without[0].starts_with("the class `pedestrian` takes `person`, `pedestrian`"), "{without:?}");
    }

    #[test]
    fn objects_get_the_classes_of_a_detector_and_keep_their_areas_and_crowds() {
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
        let ours = in_classes(&data, &people_and_vehicles(), Judged::Clear);
        let seen: Vec<_> =
            ours.annotations.iter().map(|a| (a.id, a.image_id, a.category_id, a.bounds.x, a.crowd)).collect();
        let expected =
            [(1, 5, 1, 1.0, false), (2, 5, 2, 3.0, false), (3, 5, 2, 4.0, true), (4, 5, 1, 6.0, true)];
        assert_eq!(seen, expected);
        assert!(ours.annotations.iter().all(|a| a.area == 20.0 && !a.ignore));
        // For pycocotools an object to be ignored is one like others.
        let theirs = in_classes(&data, &people_and_vehicles(), Judged::AllButCrowds);
        let crowds: Vec<bool> = theirs.annotations.iter().map(|a| a.crowd).collect();
        assert_eq!(crowds, [false, false, true, false]);
        assert!(theirs.annotations.iter().all(|a| !a.ignore));
        assert_eq!(
            ours.categories.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(),
            ["pedestrian", "vehicle"]
        );
        // A detector has them as regions in which their class is not judged.
        let truth = truth(&data, &[2, 3, 5], &people_and_vehicles());
        let ignored: Vec<_> = truth.ignored.iter().map(|region| (region.bbox.x1, region.class)).collect();
        assert_eq!((truth.objects.len(), &ignored[..]), (1, &[(4.0, Some(1)), (6.0, Some(0))][..]));
        // What is background is said.
        let note = taken_as(&data, &people_and_vehicles()).unwrap();
        assert!(note.contains("background: traffic light, tree; as `pedestrian`: Pedestrians"), "{note}");
        let taken = Taken::of(&data, &people_and_vehicles());
        let boxes: Vec<_> = taken.classes.iter().map(|c| (c.class.as_str(), c.boxes)).collect();
        assert_eq!(boxes, [("pedestrian", 2), ("vehicle", 2)]);
    }
}
