//! Defects of a data set: each kind with a count, the first cases and the worst one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::picture_set::UnreadPicture;

/// Examples of a kind that are kept.
const EXAMPLES: usize = 3;

/// Whether what is defective can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// It cannot be used, and is left out.
    Error,
    /// It is used, after a correction if the kind names one.
    Warning,
}

macro_rules! kinds {
    ($($kind:ident $severity:ident $sentence:literal $hint:literal;)*) => {
        /// A kind of defect.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum DefectKind {
            $(#[doc = $sentence] $kind,)*
        }

        impl DefectKind {
            /// Every kind, errors first.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// Whether what is defective can be used.
            pub fn severity(self) -> Severity {
                match self { $(Self::$kind => Severity::$severity,)* }
            }

            /// What is wrong, and what becomes of it.
            pub fn sentence(self) -> &'static str {
                match self { $(Self::$kind => $sentence,)* }
            }

            /// What to do about it.
            pub fn hint(self) -> &'static str {
                match self { $(Self::$kind => $hint,)* }
            }
        }
    };
}

kinds! {
    MissingField Error "A record lacks a value that it needs; it is left out."
        "images need id and file_name, categories id and name, annotations image_id, category_id and bbox";
    WrongType Error "A value is of the wrong type; its record is left out."
        "ids are whole numbers from 0, or texts where none is a number; sizes are numbers, names texts, a bbox is [x, y, width, height]; one with an angle is not read; a mask has the size of its picture";
    NotFinite Error "A box holds NaN, infinity or no number; it is left out."
        "find the program that wrote it; a division by zero is the usual cause";
    NegativeSize Error "A box has a negative width or height; it is left out."
        "COCO boxes are [x, y, width, height], not two corners; where a format has two corners, the left, upper one comes first";
    ZeroSize Error "A box has no width or no height; it is left out."
        "take it out of the file";
    OutsidePicture Error "A box lies outside its picture; it is left out."
        "check that boxes are in pixels of this picture, not of one of another size";
    CornerBoxes Error "Many boxes reach out of their pictures as they stand, and none would as two corners."
        "COCO boxes are [x, y, width, height]: subtract the first number from the third and the second from the fourth; if they are so already, state it: \"bbox_mode\": 1 in each annotation";
    ShareBoxes Error "Many boxes have no number larger than 1: these are shares of the picture."
        "COCO boxes are in pixels: multiply by width and height of the picture; YOLO label files have shares, see `data convert yolo`";
    UnknownImage Error "An annotation names a picture that is not listed; it is left out."
        "add the picture to `images`";
    UnknownCategory Error "An annotation names a class that is not listed; it is left out."
        "add the class to `categories`";
    RepeatedImageId Error "Two pictures have one id; both are left out with their labels, which may be of either."
        "give every picture its own id";
    RepeatedCategoryId Error "Two classes have one id; the second is left out."
        "give every class its own id";
    MissingPicture Error "The file of a picture does not exist; picture and boxes are left out."
        "put the pictures where the format has them: for COCO beside the annotations or into `images` there, for KITTI into `image_2`, for Pascal VOC into `JPEGImages`";
    SeveralPictures Error "Labels name a picture of which there are several, and nothing says which is meant; they are left out."
        "lay labels and pictures of each part into folders of one name, such as `train`; or give every picture its own name";
    SeveralTimes Error "Labels of several times are of one picture; the picture is left out with them."
        "keep the labels of the time of the picture, or give every frame the name of its own picture";
    UnreadablePicture Error "The file of a picture cannot be decoded; picture and boxes are left out."
        "replace it by an undamaged PNG, JPEG, TIFF, WebP, BMP or OpenEXR file";
    UnopenedPicture Error "The file of a picture cannot be opened or read; picture and boxes are left out."
        "check the right to read it; where it is a link, restore the file to which it leads, or replace the link by the file";
    OtherPictureSize Error "A picture has another size than stated, so that its boxes are of other pixels; both are left out."
        "restore the picture to which the boxes belong, or scale the boxes with it; another size alone does not move them";
    UnknownTurn Error "EXIF turns a picture, and nothing says whether its boxes are of the turned one; both are left out."
        "look at a picture with its boxes. Converting another format, say it for all: `--turned true` if boxes are of the pictures as they are shown, `--turned false` if of the stored pixels. In COCO format write `turned: true` or `turned: false` into the entry in `images`";
    LabelWithoutBox Error "A label of an object has no box that is read; it is left out."
        "write a box for it, or take it out if it is no object";
    PictureOfLostLabels Error "No label of a picture can be used; the picture is left out, because it is no background."
        "correct its labels, which are named above; or take them out if the picture shows no object";
    NoPicture Error "The data set has no picture that can be used."
        "correct the entries above, or name the file that lists the pictures";
    TurnedBoxes Warning "EXIF turns a picture whose stated size is that of its stored pixels; its boxes are turned with it."
        "fine; look at some with `data check --out DIR`";
    TurnedPicture Warning "EXIF turns a picture; its boxes are taken as of the turned one, which is what this format means."
        "fine if the program for labelling obeyed EXIF, as most do; look at some with `data check --out DIR`";
    OutlineBox Warning "An object is an outline or a mask; the box around it is taken."
        "fine for outlines; numbers that are keypoints need `kpt_shape` in data.yaml";
    RotatedBox Warning "A box is rotated; the upright box around it is taken, which is larger."
        "fine, but tighter upright boxes give better detectors";
    ScoredLabel Warning "A label has a score, as detections have; it is taken as an object that is there."
        "make sure that these are labels, not what a detector found";
    LaneOrArea Warning "A label is a lane or an area without a box; it is left out."
        "fine: it is no object";
    UnreadField Warning "Files have fields that are not read."
        "fine unless one of them changes what a box means";
    ClippedBox Warning "A box reaches out of its picture; it is clipped."
        "overhangs of a pixel are rounding; longer ones are boxes of another picture";
    CountedFromZero Warning "A box begins at 0, and this format counts pixels from 1."
        "if the data set counts from 0, all its boxes lie a pixel too far left and up: add 1 to xmin, ymin, xmax and ymax";
    RepeatedAnnotationId Warning "Two annotations have one id; the second gets a new one."
        "give every annotation its own id";
    ZeroId Warning "An annotation or a class has the id 0, which is an id like others here."
        "count ids from 1 if other programs use this data set: pycocotools takes annotation 0 for `not detected`, torchvision class 0 for background";
    ThinBox Warning "A box is narrower or lower than a pixel; whether it is detected does not count."
        "look at it in the picture, and take it out of the file; if all boxes are thin, they are shares of the picture, and COCO has pixels";
    UnknownState Warning "A `state` is none of red, yellow, green and off; a traffic light whose class does not name one is not judged."
        "write one of the four as a text; fine for objects that are no traffic lights";
    OtherFileName Warning "A picture is not where its name says; the only file that the name can mean is taken."
        "fine if these are the pictures; else write names as they are in the folder of the data set";
    SizeNotStated Warning "A picture has no stated size; that of its file is taken."
        "write width and height";
    AreaNotStated Warning "An annotation has no usable area; that of its box is taken."
        "write the area, by which scores divide objects into small and large ones";
    AreaBeyondBox Warning "An annotation has more area than its box; that of its box is taken."
        "check whether the boxes were scaled and the areas not";
    RepeatedFile Warning "Two entries are of one picture file."
        "keep one, or a picture may be both learned from and judged on";
    FileWithoutBoxes Warning "A file of labels has lanes or areas alone; it says nothing of its pictures."
        "fine if another file has their boxes; else they are no background and are left out";
    PictureWithoutLabels Warning "A picture has no labels; it is left out."
        "fine for masks; to keep it as background, give it labels that list no object";
    PartWithoutPictures Warning "A file names a part of the data set that has no pictures here."
        "correct the path, which counts from the folder of the data set; pictures of no named part have that of their folder, if it is called `train`, `val` or `test`";
    ListedWithoutPicture Warning "A list of a part names a picture that is not there."
        "correct the list, or add the picture";
    PictureInTwoParts Warning "Lists name a picture in two parts of the data set; it is held out."
        "keep it in one list: a picture that is learned from must not be judged on";
    SmallPicture Warning "A photograph is smaller than 126 pixels, the training window of the main job; built-in experiments on photographs leave it out."
        "give larger originals, or set a smaller `training.crop` and `scoring.crop`";
    SamePicture Warning "Two picture files have the same content."
        "keep one, or a picture may be both learned from and judged on";
    RepeatedBox Warning "Two annotations of a picture have the same class and the same box."
        "keep one: a detector cannot find both";
    RepeatedClassName Warning "Two classes have one name, or a class has none."
        "give every class its own name";
    LooseAttribute Warning "An attribute is a list or a table; it is left out."
        "attributes are texts, numbers, true or false";
    PictureWithoutBoxes Warning "A picture has no boxes; it is kept as background."
        "fine if it shows none of the classes";
    ClassWithoutBoxes Warning "A class has no boxes; it has no score."
        "fine if no picture shows one";
    CrowdBox Warning "A box holds a crowd; no detection in it is a mistake."
        "fine: pycocotools does the same";
    IgnoredBox Warning "A box is to be ignored; whether it is detected does not count."
        "fine; pycocotools honours only iscrowd";
    ManyBoxes Warning "A picture has more than 1000 boxes; scores count its 100 best detections of each class."
        "cut the picture into tiles";
}

