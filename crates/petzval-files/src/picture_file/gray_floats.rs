//! TIFF pictures of gray floats, which the decoder of the image crate refuses.

use std::io::{Read, Seek};

use ::image::error::{DecodingError, ImageFormatHint};
use ::image::metadata::Orientation;
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};
use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{SampleFormat, Tag};

use super::error::MOST_PICTURE_BYTES;

/// Decodes the first page of a TIFF of gray floats of 16, 32 or 64 bits as three equal planes of 32.
pub struct GrayFloats<R: Read + Seek> {
    size: (u32, u32),
    decoder: Decoder<R>,
}

impl<R: Read + Seek> GrayFloats<R> {
    /// Whether a TIFF is of gray floats, by its head.
    pub fn is_in(source: R) -> bool {
        Decoder::new(source).is_ok_and(|mut decoder| {
            let is_gray = matches!(decoder.colortype(), Ok(tiff::ColorType::Gray(16 | 32 | 64)));
            let formats = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat);
            is_gray && formats.is_ok_and(|formats| formats == Some(vec![SampleFormat::IEEEFP.to_u16()]))
        })
    }

    /// Reads the head.
    pub fn new(source: R) -> ImageResult<Self> {
        let mut limits = Limits::default();
        limits.decoding_buffer_size = MOST_PICTURE_BYTES as usize;
        limits.intermediate_buffer_size = MOST_PICTURE_BYTES as usize;
        let mut decoder = Decoder::new(source).map_err(undecodable)?.with_limits(limits);
        Ok(Self { size: decoder.dimensions().map_err(undecodable)?, decoder })
    }
}

/// The error of the image crate for one of its TIFF decoder.
fn undecodable(error: TiffError) -> ImageError {
    match error {
        TiffError::IoError(error) => ImageError::IoError(error),
        error => ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Tiff), error)),
    }
}

impl<R: Read + Seek> ImageDecoder for GrayFloats<R> {
    fn dimensions(&self) -> (u32, u32) {
        self.size
    }

    fn color_type(&self) -> ColorType {
        ColorType::Rgb32F
    }

    fn icc_profile(&mut self) -> ImageResult<Option<Vec<u8>>> {
        Ok(self.decoder.get_tag_u8_vec(Tag::IccProfile).ok())
    }

    fn orientation(&mut self) -> ImageResult<Orientation> {
        let found = self.decoder.find_tag_unsigned::<u8>(Tag::Orientation).map_err(undecodable)?;
        Ok(found.and_then(Orientation::from_exif).unwrap_or(Orientation::NoTransforms))
    }

    fn read_image(mut self, buf: &mut [u8]) -> ImageResult<()> {
        let light: Vec<f32> = match self.decoder.read_image().map_err(undecodable)? {
            DecodingResult::F16(values) => values.into_iter().map(f32::from).collect(),
            DecodingResult::F32(values) => values,
            DecodingResult::F64(values) => values.into_iter().map(|value| value as f32).collect(),
            _ => {
                let format = ImageFormatHint::Exact(ImageFormat::Tiff);
                return Err(ImageError::Decoding(DecodingError::new(format, "its samples are no floats")));
            }
        };
        let pixels = buf.chunks_exact_mut(usize::from(ColorType::Rgb32F.bytes_per_pixel()));
        for (pixel, value) in pixels.zip(light) {
            pixel.chunks_exact_mut(size_of::<f32>()).for_each(|s| s.copy_from_slice(&value.to_ne_bytes()));
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, buf: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(buf)
    }
}
