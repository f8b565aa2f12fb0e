//! A data set whose parts have files of annotations of their own, as COCO and Roboflow write them.

use std::collections::{BTreeSet, HashMap, HashSet};

use super::data_set::{Category, DataSet};
use super::defect::{DefectKind, Defects};

/// One data set of parts and their names. Classes of one name become one, with the number that the first part with it gives it, if that is free.
/// Pictures and objects are numbered anew. A picture that names no part is of that of its file. Pictures that several parts list are noted.
pub(super) fn joined(parts: Vec<(String, DataSet)>, defects: &mut Defects) -> DataSet {
    note_shared_pictures(&parts, defects);
    let states_form = parts.iter().all(|(_, data)| data.states_form);
    let mut whole = DataSet { states_form, ..DataSet::default() };
    let mut numbers: HashMap<String, u64> = HashMap::new();
    let mut taken = HashSet::new();
    for (part, data) in parts {
        let mut category_ids = HashMap::new();
        for category in data.categories {
            let id = *numbers.entry(category.name.clone()).or_insert_with(|| {
                let id =
                    (std::iter::once(category.id).chain(1..)).find(|id| !taken.contains(id)).unwrap_or(0);
                taken.insert(id);
                whole.categories.push(Category { id, text_id: None, ..category.clone() });
                id
            });
            category_ids.insert(category.id, id);
        }
        let mut image_ids = HashMap::new();
        for mut image in data.images {
            let id = whole.images.len() as u64 + 1;
            image_ids.insert(image.id, id);
            // A text may be the id of two pictures in two files, and so of two classes.
            (image.id, image.text_id) = (id, None);
            image.split.get_or_insert_with(|| part.clone());
            whole.images.push(image);
        }
        for mut object in data.annotations {
            object.id = whole.annotations.len() as u64 + 1;
            // Both are known: a check took out what refers to nothing.
            object.image_id = image_ids[&object.image_id];
            object.category_id = category_ids[&object.category_id];
            whole.annotations.push(object);
        }
        whole.info.extend(data.info);
        whole.licenses.extend(data.licenses);
    }
    whole
}

/// Notes the pictures of a part that an earlier part lists, too. Those that one part lists twice are noted by the check of its file.
fn note_shared_pictures(parts: &[(String, DataSet)], defects: &mut Defects) {
    let mut first: HashMap<&str, usize> = HashMap::new();
    for (place, (part, data)) in parts.iter().enumerate() {
        let names: BTreeSet<&str> = data.images.iter().map(|image| image.file_name.as_str()).collect();
        for name in names {
            let earlier = *first.entry(name).or_insert(place);
            if earlier < place {
                defects.add(DefectKind::RepeatedFile, || {
                    format!("{name}: in `{}` and `{part}`", parts[earlier].0)
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::data_set::{Annotation, Image};
    use super::super::read::parse_coco;
    use super::*;

    fn part(categories: &str, image: &str, category: u64) -> DataSet {
        let text = format!(
            r#"{{"categories": [{categories}], "images": [{image}],
                "annotations": [{{"id": 1, "image_id": 1, "category_id": {category}, "bbox": [0, 0, 9, 9], "area": 81}}]}}"#
        );
        parse_coco(text.into_bytes(), &mut Defects::default()).unwrap()
    }

    #[test]
    fn classes_come_together_by_name_and_everything_else_stays_apart() {
        let image = |name: &str| format!(r#"{{"id": 1, "file_name": "{name}", "width": 9, "height": 9}}"#);
        let own = r#"{"id": 1, "file_name": "c", "width": 9, "height": 9, "split": "test"}"#;
        let (car, person) = (r#"{"id": 3, "name": "car"}"#, r#"{"id": 3, "name": "person"}"#);
        let parts = vec![
            ("train".to_owned(), part(car, &image("a"), 3)),
            ("val".to_owned(), part(&format!(r#"{person}, {{"id": 9, "name": "car"}}"#), &image("b"), 9)),
            ("more".to_owned(), part(person, own, 3)),
        ];
        let whole = joined(parts, &mut Defects::default());
        let categories: Vec<_> = whole.categories.iter().map(|c| (c.id, c.name.as_str())).collect();
        assert_eq!(categories, [(3, "car"), (1, "person")]);
        let images: Vec<_> =
            whole.images.iter().map(|i: &Image| (i.id, i.split.as_deref().unwrap())).collect();
        assert_eq!(images, [(1, "train"), (2, "val"), (3, "test")]);
        let of = |a: &Annotation| (a.id, a.image_id, a.category_id);
        assert_eq!(whole.annotations.iter().map(of).collect::<Vec<_>>(), [(1, 1, 3), (2, 2, 3), (3, 3, 1)]);
    }
}
