//! Checks the values of a data set: ids, references and boxes.

use std::collections::{HashMap, HashSet};

use super::bounds::{Bounds, short};
use super::data_set::{Annotation, DataSet, Image};
use super::defect::{DefectKind, Defects};
use super::light_state::light_state;

/// More boxes than this in one picture are noted.
pub const MANY_BOXES: usize = 1000;

/// Fewer boxes than this do not show in which form they are.
const LEAST_BOXES: usize = 3;

/// If so large a share of the boxes reach out of their pictures, and none would as two corners, they are corners. If so large a share lie in the
/// first pixel of their pictures, they are shares.
const LEAST_OUT: f64 = 0.25;

/// Overhangs of so many pixels are rounding.
const ROUNDING_PX: f64 = 2.0;

/// Corners lie so many pixels beyond the picture at most: some programs count from 1.
const CORNER_SLACK_PX: f64 = 1.0;

/// Areas may exceed their box by this share, which is rounding.
const AREA_SLACK: f64 = 1.01;

/// Checks ids, references and boxes. What cannot be used is taken out, what can be corrected is corrected, and all of it is noted. Pictures and
/// classes without boxes, and pictures with very many, are noted, too.
///
/// Boxes are clipped to the stated size of their picture; a picture without one, of size 0, is not clipped.
pub fn check_values(data: &mut DataSet, defects: &mut Defects) {
    check_entries(data, defects);
    count_boxes(data, defects);
}

/// [`check_values`] without a count of boxes, which depends on the pictures that are left.
pub(super) fn check_entries(data: &mut DataSet, defects: &mut Defects) {
    check_images(data, defects);
    check_categories(data, defects);
    check_form(data, |image| (image.width, image.height), defects);
    check_annotations(data, defects);
    leave_out_pictures_of_lost_labels(data, defects);
}

/// Takes out pictures none of whose labels can be used: they would be learned from and judged on as if they showed no object.
fn leave_out_pictures_of_lost_labels(data: &mut DataSet, defects: &mut Defects) {
    let mut lost = defects.take_lost_labels();
    if lost.is_empty() {
        return;
    }
    for annotation in &data.annotations {
        lost.remove(&annotation.image_id);
    }
    data.images.retain(|image| {
        let is_lost = lost.contains(&image.id);
        if is_lost {
            defects.add(DefectKind::PictureOfLostLabels, || image.file_name.clone());
        }
        !is_lost
    });
}

/// Takes out pictures of one id with their labels, which may be of either. An entry that is there twice is one picture.
fn check_images(data: &mut DataSet, defects: &mut Defects) {
    let mut firsts: HashMap<u64, Image> = HashMap::with_capacity(data.images.len());
    let mut doubtful = HashSet::new();
    data.images.retain(|image| {
        let Some(first) = firsts.get(&image.id) else {
            firsts.insert(image.id, image.clone());
            return true;
        };
        let both = || format!("image {}: {} and {}", image.id, first.file_name, image.file_name);
        if first == image {
            defects.add(DefectKind::RepeatedFile, both);
        } else {
            doubtful.insert(image.id);
            defects.add(DefectKind::RepeatedImageId, both);
        }
        false
    });
    if !doubtful.is_empty() {
        data.images.retain(|image| !doubtful.contains(&image.id));
        data.annotations.retain(|annotation| !doubtful.contains(&annotation.image_id));
    }
    let mut files = HashMap::new();
    for image in &data.images {
        if let Some(first) = files.insert(image.file_name.as_str(), image.id) {
            defects.add(DefectKind::RepeatedFile, || {
                format!("images {first} and {}: {}", image.id, image.file_name)
            });
        }
    }
}

fn check_categories(data: &mut DataSet, defects: &mut Defects) {
    let mut ids = HashSet::new();
    data.categories.retain(|category| {
        let is_new = ids.insert(category.id);
        if !is_new {
            defects.add(DefectKind::RepeatedCategoryId, || {
                format!("category {}: {:?}", category.id, category.name)
            });
        }
        if category.id == 0 {
            defects.add(DefectKind::ZeroId, || format!("category 0: {:?}", category.name));
        }
        is_new
    });
    let mut names = HashSet::new();
    for category in &data.categories {
        let name = category.name.trim();
        if name.is_empty() || !names.insert(name) {
            defects.add(DefectKind::RepeatedClassName, || format!("category {}: {name:?}", category.id));
        }
    }
}

