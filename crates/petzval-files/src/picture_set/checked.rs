//! Pictures that were decoded as a whole: their digests, remembered from one check to the next.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use petzval_base::{Cancelled, Tally, write_whole};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::StoredPicture;
use crate::picture_file::{ImageError, MOST_PICTURE_BYTES, PictureHead, PictureNotes};

/// Files that changed so recently may change again without another time: they are checked again.
const RECENT: Duration = Duration::from_secs(3);

/// Pictures that were decoded from end to end without an error, each with its digest. A picture is known as long as its path, size and time stay.
#[derive(Debug, Default)]
pub struct CheckedPictures {
    known: HashMap<String, Checked>,
    fresh: Mutex<BTreeMap<String, Checked>>,
    /// What the files of the pictures say that is not obeyed.
    notes: Mutex<PictureNotes>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Checked {
    /// Bytes of the picture.
    bytes: u64,
    /// Time of the last change of its file, nanoseconds since 1970.
    modified_ns: u64,
    /// SHA-256 of the picture, hexadecimal.
    sha256: String,
    /// What its file says that is not obeyed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

/// The file in which they are kept.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Memory {
    /// Version of the form of this file, and of what a check is.
    version: u32,
    pictures: BTreeMap<String, Checked>,
}

/// Version of [`Memory`].
const VERSION: u32 = 2;

impl CheckedPictures {
    /// Those that a file remembers: none if there is no such file, or one that cannot be read.
    pub fn read(file: &Path) -> Self {
        let memory = petzval_base::read_whole(file).ok();
        let memory = memory.and_then(|bytes| serde_json::from_slice::<Memory>(&bytes).ok());
        let known = memory
            .filter(|memory| memory.version == VERSION)
            .map_or_else(HashMap::new, |memory| memory.pictures.into_iter().collect());
        Self { known, ..Self::default() }
    }

    /// Whether anything is to be remembered that was not.
    pub fn has_fresh(&self) -> bool {
        !self.fresh.lock().unwrap_or_else(PoisonError::into_inner).is_empty()
    }

    /// Keeps them in a file, whose folder is made.
    pub fn write(&self, file: &Path) -> io::Result<()> {
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let fresh = self.fresh.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let known = self.known.iter().map(|(name, checked)| (name.clone(), checked.clone()));
        let pictures = known.chain(fresh).collect();
        write_whole(file, &serde_json::to_vec(&Memory { version: VERSION, pictures })?)
    }

    /// What the files of the pictures checked since the last call say that is not obeyed, a clause for each kind.
    pub fn take_notes(&self) -> Vec<String> {
        std::mem::take(&mut *self.notes.lock().unwrap_or_else(PoisonError::into_inner)).clauses()
    }

    /// SHA-256 of a picture that is known and has not changed.
    pub fn digest(&self, picture: &StoredPicture) -> Option<String> {
        self.find(picture).map(|checked| checked.sha256)
    }

    /// A picture that is known and has not changed.
    fn find(&self, picture: &StoredPicture) -> Option<Checked> {
        let (name, bytes, modified_ns) = identity(picture)?;
        let is_same = |checked: &&Checked| checked.bytes == bytes && checked.modified_ns == modified_ns;
        let fresh = self.fresh.lock().unwrap_or_else(PoisonError::into_inner);
        fresh.get(&name).or_else(|| self.known.get(&name)).filter(is_same).cloned()
    }

    /// Remembers a picture whose identity before it was read is `before`.
    fn note(&self, picture: &StoredPicture, before: Option<Identity>, sha256: String, notes: Vec<String>) {
        let Some((name, bytes, modified_ns)) =
            before.filter(|before| identity(picture).as_ref() == Some(before))
        else {
            return;
        };
        let changed = UNIX_EPOCH + Duration::from_nanos(modified_ns);
        if SystemTime::now().duration_since(changed).is_ok_and(|age| age > RECENT) {
            let checked = Checked { bytes, modified_ns, sha256, notes };
            self.fresh.lock().unwrap_or_else(PoisonError::into_inner).insert(name, checked);
        }
    }
}

/// What distinguishes a picture from others, and from itself after a change.
type Identity = (String, u64, u64);

/// Absolute path, with the name of a member, size, and time of the last change, nanoseconds. None where the system does not know them.
fn identity(picture: &StoredPicture) -> Option<Identity> {
    let path = std::path::absolute(picture.path()).ok()?;
    let modified = path.metadata().ok()?.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    let path = path.to_str()?;
    let name = picture.member_name().map_or_else(|| path.to_owned(), |member| format!("{path}\n{member}"));
    Some((name, picture.stamp().ok()?.bytes, u64::try_from(modified.as_nanos()).ok()?))
}

/// Why a picture cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnreadPicture {
    /// Whether the system did not let its file be opened or read. Else its content cannot be decoded.
    pub is_unopened: bool,
    /// The whole message, with the name of the picture.
    pub message: String,
}

