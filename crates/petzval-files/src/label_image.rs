//! Pictures of labels: one index a pixel, 8 or 16 bits, in PNG and TIFF files.

use std::io::Cursor;
use std::path::Path;

use ::image::metadata::Orientation;
use ::image::{DynamicImage, ExtendedColorType, ImageBuffer, ImageFormat, Luma};
use png::{BitDepth, ColorType, Transformations};
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::{PhotometricInterpretation, Tag};

use crate::picture_file::{
    CUT_OFF, ImageError, PictureHead, animation_note, damaged, encode, format_of, head_of, is_cut_off,
    picture_bytes, tiff_notes,
};

/// What the samples of a TIFF file mean: 0 is white.
const WHITE_IS_ZERO: u32 = 0;

/// The type of the value in a TIFF directory that says what samples mean: 16 bits.
const SHORT: u16 = 3;

/// Bytes of an entry in a TIFF directory.
const ENTRY: usize = 12;

/// A picture of labels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelImage {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Whether the file has indices of 16 bits; those of 1 to 8 bits are read as 8.
    pub has_16_bits: bool,
    /// The index of each pixel, row by row, the right way up.
    pub values: Vec<u16>,
    /// Whether EXIF or TIFF turns or mirrors the stored pixels.
    pub is_turned: bool,
    /// What the file holds that is not read, such as further pages; one clause each, without the name of the file.
    pub notes: Vec<String>,
}

/// Reads the indices of a PNG or TIFF file, gray or with a palette, whose entries say nothing. The orientation of EXIF and TIFF is obeyed, as it is
/// for pictures. Of a file with several pages the first is read, which is noted. No colour profile or gamma is applied. Fails on
/// pixels that are colours, and on files of other kinds.
pub fn load_label_image(path: &Path) -> Result<LabelImage, ImageError> {
    let name = path.display().to_string();
    let mut bytes = picture_bytes(path)?;
    make_palette_gray(&mut bytes);
    let head = checked_head(&bytes, &name)?;
    let read = match format_of(&bytes) {
        Some(ImageFormat::Png) if is_cut_off(&bytes) => Err(CUT_OFF.to_owned()),
        Some(ImageFormat::Png) => read_png(&bytes),
        Some(ImageFormat::Tiff) => read_tiff(&bytes),
        _ => Err("it is neither a PNG nor a TIFF file".to_owned()),
    };
    let upright = read.and_then(|labels| turned(labels, head.orientation));
    upright.map_err(|reason| ImageError::NoLabels { name, reason })
}

/// Labels with their pixels the right way up.
fn turned(labels: LabelImage, orientation: Orientation) -> Result<LabelImage, String> {
    if orientation == Orientation::NoTransforms {
        return Ok(labels);
    }
    let LabelImage { height, width, values, .. } = labels;
    let pixels = ImageBuffer::<Luma<u16>, _>::from_raw(width as u32, height as u32, values)
        .ok_or_else(|| damaged("it has fewer pixels than its size says"))?;
    let mut picture = DynamicImage::ImageLuma16(pixels);
    picture.apply_orientation(orientation);
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    Ok(LabelImage { height, width, values: picture.into_luma16().into_raw(), is_turned: true, ..labels })
}

/// An 8-bit index PNG of a map of `height` x `width` indices, row by row.
pub fn index_png_bytes(values: &[u8], height: usize, width: usize) -> Result<Vec<u8>, ImageError> {
    encode(values, height, width, ExtendedColorType::L8, ImageFormat::Png, "PNG buffer of indices")
}

/// The head of a file. Refuses what is empty or takes too much memory.
fn checked_head(bytes: &[u8], name: &str) -> Result<PictureHead, ImageError> {
    let checked = head_of(Cursor::new(bytes), bytes.len() as u64, name).and_then(|head| head.checked(name));
    match checked {
        // The hint of a photograph names files that hold no labels.
        Err(ImageError::Decode { name, reason }) => {
            Err(ImageError::NoLabels { name, reason: format!("cannot decode it: {reason}") })
        }
        checked => checked,
    }
}

