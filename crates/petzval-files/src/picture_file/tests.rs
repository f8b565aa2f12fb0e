//! Pictures by format: what is read, what is obeyed, what is noted and what is refused.

use ::image::codecs::hdr::HdrEncoder;
use ::image::codecs::jpeg::JpegEncoder;
use ::image::codecs::png::PngEncoder;
use ::image::codecs::webp::WebPEncoder;
use ::image::metadata::Orientation;
use ::image::{ImageBuffer, ImageEncoder, RgbImage};
use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Vec2, WritableImage,
};
use moxcms::{ColorProfile, ToneReprCurve};
use png::{ScaledFloat, SourceChromaticities, SrgbRenderingIntent};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

use super::*;
use crate::picture_set::StoredPicture;
use crate::save_exr;
use crate::spectral_file::is_spectral;

fn read(bytes: &[u8]) -> Picture {
    load_image_bytes(bytes, "test").unwrap()
}

fn light(bytes: &[u8]) -> LinearImage {
    read(bytes).light
}

/// The only note of a picture.
fn note(bytes: &[u8]) -> String {
    let notes = read(bytes).notes;
    assert_eq!(notes.len(), 1, "{notes:?}");
    notes[0].clone()
}

#[test]
fn png_round_trip_keeps_eight_bits() {
    let data = (0..3 * 4 * 5).map(|i| srgb_decode(((i * 4) % 256) as f32 / 255.0)).collect();
    let image = LinearImage::from_data(3, 4, 5, data).unwrap();
    let back = light(&png_bytes(&image).unwrap());
    for (a, b) in image.data.iter().zip(&back.data) {
        assert!((a - b).abs() < 1e-6);
    }
}

#[test]
fn a_sixteen_bit_png_keeps_differences_below_one_of_256_levels() {
    let folder = tempfile::tempdir().unwrap();
    let data: Vec<f32> = (0..3 * 8 * 8).map(|i| srgb_decode(0.2 + i as f32 / 2000.0)).collect();
    let image = LinearImage::from_data(3, 8, 8, data).unwrap();
    let path = folder.path().join("fine.png");
    save_png16(&image, &path).unwrap();
    let back = load_image(&path).unwrap().light;
    for (a, b) in image.to_srgb().iter().zip(back.to_srgb()) {
        assert!((a - b).abs() <= 0.6 / 65535.0, "{a} {b}");
    }
    let samples = ::image::open(&path).unwrap();
    assert_eq!(samples.color(), ::image::ColorType::Rgb16);
}

#[test]
fn the_error_of_a_truncated_picture_says_that_it_is_cut_off() {
    let noise = (0..3 * 64 * 64).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect();
    let bytes = png_bytes(&LinearImage::from_data(3, 64, 64, noise).unwrap()).unwrap();
    let error = load_image_bytes(&bytes[..bytes.len() / 2], "half.png").unwrap_err().to_string();
    assert!(error.contains("half.png") && error.contains("it is cut off"), "{error}");
    assert!(error.ends_with("; hint: copy or export the file again"), "{error}");
}

#[test]
fn the_error_of_a_damaged_picture_says_so_in_words() {
    let noise = (0..3 * 64 * 64).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect();
    let whole = png_bytes(&LinearImage::from_data(3, 64, 64, noise).unwrap()).unwrap();
    // The last byte of a chunk of light is that of its checksum.
    let at = whole.windows(4).position(|name| name == b"IDAT").unwrap();
    let length = u32::from_be_bytes([whole[at - 4], whole[at - 3], whole[at - 2], whole[at - 1]]) as usize;
    let mut bytes = whole.clone();
    bytes[at + 4 + length + 3] ^= 1;
    let error = load_image_bytes(&bytes, "wrong.png").unwrap_err().to_string();
    assert_eq!(
        error,
        "wrong.png: cannot decode the picture: the file is damaged: its checksum is wrong; hint: copy or export the file again"
    );
}

#[test]
fn gray_and_alpha_become_three_planes() {
    let mut bytes = Cursor::new(Vec::new());
    let gray = ::image::LumaA([255u8, 51]);
    DynamicImage::ImageLumaA8(ImageBuffer::from_pixel(2, 1, gray))
        .write_to(&mut bytes, ImageFormat::Png)
        .unwrap();
    let image = light(bytes.get_ref());
    assert_eq!((image.channels, image.height, image.width), (3, 1, 2));
    assert!(image.data.iter().all(|v| (v - 0.2).abs() < 1e-6));
}

