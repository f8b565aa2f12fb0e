//! Why a picture could not be read or written.

use std::error::Error;
use std::path::PathBuf;

use ::image::ExtendedColorType;
use ::image::error::UnsupportedErrorKind;

use super::cut_off::CUT_OFF;

/// Most bytes of memory that reading one picture may take.
pub(crate) const MOST_PICTURE_BYTES: u64 = 2_000_000_000;

/// Why a picture could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The content is not a picture that we can decode.
    #[error("{name}: cannot decode the picture: {reason}; hint: {}", hint_of(reason, PICTURES))]
    Decode {
        /// The file or the name of the buffer.
        name: String,
        /// The error of the decoder.
        reason: String,
    },
    /// The file holds no labels.
    #[error("{name}: no picture of labels: {reason}; hint: {}", hint_of(reason, LABELS))]
    NoLabels {
        /// The file.
        name: String,
        /// Why it is none.
        reason: String,
    },
    /// The picture cannot be encoded.
    #[error("{name}: cannot encode the picture: {reason}")]
    Encode {
        /// The file.
        name: String,
        /// The error of the encoder.
        reason: String,
    },
    /// The picture has no pixels.
    #[error("{name}: the picture is empty ({width} x {height})")]
    Empty {
        /// The file or the name of the buffer.
        name: String,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// Reading the picture would take too much memory.
    #[error(
        "{name}: the picture of {width} x {height} pixels takes {:.1} GB of memory to read, and at most {:.0} GB are used; hint: scale it \
         down, or cut it into parts",
        *bytes as f64 / 1e9, MOST_PICTURE_BYTES as f64 / 1e9
    )]
    TooLarge {
        /// The file or the name of the buffer.
        name: String,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes of memory.
        bytes: u64,
    },
    /// A floating-point picture holds infinity or no number.
    #[error(
        "{name}: the light in row {row}, column {column} is {value}; hint: write a finite number of at least 0, white is 1"
    )]
    NotFinite {
        /// The file or the name of the buffer.
        name: String,
        /// The value.
        value: f32,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
    },
}

/// The reason of a file that no decoder knows.
pub(crate) const NO_FORMAT: &str = "it is of no format that is read";

/// How the reason begins for a file of a known format whose content is wrong.
const DAMAGED: &str = "the file is damaged";

/// What to give in place of a file of another kind.
const PICTURES: &str = "give a PNG, JPEG, TIFF, WebP, BMP, OpenEXR or Radiance HDR file";
const LABELS: &str = "give a PNG or TIFF file with one index of 8 or 16 bits a pixel";

/// What to do about a picture that cannot be decoded for this reason: a file of these kinds is needed, or a whole copy of the file.
fn hint_of(reason: &str, kinds: &'static str) -> &'static str {
    let is_broken = reason.starts_with(DAMAGED) || reason == CUT_OFF;
    if is_broken { "copy or export the file again" } else { kinds }
}

/// The reason of a file of a known format, from its decoder's words.
pub(crate) fn damaged(of_decoder: &str) -> String {
    // Decoders report a wrong checksum with the chunk's internals.
    let words = if of_decoder.contains("CRC") { "its checksum is wrong" } else { of_decoder };
    format!("{DAMAGED}: {words}")
}

/// The reason of a decoder's error, in terms of the picture.
pub(crate) fn undecoded(error: &::image::ImageError) -> String {
    if let ::image::ImageError::Unsupported(unsupported) = error
        && let UnsupportedErrorKind::Color(ExtendedColorType::Unknown(bits)) = unsupported.kind()
    {
        return format!("it has pixels of {bits} bits of a kind that is not read");
    }
    // An I/O error is the decoder's error itself or one of its causes.
    let is_end = |io: &std::io::Error| io.kind() == std::io::ErrorKind::UnexpectedEof;
    let mut is_cut_off = matches!(error, ::image::ImageError::IoError(io) if is_end(io));
    let mut cause = error.source();
    while let Some(error) = cause {
        is_cut_off |= error.downcast_ref().is_some_and(is_end);
        cause = error.source();
    }
    if is_cut_off {
        return CUT_OFF.to_owned();
    }
    if let ::image::ImageError::Decoding(wrong) = error {
        return damaged(&wrong.source().map_or_else(|| wrong.to_string(), ToString::to_string));
    }
    let words = error.to_string();
    // The decoder names a meaning that it knows and does not read, such as CIELab.
    if words.contains("unknown photometric interpretation") {
        return "its samples have a meaning that is not read (PhotometricInterpretation); a raw frame is developed by `isp develop`"
            .to_owned();
    }
    words
}

#[cfg(test)]
mod tests {
    use ::image::error::UnsupportedError;
    use ::image::{ImageError as Undecoded, ImageFormat};

    use super::*;

    #[test]
    fn a_meaning_of_samples_that_the_decoder_knows_is_named() {
        let said = |words: &str| {
            let kind = UnsupportedErrorKind::GenericFeature(words.to_owned());
            undecoded(&Undecoded::Unsupported(UnsupportedError::from_format_and_kind(
                ImageFormat::Tiff.into(),
                kind,
            )))
        };
        assert!(said("unknown photometric interpretation").contains("`isp develop`"));
        assert!(said("unsupported photometric interpretation \"CIELab\"").contains("CIELab"));
    }
}