/// Makes the indices of a TIFF file with a palette gray values: its decoder reads no palettes. Other files stay as they are.
fn make_palette_gray(bytes: &mut [u8]) {
    if let Some((place, is_little)) = place_of_palette(bytes) {
        let gray = PhotometricInterpretation::BlackIsZero.to_u16();
        let gray = if is_little { gray.to_le_bytes() } else { gray.to_be_bytes() };
        bytes[place..place + gray.len()].copy_from_slice(&gray);
    }
}

/// The place of the two bytes by which a TIFF file says that its samples are indices of a palette, and whether the low byte comes first. `None` of other files.
fn place_of_palette(bytes: &[u8]) -> Option<(usize, bool)> {
    let is_little = match bytes.first_chunk::<4>()? {
        b"II*\0" => true,
        b"MM\0*" => false,
        _ => return None,
    };
    let short_at = |place: usize| {
        let pair = *bytes.get(place..)?.first_chunk::<2>()?;
        Some(if is_little { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) })
    };
    let directory = *bytes.get(4..)?.first_chunk::<4>()?;
    let directory = if is_little { u32::from_le_bytes(directory) } else { u32::from_be_bytes(directory) };
    let directory = usize::try_from(directory).ok()?;
    // An entry is its tag, its type, the number of its values, and the values in the last four bytes.
    let mut entries = (0..usize::from(short_at(directory)?)).map(|i| directory + 2 + ENTRY * i);
    let meaning = Tag::PhotometricInterpretation.to_u16();
    let entry = entries.find(|entry| short_at(*entry) == Some(meaning))?;
    let (kind, place) = (short_at(entry + 2)?, entry + 8);
    let is_palette = short_at(place)? == PhotometricInterpretation::RGBPalette.to_u16();
    (kind == SHORT && is_palette).then_some((place, is_little))
}

