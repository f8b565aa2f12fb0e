//! Developed pictures by the hash of all that they depend on.

use std::path::{Path, PathBuf};

use petzval_base::write_whole;
use petzval_camera::isp::RgbPicture;
use petzval_files::isp_file::{ExternalIspFile, PICTURE_FILES, decode_picture};
use sha2::{Digest, Sha256};

/// A folder of pictures, each in the file that the command had written. Files appear whole or not at all, so that several programs may
/// share the folder.
pub(super) struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// Opens the folder, and makes it if it does not exist.
    pub fn open(folder: &Path) -> std::io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// SHA-256 of name, version and command of the ISP and of the frame's two files, each behind its length.
    pub fn key(about: &ExternalIspFile, text: &str, raw: &[u8]) -> String {
        let mut hash = Sha256::new();
        let mut add = |bytes: &[u8]| {
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        };
        add(about.name.as_bytes());
        add(about.version.as_bytes());
        about.command.iter().for_each(|part| add(part.as_bytes()));
        add(text.as_bytes());
        add(raw);
        petzval_base::hex(&hash.finalize())
    }

    /// A picture that was kept. A file that does not hold one counts as none.
    pub fn find(&self, key: &str, size: (usize, usize)) -> Option<RgbPicture> {
        PICTURE_FILES.into_iter().find_map(|name| {
            let bytes = petzval_base::read_whole(self.path(key, name)).ok()?;
            decode_picture(name, &bytes, size).ok()
        })
    }

    /// Keeps a picture file.
    pub fn keep(&self, key: &str, name: &str, bytes: &[u8]) -> Result<(), String> {
        let path = self.path(key, name);
        write_whole(&path, bytes).map_err(|e| format!("{}: {e}", path.display()))
    }

    fn path(&self, key: &str, name: &str) -> PathBuf {
        let ending = Path::new(name).extension().unwrap_or_default();
        self.folder.join(key).with_extension(ending)
    }
}