impl DefectKind {
    /// The kind of a picture file that cannot be used.
    pub fn of_unread(unread: &UnreadPicture) -> Self {
        if unread.is_unopened { Self::UnopenedPicture } else { Self::UnreadablePicture }
    }
}

/// The defects of one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Defect {
    /// The kind.
    pub kind: DefectKind,
    /// Whether what is defective can be used.
    pub severity: Severity,
    /// Cases.
    pub count: usize,
    /// The first cases, each with its place in the data set.
    pub first: Vec<String>,
    /// The worst case, where cases can be compared.
    pub worst: Option<String>,
}

impl Defect {
    /// How often it occurs, in words.
    pub fn times(&self) -> String {
        if self.count == 1 { "once".to_owned() } else { format!("{} times", self.count) }
    }
}

/// All defects of a data set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defects {
    by_kind: BTreeMap<DefectKind, (Defect, f64)>,
    /// Pictures of labels that are left out, until the pictures are checked.
    lost_labels: BTreeSet<u64>,
}

impl Defects {
    /// Adds a case.
    pub fn add(&mut self, kind: DefectKind, example: impl FnOnce() -> String) {
        self.add_measured(kind, f64::NEG_INFINITY, example);
    }

    /// Remembers that a label of a picture is left out.
    pub(super) fn lose_label(&mut self, image_id: u64) {
        self.lost_labels.insert(image_id);
    }

