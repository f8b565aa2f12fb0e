//! Collects what a converter reads.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

use petzval_base::FileError;

use crate::coco::bounds::Bounds;
use crate::coco::check::check_values;
use crate::coco::data_set::{Annotation, Attribute, Category, DataSet, Image};
use crate::coco::defect::{DefectKind, Defects, note_unread};
use crate::coco::error::CocoError;
use crate::coco::turned::{BoxesOf, boxes_of, turned};
use crate::picture_file::{PictureHead, picture_head};
use crate::picture_set::UnreadPicture;

/// Folders that say nothing about a picture but that it is one.
pub(super) const PLAIN_FOLDERS: [&str; 6] = ["images", "JPEGImages", "image_2", "image_02", "data", "."];

/// A converted data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Converted {
    /// The data set. Pictures are named as they are to lie in its folder: `images/...`.
    pub data: DataSet,
    /// The file of each picture, in the order of `data.images`.
    pub sources: Vec<PathBuf>,
    /// What was found wrong. What cannot be used is not in `data`.
    pub defects: Defects,
}

/// An object as a converter reads it.
pub(super) struct Label<'a> {
    pub class: &'a str,
    pub bounds: Bounds,
    pub crowd: bool,
    pub ignore: bool,
    pub attributes: BTreeMap<String, Attribute>,
}

impl<'a> Label<'a> {
    pub fn new(class: &'a str, bounds: Bounds) -> Self {
        Self { class, bounds, crowd: false, ignore: false, attributes: BTreeMap::new() }
    }
}

/// The file of a picture.
struct Source {
    path: PathBuf,
    head: PictureHead,
    /// The size that the labels state, px.
    stated: Option<(u32, u32)>,
}

/// Collects pictures, classes and objects, and places that cannot be understood.
#[derive(Default)]
pub(super) struct Builder {
    data: DataSet,
    sources: HashMap<u64, Source>,
    /// Whether the format itself says that boxes are of the picture the right way up.
    means_upright: bool,
    /// Whether boxes are of the pictures the right way up, as the caller says; it counts where the stated sizes leave that open.
    turned: Option<bool>,
    unread: BTreeMap<String, usize>,
    /// The number of the picture in each file that was looked up; none if the file cannot be opened or decoded.
    taken: HashMap<PathBuf, Option<u64>>,
    names: HashSet<String>,
    /// Pictures that are left out with their labels.
    left_out: HashSet<u64>,
    categories: HashMap<String, u64>,
    pub defects: Defects,
    first_error: Option<(PathBuf, FileError)>,
    errors: usize,
}

impl Builder {
    /// One for a format that does not say whether boxes are of the picture as EXIF turns it; `turned` is what the caller says.
    pub fn new(turned: Option<bool>) -> Self {
        Self { turned, ..Self::default() }
    }

    /// One for a format that says that boxes are of the picture as EXIF turns it, unless the caller says otherwise.
    pub fn of_turned_pictures(turned: Option<bool>) -> Self {
        Self { means_upright: true, turned, ..Self::default() }
    }

    /// Size of a picture of which labels give shares, px: of the stored pixels, if the caller says that boxes are of these.
    pub fn labelled_size(&self, id: u64) -> (u32, u32) {
        let size = |source: &Source| match self.turned {
            Some(false) => source.head.stored,
            _ => source.head.upright(),
        };
        self.sources.get(&id).map_or((0, 0), size)
    }

    /// Notes a place that cannot be understood.
    pub fn wrong(&mut self, path: &Path, error: FileError) {
        self.errors += 1;
        self.first_error.get_or_insert_with(|| (path.to_owned(), error));
    }

    /// The value that was read, or `None` after noting the error.
    pub fn understood<T>(&mut self, path: &Path, read: Result<T, FileError>) -> Option<T> {
        read.map_err(|error| self.wrong(path, error)).ok()
    }

    /// Adds a class, if it is new; its number.
    pub fn category(&mut self, name: &str) -> u64 {
        if let Some(id) = self.categories.get(name) {
            return *id;
        }
        let id = self.data.categories.len() as u64 + 1;
        self.data.categories.push(Category { id, name: name.to_owned(), ..Category::default() });
        self.categories.insert(name.to_owned(), id);
        id
    }

    /// Adds a picture, or returns it if its file was added before; `None` if its file cannot be opened or decoded, which is noted. Its name in the data set is
    /// its path below `root`.
    pub fn picture(&mut self, root: &Path, path: &Path, split: Option<String>) -> Option<&mut Image> {
        if let Some(id) = self.taken.get(path) {
            // Pictures are in the order of their numbers.
            let place = self.data.images.binary_search_by_key(&(*id)?, |image| image.id).ok()?;
            return self.data.images.get_mut(place);
        }
        let head = picture_head(path).map_err(UnreadPicture::from).inspect_err(|unread| {
            self.defects.add(DefectKind::of_unread(unread), || unread.message.clone());
            self.taken.insert(path.to_owned(), None);
        });
        let head = head.ok()?;
        let id = self.sources.len() as u64 + 1;
        let file_name = self.free_name(root, path);
        let (width, height) = head.upright();
        self.sources.insert(id, Source { path: path.to_owned(), head, stated: None });
        self.taken.insert(path.to_owned(), Some(id));
        let turned = head.is_turned().then_some(true);
        self.data.images.push(Image { id, file_name, width, height, split, turned, ..Image::default() });
        self.data.images.last_mut()
    }