#[test]
fn a_transparent_picture_is_noted() {
    // All pixels but one have the first alpha, and one has the second.
    let every = "every pixel is transparent, and the picture is black";
    for (most, one, starts) in [
        (0u8, 0u8, Some(every)),
        (0, 1, Some("64 of its 64 pixels (100.00 %) are transparent and darkened as over black")),
        (255, 128, Some("1 of its 64 pixels (1.56 %) are transparent and darkened as over black")),
        (255, 255, None),
    ] {
        let mut eight = ImageBuffer::from_pixel(8, 8, ::image::Rgba([200u8, 100, 50, most]));
        eight.put_pixel(3, 4, ::image::Rgba([200, 100, 50, one]));
        let eight = DynamicImage::ImageRgba8(eight);
        let sixteen = DynamicImage::ImageRgba16(eight.to_rgba16());
        let gray = DynamicImage::ImageLumaA8(eight.to_luma_alpha8());
        let fine_gray = DynamicImage::ImageLumaA16(eight.to_luma_alpha16());
        for picture in [eight, sixteen, gray, fine_gray] {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
            let found = load_image_bytes(bytes.get_ref(), "clear.png").unwrap().notes;
            assert_eq!(found.len(), usize::from(starts.is_some()), "{found:?}");
            assert!(found.iter().all(|note| note.starts_with(starts.unwrap_or("none"))), "{found:?}");
            assert_eq!(check_decodes(bytes.get_ref(), "clear.png").unwrap(), found);
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_file_says_is_read_from_its_head() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.png");
    let mut encoder = PngEncoder::new(std::fs::File::create(&path).unwrap());
    encoder.set_icc_profile(vec![7; 300]).unwrap();
    RgbImage::new(8, 8).write_with_encoder(encoder).unwrap();
    // A sparse file of more bytes than are read.
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    file.set_len(MOST_PICTURE_BYTES + 1).unwrap();
    let found = picture_statements(&path).unwrap();
    assert_eq!(found, ["its ICC profile (that cannot be read) is ignored: values are taken as sRGB"]);
}

#[test]
fn errors_name_the_file_and_the_reason() {
    let missing = load_image(Path::new("no/such/picture.png")).unwrap_err().to_string();
    assert!(missing.starts_with("no/such/picture.png: "), "{missing}");
    let garbage = load_image_bytes(b"not a picture", "note.txt").unwrap_err().to_string();
    assert!(
        garbage.starts_with("note.txt: cannot decode the picture: it is of no format that is read"),
        "{garbage}"
    );
}

/// A picture of 32 x 16 pixels, black but for its upper left quarter, encoded by `write`.
fn corner(write: impl FnOnce(&RgbImage, &mut Cursor<Vec<u8>>)) -> Vec<u8> {
    let is_white = |x: u32, y: u32| x < 16 && y < 8;
    let picture = RgbImage::from_fn(32, 16, |x, y| ::image::Rgb([if is_white(x, y) { 255 } else { 0 }; 3]));
    let mut out = Cursor::new(Vec::new());
    write(&picture, &mut out);
    out.into_inner()
}

/// EXIF data that only holds an orientation.
fn exif(orientation: Orientation) -> Vec<u8> {
    // A little-endian TIFF directory of one entry: tag 0x112, a SHORT.
    let head = b"II\x2a\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0";
    [&head[..], &[orientation.to_exif(), 0, 0, 0], &[0; 4]].concat()
}

#[test]
fn the_orientation_of_exif_and_tiff_is_obeyed() {
    // "Rotate 90" means that the stored picture is to be turned clockwise: its upper left goes to the upper right.
    let turn = Orientation::Rotate90;
    let write = |encoder: &mut dyn FnMut(&RgbImage, &mut Cursor<Vec<u8>>)| corner(encoder);
    let png = write(&mut |picture, out| {
        let mut encoder = PngEncoder::new(out);
        encoder.set_exif_metadata(exif(turn)).unwrap();
        encoder.write_image(picture, 32, 16, ExtendedColorType::Rgb8).unwrap();
    });
    let jpeg = write(&mut |picture, out| {
        let mut encoder = JpegEncoder::new_with_quality(out, 98);
        encoder.set_exif_metadata(exif(turn)).unwrap();
        encoder.write_image(picture, 32, 16, ExtendedColorType::Rgb8).unwrap();
    });
    let webp = write(&mut |picture, out| {
        let mut encoder = WebPEncoder::new_lossless(out);
        encoder.set_exif_metadata(exif(turn)).unwrap();
        encoder.write_image(picture, 32, 16, ExtendedColorType::Rgb8).unwrap();
    });
    let tiff = write(&mut |picture, out| {
        let mut encoder = TiffEncoder::new(out).unwrap();
        let mut page = encoder.new_image::<colortype::RGB8>(32, 16).unwrap();
        page.encoder().write_tag(Tag::Orientation, u16::from(turn.to_exif())).unwrap();
        page.write_data(picture).unwrap();
    });
    for bytes in [png, jpeg, tiff, webp] {
        let Picture { light, notes, .. } = read(&bytes);
        assert_eq!((light.height, light.width, notes.len()), (32, 16, 0));
        for (row, col, bright) in [(4, 12, true), (4, 4, false), (24, 12, false), (24, 4, false)] {
            assert_eq!(light.get(1, row, col) > 0.5, bright, "{row} {col}");
        }
    }
}

#[test]
fn webp_and_bmp_have_the_pixels_of_the_same_png() {
    let file = |format| corner(|picture, out| picture.write_to(out, format).unwrap());
    let png = read(&file(ImageFormat::Png));
    for format in [ImageFormat::WebP, ImageFormat::Bmp] {
        assert_eq!(read(&file(format)), png, "{format:?}");
    }
}

/// A WebP animation whose frames all show one picture of 32 x 16 pixels.
fn webp_animation(frames: usize) -> Vec<u8> {
    let chunk = |name: &[u8; 4], content: &[u8]| {
        let padding = content.len() % 2;
        [name, &(content.len() as u32).to_le_bytes()[..], content, &[0][..padding]].concat()
    };
    let still = corner(|picture, out| picture.write_to(out, ImageFormat::WebP).unwrap());
    let size = [31, 0, 0, 15, 0, 0];
    // Behind the place of a frame its size, 100 ms and no flags; then the chunk of its picture.
    let frame = [&[0; 6][..], &size, &[100, 0, 0, 0], &still[12..]].concat();
    let mut content = [b"WEBP", &chunk(b"VP8X", &[&[2, 0, 0, 0], &size[..]].concat())[..]].concat();
    content.extend(chunk(b"ANIM", &[0; 6]));
    for _ in 0..frames {
        content.extend(chunk(b"ANMF", &frame));
    }
    chunk(b"RIFF", &content)
}

#[test]
fn an_animation_is_noted() {
    let note = note(&webp_animation(2));
    assert_eq!(note, "it is an animation, of which only one picture is used");
    assert_eq!(light(&webp_animation(2)).width, 32);
}

#[test]
fn a_big_tiff_is_a_picture() {
    let mut out = Cursor::new(Vec::new());
    let samples: Vec<u8> = (0..72).collect();
    TiffEncoder::new_big(&mut out).unwrap().write_image::<colortype::RGB8>(6, 4, &samples).unwrap();
    let bytes = out.into_inner();
    assert!(bytes.starts_with(b"II\x2b\0"));
    let found = light(&bytes);
    assert_eq!((found.height, found.width), (4, 6));
    assert_eq!(found.data[1], srgb_decode(3.0 / 255.0));
    let head = head_of(Cursor::new(&bytes), bytes.len() as u64, "big").unwrap();
    assert_eq!(head.upright(), (6, 4));
}

#[test]
fn gray_floats_of_a_tiff_are_linear_light() {
    let mut out = Cursor::new(Vec::new());
    let samples = [0.0_f32, 0.25, 0.5, 1.0, 2.0, 16.0];
    TiffEncoder::new(&mut out).unwrap().write_image::<colortype::Gray32Float>(3, 2, &samples).unwrap();
    let single = out.into_inner();
    let mut out = Cursor::new(Vec::new());
    let wide = samples.map(f64::from);
    TiffEncoder::new_big(&mut out).unwrap().write_image::<colortype::Gray64Float>(3, 2, &wide).unwrap();
    for bytes in [single, out.into_inner()] {
        let picture = read(&bytes);
        assert!(picture.is_linear && picture.notes.is_empty(), "{:?}", picture.notes);
        assert!((0..3).all(|c| picture.light.plane(c) == samples));
        let head = head_of(Cursor::new(&bytes), bytes.len() as u64, "gray").unwrap();
        assert_eq!(head.upright(), (3, 2));
    }
}

#[test]
fn further_pages_of_a_tiff_are_noted() {
    let tiff = |pages: usize| {
        corner(|picture, out| {
            let mut encoder = TiffEncoder::new(out).unwrap();
            for _ in 0..pages {
                encoder.write_image::<colortype::RGB8>(32, 16, picture).unwrap();
            }
        })
    };
    assert_eq!(note(&tiff(3)), "it has several pages, of which only the first is used");
    assert!(read(&tiff(1)).notes.is_empty());
}

#[test]
fn gamma_and_primaries_of_a_png_are_noted_unless_they_are_those_of_srgb() {
    let png = |change: &dyn Fn(&mut png::Info)| {
        let mut info = png::Info::with_size(1, 1);
        info.color_type = png::ColorType::Rgb;
        change(&mut info);
        let mut out = Vec::new();
        let mut writer = png::Encoder::with_info(&mut out, info).unwrap().write_header().unwrap();
        writer.write_image_data(&[1, 2, 3]).unwrap();
        writer.finish().unwrap();
        out
    };
    let (srgb_gamma, linear) = (ScaledFloat::from_scaled(45_455), ScaledFloat::new(1.0));
    let rec_2020 = SourceChromaticities::new((0.3127, 0.329), (0.708, 0.292), (0.17, 0.797), (0.131, 0.046));
    let rec_709 = SourceChromaticities::new((0.3127, 0.329), (0.64, 0.33), (0.3, 0.6), (0.15, 0.06));
    assert!(
        note(&png(&|i| i.source_gamma = Some(linear))).starts_with("its gamma of 1.0000 (gAMA) is ignored")
    );
    let primaries = note(&png(&|i| {
        (i.source_gamma, i.source_chromaticities) = (Some(srgb_gamma), Some(rec_2020));
    }));
    assert!(primaries.contains("red 0.708 0.292") && primaries.contains("Rec. 709"), "{primaries}");
    assert!(read(&png(&|_| {})).notes.is_empty());
    assert!(read(&png(&|i| i.source_gamma = Some(srgb_gamma))).notes.is_empty());
    assert!(read(&png(&|i| i.source_chromaticities = Some(rec_709))).notes.is_empty());
    // A statement of sRGB stands above the others.
    let srgb = png(&|i| {
        (i.source_gamma, i.srgb) = (Some(linear), Some(SrgbRenderingIntent::Perceptual));
    });
    assert!(read(&srgb).notes.is_empty());
}

#[test]
fn a_profile_is_noted_unless_its_numbers_are_those_of_srgb() {
    let png = |profile: Vec<u8>| {
        corner(|picture, out| {
            let mut encoder = PngEncoder::new(out);
            encoder.set_icc_profile(profile).unwrap();
            encoder.write_image(picture, 32, 16, ExtendedColorType::Rgb8).unwrap();
        })
    };
    let jpeg = |profile: Vec<u8>| {
        corner(|picture, out| {
            let mut encoder = JpegEncoder::new(out);
            encoder.set_icc_profile(profile).unwrap();
            encoder.write_image(picture, 32, 16, ExtendedColorType::Rgb8).unwrap();
        })
    };
    let srgb = ColorProfile::new_srgb();
    assert!(read(&png(srgb.encode().unwrap())).notes.is_empty());
    assert!(read(&jpeg(srgb.encode().unwrap())).notes.is_empty());
    let p3 = ColorProfile::new_display_p3().encode().unwrap();
    for bytes in [png(p3.clone()), jpeg(p3)] {
        assert_eq!(note(&bytes), "its ICC profile (Display P3) is ignored: values are taken as sRGB");
    }
    // Linear light keeps the name of sRGB.
    let line = Some(ToneReprCurve::Lut(Vec::new()));
    let mut linear = srgb.clone();
    (linear.red_trc, linear.green_trc, linear.blue_trc) = (line.clone(), line.clone(), line);
    assert!(note(&png(linear.encode().unwrap())).contains("sRGB"));
    assert!(note(&png(vec![7; 300])).contains("that cannot be read"));
}

/// An OpenEXR file of one layer of 3 x 2 pixels, with more than [`save_exr`] writes.
fn exr_file(
    channels: &[(&str, [f32; 6])],
    change: impl FnOnce(&mut Image<Layer<AnyChannels<FlatSamples>>>),
) -> Vec<u8> {
    let list = channels
        .iter()
        .map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.to_vec())))
        .collect();
    let layer =
        Layer::new((3, 2), LayerAttributes::default(), Encoding::UNCOMPRESSED, AnyChannels::sort(list));
    let mut image = Image::from_layer(layer);
    change(&mut image);
    let mut out = Cursor::new(Vec::new());
    image.write().to_buffered(&mut out).unwrap();
    out.into_inner()
}

