//! Round trips to the bit, contradictory files, and damaged files.

use std::path::Path;

use proptest::prelude::*;

use super::*;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, CfaPattern, Exposure, Raw};

fn frame(height: usize, width: usize, bits: u32) -> RawFrame {
    let max = info::largest_dn(bits);
    let dn = (0..height * width).map(|i| (i as u32).wrapping_mul(2_654_435_761) >> 7 & max).map(|v| v as u16);
    RawFrame {
        height,
        width,
        dn: dn.collect(),
        info: RawInfo {
            sensor: Some("test \"sensor\"".to_owned()),
            bits: Some(bits),
            cfa: Some("RG/GB".parse().unwrap()),
            black_level_dn: Some(0.5),
            black_tile_dn: None,
            white_level_dn: Some(f64::from(max)),
            exposure_s: Some(0.0025),
            linear_gain: Some(31.62),
            pixel_um: Some(5.86),
            temperature_c: Some(-10.0),
            orientation: Some(6),
            companding: None,
            calibration: Some("lens \\ one.toml".to_owned()),
        },
    }
}

fn formats(bits: u32) -> Vec<RawFormat> {
    let mut all = vec![RawFormat::Tiff, RawFormat::Png, RawFormat::Npy];
    let packings = [Packing::Lsb, Packing::U16le, Packing::U16be];
    all.extend(packings.map(RawFormat::Packed));
    if [8, 10, 12, 14].contains(&bits) {
        all.push(RawFormat::Packed(Packing::Mipi));
    }
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_format_keeps_every_bit(height in 1usize..9, width in 1usize..23, bits in 1u32..=16) {
        let folder = tempfile::tempdir().unwrap();
        let frame = frame(height, width, bits.max(2));
        for format in formats(bits.max(2)) {
            let path = folder.path().join(format!("frame.{}", format.extension()));
            save_raw(&frame, &path, format).unwrap();
            prop_assert_eq!(&load_raw(&path).unwrap(), &frame, "{:?}", format);
        }
    }

    #[test]
    fn padded_rows_headers_and_footers_are_skipped(
        height in 1usize..6, width in 1usize..19, bits in 2u32..=16, pad in 0usize..9, header in 0usize..40, footer in 0usize..9,
    ) {
        let frame = frame(height, width, bits);
        let tight = PackedLayout::tight(height, width, bits, Packing::Lsb);
        let layout = PackedLayout {
            row_stride_bytes: tight.row_stride_bytes + pad, header_bytes: header, footer_bytes: footer, ..tight
        };
        let bytes = packing::pack(&layout, &frame.dn).unwrap();
        prop_assert_eq!(packing::unpack(&layout, &bytes).unwrap(), &frame.dn[..]);
        let mut sidecar = Sidecar::of(&frame);
        sidecar.layout = Some(layout);
        let back = Sidecar::from_toml(&sidecar.to_toml()).unwrap();
        prop_assert_eq!(back.layout, sidecar.layout);
        prop_assert_eq!(back.info, frame.info);
    }

    #[test]
    fn no_sidecar_makes_the_reader_panic(line in 0usize..14, text in "\\PC{0,40}") {
        let mut sidecar = Sidecar::of(&frame(4, 6, 12));
        sidecar.layout = Some(PackedLayout { header_bytes: 4, ..PackedLayout::tight(4, 6, 12, Packing::Mipi) });
        let good = sidecar.to_toml();
        let mut lines: Vec<&str> = good.lines().collect();
        let at = line.min(lines.len() - 1);
        lines[at] = &text;
        let _ = Sidecar::from_toml(&lines.join("\n"));
    }
}

#[test]
fn a_simulated_frame_has_the_metadata_of_its_camera() {
    let sensor =
        crate::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml")).unwrap();
    let exposure = Exposure { white_e: 1e4, time_s: 0.005, linear_gain: 2.0 };
    let capture = Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: 0 };
    let raw = Raw { height: 1, width: 3, dn: vec![-4.0, 119.5, 70000.0], capture };
    let frame = RawFrame::from_raw(&raw, &sensor);
    assert_eq!(frame.dn, [0, 120, 65535]);
    assert_eq!((frame.info.bits, frame.info.cfa), (Some(12), Some(CfaPattern::RGGB)));
    assert_eq!((frame.info.black_level_dn, frame.info.white_level_dn), (Some(119.0), Some(4095.0)));
    assert_eq!(frame.info.exposure_s, Some(0.005));
    assert_eq!((frame.info.linear_gain, frame.info.pixel_um), (Some(2.0), Some(5.86)));

    // The mosaic of a window starts at the window's first pixel.
    let capture = Capture { placement: Placement { row: 7, col: 4 }, ..capture };
    let window = RawFrame::from_raw(&Raw { capture, ..raw }, &sensor);
    assert_eq!(window.info.cfa, Some(CfaPattern::GBRG));
}

