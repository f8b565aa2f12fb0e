//! What a run was made from, input by input: `inputs/inputs.json`. It names the input that has changed, and remembers where pictures were.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use petzval_learn::dataset::{List, PictureFile};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, PicturesKey};
use crate::path_text::path_text;
use crate::run::date::date_since_1970;
use crate::run::{RunFolder, read_json_if_there, write_file};

/// The name of the built-in photographs among the inputs.
pub(crate) const BUILT_IN: &str = "built-in photographs";

/// Most inputs that a message names.
const NAMED: usize = 3;

/// The inputs of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputList {
    /// SHA-256 by name: the lens of each variant, the sensor, the ISP, PSFs of a file, given weights.
    pub parts: BTreeMap<String, String>,
    /// Held-out pictures, and places of the sensor at which each is scored.
    pub held_out: [usize; 2],
    /// The user's pictures; none for built-in photographs and streets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pictures: Option<Pictures>,
}

/// The pictures of a user.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pictures {
    /// Where they are: an absolute path of a folder or a file of annotations.
    pub place: PathBuf,
    /// SHA-256 of all labels; none of photographs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// SHA-256 of each label image by its name; none where labels are boxes, and in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub label_files: BTreeMap<String, String>,
    /// Their files.
    pub files: Vec<PictureFile>,
}

impl InputList {
    /// That of a run; none in a folder of an earlier version.
    pub fn read(run: &RunFolder) -> Result<Option<Self>> {
        read_json_if_there(&run.input_list())
    }

    /// Keeps it in the folder of its run.
    pub fn write(&self, run: &RunFolder) -> Result<()> {
        write_file(&run.input_list(), DesignError::json("the inputs of the run", self)?.as_bytes())
    }

    /// The same with the sizes and times that pictures have `now`, but for those that were read: a picture may be repaired before its first read.
    pub fn with_unread(mut self, now: &Self, is_read: impl Fn(&str) -> bool) -> Self {
        let found: BTreeMap<&str, &PictureFile> =
            now.pictures.iter().flat_map(|now| &now.files).map(|file| (file.name.as_str(), file)).collect();
        for file in self.pictures.iter_mut().flat_map(|pictures| &mut pictures.files) {
            let unread =
                found.get(file.name.as_str()).filter(|_| file.sha256.is_none() && !is_read(&file.name));
            if let Some(now) = unread {
                (file.bytes, file.modified_s) = (now.bytes, now.modified_s);
            }
        }
        self
    }

    /// Names of the parts that both lists have, with another digest `now`.
    pub fn parts_unlike(&self, now: &Self) -> Vec<&str> {
        let is_other =
            |(name, sha256): &(&String, &String)| now.parts.get(*name).is_some_and(|now| now != *sha256);
        self.parts.iter().filter(is_other).map(|(name, _)| name.as_str()).collect()
    }

    /// The inputs that are others `now`, in words: at most three, and how many more there are.
    pub fn differences(&self, now: &Self) -> Vec<String> {
        let parts = self.parts.iter().filter(|(name, sha256)| now.parts.get(*name) != Some(sha256));
        let mut all: Vec<String> = parts.map(|(name, _)| format!("the {name}")).collect();
        all.extend(
            now.parts.keys().filter(|name| !self.parts.contains_key(*name)).map(|n| format!("the {n}")),
        );
        let pictures = |list: &Self| list.pictures.clone().unwrap_or_default();
        all.extend(pictures(self).differences(&pictures(now)));
        let more = all.len().saturating_sub(NAMED);
        if more > 1 {
            all.truncate(NAMED);
            all.push(format!("{more} more"));
        }
        all
    }
}

impl Pictures {
    /// Whether the content of every file is known.
    pub fn are_read(&self) -> bool {
        self.files.iter().all(|file| file.sha256.is_some())
    }

    /// Adds the files to a hash by list, name and size.
    pub fn add_names_to(&self, hash: &mut Sha256) {
        for PictureFile { name, list, bytes, .. } in &self.files {
            hash.update(format!("{}: {name} {bytes} bytes\n", purpose(*list)));
        }
    }

