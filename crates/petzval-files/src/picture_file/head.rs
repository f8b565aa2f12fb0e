//! What the head of a picture file says: its size, how it lies, and the memory that reading it takes.

use std::io::{BufRead, BufReader, Cursor, Seek, SeekFrom};
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;
use ::image::metadata::Orientation;
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use petzval_camera::image::CHANNELS;

use super::{CUT_OFF, ImageError, OLD_HDR, exr_file, is_cut_off, load_image_bytes, picture_bytes, undecoded};

/// Most bytes of memory that reading one picture may take.
pub(crate) const MOST_PICTURE_BYTES: u64 = 2_000_000_000;

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
        // A progressive JPEG keeps two bytes of coefficients for each sample; strips of a TIFF and turned pictures are a second copy.
        let copies = if format == Some(ImageFormat::Jpeg) { 3 } else { 2 };
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

    /// Most bytes of memory that reading takes. The decoder may copy the file. The samples are there until they are light.
    pub fn reading_bytes(&self) -> u64 {
        let pixels = u64::from(self.stored.0) * u64::from(self.stored.1);
        let converting = self.sample_bytes.saturating_add(pixels.saturating_mul(LIGHT_BYTES));
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

/// Columns and rows of a picture as [`load_image`](super::load_image) reads it, the right way up. Pixels are not decoded.
pub fn picture_size(path: &Path) -> Result<(u32, u32), ImageError> {
    Ok(picture_head(path)?.upright())
}

/// The head of a picture file. Fails where the picture is empty or too large to be read.
pub(crate) fn picture_head(path: &Path) -> Result<PictureHead, ImageError> {
    let io = |source| ImageError::Io { path: path.to_owned(), source };
    let file = petzval_base::open_file(path).map_err(io)?;
    let file_bytes = file.metadata().map_err(io)?.len();
    let name = path.display().to_string();
    head_of(BufReader::new(file), file_bytes, &name)?.checked(&name)
}

fn head_of<R: BufRead + Seek>(source: R, file_bytes: u64, name: &str) -> Result<PictureHead, ImageError> {
    let decode = |reason: String| ImageError::Decode { name: name.to_owned(), reason };
    let undecodable = |e: ::image::ImageError| decode(undecoded(&e));
    let system = |e: std::io::Error| decode(e.to_string());
    let mut reader = ImageReader::new(source).with_guessed_format().map_err(system)?;
    reader.limits(decoder_limits());
    let format = reader.format();
    match format {
        Some(ImageFormat::OpenExr) => {
            let mut source = reader.into_inner();
            source.seek(SeekFrom::Start(0)).map_err(system)?;
            exr_file::head(source, file_bytes).map_err(decode)
        }
        Some(ImageFormat::Hdr) | None => {
            let mut source = reader.into_inner();
            source.seek(SeekFrom::Start(0)).map_err(system)?;
            let is_old = source.fill_buf().map_err(system)?.starts_with(OLD_HDR);
            if format.is_none() && !is_old {
                let reason = "it is of no format that is read".to_owned();
                return Err(decode(reason));
            }
            let mut decoder = HdrDecoder::with_strictness(source, !is_old).map_err(undecodable)?;
            Ok(PictureHead::of(&mut decoder, Some(ImageFormat::Hdr), file_bytes))
        }
        Some(_) => {
            let mut decoder = reader.into_decoder().map_err(undecodable)?;
            Ok(PictureHead::of(&mut decoder, format, file_bytes))
        }
    }
}

/// [`picture_head`] of a file that is decoded from its first byte to its last: [`load_image`](super::load_image) does not fail with it.
pub(crate) fn decoded_head(path: &Path) -> Result<PictureHead, ImageError> {
    let head = picture_head(path)?;
    let bytes = picture_bytes(path)?;
    let name = path.display().to_string();
    let format = ::image::guess_format(&bytes).ok();
    // The samples of the two common kinds are numbers in any case: turning them into light would take most of the time.
    if !matches!(format, Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        load_image_bytes(&bytes, &name)?;
        return Ok(head);
    }
    let decode = |reason: String| ImageError::Decode { name: name.clone(), reason };
    if is_cut_off(&bytes) {
        return Err(decode(CUT_OFF.to_owned()));
    }
    let mut reader =
        ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(|e| decode(e.to_string()))?;
    reader.limits(decoder_limits());
    let decoder = reader.into_decoder().map_err(|e| decode(undecoded(&e)))?;
    DynamicImage::from_decoder(decoder).map_err(|e| decode(undecoded(&e)))?;
    Ok(head)
}