impl From<ImageError> for UnreadPicture {
    fn from(error: ImageError) -> Self {
        Self { is_unopened: matches!(error, ImageError::Io { .. }), message: error.to_string() }
    }
}

/// The head of a picture, or why it cannot be read; `None` where there is none.
pub(crate) type Head = Option<Result<PictureHead, UnreadPicture>>;

/// The head of each picture, and whether files were decoded as a whole, as they are unless their light takes more than `most_light_bytes`. Those that
/// are known are not decoded again. All threads together take at most 2 GB for files and decoded pictures. `watch` is called with 0 before each head,
/// and with how many are done after each decoded picture; its error ends the check.
pub(crate) fn checked_heads(
    pictures: &[Option<StoredPicture>],
    most_light_bytes: u64,
    remembered: &CheckedPictures,
    watch: &(dyn Fn(usize) -> Result<(), Cancelled> + Sync),
) -> Result<(Vec<Head>, bool), Cancelled> {
    // Some decoders read the whole file for its head.
    let length = |picture: &Option<StoredPicture>| {
        picture.as_ref().and_then(|picture| picture.stamp().ok()).map_or(0, |stamp| stamp.bytes)
    };
    let lengths: Vec<u64> = pictures.par_iter().map(length).collect();
    let heads = in_batches(pictures, &lengths, |picture| {
        watch(0)?;
        Ok(picture.as_ref().map(|picture| picture.head().map_err(UnreadPicture::from)))
    })?;
    let light = heads.iter().flatten().flatten().map(PictureHead::light_bytes);
    if light.fold(0, u64::saturating_add) > most_light_bytes {
        return Ok((heads, false));
    }
    let bytes = |head: &Head| match head {
        Some(Ok(head)) => head.reading_bytes(),
        _ => 0,
    };
    let bytes: Vec<u64> = heads.iter().map(bytes).collect();
    let done = Tally::default();
    let pairs: Vec<_> = pictures.iter().zip(heads).collect();
    let heads = in_batches(&pairs, &bytes, |(picture, head)| {
        let found = match (picture, head) {
            (Some(picture), Some(Ok(head))) => match remembered.find(picture) {
                Some(checked) => (Some(Ok(*head)), checked.notes),
                None => decoded(picture, remembered),
            },
            (_, head) => (head.clone(), Vec::new()),
        };
        done.add(1, |done| watch(done as usize))?;
        Ok(found)
    })?;
    // In the order of the pictures, whichever was decoded first.
    let (heads, notes): (Vec<Head>, Vec<Vec<String>>) = heads.into_iter().unzip();
    let mut all = remembered.notes.lock().unwrap_or_else(PoisonError::into_inner);
    // Two entries of one file are one picture.
    let mut seen = HashSet::new();
    for (picture, notes) in pictures.iter().zip(&notes) {
        if let Some(picture) = picture
            && seen.insert((picture.path(), &picture.name))
        {
            all.add(&picture.name, notes);
        }
    }
    Ok((heads, true))
}

/// The head of a picture and its notes, decoded as a whole and remembered.
fn decoded(picture: &StoredPicture, remembered: &CheckedPictures) -> (Head, Vec<String>) {
    let before = identity(picture);
    match picture.decoded() {
        Ok((head, digest, notes)) => {
            remembered.note(picture, before, digest, notes.clone());
            (Some(Ok(head)), notes)
        }
        Err(error) => (Some(Err(error.into())), Vec::new()),
    }
}

/// Columns and rows of a picture, the right way up, or why it cannot be read.
pub type CheckedSize = Result<(u32, u32), UnreadPicture>;

