//! The files by which a frame goes to an external ISP, and its picture comes back.

use std::io::Cursor;

use ::image::{DynamicImage, ImageFormat, ImageReader};
use half::f16;
use npyz::{Deserialize, NpyFile, Order};
use petzval_camera::isp::{IspParameter, RawInput, RgbPicture};
use petzval_camera::sensor::CfaPattern;
use serde::Serialize;

use crate::undecoded;

/// Version of the exchange: a program refuses one that it does not know.
const PROTOCOL: u32 = 1;

/// Shape, mosaic, calibration and parameters of a frame.
pub const FRAME_FILE: &str = "frame.toml";

/// Digital numbers of a frame.
pub const RAW_FILE: &str = "raw.bin";

/// Names under which a program leaves its picture; the first that exists counts.
pub const PICTURE_FILES: [&str; 3] = ["rgb.npy", "rgb.png", "rgb.ppm"];

/// Longest header of an array that is read, bytes; NumPy writes 128.
const MOST_HEADER: usize = 1024;

/// Values of floats that are refused: filters overshoot by less.
const FAR_OUTSIDE: std::ops::RangeInclusive<f64> = -1.0..=2.0;

/// Largest share of floats that may lie outside 0..1 by more than [`ROUNDING`], half a step of 8 bits. Filters overshoot beside edges
/// only; where more lies outside, the picture has another scale.
const MOST_OUTSIDE: f64 = 0.05;
const ROUNDING: f64 = 0.5 / 255.0;

/// The text of [`FRAME_FILE`].
pub fn frame_toml(frame: &RawInput, parameters: &[IspParameter], values: &[f64]) -> String {
    #[derive(Serialize)]
    struct Shape {
        protocol: u32,
        height: usize,
        width: usize,
        bits: u32,
        cfa: CfaPattern,
    }
    let RawInput { height, width, bits, cfa, ref about, .. } = *frame;
    // Structures of numbers and short texts are always TOML.
    let shape = toml::to_string(&Shape { protocol: PROTOCOL, height, width, bits, cfa }).unwrap_or_default();
    let values: toml::Table =
        parameters.iter().zip(values).map(|(p, value)| (p.name.clone(), (*value).into())).collect();
    let parameters = toml::to_string(&values).unwrap_or_default();
    let about = toml::Table::try_from(about).unwrap_or_default();
    let about = toml::to_string(&toml::Table::from_iter([("calibration".to_owned(), about.into())]));
    format!("{shape}\n[parameters]\n{parameters}\n{}", about.unwrap_or_default())
}

/// The bytes of [`RAW_FILE`]: each digital number as four bytes, the lowest first, row by row.
pub fn raw_bytes(frame: &RawInput) -> Vec<u8> {
    frame.dn.iter().flat_map(|dn| dn.to_le_bytes()).collect()
}

/// Reads the picture that a program has left under one of [`PICTURE_FILES`], and checks that it has the size of the frame.
///
/// `rgb.npy` is an array `(height, width, 3)` of `uint8` or `uint16`, or of floats of 16, 32 or 64 bits from 0 to 1; at most 5 % of the floats may lie outside.
/// `rgb.png` and `rgb.ppm` have 8 or 16 bits. Values are sRGB-encoded. A message says what is wrong.
pub fn decode_picture(
    name: &str,
    bytes: &[u8],
    (height, width): (usize, usize),
) -> Result<RgbPicture, String> {
    let picture = if name.ends_with(".npy") { decode_npy(bytes)? } else { decode_image(name, bytes)? };
    if (picture.height, picture.width) != (height, width) {
        let (got_height, got_width) = (picture.height, picture.width);
        return Err(format!("{got_width} x {got_height} pixels; the frame has {width} x {height}"));
    }
    Ok(picture)
}