#[test]
fn an_eight_bit_picture_keeps_its_numbers_and_has_eight_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gray.png");
    ::image::GrayImage::from_raw(2, 1, vec![0, 200]).unwrap().save(&path).unwrap();
    let frame = load_raw(&path).unwrap();
    assert_eq!((frame.dn, frame.info.bits), (vec![0, 200], Some(8)));
}

/// Samples that a picture decoder would spread, invert or round are refused, because the result is not the file's numbers.
#[test]
fn pictures_that_would_be_converted_are_refused() {
    let says = |bytes: &[u8]| picture::decode(bytes).map(AnyFrame::widened).map_err(|e| e.reason);
    // Two gray pixels in one row: bits per sample with the header's checksum, and the compressed row with its checksum.
    let png_of = |bits: u8, check: [u8; 4], row: &[u8]| {
        let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x02\0\0\0\x01".to_vec();
        bytes.extend([bits, 0, 0, 0, 0].into_iter().chain(check).chain([0, 0, 0, row.len() as u8 - 4]));
        bytes.extend(b"IDAT".iter().chain(row).chain(b"\0\0\0\0IEND\xae\x42\x60\x82"));
        bytes
    };
    let eight = png_of(
        8,
        [0xd1, 0x49, 0x20, 0x56],
        &[0x78, 0x9c, 0x63, 0x60, 0x64, 0x02, 0x00, 0x00, 0x07, 0x00, 0x04, 0x76, 0x49, 0xe3, 0x28],
    );
    let four = png_of(
        4,
        [0x14, 0xb9, 0xcd, 0x57],
        &[0x78, 0x9c, 0x63, 0x10, 0x02, 0x00, 0x00, 0x14, 0x00, 0x13, 0x02, 0x1d, 0x7b, 0xdb],
    );
    let one = png_of(
        1,
        [0xdc, 0x59, 0x42, 0x27],
        &[0x78, 0x9c, 0x63, 0x68, 0x00, 0x00, 0x00, 0x82, 0x00, 0x81, 0x77, 0xcd, 0x72, 0xb6],
    );
    assert_eq!(says(&eight).unwrap().dn, [1, 2]);
    assert!(says(&four).unwrap_err().contains("samples of 4 bits"));
    assert!(says(&one).unwrap_err().contains("samples of 1 bits"));

    // One row of two numbers, 119 and 120; entries are tag, type (3 short, 4 long), value.
    let tiff_of = |photometric: u32, bits: u32| {
        let entries: [(u16, u16, u32); 9] = [
            (256, 3, 2),
            (257, 3, 1),
            (258, 3, bits),
            (259, 3, 1),
            (262, 3, photometric),
            (273, 4, 122),
            (277, 3, 1),
            (278, 3, 1),
            (279, 4, 4),
        ];
        let mut bytes = b"II*\0\x08\0\0\0\x09\0".to_vec();
        for (tag, kind, value) in entries {
            bytes.extend(tag.to_le_bytes().into_iter().chain(kind.to_le_bytes()).chain([1, 0, 0, 0]));
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0, 0, 0, 0, 119, 0, 120, 0]);
        bytes
    };
    assert_eq!(says(&tiff_of(1, 16)).unwrap().dn, [119, 120]);
    assert!(says(&tiff_of(0, 16)).unwrap_err().contains("white is zero"));
    let mosaic = says(&tiff_of(32_803, 16)).unwrap_err();
    assert!(mosaic.contains("a meaning that is not read (PhotometricInterpretation)"), "{mosaic}");
    for bits in [1, 4] {
        assert!(says(&tiff_of(1, bits)).unwrap_err().contains(&format!("{bits} bits")));
    }

    // JPEG is lossy and has a display curve.
    let mut jpeg = std::io::Cursor::new(Vec::new());
    ::image::GrayImage::new(8, 8).write_to(&mut jpeg, ::image::ImageFormat::Jpeg).unwrap();
    assert!(says(&jpeg.into_inner()).unwrap_err().contains("neither a TIFF nor a PNG"));
}

