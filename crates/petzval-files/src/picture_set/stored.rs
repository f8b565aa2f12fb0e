//! A picture that is not read yet.

use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::UNIX_EPOCH;

use sha2::{Digest, Sha256};

use super::part_of_file::PartOfFile;
use crate::picture_file::{
    ImageError, MOST_PICTURE_BYTES, Picture, PictureHead, check_decodes, head_of, load_image_bytes,
    picture_bytes,
};

/// Bytes at either end of a file that tell most pictures of one size apart.
const END: u64 = 4096;

/// A picture that is not read yet: a file, or a member of a tar file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredPicture {
    /// Its name in its folder, list or shards.
    pub name: String,
    place: Place,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Place {
    File(PathBuf),
    Member { shard: Arc<Path>, first: u64, bytes: u64 },
}

/// Size and time of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Bytes.
    pub bytes: u64,
    /// Time of the last change, seconds since 1970; none if the system does not report it. Of a member that of its shard.
    pub modified_s: Option<u64>,
}

impl Stamp {
    /// That of a file.
    pub fn of(path: &Path) -> io::Result<Self> {
        let about = path.metadata()?;
        let since_1970 = about.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        Ok(Self { bytes: about.len(), modified_s: since_1970.map(|since| since.as_secs()) })
    }
}

impl StoredPicture {
    /// A file by its name.
    pub fn file(path: PathBuf) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Self { name, place: Place::File(path) }
    }

    pub(super) fn member(name: String, shard: Arc<Path>, first: u64, bytes: u64) -> Self {
        Self { name, place: Place::Member { shard, first, bytes } }
    }

    /// The same by another name.
    pub fn named(&self, name: String) -> Self {
        Self { name, place: self.place.clone() }
    }

    /// What errors call it: the path of its file, or that of its shard and its name in it.
    pub fn display(&self) -> String {
        match &self.place {
            Place::File(path) => path.display().to_string(),
            Place::Member { shard, .. } => {
                format!("{}, {}", shard.display(), self.member_name().unwrap_or(&self.name))
            }
        }
    }

    /// The file that holds it.
    pub fn path(&self) -> &Path {
        match &self.place {
            Place::File(path) => path,
            Place::Member { shard, .. } => shard,
        }
    }

    fn failed(&self) -> impl Fn(io::Error) -> ImageError + use<> {
        let path = self.path().to_owned();
        move |source| ImageError::Io { path: path.clone(), source }
    }

    /// Its encoded bytes. At most 2 GB are read.
    pub fn bytes(&self) -> Result<Vec<u8>, ImageError> {
        match &self.place {
            Place::File(path) => picture_bytes(path),
            Place::Member { bytes, .. } => {
                let mut all = Vec::new();
                if *bytes > MOST_PICTURE_BYTES {
                    let reason = format!("{bytes} bytes, and at most {MOST_PICTURE_BYTES} are read");
                    return Err(ImageError::Decode { name: self.display(), reason });
                }
                let (mut part, _) = self.part().map_err(self.failed())?;
                part.read_to_end(&mut all).map_err(self.failed())?;
                Ok(all)
            }
        }
    }

    /// Reads it, see [`load_image`](crate::load_image).
    pub fn load(&self) -> Result<Picture, ImageError> {
        load_image_bytes(&self.bytes()?, &self.display())
    }

    /// Its rows and columns, the right way up. No pixel is decoded.
    pub fn size(&self) -> Result<[usize; 2], ImageError> {
        let (width, height) = self.head()?.upright();
        Ok([height as usize, width as usize])
    }

    /// Its head. Fails where it is empty or too large to be read.
    pub(crate) fn head(&self) -> Result<PictureHead, ImageError> {
        let (part, bytes) = self.part().map_err(self.failed())?;
        let name = self.display();
        head_of(BufReader::new(part), bytes, &name)?.checked(&name)
    }

    /// Its head, its SHA-256, hexadecimal, and what its file says that is not obeyed, where it can be decoded from its first byte to its last.
    pub(crate) fn decoded(&self) -> Result<(PictureHead, String, Vec<String>), ImageError> {
        let head = self.head()?;
        let bytes = self.bytes()?;
        let notes = check_decodes(&bytes, &self.display())?;
        Ok((head, hex_digest(&bytes), notes))
    }

    /// The name of a member in its shard; none of a file.
    pub(super) fn member_name(&self) -> Option<&str> {
        match &self.place {
            Place::File(_) => None,
            Place::Member { shard, .. } => {
                let own = shard.file_name().unwrap_or_default().to_string_lossy();
                let name = self.name.strip_prefix(&*own).and_then(|name| name.strip_prefix('/'));
                Some(name.unwrap_or(&self.name))
            }
        }
    }

    /// Its size and time.
    pub fn stamp(&self) -> io::Result<Stamp> {
        match &self.place {
            Place::File(path) => Stamp::of(path),
            Place::Member { shard, bytes, .. } => Ok(Stamp { bytes: *bytes, ..Stamp::of(shard)? }),
        }
    }

    /// SHA-256 of its first and its last 4096 bytes: pictures with others have another content.
    pub fn digest_of_ends(&self) -> io::Result<[u8; 32]> {
        let (mut part, length) = self.part()?;
        let mut hash = Sha256::new();
        let mut end = Vec::new();
        (&mut part).take(END).read_to_end(&mut end)?;
        hash.update(&end);
        if length > END {
            end.clear();
            part.seek(SeekFrom::Start((length - END).max(END)))?;
            part.read_to_end(&mut end)?;
            hash.update(&end);
        }
        Ok(hash.finalize().into())
    }

    /// SHA-256 of its content.
    pub fn digest(&self) -> io::Result<[u8; 32]> {
        let (mut part, _) = self.part()?;
        let mut hash = Sha256::new();
        io::copy(&mut part, &mut hash)?;
        Ok(hash.finalize().into())
    }

    /// Its bytes as a file of their own, and how many there are.
    fn part(&self) -> io::Result<(PartOfFile, u64)> {
        let file = petzval_base::open_file(self.path())?;
        let (first, bytes) = match &self.place {
            Place::File(_) => (0, file.metadata()?.len()),
            Place::Member { first, bytes, .. } => (*first, *bytes),
        };
        Ok((PartOfFile::new(file, first, bytes)?, bytes))
    }
}

/// The SHA-256 of bytes, hexadecimal.
pub fn hex_digest(bytes: &[u8]) -> String {
    petzval_base::hex(&Sha256::digest(bytes))
}