fn decode_image(name: &str, bytes: &[u8]) -> Result<RgbPicture, String> {
    let format = if name.ends_with(".png") { ImageFormat::Png } else { ImageFormat::Pnm };
    let mut reader = ImageReader::new(Cursor::new(bytes));
    reader.set_format(format);
    let picture = reader.decode().map_err(|e| undecoded(&e))?;
    let (height, width) = (picture.height() as usize, picture.width() as usize);
    let planes = |pixel: &dyn Fn(usize) -> u16| -> Vec<u16> {
        (0..3).flat_map(|c| (0..height * width).map(move |i| 3 * i + c)).map(pixel).collect()
    };
    match picture {
        DynamicImage::ImageRgb8(p) => {
            Ok(RgbPicture { height, width, bits: 8, data: planes(&|i| u16::from(p.as_raw()[i])) })
        }
        DynamicImage::ImageRgb16(p) => {
            Ok(RgbPicture { height, width, bits: 16, data: planes(&|i| p.as_raw()[i]) })
        }
        other => {
            Err(format!("a picture of {:?}; it must have red, green and blue of 8 or 16 bits", other.color()))
        }
    }
}

fn decode_npy(bytes: &[u8]) -> Result<RgbPicture, String> {
    // A long header is not that of a picture, and nested brackets could exhaust its reader.
    let header = bytes.get(..MOST_HEADER.min(bytes.len())).unwrap_or_default();
    let end = header.iter().position(|b| *b == b'\n').ok_or("not an array of NumPy")?;
    if header[..end].iter().filter(|b| matches!(b, b'(' | b'[' | b'{')).count() > 4 {
        return Err("the header is not that of a picture".to_owned());
    }
    let array = NpyFile::new(bytes).map_err(|e| e.to_string())?;
    let &[height, width, 3] = array.shape() else {
        return Err(format!("an array of shape {:?}; it must be (height, width, 3)", array.shape()));
    };
    if array.order() != Order::C {
        return Err("an array in Fortran order; save numpy.ascontiguousarray of it".to_owned());
    }
    let pixels = usize::try_from(height.saturating_mul(width)).map_err(|e| e.to_string())?;
    let kind = array.dtype().descr();
    let kind = kind.trim_matches('\'').trim_start_matches(['<', '>', '|', '=']).to_owned();
    let each = array.dtype().num_bytes().unwrap_or(0);
    // Check the length before memory is allocated for it.
    if array.into_inner().len() != pixels.saturating_mul(3 * each) {
        return Err("the array is cut off".to_owned());
    }
    let (bits, values) = match kind.as_str() {
        "u1" => (8, array_of::<u8>(bytes)?.into_iter().map(u16::from).collect()),
        "u2" => (16, array_of::<u16>(bytes)?),
        "f2" => (16, encoded(&array_of::<f16>(bytes)?.into_iter().map(f64::from).collect::<Vec<_>>())?),
        "f4" => (16, encoded(&array_of::<f32>(bytes)?.into_iter().map(f64::from).collect::<Vec<_>>())?),
        "f8" => (16, encoded(&array_of::<f64>(bytes)?)?),
        other => return Err(format!("an array of {other}; it must be of uint8, uint16 or floats")),
    };
    let data = (0..3).flat_map(|c| values.iter().skip(c).step_by(3)).copied().collect();
    Ok(RgbPicture { height: height as usize, width: width as usize, bits, data })
}

fn array_of<T: Deserialize>(bytes: &[u8]) -> Result<Vec<T>, String> {
    NpyFile::new(bytes).and_then(|array| array.into_vec()).map_err(|e| e.to_string())
}