const RED: (&str, [f32; 6]) = ("R", [0.0, 0.25, 1.0, 12.5, 1e4, 3e-6]);
const GREEN: (&str, [f32; 6]) = ("G", [0.1; 6]);
const BLUE: (&str, [f32; 6]) = ("B", [0.2; 6]);

#[test]
fn an_exr_of_red_green_blue_is_linear_light_with_its_highlights() {
    let Picture { light, notes, .. } = read(&exr_file(&[RED, GREEN, BLUE], |_| {}));
    assert_eq!((light.channels, light.height, light.width), (3, 2, 3));
    assert!(light.plane(0) == RED.1 && light.plane(1) == GREEN.1 && light.plane(2) == BLUE.1);
    assert_eq!(notes, [""; 0]);
    // Colours are premultiplied by alpha: over black they stay.
    let with_alpha = exr_file(&[RED, GREEN, BLUE, ("A", [0.5; 6])], |_| {});
    assert_eq!(read(&with_alpha), Picture { light, is_linear: true, notes });
    // Gray.
    let gray = read(&exr_file(&[("Y", RED.1)], |_| {}));
    assert!((0..3).all(|c| gray.light.plane(c) == RED.1) && gray.notes.is_empty());
}

#[test]
fn what_an_exr_says_beyond_its_colours_is_noted() {
    let rgb = [RED, GREEN, BLUE];
    assert_eq!(
        note(&exr_file(&[rgb[0], rgb[1], rgb[2], ("Z", [1.0; 6])], |_| {})),
        "its channels Z are not used"
    );
    let primaries = note(&exr_file(&rgb, |image| {
        let (red, green, blue) = (Vec2(0.7347, 0.2653), Vec2(0.0, 1.0), Vec2(0.0001, -0.077));
        image.attributes.chromaticities =
            Some(Chromaticities { red, green, blue, white: Vec2(0.32168, 0.33767) });
    }));
    assert!(primaries.starts_with("its primaries, red 0.735 0.265"), "{primaries}");
    let window = exr_file(&rgb, |image| image.layer_data.attributes.layer_position = Vec2(4, 0));
    assert!(note(&window).contains("display window is ignored"));
    let nits = exr_file(&rgb, |image| image.layer_data.attributes.white_luminance = Some(80.0));
    assert!(note(&nits).contains("80 cd/m2"));
    let negative = exr_file(&[RED, GREEN, ("B", [0.1, -0.25, 0.0, -0.0, 0.5, 0.5])], |_| {});
    assert_eq!(note(&negative), "1 of its 18 values are negative, down to -0.25, and taken as 0");
    assert_eq!(light(&negative).get(2, 0, 1), 0.0);
}