    /// The pictures and labels that are others `now`, in words. Of a picture that moved to another list nothing is said where pictures were added or
    /// taken away: the lists follow from all of them.
    fn differences(&self, now: &Self) -> Vec<String> {
        let by_name = |files: &[PictureFile]| -> BTreeMap<String, PictureFile> {
            files.iter().map(|file| (file.name.clone(), file.clone())).collect()
        };
        let (then, found) = (by_name(&self.files), by_name(&now.files));
        let new: Vec<&PictureFile> = found.values().filter(|file| !then.contains_key(&file.name)).collect();
        let of_content: BTreeMap<&str, &str> =
            new.iter().filter_map(|file| Some((file.sha256.as_deref()?, file.name.as_str()))).collect();
        let (mut all, mut moved, mut renamed) = (Vec::new(), Vec::new(), BTreeSet::new());
        for (name, file) in &then {
            let equal = file.sha256.as_deref().and_then(|sha256| of_content.get(sha256).copied());
            match (found.get(name), equal) {
                (None, Some(equal)) => {
                    renamed.insert(equal);
                    all.push(format!("the picture {name}, in whose place {equal} has the same content"));
                }
                (None, None) => {
                    all.push(format!("the picture {name}, which is missing or cannot be used"));
                }
                (Some(other), _) if !is_same(file, other) => {
                    all.push(format!("the picture {name} ({}, and now {})", in_words(file), in_words(other)));
                }
                (Some(other), _) if other.list != file.list => moved.push(format!(
                    "the picture {name}, which was {} and is {}",
                    purpose(file.list),
                    purpose(other.list)
                )),
                (Some(_), _) => {}
            }
        }
        let names = new.iter().map(|file| file.name.as_str()).filter(|name| !renamed.contains(name));
        all.extend(names.map(|name| format!("the new picture {name}")));
        if then.keys().eq(found.keys()) {
            all.extend(moved);
        }
        let labels = self.other_label_files(now);
        if labels.is_empty() && self.labels != now.labels {
            all.push("the labels of the pictures".to_owned());
        }
        all.extend(labels);
        all
    }

    /// The label images that are others `now`, in words; none where the run or what is there `now` has no list of them.
    fn other_label_files(&self, now: &Self) -> Vec<String> {
        let (then, found) = (&self.label_files, &now.label_files);
        if then.is_empty() || found.is_empty() {
            return Vec::new();
        }
        let changed = then.iter().filter_map(|(name, sha256)| match found.get(name) {
            None => Some(format!("the label image {name}, which is missing or whose picture cannot be used")),
            Some(other) if other != sha256 => Some(format!("the label image {name}")),
            Some(_) => None,
        });
        let new = found.keys().filter(|name| !then.contains_key(*name));
        changed.chain(new.map(|name| format!("the new label image {name}"))).collect()
    }
}

/// The pictures of a run where they are now: where the user says, where its `config.toml` says, or where they were when it began.
pub fn pictures_of_run(
    run: &RunFolder,
    experiment: &mut Experiment,
    key: PicturesKey,
    now: Option<&Path>,
) -> Result<()> {
    let place = experiment.pictures_mut(key);
    if let Some(now) = now {
        *place = path_text(now)?;
        return Ok(());
    }
    if place == key.built_in() || Path::new(place).exists() {
        return Ok(());
    }
    let pictures = InputList::read(run)?.and_then(|list| list.pictures);
    if let Some(pictures) = pictures.filter(|pictures| pictures.place.exists()) {
        *place = path_text(&pictures.place)?;
    }
    Ok(())
}

/// Fails if the pictures of a run are not there, with what to do.
pub fn check_pictures_are_there(run: &RunFolder, experiment: &Experiment, key: PicturesKey) -> Result<()> {
    let place = experiment.pictures(key);
    if place == key.built_in() || Path::new(place).exists() {
        return Ok(());
    }
    let was = InputList::read(run)?.and_then(|list| list.pictures).map(|pictures| pictures.place);
    let [option, what] = key.in_words();
    let problem = format!(
        "the {what} of this run are not at {}; hint: say where they are now: {option} PATH",
        was.map_or_else(|| place.clone(), |was| was.display().to_string())
    );
    Err(DesignError::Run { path: run.root().to_path_buf(), problem })
}

/// Whether two files have the same content, as far as that is known.
fn is_same(one: &PictureFile, other: &PictureFile) -> bool {
    match (&one.sha256, &other.sha256) {
        (Some(one), Some(other)) => one == other,
        _ => one.bytes == other.bytes,
    }
}

/// Size and time of a file.
fn in_words(file: &PictureFile) -> String {
    let of = file
        .modified_s
        .map_or_else(String::new, |s| format!(" of {}", date_since_1970(Duration::from_secs(s))));
    format!("{} bytes{of}", file.bytes)
}