#[test]
fn the_orientation_of_a_file_is_kept_and_that_of_the_sidecar_counts() {
    use ::image::ImageEncoder;
    use tiff::encoder::{TiffEncoder, colortype};
    let folder = tempfile::tempdir().unwrap();
    let (tiff, png) = (folder.path().join("frame.tiff"), folder.path().join("frame.png"));
    for (stored, read) in [(1_u16, None), (3, Some(3)), (6, Some(6)), (8, Some(8)), (9, None)] {
        let mut encoder = TiffEncoder::new(std::fs::File::create(&tiff).unwrap()).unwrap();
        let mut page = encoder.new_image::<colortype::Gray16>(2, 1).unwrap();
        page.encoder().write_tag(::tiff::tags::Tag::Orientation, stored).unwrap();
        page.write_data(&[5, 6]).unwrap();
        assert_eq!(load_raw(&tiff).unwrap().info.orientation, read, "{stored}");
    }
    // EXIF data that hold an orientation alone.
    let exif = b"II\x2a\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let mut encoder = ::image::codecs::png::PngEncoder::new(std::fs::File::create(&png).unwrap());
    encoder.set_exif_metadata(exif.to_vec()).unwrap();
    encoder.write_image(&[5, 6], 2, 1, ::image::ExtendedColorType::L8).unwrap();
    let frame = load_raw(&png).unwrap();
    assert_eq!((frame.dn, frame.info.orientation), (vec![5, 6], Some(6)));

    for (line, wanted) in [("orientation = 1\n", Some(1)), ("", Some(6))] {
        std::fs::write(sidecar_path(&png), line).unwrap();
        assert_eq!(load_raw(&png).unwrap().info.orientation, wanted, "{line}");
    }
    for line in ["orientation = 0\n", "orientation = 9\n"] {
        std::fs::write(sidecar_path(&png), line).unwrap();
        let error = load_raw(&png).unwrap_err().to_string();
        assert!(error.contains("orientation") && error.contains("1 to keep"), "{error}");
    }
}

#[test]
fn numpy_arrays_of_other_types_and_orders_are_read() {
    fn array<T: npyz::AutoSerialize>(order: npyz::Order, values: [T; 6]) -> Vec<u8> {
        use npyz::WriterBuilder;
        let mut bytes = Vec::new();
        let options = npyz::WriteOptions::new().default_dtype().order(order).shape(&[2, 3]);
        let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
        writer.extend(values).unwrap();
        writer.finish().unwrap();
        bytes
    }
    let read = |bytes: &[u8]| npy::decode(bytes).map(AnyFrame::widened).map_err(|e| e.reason);
    let rows = vec![1, 2, 3, 4, 5, 6];
    assert_eq!(read(&array(npyz::Order::C, [1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0])).unwrap().dn, rows);
    assert_eq!(read(&array(npyz::Order::Fortran, [1i64, 4, 2, 5, 3, 6])).unwrap().dn, rows);
    assert_eq!(read(&array(npyz::Order::C, [1u8, 2, 3, 4, 5, 6])).unwrap().info.bits, Some(8));
    for wrong in [0.5f64, -1.0, 16_777_216.0, f64::NAN] {
        let error = read(&array(npyz::Order::C, [0.0, 0.0, 0.0, 0.0, wrong, 0.0])).unwrap_err();
        assert!(error.contains("row 1, column 1"), "{error}");
    }
}

/// The checksum of a chunk of a PNG.
fn crc32(bytes: &[u8]) -> u32 {
    let bit = |crc: u32, _: u32| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
    !bytes.iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), bit))
}