#[test]
fn an_exr_without_light_is_refused() {
    let error = |bytes: &[u8]| load_image_bytes(bytes, "sky.exr").unwrap_err().to_string();
    let mut hot = BLUE;
    hot.1[4] = f32::INFINITY;
    let infinite = error(&exr_file(&[RED, GREEN, hot], |_| {}));
    assert!(infinite.starts_with("sky.exr: the light in row 1, column 1 is inf; hint: "), "{infinite}");
    for channels in [&[("Z", [1.0; 6])][..], &[("Y", [1.0; 6]), ("RY", [0.0; 6]), ("BY", [0.0; 6])]] {
        let other = error(&exr_file(channels, |_| {}));
        assert!(
            other.contains("neither the channels R, G and B nor Y") && other.contains(channels[0].0),
            "{other}"
        );
    }
}

#[test]
fn an_exr_is_a_picture_or_spectral_by_its_channels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let band = ("S0.550nm", [1.0; 6]);
    for (channels, spectral) in [
        (&[RED, GREEN, BLUE][..], false),
        (&[("Y", [1.0; 6])], false),
        (&[band], true),
        // A preview beside the bands.
        (&[RED, GREEN, BLUE, band], true),
        (&[("Z", [1.0; 6])], true),
    ] {
        std::fs::write(&path, exr_file(channels, |_| {})).unwrap();
        assert_eq!(is_spectral(&path), spectral, "{channels:?}");
    }
    // What simulate writes is a picture.
    save_exr(&LinearImage::zeros(3, 2, 2), &path).unwrap();
    assert!(!is_spectral(&path));
}