/// Boxes of another form than COCO's show it many together: one alone may be small, or at the edge. `size_of` gives the columns and rows of the pixels
/// to which the boxes of a picture refer, px; 0 where they are not known. Shares show without them, corners do not.
pub(super) fn check_form(data: &DataSet, size_of: impl Fn(&Image) -> (u32, u32), defects: &mut Defects) {
    let images: HashMap<u64, &Image> = data.images.iter().map(|image| (image.id, image)).collect();
    // The bounds as the file has them: a clipped box does not reach out.
    let placed = data.annotations.iter().filter_map(|annotation| {
        let image = *images.get(&annotation.image_id)?;
        let bounds = annotation.unclipped.map_or(annotation.bounds, |(bounds, _)| bounds);
        let size = size_of(image);
        // In a picture of one or two pixels every box looks like shares.
        (!(1..=2).contains(&size.0) && !(1..=2).contains(&size.1))
            .then_some((annotation, image, bounds, size))
    });
    let placed: Vec<Placed> = placed.collect();
    let is_many = |count: usize, of: usize| count >= LEAST_BOXES && count as f64 > LEAST_OUT * of as f64;
    let said =
        |(a, image, bounds, _): &Placed| format!("annotation {} of {}: {bounds}", a.id, image.file_name);
    let shares: Vec<&Placed> = placed.iter().filter(|(_, _, bounds, _)| is_share(bounds)).collect();
    // Some programs write the first pixel for a picture without objects: numbers between 0 and 1 show shares.
    let are_all = placed.len() >= LEAST_BOXES && shares.len() == placed.len();
    let between = shares.iter().filter(|(_, _, bounds, _)| has_fraction(bounds)).count();
    if are_all || is_many(between, placed.len()) {
        shares.into_iter().for_each(|place| defects.add(DefectKind::ShareBoxes, || said(place)));
        return;
    }
    let placed: Vec<&Placed> = placed.iter().filter(|(_, _, _, size)| size.0 > 0 && size.1 > 0).collect();
    if data.states_form || placed.len() < LEAST_BOXES {
        return;
    }
    // Read as two corners, a box lies in its picture.
    let could_be_corners = |(_, _, b, size): &Placed| {
        let ends = [f64::from(size.0) + CORNER_SLACK_PX, f64::from(size.1) + CORNER_SLACK_PX];
        let begins_inside = b.x >= -CORNER_SLACK_PX && b.y >= -CORNER_SLACK_PX;
        begins_inside && b.x < b.width && b.y < b.height && b.width <= ends[0] && b.height <= ends[1]
    };
    let reaches_out =
        |(_, _, bounds, size): &Placed| bounds.overhang(f64::from(size.0), f64::from(size.1)) > ROUNDING_PX;
    let out: Vec<&Placed> = placed.iter().copied().filter(|place| reaches_out(place)).collect();
    let share = out.len() as f64 / placed.len() as f64;
    if share > LEAST_OUT && placed.iter().all(|place| could_be_corners(place)) {
        out.into_iter().for_each(|place| defects.add(DefectKind::CornerBoxes, || said(place)));
    }
}

/// An object with its picture, its bounds as the file has them, and the columns and rows of the pixels to which they refer.
type Placed<'d> = (&'d Annotation, &'d Image, Bounds, (u32, u32));

/// Whether the numbers of a box may be shares of a picture. Formats in which the last pixel is inside, or pixels are counted from 1, make sides of
/// shares longer by 1.
fn is_share(bounds: &Bounds) -> bool {
    bounds.x <= 1.0 && bounds.y <= 1.0 && bounds.width <= 2.0 && bounds.height <= 2.0
}

/// Whether a box with an area has a number between 0 and 1.
fn has_fraction(bounds: &Bounds) -> bool {
    bounds.width > 0.0 && bounds.height > 0.0 && <[f64; 4]>::from(*bounds).iter().any(|n| n.fract() != 0.0)
}

fn check_annotations(data: &mut DataSet, defects: &mut Defects) {
    let images: HashMap<u64, &Image> = data.images.iter().map(|image| (image.id, image)).collect();
    let categories: HashSet<u64> = data.categories.iter().map(|category| category.id).collect();
    let mut free = data.annotations.iter().map(|a| a.id).max().map_or(1, |id| id.wrapping_add(1));
    let mut ids = HashSet::with_capacity(data.annotations.len());
    let mut boxes = HashSet::with_capacity(data.annotations.len());
    data.annotations.retain_mut(|annotation| {
        let Some(image) = images.get(&annotation.image_id) else {
            defects.add(DefectKind::UnknownImage, || {
                format!(
                    "annotation {} of image {}: {}",
                    annotation.id, annotation.image_id, annotation.bounds
                )
            });
            return false;
        };
        let said = |a: &Annotation| format!("annotation {} of {}: {}", a.id, image.file_name, a.bounds);
        if !categories.contains(&annotation.category_id) {
            defects.add(DefectKind::UnknownCategory, || {
                let Annotation { id, category_id, .. } = annotation;
                format!("annotation {id} of {}: category {category_id}", image.file_name)
            });
            defects.lose_label(image.id);
            return false;
        }
        if !check_bounds(annotation, image, defects) {
            defects.lose_label(image.id);
            return false;
        }
        check_area(annotation, image, defects);
        if annotation.bounds.is_thin() {
            defects.add(DefectKind::ThinBox, || said(annotation));
        }
        if let Some(state) = annotation.attributes.get("state")
            && state.text().and_then(light_state).is_none()
        {
            defects.add(DefectKind::UnknownState, || format!("{}: state {state}", said(annotation)));
        }
        if annotation.id == 0 {
            defects.add(DefectKind::ZeroId, || said(annotation));
        }
        if !ids.insert(annotation.id) {
            defects.add(DefectKind::RepeatedAnnotationId, || said(annotation));
            // Ids may be used up to the largest number; search from 1 then.
            while !ids.insert(free) {
                free = free.wrapping_add(1);
            }
            annotation.id = free;
        }
        let bits = <[f64; 4]>::from(annotation.bounds).map(f64::to_bits);
        if !boxes.insert((annotation.image_id, annotation.category_id, annotation.crowd, bits)) {
            defects.add(DefectKind::RepeatedBox, || said(annotation));
        }
        if annotation.crowd {
            defects.add(DefectKind::CrowdBox, || said(annotation));
        } else if annotation.ignore {
            defects.add(DefectKind::IgnoredBox, || said(annotation));
        }
        true
    });
}