#[test]
fn a_frame_that_takes_too_much_memory_is_refused_by_its_head() {
    // Gray PNGs of 22000 rows; the data would be damaged, and are not reached.
    let png_of = |bits: u8, columns: u32| {
        let chunk = |name: &[u8; 4], data: &[u8]| {
            let named = [&name[..], data].concat();
            [&(data.len() as u32).to_be_bytes()[..], &named, &crc32(&named).to_be_bytes()].concat()
        };
        let head = [&columns.to_be_bytes()[..], &22_000_u32.to_be_bytes(), &[bits, 0, 0, 0, 0]].concat();
        let data = vec![0_u8; 500_000];
        [&b"\x89PNG\r\n\x1a\n"[..], &chunk(b"IHDR", &head), &chunk(b"IDAT", &data)].concat()
    };
    let says = |bytes: &[u8]| picture::decode(bytes).map(AnyFrame::widened).map_err(|e| e.reason);
    for bits in [8, 16] {
        let said = says(&png_of(bits, 22_000)).unwrap_err();
        assert!(
            said.contains("22000 x 22000 pixels takes 2.9 GB") && said.contains("at most 2 GB"),
            "{said}"
        );
    }
    let damaged = says(&png_of(8, 100)).unwrap_err();
    assert!(!damaged.contains("GB"), "{damaged}");
    // A frame of 150 million pixels in 16 bits is read, also as the transposed array that takes most.
    assert!(frame::check_memory((14_204, 10_652), 302_600_000, 8).is_ok());
}

#[test]
fn frames_of_more_than_16_bits_are_read_for_an_isp_and_not_for_measurements() {
    use tiff::encoder::{TiffEncoder, colortype};
    let folder = tempfile::tempdir().unwrap();
    let (npy, tiff) = (folder.path().join("frame.npy"), folder.path().join("frame.tiff"));
    let write = |values: [u32; 4]| {
        std::fs::write(&npy, crate::npy_bytes(&[2, 2], &values).unwrap()).unwrap();
        let mut encoder = TiffEncoder::new(std::fs::File::create(&tiff).unwrap()).unwrap();
        encoder.write_image::<colortype::Gray32>(2, 2, &values).unwrap();
    };
    let error = |path: &Path| load_raw(path).unwrap_err().to_string();
    write([0, 65_535, 65_536, 16_777_215]);
    for path in [&npy, &tiff] {
        assert_eq!(load_any_raw(path).unwrap().dn, [0, 65_535, 65_536, 16_777_215]);
        assert!(error(path).contains("the value 65536 at row 1, column 0 has more than 16 bits"));
        assert!(error(path).contains("petzval isp develop"));
        // The sidecar applies to wide frames, too.
        std::fs::write(sidecar_path(path), "bits = 24\nwhite_level_dn = 16777215.0").unwrap();
        assert_eq!(load_any_raw(path).unwrap().info.white_level_dn, Some(16_777_215.0));
        std::fs::write(sidecar_path(path), "bits = 20").unwrap();
        let said = load_any_raw(path).unwrap_err().to_string();
        assert!(said.contains("the value 16777215 at row 1, column 1"), "{said}");
    }
    // Small numbers in 32 bits are a frame like any other, unless its bits say otherwise.
    write([0, 1, 2, 4095]);
    for path in [&npy, &tiff] {
        assert!(error(path).contains("digital numbers of 20 bits"), "{}", error(path));
        std::fs::remove_file(sidecar_path(path)).unwrap();
        assert_eq!(load_raw(path).unwrap().dn, [0, 1, 2, 4095]);
    }
    write([0, 1, 2, 1 << 24]);
    for path in [&npy, &tiff] {
        let said = load_any_raw(path).unwrap_err().to_string();
        assert!(said.contains("the value 16777216 at row 1, column 1"), "{said}");
    }
}