/// A Radiance file of 2 x 1 pixels with further header lines.
fn hdr_file(lines: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let pixels = [::image::Rgb([0.25, 0.5, 1.0]), ::image::Rgb([64.0, 32.0, 0.0])];
    HdrEncoder::new(&mut bytes).encode(&pixels, 2, 1).unwrap();
    let text = "#?RADIANCE\n";
    assert!(bytes.starts_with(text.as_bytes()));
    [text.as_bytes(), lines.as_bytes(), &bytes[text.len()..]].concat()
}

#[test]
fn a_radiance_file_is_linear_light_with_its_highlights() {
    let Picture { light, notes, .. } = read(&hdr_file(""));
    assert_eq!((light.height, light.width), (1, 2));
    assert_eq!(light.data, [0.25, 64.0, 0.5, 32.0, 1.0, 0.0]);
    assert_eq!(notes, [""; 0]);
    // Older files begin otherwise.
    let older = [b"#?RGBE\n", &hdr_file("")[b"#?RADIANCE\n".len()..]].concat();
    assert_eq!(read(&older).light, light);
    for (lines, needle) in [
        ("EXPOSURE=2\n", "its EXPOSURE of 2 is ignored: 1 is white"),
        ("COLORCORR=1 0.5 1\n", "its COLORCORR is ignored"),
        ("PIXASPECT=0.5\n", "its PIXASPECT of 0.5 is ignored"),
        ("PRIMARIES=0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329\n", "red 0.708 0.292"),
    ] {
        assert!(note(&hdr_file(lines)).contains(needle), "{lines}");
    }
    assert!(read(&hdr_file("PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329\n")).notes.is_empty());
}