    /// Notes pictures that no label names. One whose name without ending is that of a picture with labels is taken for a mask of it.
    pub fn note_unlabelled<'p>(&mut self, pictures: impl Iterator<Item = &'p Path>) {
        let labelled: HashSet<&OsStr> = self.taken.keys().filter_map(|path| path.file_stem()).collect();
        for path in pictures.filter(|path| path.file_stem().is_none_or(|stem| !labelled.contains(stem))) {
            self.defects.add(DefectKind::PictureWithoutLabels, || path.display().to_string());
        }
    }

    /// Notes the size of a picture that its labels state.
    pub fn stated(&mut self, id: u64, size: (u32, u32)) {
        if let Some(source) = self.sources.get_mut(&id) {
            source.stated = Some(size);
        }
    }

    /// Counts a field of the labels that is not read.
    pub fn unread(&mut self, field: &str) {
        *self.unread.entry(field.to_owned()).or_default() += 1;
    }

    /// The place of a picture in the folder of the data set: `images/` and its path below the root, without folders that say nothing.
    fn free_name(&mut self, root: &Path, path: &Path) -> String {
        let below = path.strip_prefix(root).unwrap_or(path);
        let parts = below.components().filter_map(|part| match part {
            Component::Normal(part) => Some(part.to_string_lossy()),
            _ => None,
        });
        let kept: Vec<_> = parts.filter(|part| !PLAIN_FOLDERS.contains(&part.as_ref())).collect();
        let name = format!("images/{}", kept.join("/"));
        let mut free = name.clone();
        for n in 2.. {
            // Some systems take two spellings for one name.
            if self.names.insert(free.to_lowercase()) {
                break;
            }
            let (stem, ending) = name.rsplit_once('.').unwrap_or((&name, ""));
            free = format!("{stem}-{n}.{ending}");
        }
        free
    }

    /// Adds an object of a picture.
    pub fn object(&mut self, image_id: u64, label: Label) {
        let category_id = self.category(label.class);
        self.data.annotations.push(Annotation {
            id: self.data.annotations.len() as u64 + 1,
            image_id,
            category_id,
            area: label.bounds.area(),
            bounds: label.bounds,
            crowd: label.crowd,
            ignore: label.ignore,
            attributes: label.attributes,
            unclipped: None,
        });
    }

    /// Leaves a picture out with its labels, which the caller notes.
    pub fn leave_out(&mut self, image_id: u64) {
        self.left_out.insert(image_id);
    }

    /// Remembers that a label of a picture is left out.
    pub fn lose_label(&mut self, image_id: u64) {
        self.defects.lose_label(image_id);
    }

    /// Classes added so far.
    pub fn class_names(&self) -> Vec<String> {
        self.data.categories.iter().map(|category| category.name.clone()).collect()
    }

    /// The data set once its values are checked, or the first place that cannot be understood.
    pub fn finish(mut self, format: &str) -> Result<Converted, CocoError> {
        if let Some((path, error)) = self.first_error {
            return Err(CocoError::File { path, error: Box::new(error), more: self.errors - 1 });
        }
        self.data.info.insert("description".to_owned(), format!("converted from {format}").into());
        self.settle_turns();
        note_unread(&self.unread, &mut self.defects);
        // The form of the labels is that of their format, and is not guessed.
        self.data.states_form = true;
        check_values(&mut self.data, &mut self.defects);
        let path = |image: &Image| self.sources.get(&image.id).map(|source| source.path.clone());
        let sources = self.data.images.iter().filter_map(path).collect();
        Ok(Converted { data: self.data, sources, defects: self.defects })
    }

    /// Turns boxes of stored pixels with their pictures, and takes pictures out whose boxes may be of others.
    fn settle_turns(&mut self) {
        let with_boxes: HashSet<u64> = self.data.annotations.iter().map(|a| a.image_id).collect();
        let (mut left_out, mut turning) = (std::mem::take(&mut self.left_out), HashMap::new());
        for image in &self.data.images {
            if left_out.contains(&image.id) {
                continue;
            }
            let Some(Source { path, head, stated }) = self.sources.get(&image.id) else { continue };
            let ((width, height), path) = (head.upright(), path.display());
            let turn = format!("{path}: orientation {}", head.orientation.to_exif());
            match boxes_of(head, None, *stated) {
                BoxesOf::Upright => {}
                // What the caller says decides where the stated size does not.
                BoxesOf::Unknown if self.turned == Some(true) => {}
                BoxesOf::Unknown if self.turned == Some(false) => {
                    turning.insert(image.id, *head);
                }
                BoxesOf::Unknown if !with_boxes.contains(&image.id) => {}
                BoxesOf::Unknown if self.means_upright => {
                    self.defects.add(DefectKind::TurnedPicture, || turn);
                }
                BoxesOf::Unknown => {
                    self.defects.add(DefectKind::UnknownTurn, || turn);
                    left_out.insert(image.id);
                }
                BoxesOf::Stored => {
                    self.defects.add(DefectKind::TurnedBoxes, || turn);
                    turning.insert(image.id, *head);
                }
                BoxesOf::Other => {
                    let stated = stated.map_or(String::new(), |(w, h)| format!(", stated {w} x {h}"));
                    let found = format!("{path}: {width} x {height} px{stated}");
                    self.defects.add(DefectKind::OtherPictureSize, || found);
                    left_out.insert(image.id);
                }
            }
        }
        self.data.images.retain(|image| !left_out.contains(&image.id));
        self.data.annotations.retain(|annotation| !left_out.contains(&annotation.image_id));
        for annotation in &mut self.data.annotations {
            if let Some(head) = turning.get(&annotation.image_id) {
                annotation.bounds = turned(annotation.bounds, head);
            }
        }
    }
}
