//! The file format of a raw frame.

use std::path::Path;

use super::Packing;

/// File format of a raw frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RawFormat {
    /// 16-bit gray TIFF.
    Tiff,
    /// 16-bit gray PNG.
    Png,
    /// Packed digital numbers without a header of their own.
    Packed(Packing),
    /// NumPy array.
    Npy,
    /// OpenEXR, one channel; written only.
    Exr,
    /// Adobe Digital Negative; read only.
    Dng,
}

impl RawFormat {
    /// The format of a file's extension; `packing` is the packing of `.raw` and `.bin`.
    pub fn of_name(path: &Path, packing: Packing) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "tif" | "tiff" => Self::Tiff,
            "png" => Self::Png,
            "raw" | "bin" => Self::Packed(packing),
            "npy" => Self::Npy,
            "exr" => Self::Exr,
            "dng" => Self::Dng,
            _ => return None,
        })
    }

    /// The extension of new files of this format.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Tiff => "tiff",
            Self::Png => "png",
            Self::Packed(_) => "raw",
            Self::Npy => "npy",
            Self::Exr => "exr",
            Self::Dng => "dng",
        }
    }

    /// The format of an existing file, by its first bytes. Two formats are recognised by name: a DNG, which starts like any
    /// TIFF, and a packed frame, which may start with any bytes.
    pub(super) fn of(path: &Path, bytes: &[u8]) -> Option<Self> {
        let named = Self::of_name(path, Packing::U16le);
        match named {
            Some(Self::Packed(_) | Self::Dng) => named,
            _ if bytes.starts_with(b"\x93NUMPY") => Some(Self::Npy),
            _ if bytes.starts_with(b"\x89PNG") => Some(Self::Png),
            _ if bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*") => Some(Self::Tiff),
            _ if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) => Some(Self::Exr),
            _ => named,
        }
    }
}