    /// The pictures of labels that are left out, which are forgotten.
    pub(super) fn take_lost_labels(&mut self) -> BTreeSet<u64> {
        std::mem::take(&mut self.lost_labels)
    }

    /// Adds a case that is as bad as `extent`; the case of the largest extent is the worst.
    pub fn add_measured(&mut self, kind: DefectKind, extent: f64, example: impl FnOnce() -> String) {
        let none = || Defect { kind, severity: kind.severity(), count: 0, first: Vec::new(), worst: None };
        let (defect, worst) = self.by_kind.entry(kind).or_insert_with(|| (none(), f64::NEG_INFINITY));
        defect.count += 1;
        let (is_early, is_worse) = (defect.first.len() < EXAMPLES, extent > *worst);
        if is_early || is_worse {
            let text = example();
            if is_worse {
                (*worst, defect.worst) = (extent, Some(text.clone()));
            }
            if is_early {
                defect.first.push(text);
            }
        }
    }

    /// Adds the cases of some kinds that another check found.
    pub(super) fn add_kinds(&mut self, other: Self, kinds: &[DefectKind]) {
        for (kind, (found, extent)) in other.by_kind.into_iter().filter(|(kind, _)| kinds.contains(kind)) {
            let (defect, worst) = self.by_kind.entry(kind).or_insert_with(|| {
                let defect = Defect { count: 0, first: Vec::new(), worst: None, ..found.clone() };
                (defect, f64::NEG_INFINITY)
            });
            defect.count += found.count;
            defect.first.extend(found.first);
            defect.first.truncate(EXAMPLES);
            if extent > *worst {
                (*worst, defect.worst) = (extent, found.worst);
            }
        }
    }

    /// Cases of a kind.
    pub fn count(&self, kind: DefectKind) -> usize {
        self.by_kind.get(&kind).map_or(0, |(defect, _)| defect.count)
    }

    /// Cases that cannot be used.
    pub fn errors(&self) -> usize {
        let is_error = |defect: &&Defect| defect.severity == Severity::Error;
        self.iter().filter(is_error).map(|defect| defect.count).sum()
    }

    /// A line for each kind that occurs, errors first: what is wrong with the data set at `place`, how often, and the first case.
    pub fn lines(&self, place: &Path) -> impl Iterator<Item = String> {
        self.iter().map(move |defect| {
            let sentence = defect.kind.sentence().trim_end_matches('.');
            let first = defect.first.first().map(|first| format!("; the first: {first}")).unwrap_or_default();
            format!("{}: {sentence} ({}{first})", place.display(), defect.times())
        })
    }

    /// The kinds that occur, errors first.
    pub fn iter(&self) -> impl Iterator<Item = &Defect> {
        self.by_kind.values().map(|(defect, _)| defect)
    }
}

/// Notes the fields that are not read: each with the number of records that have it, the most frequent first.
pub(super) fn note_unread(fields: &BTreeMap<String, usize>, defects: &mut Defects) {
    const SHOWN: usize = 12;
    let mut fields: Vec<(&String, &usize)> = fields.iter().collect();
    fields.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    let mut shown: Vec<String> =
        fields.iter().take(SHOWN).map(|(name, count)| format!("{name} ({count})")).collect();
    if fields.len() > SHOWN {
        shown.push(format!("and {} more", fields.len() - SHOWN));
    }
    if !shown.is_empty() {
        defects.add(DefectKind::UnreadField, || shown.join(", "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_cases_and_the_worst_are_kept() {
        let mut defects = Defects::default();
        for i in 0..1000 {
            let extent = f64::from((i * 37) % 1000);
            defects.add_measured(DefectKind::ClippedBox, extent, || format!("box {i}: {extent} px"));
            defects.add(DefectKind::ZeroSize, || format!("box {i}"));
        }
        let all: Vec<&Defect> = defects.iter().collect();
        assert_eq!(
            all.iter().map(|d| d.kind).collect::<Vec<_>>(),
            [DefectKind::ZeroSize, DefectKind::ClippedBox]
        );
        assert_eq!((all[0].count, all[0].worst.as_deref()), (1000, None));
        assert_eq!(all[1].first, ["box 0: 0 px", "box 1: 37 px", "box 2: 74 px"]);
        assert_eq!(all[1].worst.as_deref(), Some("box 27: 999 px"));
        assert_eq!(defects.errors(), 1000);
        assert!(DefectKind::ALL.is_sorted_by_key(|kind| kind.severity()));
    }
}