/// What pictures of a list are for, in words.
fn purpose(list: List) -> &'static str {
    match list {
        List::Training => "for training",
        List::Validation => "for validation",
        List::HeldOut => "held out",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, sha256: &str, list: List) -> PictureFile {
        PictureFile { name: name.into(), list, bytes: 10, modified_s: Some(0), sha256: Some(sha256.into()) }
    }

    #[test]
    fn label_images_that_changed_are_named() {
        let list = |labels: &str, files: &[(&str, &str)]| {
            let label_files = files.iter().map(|(name, sha256)| ((*name).into(), (*sha256).into())).collect();
            let pictures = Pictures { labels: Some(labels.into()), label_files, ..Pictures::default() };
            InputList { pictures: Some(pictures), ..InputList::default() }
        };
        let then = list("1", &[("labels/a.png", "a"), ("labels/b.png", "b"), ("labels/c.png", "c")]);
        assert!(then.differences(&then).is_empty());
        let now = list("2", &[("labels/a.png", "a"), ("labels/b.png", "x"), ("labels/d.png", "d")]);
        assert_eq!(
            then.differences(&now),
            [
                "the label image labels/b.png",
                "the label image labels/c.png, which is missing or whose picture cannot be used",
                "the new label image labels/d.png"
            ]
        );
        // A run of an earlier version has one digest of all labels.
        assert_eq!(list("1", &[]).differences(&now), ["the labels of the pictures"]);
        let text = r#"{"place": "/data", "labels": "1", "files": []}"#;
        let old: Pictures = serde_json::from_str(text).unwrap();
        assert!(old.label_files.is_empty() && !serde_json::to_string(&old).unwrap().contains("label_files"));
    }

    #[test]
    fn every_input_that_changed_is_named() {
        let then = InputList {
            parts: BTreeMap::from([("sensor".into(), "a".into()), ("lens of wide".into(), "b".into())]),
            held_out: [1, 1],
            pictures: Some(Pictures {
                place: "/photos".into(),
                labels: Some("boxes".into()),
                label_files: BTreeMap::new(),
                files: vec![file("one.png", "1", List::Training), file("two.png", "2", List::HeldOut)],
            }),
        };
        assert!(then.differences(&then).is_empty());
        let mut moved = then.clone();
        moved.pictures.as_mut().unwrap().place = "/elsewhere".into();
        moved.pictures.as_mut().unwrap().files[0].modified_s = None;
        assert!(then.differences(&moved).is_empty(), "neither place nor time count");
        let mut changed = then.clone();
        changed.parts.insert("sensor".into(), "c".into());
        assert_eq!(then.differences(&changed), ["the sensor"]);
        assert_eq!(then.parts_unlike(&changed), ["sensor"]);
        let pictures = changed.pictures.as_mut().unwrap();
        pictures.files = vec![file("one.png", "9", List::Training), file("three.png", "3", List::HeldOut)];
        let all = then.differences(&changed);
        assert_eq!(
            all[1],
            "the picture one.png (10 bytes of 1970-01-01T00:00:00Z, and now 10 bytes of 1970-01-01T00:00:00Z)"
        );
        assert_eq!(
            all[2..],
            ["the picture two.png, which is missing or cannot be used", "the new picture three.png"]
        );
        changed.pictures.as_mut().unwrap().labels = None;
        assert_eq!(then.differences(&changed)[3], "2 more");
        // In a large set a picture may change until it is read.
        let unread = |bytes: u64| {
            let mut list = then.clone();
            for file in &mut list.pictures.as_mut().unwrap().files {
                (file.sha256, file.bytes) = (None, bytes);
            }
            list
        };
        let (large, now) = (unread(10), unread(20));
        assert_eq!(large.differences(&now).len(), 2);
        assert!(large.clone().with_unread(&now, |_| false).differences(&now).is_empty());
        let all = large.with_unread(&now, |name| name == "two.png").differences(&now);
        assert!(all.len() == 1 && all[0].starts_with("the picture two.png"), "{all:?}");
        assert_eq!(
            then.clone().with_unread(&changed, |_| false),
            then,
            "of those whose content is known none may"
        );
        // A picture of the same content comes in its place; what follows from that in the lists is not named.
        let mut renamed = then.clone();
        renamed.pictures.as_mut().unwrap().files =
            vec![file("a.png", "1", List::Training), file("two.png", "2", List::Training)];
        assert_eq!(
            then.differences(&renamed),
            ["the picture one.png, in whose place a.png has the same content"]
        );
        let mut fewer = then.clone();
        fewer.pictures.as_mut().unwrap().files = vec![file("two.png", "2", List::Training)];
        assert_eq!(then.differences(&fewer), ["the picture one.png, which is missing or cannot be used"]);
        let mut listed = then.clone();
        listed.pictures.as_mut().unwrap().files[1].list = List::Training;
        assert_eq!(
            then.differences(&listed),
            ["the picture two.png, which was held out and is for training"]
        );
    }
}