/// Floats as 16 bits; refuses what is no number, and what lies further outside 0..1, or more often, than a filter overshoots.
fn encoded(values: &[f64]) -> Result<Vec<u16>, String> {
    let hint = "floats lie between 0, black, and 1, white: scale and clip them";
    if let Some(far) = values.iter().find(|v| !FAR_OUTSIDE.contains(*v)) {
        return Err(format!("a value of {far}; {hint}"));
    }
    let beyond = |v: &f64| (-v).max(v - 1.0);
    let outside = values.iter().filter(|v| beyond(v) > ROUNDING).count();
    if outside as f64 > MOST_OUTSIDE * values.len() as f64 {
        let worst = values.iter().copied().max_by(|a, b| beyond(a).total_cmp(&beyond(b))).unwrap_or(0.0);
        let share = 100.0 * outside as f64 / values.len() as f64;
        let most = 100.0 * MOST_OUTSIDE;
        return Err(format!(
            "{share:.1} % of the values lie outside 0..1, at worst {worst}; at most {most:.0} % may: {hint}"
        ));
    }
    Ok(values.iter().map(|v| (v.clamp(0.0, 1.0) * 65535.0).round() as u16).collect())
}

/// A developed picture as the bytes of a PNG of 8, 10 or 16 bits.
///
/// PNG has no samples of 10 bits. Codes of 10 bits are stored in the upper bits of 16, and the chunk `sBIT` states that 10 count.
pub fn picture_png_bytes(picture: &RgbPicture, bits: u32) -> Result<Vec<u8>, String> {
    let RgbPicture { height, width, .. } = *picture;
    let (pixels, white) = (height * width, f64::from((1_u32 << picture.bits) - 1));
    if pixels == 0 || picture.data.len() != 3 * pixels {
        return Err(format!("{} values do not fill {width} x {height} pixels", picture.data.len()));
    }
    let (codes, is_deep) = (f64::from((1_u32 << bits) - 1), bits > 8);
    let full = if is_deep { 65535.0 } else { 255.0 };
    let sample = |v: u32| ((f64::from(v) / white * codes).round() / codes * full).round() as u16;
    let table: Vec<u16> = (0..=white as u32).map(sample).collect();
    let highest = table.len() - 1;
    let samples =
        (0..3 * pixels).map(|k| table[usize::from(picture.data[k % 3 * pixels + k / 3]).min(highest)]);
    let bytes: Vec<u8> = if is_deep {
        samples.flat_map(u16::to_be_bytes).collect()
    } else {
        samples.map(|v| v as u8).collect()
    };
    encoded_png(&bytes, (height, width), bits).map_err(|e| e.to_string())
}