#[test]
fn knots_of_companding_are_kept_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.raw");
    let knots = "\n[companding]\ncompanded_dn = [0, 1024, 4095]\nlinear_dn = [0, 1024, 1048575]\n";
    let head = "height = 1\nwidth = 4\nbits = 12\npacking = \"u16le\"\nwhite_level_dn = 1048575.0\n";
    let dn = [0_u16, 1024, 2048, 4095];
    let says = |dn: [u16; 4], sidecar: &str| {
        std::fs::write(&path, dn.map(u16::to_le_bytes).concat()).unwrap();
        std::fs::write(sidecar_path(&path), sidecar).unwrap();
        load_any_raw(&path).map_err(|e| e.to_string())
    };
    let frame = says(dn, &format!("{head}{knots}")).unwrap();
    let companding = frame.info.companding.clone().unwrap();
    assert_eq!(frame.dn.iter().map(|dn| companding.expand(*dn)).collect::<Vec<_>>()[3], 1_048_575);
    // It is written as it was read, and no measurement takes it for linear.
    let format = RawFormat::Packed(Packing::U16le);
    save_raw(&frame.clone().in_16_bits().unwrap(), &path, format).unwrap();
    assert_eq!(load_any_raw(&path).unwrap(), frame);
    let error = load_raw(&path).unwrap_err().to_string();
    assert!(error.contains("companded") && error.contains("isp develop"), "{error}");

    for (from, to, needles) in [
        (
            "[0, 1024, 4095]",
            "[0, 1024, 4096]",
            ["line 8", "the knot 4096 is above 4095, the largest of 12 bits"],
        ),
        ("[0, 1024, 4095]", "[1, 1024, 4095]", ["`companded_dn = [1, 1024, 4095]`", "ascending list from 0"]),
        ("[0, 1024, 4095]", "[0, 1024, 1024]", ["line 8", "ascending order"]),
        ("[0, 1024, 4095]", "[0, 2047]", ["line 9", "has 3 knots, and `companded_dn` has 2"]),
        ("[0, 1024, 1048575]", "[0, 1024, 16777216]", ["line 9", "above 16777215, the largest of 24 bits"]),
        ("[0, 1024, 1048575]", "[0]", ["`linear_dn = [0]`", "at least two numbers"]),
        ("[0, 1024, 1048575]", "[0, -4, 9]", ["line 9", "-4"]),
        ("linear_dn =", "light_dn =", ["line 9", "linear_dn"]),
        ("[0, 1024, 4095]", "[0, 1024, 4094]", ["line 8", "has the value 4095 at row 0, column 3"]),
    ] {
        let error = says(dn, &format!("{head}{knots}").replace(from, to)).unwrap_err();
        for needle in needles.iter().chain(&["frame.raw.toml"]) {
            assert!(error.contains(needle), "{to}: {needle}\n{error}");
        }
    }
    // The levels of a linear frame have the numbers of its file.
    let error = says(dn, head).unwrap_err();
    assert!(error.contains("white_level_dn") && error.contains("65535"), "{error}");
}

/// Errors name the file, the line, the key and a hint.
#[test]
fn sidecars_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.raw");
    let layout = "height = 2\nwidth = 4\nbits = 12\npacking = \"mipi\"\n";
    let says = |bytes: &[u8], sidecar: &str| {
        std::fs::write(&path, bytes).unwrap();
        std::fs::write(sidecar_path(&path), sidecar).unwrap();
        load_raw(&path).map_err(|e| e.to_string())
    };
    assert_eq!(says(&[0; 12], layout).unwrap().dn, [0; 8]);
    for (bytes, sidecar, needles) in [
        (12, layout.replace("bits = 12\n", ""), ["frame.raw.toml", "needs the key `bits`"]),
        (
            12,
            format!("{layout}black_level_dn = 100.0\nwhite_level_dn = 90.0\n"),
            ["line 6", "white_level_dn is 90, outside 101..4095"],
        ),
        (
            12,
            format!("{layout}white_level_dn = 9000.0\n"),
            ["line 5", "white_level_dn is 9000, outside 1..4095"],
        ),
        (
            12,
            format!("{layout}black_level_dn = 4095.0\n"),
            ["line 5", "black_level_dn is 4095, outside 0..4094"],
        ),
        (12, layout.replace("12", "16"), ["line 3", "only 8, 10, 12 and 14"]),
        (12, layout.replace("12", "40"), ["line 3", "bits is 40"]),
        (12, layout.replace("mipi", "mippi"), ["line 4", "did you mean \"mipi\"?"]),
        (12, layout.replace("height", "hight"), ["line 1", "did you mean `height`?"]),
        (12, format!("{layout}row_stride_bytes = 5"), ["line 5", "takes 6 bytes"]),
        (12, layout.replace("height = 2", "height = 2000000000"), ["line 1", "2^28"]),
        (12, format!("{layout}cfa = \"RGX\""), ["line 5", "RGGB"]),
        (12, format!("{layout}linear_gain = nan"), ["line 5", "linear_gain is NaN"]),
        (12, layout.replace("packing = \"mipi\"", ""), ["frame.raw.toml", "needs the key `packing`"]),
        (12, "bits = 12\nheader_bytes = 4".to_owned(), ["line 2", "`packing` is missing"]),
        (11, layout.to_owned(), ["frame.raw: the file has 11 bytes", "take 12; hint"]),
        (13, layout.to_owned(), ["frame.raw: the file has 13 bytes", "header_bytes"]),
    ] {
        let error = says(&vec![0; bytes], &sidecar).unwrap_err();
        for needle in needles {
            assert!(error.contains(needle), "{sidecar}\n{error}");
        }
    }
    let error = says(&[255; 16], &layout.replace("mipi", "u16le")).unwrap_err();
    assert!(error.contains("the value 65535 at row 0, column 0 does not fit in 12 bits"), "{error}");

    std::fs::remove_file(sidecar_path(&path)).unwrap();
    let error = load_raw(&path).unwrap_err().to_string();
    assert!(error.contains("no sidecar") && error.contains("packing = \"mipi\""), "{error}");
}