/// Decodes pictures from end to end: the columns and rows of each, the right way up, or why it cannot be read. See [`CheckedPictures`] and, for
/// memory and `watch`, [`check_pictures`](crate::coco::check_pictures).
pub fn check_stored(
    pictures: &[StoredPicture],
    remembered: &CheckedPictures,
    watch: &(dyn Fn(usize) -> Result<(), Cancelled> + Sync),
) -> Result<Vec<CheckedSize>, Cancelled> {
    let (found, _) = check_stored_up_to(u64::MAX, pictures, remembered, watch)?;
    Ok(found.into_iter().map(|found| found.map(|picture| picture.size)).collect())
}

/// What is known of a picture that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CheckedPicture {
    /// Columns and rows, the right way up, px.
    pub size: (u32, u32),
    /// Whether EXIF or TIFF turns or mirrors the stored pixels.
    pub is_turned: bool,
}

/// Each picture, or why it cannot be read.
pub type FoundPictures = Vec<Result<CheckedPicture, UnreadPicture>>;

/// [`check_stored`] of pictures whose light takes at most so many bytes together. Of more of them the heads alone are read. Says whether all were
/// decoded.
pub fn check_stored_up_to(
    most_light_bytes: u64,
    pictures: &[StoredPicture],
    remembered: &CheckedPictures,
    watch: &(dyn Fn(usize) -> Result<(), Cancelled> + Sync),
) -> Result<(FoundPictures, bool), Cancelled> {
    let pictures: Vec<Option<StoredPicture>> = pictures.iter().cloned().map(Some).collect();
    let (heads, are_decoded) = checked_heads(&pictures, most_light_bytes, remembered, watch)?;
    let found = |head: PictureHead| CheckedPicture { size: head.upright(), is_turned: head.is_turned() };
    Ok((heads.into_iter().flatten().map(|head| head.map(found)).collect(), are_decoded))
}

/// What a function makes of each value, on all threads; of so many at a time that they take at most [`MOST_PICTURE_BYTES`] together. Ends soon
/// after its first error.
fn in_batches<T: Sync, U: Send>(
    values: &[T],
    bytes: &[u64],
    make: impl Fn(&T) -> Result<U, Cancelled> + Sync,
) -> Result<Vec<U>, Cancelled> {
    let mut made = Vec::with_capacity(values.len());
    for batch in batches(bytes, MOST_PICTURE_BYTES) {
        made.extend(values[batch].par_iter().map(&make).collect::<Result<Vec<U>, Cancelled>>()?);
    }
    Ok(made)
}

/// Consecutive ranges of values whose sums are at most `most`; a larger value is a range of its own.
fn batches(values: &[u64], most: u64) -> Vec<Range<usize>> {
    let (mut ranges, mut first, mut sum) = (Vec::new(), 0, 0u64);
    for (i, value) in values.iter().enumerate() {
        if i > first && sum.saturating_add(*value) > most {
            ranges.push(first..i);
            (first, sum) = (i, 0);
        }
        sum = sum.saturating_add(*value);
    }
    ranges.push(first..values.len());
    ranges
}

#[cfg(test)]
mod tests {
    use petzval_camera::image::LinearImage;

    use super::*;
    use crate::png_bytes;

    #[test]
    fn batches_keep_the_order_and_their_sums_below_the_limit() {
        let values = [5, 3, 2, 1, 12, 9, 1, 0, 0, 7];
        let ranges = batches(&values, 10);
        assert_eq!(ranges, [0..3, 3..4, 4..5, 5..9, 9..10]);
        assert_eq!(batches(&[], 10).iter().map(Range::len).collect::<Vec<_>>(), [0]);
    }

