//! Whether the file of a picture was cut off, as by a copy that was interrupted. Decoders fill the rest of a JPEG with gray, without an error.

/// What is wrong with such a file.
pub(crate) const CUT_OFF: &str = "the file ends before the picture does: it is cut off";

/// Whether a JPEG or PNG file lacks the mark with which its picture ends, or a WebP file some of the bytes that its head states. Whatever is
/// behind the end does not matter. Files of other kinds are never cut off.
pub(crate) fn is_cut_off(bytes: &[u8]) -> bool {
    const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
    const JPEG: &[u8] = b"\xff\xd8";
    if bytes.starts_with(PNG) {
        !has_end_of_png(&bytes[PNG.len()..])
    } else if bytes.starts_with(JPEG) {
        !has_end_of_jpeg(&bytes[JPEG.len()..])
    } else if let Some((b"RIFF", [a, b, c, d, rest @ ..])) = bytes.split_at_checked(4)
        && rest.starts_with(b"WEBP")
    {
        rest.len() < u32::from_le_bytes([*a, *b, *c, *d]) as usize
    } else {
        false
    }
}

/// Goes from chunk to chunk: length, name, content, checksum.
fn has_end_of_png(mut rest: &[u8]) -> bool {
    while let Some((head, behind)) = rest.split_at_checked(8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some((_, next)) = behind.split_at_checked(length.saturating_add(4)) else { return false };
        if &head[4..] == b"IEND" {
            return true;
        }
        rest = next;
    }
    false
}

/// Goes from segment to segment: mark, length, content. A thumbnail inside of a segment has an end of its own, which does not count. In the
/// compressed light behind a start of scan (`ff da`) a byte `ff` is followed by 0, unless it begins a mark.
fn has_end_of_jpeg(mut rest: &[u8]) -> bool {
    loop {
        let Some(at) = rest.windows(2).position(|pair| pair[0] == 0xff && !matches!(pair[1], 0 | 0xff))
        else {
            return false;
        };
        let mark = rest[at + 1];
        rest = &rest[at + 2..];
        match mark {
            0xd9 => return true,
            // Marks without a length: restarts within a scan, the start of the picture, and one for temporary use.
            0xd0..=0xd8 | 0x01 => {}
            _ => {
                let Some([high, low]) = rest.first_chunk::<2>() else { return false };
                let length = usize::from(u16::from_be_bytes([*high, *low]));
                let Some(next) = rest.get(length..) else { return false };
                rest = next;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use image::{DynamicImage, ImageFormat, RgbImage};

    use super::*;

    fn file(format: ImageFormat) -> Vec<u8> {
        let picture =
            RgbImage::from_fn(60, 40, |x, y| image::Rgb([(7 * x % 251) as u8, (11 * y % 241) as u8, 90]));
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::from(picture).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn files_are_cut_off_wherever_they_end_too_early_and_not_by_what_follows() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP] {
            let whole = file(format);
            assert!(!is_cut_off(&whole), "{format:?}");
            assert!(!is_cut_off(&[&whole[..], b"more"].concat()), "{format:?}");
            for length in 12..whole.len() {
                assert!(is_cut_off(&whole[..length]), "{format:?} at {length} of {}", whole.len());
            }
        }
        assert!(!is_cut_off(&file(ImageFormat::Tiff)[..100]));
    }

    #[test]
    fn the_end_of_a_thumbnail_is_not_that_of_the_picture() {
        let whole = file(ImageFormat::Jpeg);
        let thumbnail = file(ImageFormat::Jpeg);
        let length = u16::try_from(thumbnail.len() + 2).unwrap().to_be_bytes();
        let with = [&whole[..2], &[0xff, 0xe1], &length, &thumbnail, &whole[2..]].concat();
        assert!(!is_cut_off(&with));
        assert!(is_cut_off(&with[..thumbnail.len() + 300]));
    }
}
