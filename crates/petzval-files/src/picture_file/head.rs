//! What the head of a picture file says: its size, how it lies, and the memory that reading it takes.

use ::image::metadata::Orientation;
use ::image::{ImageDecoder, ImageFormat, Limits};
use petzval_camera::image::CHANNELS;

use super::error::{ImageError, MOST_PICTURE_BYTES};

/// The signature of older Radiance files.
pub(super) const OLD_HDR: &[u8] = b"#?RGBE";

/// Bytes of a pixel of linear light.
const LIGHT_BYTES: u64 = 4 * CHANNELS as u64;

/// The head of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PictureHead {
    /// Columns and rows of the stored pixels, px.
    pub stored: (u32, u32),
    /// How the stored pixels are to be turned.
    pub orientation: Orientation,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Bytes of the decoded samples.
    pub sample_bytes: u64,
    /// Bytes that the decoder takes beside the file, the samples included.
    pub decoding_bytes: u64,
}

impl PictureHead {
    /// What a decoder knows before it decodes.
    pub fn of(decoder: &mut impl ImageDecoder, format: Option<ImageFormat>, file_bytes: u64) -> Self {
        let sample_bytes = decoder.total_bytes();
        // A progressive JPEG keeps two bytes of coefficients for each sample, and a WebP its planes or four samples a pixel; strips of a TIFF and
        // turned pictures are a second copy.
        let copies = if matches!(format, Some(ImageFormat::Jpeg | ImageFormat::WebP)) { 3 } else { 2 };
        Self {
            stored: decoder.dimensions(),
            // A file whose orientation cannot be read is the right way up for `load_image`, too.
            orientation: decoder.orientation().unwrap_or(Orientation::NoTransforms),
            file_bytes,
            sample_bytes,
            decoding_bytes: sample_bytes.saturating_mul(copies),
        }
    }

    /// Columns and rows the right way up, px.
    pub fn upright(&self) -> (u32, u32) {
        let (width, height) = self.stored;
        if self.lies_on_its_side() { (height, width) } else { (width, height) }
    }

    /// Whether the stored pixels are not the right way up.
    pub fn is_turned(&self) -> bool {
        self.orientation != Orientation::NoTransforms
    }

    /// Whether columns of the stored pixels are rows of the picture.
    pub fn lies_on_its_side(&self) -> bool {
        matches!(
            self.orientation,
            Orientation::Rotate90
                | Orientation::Rotate270
                | Orientation::Rotate90FlipH
                | Orientation::Rotate270FlipH
        )
    }

    /// Bytes of its light.
    pub fn light_bytes(&self) -> u64 {
        (u64::from(self.stored.0) * u64::from(self.stored.1)).saturating_mul(LIGHT_BYTES)
    }

    /// Most bytes of memory that reading takes. The decoder may copy the file. The samples are there until they are light.
    pub fn reading_bytes(&self) -> u64 {
        let converting = self.sample_bytes.saturating_add(self.light_bytes());
        self.file_bytes.saturating_mul(2).saturating_add(self.decoding_bytes.max(converting))
    }

    /// Refuses pictures without pixels, and those that take more memory than [`MOST_PICTURE_BYTES`].
    pub fn checked(self, name: &str) -> Result<Self, ImageError> {
        let (width, height) = self.stored;
        let name = || name.to_owned();
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { name: name(), height: height as usize, width: width as usize });
        }
        let bytes = self.reading_bytes();
        if bytes > MOST_PICTURE_BYTES {
            return Err(ImageError::TooLarge { name: name(), width, height, bytes });
        }
        Ok(self)
    }
}

/// The limits of decoders. [`PictureHead::checked`] is the narrower one, and says what is wrong.
pub(super) fn decoder_limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_PICTURE_BYTES);
    limits
}