    #[test]
    fn notes_are_of_all_pictures_also_of_known_ones() {
        let root = tempfile::TempDir::new().unwrap();
        let file = |name: &str, negative: usize| {
            let mut light = LinearImage::filled(3, 4, 6, 0.5);
            light.data[..negative].fill(-1.0);
            let path = root.path().join(name);
            crate::save_exr(&light, &path).unwrap();
            let old = SystemTime::now() - Duration::from_secs(60);
            std::fs::File::options().write(true).open(&path).unwrap().set_modified(old).unwrap();
            StoredPicture::file(path)
        };
        let files = [file("a.exr", 0), file("b.exr", 2), file("c.exr", 5)];
        // Two entries of one file are no other picture.
        let pictures = [&files[0], &files[1], &files[2], &files[1]].map(Clone::clone);
        let memory = root.path().join("memory.json");
        let check = |remembered: &CheckedPictures| {
            check_stored(&pictures, remembered, &|_| Ok(())).unwrap();
            remembered.take_notes()
        };
        let first = CheckedPictures::default();
        let notes = check(&first);
        assert_eq!(notes.len(), 1, "{notes:?}");
        let wanted = "b.exr and another picture: 2 of its 72 values are negative, down to -1, and taken as 0";
        assert!(notes[0].ends_with(wanted), "{notes:?}");
        first.write(&memory).unwrap();
        let second = CheckedPictures::read(&memory);
        assert_eq!(check(&second), notes);
        assert!(!second.has_fresh() && second.take_notes().is_empty());
    }

    #[test]
    fn a_check_that_is_cancelled_among_the_heads_ends_there() {
        let root = tempfile::TempDir::new().unwrap();
        let path = root.path().join("a.png");
        std::fs::write(&path, png_bytes(&LinearImage::filled(3, 4, 6, 0.5)).unwrap()).unwrap();
        let pictures = [StoredPicture::file(path)];
        let watch = |done: usize| if done == 0 { Err(Cancelled) } else { Ok(()) };
        assert_eq!(check_stored(&pictures, &CheckedPictures::default(), &watch), Err(Cancelled));
    }

    #[test]
    fn a_checked_picture_is_known_until_it_changes() {
        let root = tempfile::TempDir::new().unwrap();
        let file = |name: &str, gray: f32| {
            let path = root.path().join(name);
            std::fs::write(&path, png_bytes(&LinearImage::filled(3, 4, 6, gray)).unwrap()).unwrap();
            let old = SystemTime::now() - Duration::from_secs(60);
            std::fs::File::options().write(true).open(&path).unwrap().set_modified(old).unwrap();
            StoredPicture::file(path)
        };
        let pictures = [file("a.png", 0.1), file("b.png", 0.2)];
        let damaged = StoredPicture::file(root.path().join("c.png"));
        std::fs::write(damaged.path(), &pictures[0].bytes().unwrap()[..50]).unwrap();
        let all = [pictures[0].clone(), damaged.clone(), pictures[1].clone()];
        let memory = root.path().join("cache/memory.json");
        let first = CheckedPictures::read(&memory);
        let sizes = check_stored(&all, &first, &|_| Ok(())).unwrap();
        assert!(
            sizes[0] == Ok((6, 4))
                && sizes[2] == Ok((6, 4))
                && sizes[1].as_ref().is_err_and(|e| !e.is_unopened && e.message.contains("c.png"))
        );
        assert!(first.has_fresh());
        first.write(&memory).unwrap();
        // What is known is not decoded again: its content may be damaged as long as size and time say that nothing changed.
        let bytes = pictures[1].bytes().unwrap();
        let mut broken = bytes.clone();
        let last = broken.len() - 20;
        broken[last] ^= 255;
        let time = pictures[1].path().metadata().unwrap().modified().unwrap();
        std::fs::write(pictures[1].path(), &broken).unwrap();
        let set_time = |time| {
            std::fs::File::options().write(true).open(pictures[1].path()).unwrap().set_modified(time).unwrap()
        };
        set_time(time);
        let second = CheckedPictures::read(&memory);
        assert_eq!(second.digest(&pictures[1]), Some(crate::hex_digest(&bytes)));
        assert_eq!(check_stored(&all, &second, &|_| Ok(())).unwrap()[2], Ok((6, 4)));
        assert!(!second.has_fresh());
        // Another time: it is decoded, and the damage found.
        set_time(time + Duration::from_secs(1));
        assert_eq!(second.digest(&pictures[1]), None);
        assert!(check_stored(&all, &second, &|_| Ok(())).unwrap()[2].is_err());
        // A file that is no memory is none.
        std::fs::write(&memory, "{").unwrap();
        assert!(CheckedPictures::read(&memory).digest(&pictures[0]).is_none());
    }
}