#[test]
fn damaged_pictures_are_refused_or_read_but_never_panic() {
    let profile = ColorProfile::new_adobe_rgb().encode().unwrap();
    let png = corner(|picture, out| {
        let mut encoder = PngEncoder::new(out);
        encoder.set_icc_profile(profile.clone()).unwrap();
        encoder.set_exif_metadata(exif(Orientation::Rotate180)).unwrap();
        encoder.write_image(picture, 32, 16, ExtendedColorType::Rgb8).unwrap();
    });
    let jpeg = corner(|picture, out| {
        let mut encoder = JpegEncoder::new(out);
        encoder.set_icc_profile(profile.clone()).unwrap();
        encoder.set_exif_metadata(exif(Orientation::Rotate180)).unwrap();
        encoder.write_image(picture, 32, 16, ExtendedColorType::Rgb8).unwrap();
    });
    let files = [png, jpeg, exr_file(&[RED, GREEN, BLUE], |_| {}), hdr_file("EXPOSURE=2\n")];
    let count = std::env::var("PETZVAL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000usize);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for bytes in &files {
        for _ in 0..count / files.len() {
            let mut damaged = bytes.clone();
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..damaged.len());
                damaged[at] = rng.random();
            }
            if rng.random_range(0..4) == 0 {
                damaged.truncate(rng.random_range(1..=bytes.len()));
            }
            let _ = load_image_bytes(&damaged, "damaged");
            let _ = profile_note(&damaged);
        }
        // The profile alone, which the checksums of a PNG protect.
        let mut damaged = profile.clone();
        for _ in 0..count / files.len() {
            let at = rng.random_range(0..damaged.len());
            let kept = std::mem::replace(&mut damaged[at], rng.random());
            let _ = profile_note(&damaged);
            damaged[at] = kept;
        }
    }
}

