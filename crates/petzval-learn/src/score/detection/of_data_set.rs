//! The pictures of a data set in COCO format with the detections of a camera.

use std::collections::HashMap;

use petzval_files::coco::{self, DataSet};

use super::picture::{FoundObject, Picture, TrueObject};

/// The pictures of a data set with detections, in the order in which pycocotools has them: by their ids. Classes are numbered from 0 by their
/// ids, as in the second value, their names. Detections in other pictures or of other classes are left out.
pub fn pictures_of_data_set(data: &DataSet, detections: &[coco::Detection]) -> (Vec<Picture>, Vec<String>) {
    let mut categories: Vec<_> = data.categories.iter().collect();
    categories.sort_by_key(|category| category.id);
    let class: HashMap<u64, usize> = categories.iter().enumerate().map(|(i, c)| (c.id, i)).collect();
    let place: HashMap<u64, usize> = image_ids(data).into_iter().enumerate().map(|(i, id)| (id, i)).collect();
    let mut pictures = vec![Picture::default(); place.len()];
    for object in &data.annotations {
        if let (Some(&at), Some(&class)) = (place.get(&object.image_id), class.get(&object.category_id)) {
            pictures[at].objects.push(TrueObject {
                class,
                bounds: object.bounds.into(),
                area: object.area,
                crowd: object.crowd,
                ignore: object.ignore,
            });
        }
    }
    for found in detections {
        if let (Some(&at), Some(&class)) = (place.get(&found.image_id), class.get(&found.category_id)) {
            let found = FoundObject { class, bounds: found.bounds.into(), score: found.score };
            pictures[at].detections.push(found);
        }
    }
    (pictures, categories.iter().map(|category| category.name.clone()).collect())
}

/// The cluster of each picture, in the order of [`pictures_of_data_set`]: pictures of one sequence share one, each other picture has its own.
pub fn clusters_of_data_set(data: &DataSet) -> Vec<usize> {
    let sequence: HashMap<u64, &str> =
        data.images.iter().filter_map(|image| Some((image.id, image.sequence.as_deref()?))).collect();
    clusters_of(image_ids(data).into_iter().map(|id| sequence.get(&id).copied()))
}

/// The cluster of each picture for [`Bootstrap::clusters`](super::Bootstrap::clusters), by the name of its sequence: equal names share one,
/// each picture without a name has its own.
pub fn clusters_of<'a>(sequences: impl Iterator<Item = Option<&'a str>>) -> Vec<usize> {
    let mut known: HashMap<&str, usize> = HashMap::new();
    let mut next = 0;
    let mut fresh = || {
        next += 1;
        next - 1
    };
    let cluster = |sequence: Option<&'a str>| match sequence {
        Some(name) => *known.entry(name).or_insert_with(&mut fresh),
        None => fresh(),
    };
    sequences.map(cluster).collect()
}

/// The ids of the pictures, ascending.
fn image_ids(data: &DataSet) -> Vec<u64> {
    let mut ids: Vec<u64> = data.images.iter().map(|image| image.id).collect();
    ids.sort_unstable();
    ids
}
