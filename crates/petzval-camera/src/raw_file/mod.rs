//! Raw frames from and to files: digital numbers, never a display curve.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use ::image::{DynamicImage, ImageReader};

/// A frame as its file holds it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawFrame {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Digital numbers, row by row.
    pub dn: Vec<u16>,
}

/// Why a raw frame could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RawFileError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The content is not what its name says.
    #[error("{}: {reason}; hint: {hint}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
        /// What would be right.
        hint: &'static str,
    },
}

/// Reads a frame of digital numbers: gray PNG or TIFF of 8 or 16 bits.
pub fn load_raw(path: &Path) -> Result<RawFrame, RawFileError> {
    let bytes = std::fs::read(path).map_err(|source| RawFileError::Io { path: path.to_owned(), source })?;
    let content = |reason: String| RawFileError::Content {
        path: path.to_owned(),
        reason,
        hint: "a raw frame is a gray TIFF or PNG of 8 or 16 bits",
    };
    let reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| content(e.to_string()))?;
    let picture = reader.decode().map_err(|e| content(e.to_string()))?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let dn = match picture {
        DynamicImage::ImageLuma16(gray) => gray.into_raw(),
        DynamicImage::ImageLuma8(gray) => gray.into_raw().into_iter().map(u16::from).collect(),
        other => return Err(content(format!("a picture of {:?}, not of digital numbers", other.color()))),
    };
    if dn.is_empty() {
        return Err(content("the picture is empty".to_owned()));
    }
    Ok(RawFrame { height, width, dn })
}