/// A PNG of gray bytes whose head states this size, and whose pixels are missing.
fn png_that_claims(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    writer.write_chunk(png::chunk::IDAT, b"\x78\x9c").unwrap();
    // The end of the file is written here.
    drop(writer);
    bytes
}

#[test]
fn pictures_that_take_too_much_memory_are_refused_by_their_heads() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, width: u32, height: u32| {
        let path = folder.path().join(name);
        std::fs::write(&path, png_that_claims(width, height)).unwrap();
        path
    };
    // Gray samples and light are 13 bytes a pixel.
    let large = write("large.png", 22_000, 22_000);
    let errors = [
        picture_size(&large).unwrap_err(),
        StoredPicture::file(large.clone()).decoded().unwrap_err(),
        load_image(&large).unwrap_err(),
    ];
    for error in errors {
        let text = error.to_string();
        assert!(matches!(error, ImageError::TooLarge { width: 22_000, .. }), "{text}");
        assert!(text.contains("takes 6.3 GB of memory") && text.contains("at most 2 GB"), "{text}");
    }
    let fits = write("fits.png", 12_000, 12_000);
    assert_eq!(picture_size(&fits).unwrap(), (12_000, 12_000));
    let head = picture_head(&fits).unwrap();
    let pixels = 12_000 * 12_000;
    assert_eq!(head.reading_bytes(), 2 * head.file_bytes + 13 * pixels);
    // A whole picture is refused by its light, not by its samples.
    let head = PictureHead { stored: (13_000, 13_000), file_bytes: 0, sample_bytes: 169_000_000, ..head };
    assert!(head.checked("a.png").is_err());
}

#[test]
fn heads_of_all_formats_are_those_of_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let image = LinearImage::from_data(3, 4, 6, vec![0.5; 72]).unwrap();
    let exr = folder.path().join("a.exr");
    save_exr(&image, &exr).unwrap();
    let hdr = folder.path().join("a.hdr");
    let pixels = vec![::image::Rgb([0.5f32; 3]); 24];
    HdrEncoder::new(std::fs::File::create(&hdr).unwrap()).encode(&pixels, 6, 4).unwrap();
    let tiff = folder.path().join("a.tiff");
    RgbImage::new(6, 4).save(&tiff).unwrap();
    for path in [exr, hdr, tiff] {
        assert_eq!(picture_size(&path).unwrap(), (6, 4), "{}", path.display());
        let (head, digest, _) = StoredPicture::file(path.clone()).decoded().unwrap();
        assert_eq!(head.sample_bytes % 24, 0);
        assert_eq!(digest, crate::hex_digest(&std::fs::read(&path).unwrap()));
    }
    std::fs::write(folder.path().join("b.png"), b"no picture").unwrap();
    let error = picture_size(&folder.path().join("b.png")).unwrap_err().to_string();
    assert!(error.contains("no format that is read"), "{error}");
}

/// A file that counts the bytes that are read from it.
struct Counted<'a>(Cursor<&'a [u8]>, usize);

impl std::io::Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = std::io::Read::read(&mut self.0, buffer)?;
        self.1 += count;
        Ok(count)
    }
}

impl Seek for Counted<'_> {
    fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
        self.0.seek(to)
    }
}

#[test]
fn of_a_large_jpeg_the_head_alone_is_read() {
    let mut jpeg = Vec::new();
    JpegEncoder::new(&mut jpeg).encode_image(&RgbImage::new(12, 8)).unwrap();
    // Comments of 60,000 bytes behind the first marker.
    let comment = [vec![0xff_u8, 0xfe, 0xea, 0x60], vec![0; 59_998]].concat();
    for (comments, most) in [(0, 200_000), (3, 1_000_000)] {
        let before = [&jpeg[..2], &comment.repeat(comments)].concat();
        let file = [before, jpeg[2..].to_vec(), vec![0; 3_000_000]].concat();
        let mut source = Counted(Cursor::new(file.as_slice()), 0);
        let head = head_of(std::io::BufReader::new(&mut source), file.len() as u64, "test").unwrap();
        assert_eq!(head.stored, (12, 8));
        assert!(source.1 < most, "{comments}: {} bytes", source.1);
        // What is cut off within its head has none.
        assert!(head_of(Cursor::new(&file[..60_000 * comments + 2]), 0, "test").is_err());
    }
}