#[test]
fn a_sidecar_beside_a_picture_adds_to_it_and_must_fit_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.tiff");
    save_raw(&frame(2, 4, 12), &path, RawFormat::Tiff).unwrap();
    let says = |sidecar: &str| {
        std::fs::write(sidecar_path(&path), sidecar).unwrap();
        load_raw(&path).map_err(|e| e.to_string())
    };
    assert_eq!(says("cfa = \"GRBG\"").unwrap().info.cfa, Some(CfaPattern::GRBG));
    for (sidecar, needle) in [
        ("height = 3", "`height = 3`: "),
        ("bits = 4", "shifted up"),
        ("height = 2\nwidth = 4\nbits = 12\npacking = \"lsb\"", "is not a packed file"),
    ] {
        let error = says(sidecar).unwrap_err();
        assert!(error.contains("frame.tiff.toml: line"), "{error}");
        assert!(sidecar.starts_with("bits") || error.contains(needle), "{error}");
    }
    let error = says("bits = 4").unwrap_err();
    assert!(error.contains("are they shifted up?"), "{error}");
}

#[test]
fn frames_that_cannot_be_written_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let good = frame(2, 4, 12);
    let write = |frame: &RawFrame, name: &str, format| {
        save_raw(frame, &folder.path().join(name), format).unwrap_err()
    };
    let short = RawFrame { dn: vec![0; 7], ..good.clone() };
    assert!(write(&short, "a.tiff", RawFormat::Tiff).to_string().contains("7 numbers do not fill 4 x 2"));
    let large = RawFrame { dn: vec![4096; 8], ..good.clone() };
    let error = write(&large, "a.raw", RawFormat::Packed(Packing::Mipi)).to_string();
    assert!(error.contains("does not fit in 12 bits"), "{error}");
    assert!(write(&good, "a.dng", RawFormat::Dng).to_string().contains("not written"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    assert!(matches!(write(&good, "none/a.tiff", RawFormat::Tiff), RawFileError::Io { .. }));
}

#[test]
fn formats_that_are_not_read_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    save_raw(&frame(2, 4, 12), &path, RawFormat::Exr).unwrap();
    assert!(load_raw(&path).unwrap_err().to_string().contains("are written, not read"));
    assert!(matches!(load_raw(Path::new("no/such.raw")), Err(RawFileError::Io { .. })));
    let colour = folder.path().join("colour.png");
    ::image::RgbImage::new(2, 2).save(&colour).unwrap();
    assert!(
        load_raw(&colour)
            .unwrap_err()
            .to_string()
            .contains("a colour picture of 8 bits a sample, not digital numbers")
    );
}