/// Clips a box to its picture; false if it cannot be used.
fn check_bounds(annotation: &mut Annotation, image: &Image, defects: &mut Defects) -> bool {
    let bounds = annotation.bounds;
    let said = || {
        let size = format!("{} x {} px", image.width, image.height);
        format!("annotation {} of {} ({size}): {bounds}", annotation.id, image.file_name)
    };
    let values = <[f64; 4]>::from(bounds);
    // A finite box may still have an edge or an area beyond the largest number.
    let is_finite = values.iter().all(|v| v.is_finite())
        && bounds.area().is_finite()
        && (bounds.x + bounds.width).is_finite()
        && (bounds.y + bounds.height).is_finite();
    if !is_finite {
        defects.add(DefectKind::NotFinite, said);
        return false;
    }
    if bounds.width < 0.0 || bounds.height < 0.0 {
        defects.add_measured(DefectKind::NegativeSize, -bounds.width.min(bounds.height), said);
        return false;
    }
    if bounds.area() <= 0.0 {
        defects.add(DefectKind::ZeroSize, said);
        return false;
    }
    if image.width == 0 || image.height == 0 {
        return true;
    }
    let (width, height) = (f64::from(image.width), f64::from(image.height));
    let Some(clipped) = bounds.clipped(width, height) else {
        defects.add_measured(DefectKind::OutsidePicture, bounds.overhang(width, height), said);
        return false;
    };
    let overhang = bounds.overhang(width, height);
    if overhang > 0.0 {
        defects
            .add_measured(DefectKind::ClippedBox, overhang, || format!("{}, {overhang:.1} px over", said()));
        let stated = annotation.area;
        let area = if stated.is_finite() && stated > 0.0 { stated } else { bounds.area() };
        annotation.unclipped.get_or_insert((bounds, area));
        // The area of an outline inside the picture does not change; that of a box does.
        if annotation.area > clipped.area() {
            annotation.area = clipped.area();
        }
        annotation.bounds = clipped;
    }
    true
}

fn check_area(annotation: &mut Annotation, image: &Image, defects: &mut Defects) {
    let (area, of_box) = (annotation.area, annotation.bounds.area());
    let said = || {
        let stated =
            if area.is_nan() { "no number for its area".to_owned() } else { format!("{} px^2", short(area)) };
        let of_box = short(of_box);
        format!("annotation {} of {}: {stated}, box {of_box} px^2", annotation.id, image.file_name)
    };
    if !(area.is_finite() && area > 0.0) {
        defects.add(DefectKind::AreaNotStated, said);
    } else if area > AREA_SLACK * of_box + 1.0 {
        defects.add_measured(DefectKind::AreaBeyondBox, area / of_box, said);
    } else {
        return;
    }
    annotation.area = of_box;
}

/// Notes pictures and classes without boxes, and pictures with very many.
pub(super) fn count_boxes(data: &DataSet, defects: &mut Defects) {
    let mut by_image: HashMap<u64, usize> = HashMap::new();
    let mut with_boxes = HashSet::new();
    for annotation in &data.annotations {
        *by_image.entry(annotation.image_id).or_default() += 1;
        with_boxes.insert(annotation.category_id);
    }
    for image in &data.images {
        match by_image.get(&image.id).copied().unwrap_or(0) {
            0 => defects.add(DefectKind::PictureWithoutBoxes, || image.file_name.clone()),
            n if n > MANY_BOXES => {
                let said = || format!("{}: {n} boxes", image.file_name);
                defects.add_measured(DefectKind::ManyBoxes, n as f64, said);
            }
            _ => {}
        }
    }
    for category in data.categories.iter().filter(|category| !with_boxes.contains(&category.id)) {
        defects
            .add(DefectKind::ClassWithoutBoxes, || format!("category {}: {:?}", category.id, category.name));
    }
}