fn read_png(bytes: &[u8]) -> Result<LabelImage, String> {
    let undecodable = |e: png::DecodingError| damaged(&e.to_string());
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    // Neither is a palette looked up, nor are bits scaled.
    decoder.set_transformations(Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(undecodable)?;
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    let mut samples = vec![0; size];
    let notes = animation_note(reader.info()).into_iter().collect();
    let info = reader.next_frame(&mut samples).map_err(undecodable)?;
    if !matches!(info.color_type, ColorType::Grayscale | ColorType::Indexed) {
        return Err(format!("its pixels are colours ({:?})", info.color_type));
    }
    let (height, width) = (info.height as usize, info.width as usize);
    let rows = samples[..info.buffer_size()].chunks_exact(info.line_size);
    let values = match info.bit_depth {
        BitDepth::Sixteen => {
            rows.flat_map(|row| row.as_chunks::<2>().0).map(|b| u16::from_be_bytes(*b)).collect()
        }
        depth => {
            // Several pixels share a byte, the first one in its highest bits; a row begins with a new byte.
            let bits = depth as usize;
            let pixel = move |row: &[u8], column: usize| {
                let from_left = column * bits;
                let shifted = row[from_left / 8] >> (8 - bits - from_left % 8);
                u16::from(shifted & (0xff >> (8 - bits)))
            };
            rows.flat_map(|row| (0..width).map(move |column| pixel(row, column))).collect()
        }
    };
    let has_16_bits = info.bit_depth == BitDepth::Sixteen;
    Ok(LabelImage { height, width, has_16_bits, values, is_turned: false, notes })
}

fn read_tiff(bytes: &[u8]) -> Result<LabelImage, String> {
    let damaged = |e: tiff::TiffError| e.to_string();
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(damaged)?;
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    let colours = decoder.colortype().map_err(damaged)?;
    if !matches!(colours, tiff::ColorType::Gray(8 | 16)) {
        return Err(format!("its pixels are {colours:?}"));
    }
    let meaning = decoder.find_tag_unsigned::<u32>(Tag::PhotometricInterpretation).map_err(damaged)?;
    if meaning == Some(WHITE_IS_ZERO) {
        return Err("its 0 means white, so that its indices are not what is stored".to_owned());
    }
    let values = match decoder.read_image().map_err(damaged)? {
        DecodingResult::U8(values) => values.into_iter().map(u16::from).collect(),
        DecodingResult::U16(values) => values,
        _ => return Err(format!("its pixels are not whole numbers ({colours:?})")),
    };
    let has_16_bits = matches!(colours, tiff::ColorType::Gray(16));
    let (height, width) = (height as usize, width as usize);
    let notes = tiff_notes(Cursor::new(bytes));
    Ok(LabelImage { height, width, has_16_bits, values, is_turned: false, notes })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use tiff::encoder::TiffEncoder;
    use tiff::encoder::colortype::{Gray8, Gray16};

    use super::*;

    fn png(colour: ColorType, depth: BitDepth, [width, height]: [u32; 2], samples: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        if colour == ColorType::Indexed {
            encoder.set_palette((0..3 * 16).map(|v| 255 - 3 * v).collect::<Vec<u8>>());
        }
        encoder.write_header().unwrap().write_image_data(samples).unwrap();
        bytes
    }

    /// A TIFF file of two 8-bit indices of a palette, in either order of bytes.
    fn palette_tiff(indices: [u8; 2], is_little: bool) -> Vec<u8> {
        let short = |v: u16| if is_little { v.to_le_bytes() } else { v.to_be_bytes() };
        let long = |v: u32| if is_little { v.to_le_bytes() } else { v.to_be_bytes() };
        // Width, height, bits, no compression, a palette, the place of the pixels behind the directory, rows and bytes of the strip.
        let entries =
            [(256, 2), (257, 1), (258, 8), (259, 1), (262, 3), (273, 8 + 2 + 8 * 12 + 4), (278, 1), (279, 2)];
        let mut bytes = if is_little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
        bytes.extend(long(8));
        bytes.extend(short(entries.len() as u16));
        for (tag, value) in entries {
            bytes.extend([short(tag), short(3)].concat());
            bytes.extend(long(1));
            bytes.extend([short(value), [0; 2]].concat());
        }
        bytes.extend(long(0));
        bytes.extend(indices);
        bytes
    }

    fn read(name: &str, bytes: &[u8]) -> Result<LabelImage, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        load_label_image(&path).map_err(|e| e.to_string())
    }

    /// Labels of 8 bits whose file turns nothing.
    fn upright(height: usize, width: usize, values: Vec<u16>) -> LabelImage {
        LabelImage { height, width, has_16_bits: false, values, is_turned: false, notes: Vec::new() }
    }

    #[test]
    fn labels_are_turned_as_pictures_are() {
        let tiff = |orientation: u16, pages: usize| {
            let mut bytes = Cursor::new(Vec::new());
            {
                let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
                for _ in 0..pages {
                    let mut page = encoder.new_image::<Gray8>(3, 2).unwrap();
                    page.encoder().write_tag(Tag::Orientation, orientation).unwrap();
                    page.write_data(&[1, 2, 3, 4, 5, 6]).unwrap();
                }
            }
            read("a.tif", bytes.get_ref()).unwrap()
        };
        assert_eq!(tiff(1, 1), upright(2, 3, vec![1, 2, 3, 4, 5, 6]));
        let upside_down = tiff(3, 1);
        assert_eq!((&upside_down.values[..], upside_down.is_turned), (&[6, 5, 4, 3, 2, 1][..], true));
        // 6: the first stored row is the right column.
        let on_its_side = tiff(6, 1);
        assert_eq!((on_its_side.height, on_its_side.width), (3, 2));
        assert_eq!(on_its_side.values, [4, 1, 5, 2, 6, 3]);
        let [note] = &tiff(1, 2).notes[..] else { panic!("no note on the second page") };
        assert!(note.contains("several pages, of which only the first is used"), "{note}");
    }

    #[test]
    fn indices_of_every_kind_of_file_come_as_they_are_stored() {
        let gray =
            read("a.png", &png(ColorType::Grayscale, BitDepth::Eight, [3, 2], &[0, 1, 2, 7, 254, 255]));
        assert_eq!(gray.unwrap(), upright(2, 3, vec![0, 1, 2, 7, 254, 255]));
        // Entries of a palette do not count, and four bits are not scaled to eight. A row has three pixels in two bytes.
        let palette =
            read("a.png", &png(ColorType::Indexed, BitDepth::Four, [3, 2], &[0x12, 0x30, 0xf0, 0x50]));
        assert_eq!(palette.unwrap().values, [1, 2, 3, 15, 0, 5]);
        let deep =
            read("a.png", &png(ColorType::Grayscale, BitDepth::Sixteen, [2, 1], &[0x5d, 0xc1, 0xff, 0xff]));
        let deep = deep.unwrap();
        assert_eq!((deep.has_16_bits, &deep.values[..]), (true, &[24001, 65535][..]));
        let mut eight = Cursor::new(Vec::new());
        TiffEncoder::new(&mut eight).unwrap().write_image::<Gray8>(2, 1, &[7, 255]).unwrap();
        assert_eq!(read("a.tif", eight.get_ref()).unwrap().values, [7, 255]);
        let mut sixteen = Cursor::new(Vec::new());
        TiffEncoder::new(&mut sixteen).unwrap().write_image::<Gray16>(2, 1, &[7, 24001]).unwrap();
        let sixteen = read("a.tif", sixteen.get_ref()).unwrap();
        assert_eq!((sixteen.has_16_bits, &sixteen.values[..]), (true, &[7, 24001][..]));
        // The decoder of TIFF files reads no palettes.
        for is_little in [true, false] {
            let palette = read("a.tif", &palette_tiff([7, 200], is_little)).unwrap();
            assert_eq!(palette, upright(1, 2, vec![7, 200]));
        }
        // What is written is read.
        let written = index_png_bytes(&[0, 9, 255, 3], 2, 2).unwrap();
        assert_eq!(read("a.png", &written).unwrap().values, [0, 9, 255, 3]);
    }

    #[test]
    fn colours_and_other_files_are_refused_with_their_name() {
        let refused = |name: &str, bytes: &[u8]| read(name, bytes).unwrap_err();
        let colours = refused("a.png", &png(ColorType::Rgb, BitDepth::Eight, [1, 1], &[1, 2, 3]));
        assert!(colours.contains("a.png") && colours.contains("colours (Rgb)"), "{colours}");
        assert!(colours.contains("hint: give a PNG or TIFF file"), "{colours}");
        let whole = png(ColorType::Grayscale, BitDepth::Eight, [3, 2], &[0; 6]);
        assert!(refused("a.png", &whole[..whole.len() - 14]).contains("cut off"));
        let at = whole.windows(4).position(|name| name == b"IDAT").unwrap();
        let mut wrong = whole.clone();
        // The last byte of the chunk is that of its checksum; its length is below 256.
        wrong[at + 4 + usize::from(whole[at - 1]) + 3] ^= 1;
        let error = refused("a.png", &wrong);
        assert!(
            error
                .ends_with("the file is damaged: its checksum is wrong; hint: copy or export the file again"),
            "{error}"
        );
        assert!(refused("a.png", b"P5 1 1 255 a").contains("neither a PNG nor a TIFF"));
        let empty = refused("a.png", b"");
        assert!(empty.contains("cannot decode") && empty.matches("hint: ").count() == 1, "{empty}");
        assert!(empty.contains("hint: give a PNG or TIFF file"), "{empty}");
        // A directory that lies beyond the end of the file has no palette.
        assert!(refused("a.tif", &palette_tiff([7, 200], true)[..60]).contains("a.tif"));
    }
}