/// Errors about a TIFF use the terms of the file.
#[test]
fn errors_say_why_a_tiff_file_is_not_a_frame() {
    use tiff::encoder::{TiffEncoder, colortype};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.tiff");
    let says = || load_raw(&path).unwrap_err().to_string();

    save_raw_alone(&frame(60, 100, 12), &path, RawFormat::Tiff).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for kept in [9000, 4, whole.len() - 30] {
        std::fs::write(&path, &whole[..kept]).unwrap();
        let error = says();
        assert!(
            error.contains("frame.tiff: cut off: ") && error.contains("copy the file again"),
            "{kept}: {error}"
        );
    }

    let write = |encode: &dyn Fn(&mut TiffEncoder<std::fs::File>)| {
        encode(&mut TiffEncoder::new(std::fs::File::create(&path).unwrap()).unwrap());
    };
    write(&|tiff| tiff.write_image::<colortype::Gray32Float>(2, 1, &[0.5, 1.0]).unwrap());
    assert!(
        says().contains("floating-point samples of 32 bits (SampleFormat 3); hint: a raw frame is"),
        "{}",
        says()
    );
    write(&|tiff| tiff.write_image::<colortype::GrayI16>(2, 2, &[1, 1, 5, -1]).unwrap());
    assert!(
        says().contains("the value -1 at row 1, column 1 is no digital number: it is below 0"),
        "{}",
        says()
    );
    // Software writes digital numbers as signed ones, too.
    write(&|tiff| tiff.write_image::<colortype::GrayI32>(2, 1, &[0, 3000]).unwrap());
    assert_eq!(load_raw(&path).unwrap().dn, [0, 3000]);
    write(&|tiff| tiff.write_image::<colortype::GrayI16>(2, 1, &[7, i16::MAX]).unwrap());
    assert_eq!(load_raw(&path).unwrap().dn, [7, 32_767]);
    write(&|tiff| tiff.write_image::<colortype::RGB8>(1, 1, &[1, 2, 3]).unwrap());
    assert!(says().contains("a colour picture of 8 bits a sample, not digital numbers"), "{}", says());

    // Each page is a frame; a thumbnail is not.
    write(&|tiff| {
        tiff.write_image::<colortype::Gray16>(2, 1, &[1, 2]).unwrap();
        let mut thumbnail = tiff.new_image::<colortype::Gray8>(1, 1).unwrap();
        thumbnail.encoder().write_tag(tiff::tags::Tag::NewSubfileType, 1u32).unwrap();
        thumbnail.write_data(&[7]).unwrap();
    });
    assert_eq!((page_count(&path).unwrap(), load_raw(&path).unwrap().dn), (1, vec![1, 2]));
    write(&|tiff| {
        tiff.write_image::<colortype::Gray16>(2, 1, &[1, 2]).unwrap();
        tiff.write_image::<colortype::Gray16>(1, 2, &[3, 4]).unwrap();
    });
    assert!(says().contains("a TIFF file of 2 pages"), "{}", says());
    assert_eq!(page_count(&path).unwrap(), 2);
    let second = load_raw_page(&path, 1).unwrap();
    assert_eq!((second.height, second.width, second.dn), (2, 1, vec![3, 4]));
    assert!(load_raw_page(&path, 2).unwrap_err().to_string().contains("page 3 was requested"));
}

/// Damaged files cause no panic, no huge allocation and no endless loop. `PETZVAL_MUTATIONS` sets their number.
#[test]
fn damaged_files_are_errors_or_frames() {
    use rand::{RngExt, SeedableRng};
    let mutations: usize =
        std::env::var("PETZVAL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let folder = tempfile::tempdir().unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let good = frame(6, 10, 12);
    let mut files: Vec<(RawFormat, Vec<u8>)> = Vec::new();
    for format in [RawFormat::Tiff, RawFormat::Png, RawFormat::Npy] {
        let path = folder.path().join(format!("frame.{}", format.extension()));
        save_raw(&good, &path, format).unwrap();
        files.push((format, std::fs::read(&path).unwrap()));
    }
    let (mut frames, mut errors) = (0, 0);
    for i in 0..mutations {
        let (format, bytes) = &files[i % files.len()];
        let mut bytes = bytes.clone();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..bytes.len());
            match rng.random_range(0..5) {
                0 => bytes[at] = rng.random(),
                1 => bytes[at] ^= 1 << rng.random_range(0..8),
                2 => bytes[at..].iter_mut().take(4).for_each(|b| *b = 0xff),
                3 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, rng.random()),
            }
        }
        let read = match format {
            RawFormat::Npy => npy::decode(&bytes),
            _ => picture::decode(&bytes),
        };
        match read.map(AnyFrame::widened) {
            Ok(frame) => {
                assert_eq!(frame.dn.len(), frame.height * frame.width);
                assert!(frame.dn.len() <= 4096 * bytes.len());
                frames += 1;
            }
            Err(error) => {
                assert!(!error.reason.is_empty() && !error.hint.is_empty());
                errors += 1;
            }
        }
    }
    // Damage to the numbers gives another frame, damage to the header an error; both must occur.
    assert!(frames > 0 && errors > 0, "{frames} frames, {errors} errors");
}