/// The file of samples, pixel by pixel.
fn encoded_png(
    bytes: &[u8],
    (height, width): (usize, usize),
    bits: u32,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
    let (depth, of_sample) = if bits > 8 { (png::BitDepth::Sixteen, 16) } else { (png::BitDepth::Eight, 8) };
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header()?;
    if bits < of_sample {
        writer.write_chunk(png::chunk::sBIT, &[bits as u8; 3])?;
    }
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use petzval_camera::isp::{FrameData, NoiseProfile};

    use super::*;

    fn frame() -> RawInput {
        RawInput {
            height: 16,
            width: 18,
            dn: (0..16 * 18).map(|i| i * 200_000 / 3).collect(),
            bits: 24,
            cfa: CfaPattern::RGGB,
            about: FrameData {
                black_dn: 64.0,
                white_dn: 1e6,
                response: [0.5, 1.0, 0.7],
                saturation: 1.2,
                noise: NoiseProfile { shot: 1e-4, read: 1e-6 },
                gain_ev: 0.0,
                colour_matrix: None,
                companding: None,
                shading: None,
                warp: None,
            },
        }
    }

    fn parameter(name: &str) -> IspParameter {
        let text = format!(
            "name = \"a\"\ncommand = [\"a\"]\n[[parameter]]\nname = \"{name}\"\nmin = 0\nmax = 9\ndefault = 1\nsentence = \"\""
        );
        crate::isp_file::parse_external_isp(&text).unwrap().parameters.remove(0)
    }

    #[test]
    fn a_frame_and_its_calibration_are_written_so_that_they_read_back() {
        let frame = frame();
        let text = frame_toml(&frame, &[parameter("tone.gamma"), parameter("gain.red")], &[2.2, 1.0 / 3.0]);
        assert!(text.contains("\n\"tone.gamma\" = 2.2\n"), "{text}");
        let read: toml::Table = toml::from_str(&text).unwrap();
        assert_eq!(read["height"].as_integer(), Some(16));
        assert_eq!(read["cfa"].as_str(), Some("RGGB"));
        assert_eq!(read["parameters"]["gain.red"].as_float(), Some(1.0 / 3.0));
        let about: FrameData = read["calibration"].clone().try_into().unwrap();
        assert_eq!(about, frame.about);
        let raw = raw_bytes(&frame);
        assert_eq!(raw.len(), 4 * frame.dn.len());
        assert_eq!(u32::from_le_bytes([raw[4], raw[5], raw[6], raw[7]]), 66_666);
    }

    fn npy<T: npyz::AutoSerialize + Copy>(shape: &[u64], values: &[T]) -> Vec<u8> {
        crate::npy_bytes(shape, values).unwrap()
    }

    #[test]
    fn codes_of_ten_bits_are_the_upper_ones_of_sixteen() {
        let codes: Vec<u16> = (1..=1023).collect();
        let picture = RgbPicture { height: 1, width: 341, bits: 10, data: codes.clone() };
        let bytes = picture_png_bytes(&picture, 10).unwrap();
        let read = decode_picture("rgb.png", &bytes, (1, 341)).unwrap();
        assert_eq!((read.bits, read.data[0], read.data[1022]), (16, 64, 65535));
        assert_eq!(read.data.iter().map(|v| v >> 6).collect::<Vec<u16>>(), codes);
        let significant = |bytes: &[u8]| {
            let reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
            reader.info().sbit.as_ref().map(|bits| bits.to_vec())
        };
        assert_eq!(significant(&bytes), Some(vec![10; 3]));
        assert_eq!(significant(&picture_png_bytes(&picture, 16).unwrap()), None);
        // Of a picture of 16 bits, too, ten count.
        let deep = RgbPicture { bits: 16, ..picture };
        let read = decode_picture("rgb.png", &picture_png_bytes(&deep, 10).unwrap(), (1, 341)).unwrap();
        assert!(read.data.iter().zip(&codes).all(|(v, code)| *v >> 6 == (code + 31) / 64));
    }

    #[test]
    fn pictures_of_every_kind_read_alike() {
        let text = "P3\n2 1\n255\n255 0 51  0 102 255\n";
        let ppm = decode_picture("rgb.ppm", text.as_bytes(), (1, 2)).unwrap();
        assert_eq!(ppm, RgbPicture { height: 1, width: 2, bits: 8, data: vec![255, 0, 0, 102, 51, 255] });
        let png = picture_png_bytes(&ppm, 8).unwrap();
        assert_eq!(decode_picture("rgb.png", &png, (1, 2)).unwrap(), ppm);
        let deep = decode_picture("rgb.png", &picture_png_bytes(&ppm, 16).unwrap(), (1, 2)).unwrap();
        assert_eq!((deep.bits, deep.encoded()), (16, ppm.encoded()));
        let bytes = npy(&[1, 2, 3], &[255_u8, 0, 51, 0, 102, 255]);
        assert_eq!(decode_picture("rgb.npy", &bytes, (1, 2)).unwrap(), ppm);
        let floats = npy(&[1, 2, 3], &[1.0_f32, -0.001, 0.2, 0.0, 0.4, 1.001]);
        let floats = decode_picture("rgb.npy", &floats, (1, 2)).unwrap();
        assert_eq!(floats.encoded(), ppm.encoded());
        let halves = [1.0, -0.001, 0.2, 0.0, 0.4, 1.001].map(f16::from_f32);
        let halves = decode_picture("rgb.npy", &npy(&[1, 2, 3], &halves), (1, 2)).unwrap();
        // Numbers of 16 bits have 11 of precision.
        assert!(halves.bits == 16 && halves.data.iter().zip(&floats.data).all(|(a, b)| a.abs_diff(*b) <= 16));
        let words = npy(&[1, 2, 3], &[65535_u16, 0, 13107, 0, 26214, 65535]);
        assert_eq!(decode_picture("rgb.npy", &words, (1, 2)).unwrap(), deep);
        // Ten bits become sixteen.
        let ten = decode_picture("rgb.ppm", b"P3 1 1 1023 1023 0 0", (1, 1)).unwrap();
        assert_eq!((ten.bits, ten.data), (16, vec![65535, 0, 0]));
    }

    #[test]
    fn what_is_no_picture_of_the_frame_is_refused_with_the_reason() {
        let bytes = |values: &[f32]| npy(&[1, 2, 3], values);
        for (name, bytes, says) in [
            ("rgb.npy", bytes(&[0.0, 0.5, f32::NAN, 0.0, 0.0, 0.0]), "NaN"),
            ("rgb.npy", bytes(&[0.0, 0.5, 255.0, 0.0, 0.0, 0.0]), "255"),
            ("rgb.npy", bytes(&[0.0, 0.5, f32::INFINITY, 0.0, 0.0, 0.0]), "inf"),
            ("rgb.npy", npy(&[2, 1, 3], &[0_u8; 6]), "1 x 2 pixels; the frame has 2 x 1"),
            ("rgb.npy", npy(&[3, 1, 2], &[0_u8; 6]), "(height, width, 3)"),
            ("rgb.npy", npy(&[1, 2, 3], &[0_i32; 6]), "i4"),
            ("rgb.npy", npy(&[1, 2, 3], &[0_u8; 6])[..130].to_vec(), "cut off"),
            ("rgb.npy", Vec::new(), "not an array"),
            ("rgb.npy", b"garbage\n".to_vec(), ""),
            ("rgb.png", b"garbage".to_vec(), ""),
            ("rgb.ppm", b"P3\n2 1\n255\n255 0 51".to_vec(), ""),
            ("rgb.ppm", b"P2\n2 1\n255\n255 0".to_vec(), "red, green and blue"),
        ] {
            let error = decode_picture(name, &bytes, (1, 2)).unwrap_err();
            assert!(error.contains(says) && !error.is_empty(), "{name}: {error}");
        }
    }

    #[test]
    fn a_little_overshoot_is_clipped_and_a_picture_of_another_scale_is_refused() {
        let picture = |outside: usize, value: f64| {
            let values: Vec<f64> = (0..1200).map(|i| if i < outside { value } else { 0.5 }).collect();
            decode_picture("rgb.npy", &npy(&[20, 20, 3], &values), (20, 20))
        };
        for (value, clipped) in [(1.5, 65535), (-0.25, 0)] {
            // 5 % of 1200 values are 60: 60 pass, 61 do not.
            assert_eq!(picture(60, value).unwrap().data[0], clipped);
            let error = picture(61, value).unwrap_err();
            let says = format!("5.1 % of the values lie outside 0..1, at worst {value}; at most 5 % may");
            assert!(error.contains(&says) && error.contains("scale and clip them"), "{error}");
        }
        assert!(picture(1200, 1.5).unwrap_err().contains("100.0 %"));
        // What rounding puts above white is white, and a single value far outside is none of a filter.
        assert_eq!(picture(1200, 1.0 + 1e-6).unwrap().data[0], 65535);
        assert!(picture(1, 7.0).unwrap_err().contains("a value of 7;"));
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_the_reader_panic(mut at in 0usize..150, byte in 0u8..=255, cut in 0usize..160) {
            let mut bytes = npy(&[1, 2, 3], &[7_u16; 6]);
            at %= bytes.len();
            bytes[at] = byte;
            bytes.truncate(cut);
            for name in PICTURE_FILES {
                let _ = decode_picture(name, &bytes, (1, 2));
            }
        }
    }
}
