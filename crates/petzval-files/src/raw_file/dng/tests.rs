//! Reads DNG files that the tests write byte by byte: 16-bit mosaics, uncompressed and losslessly compressed, with the tags of
//! the specification.

use super::super::{load_raw, sidecar_path};
use super::*;

/// A directory entry: tag, type, count, and its values as bytes in the file's byte order.
type Entry = (u16, u16, u32, Vec<u8>);

fn short(tag: u16, values: &[u16]) -> Entry {
    (tag, 3, values.len() as u32, values.iter().flat_map(|v| v.to_le_bytes()).collect())
}

fn long(tag: u16, values: &[u32]) -> Entry {
    (tag, 4, values.len() as u32, values.iter().flat_map(|v| v.to_le_bytes()).collect())
}

fn bytes_of(tag: u16, kind: u16, values: &[u8]) -> Entry {
    (tag, kind, values.len() as u32, values.to_vec())
}

/// A little-endian TIFF of one directory with uncompressed pixels.
fn tiff(dn: &[u16], entries: Vec<Entry>) -> Vec<u8> {
    let pixels: Vec<u8> = dn.iter().flat_map(|v| v.to_le_bytes()).collect();
    tiff_of_strip(&pixels, entries)
}

/// A little-endian TIFF of one directory: header, one strip of pixels, long values, directory.
fn tiff_of_strip(pixels: &[u8], mut entries: Vec<Entry>) -> Vec<u8> {
    let mut file = b"II*\0\0\0\0\0".to_vec();
    let strip = file.len() as u32;
    file.extend(pixels);
    file.resize(file.len().next_multiple_of(2), 0);
    entries.push(long(273, &[strip]));
    entries.push(long(279, &[pixels.len() as u32]));
    entries.sort_by_key(|(tag, ..)| *tag);
    let mut directory = (entries.len() as u16).to_le_bytes().to_vec();
    for (tag, kind, count, mut value) in entries {
        if value.len() > 4 {
            let place = file.len() as u32;
            file.append(&mut value);
            value = place.to_le_bytes().to_vec();
        }
        value.resize(4, 0);
        directory.extend(tag.to_le_bytes().into_iter().chain(kind.to_le_bytes()).chain(count.to_le_bytes()));
        directory.append(&mut value);
    }
    directory.extend([0; 4]);
    let place = file.len() as u32;
    file[4..8].copy_from_slice(&place.to_le_bytes());
    file.append(&mut directory);
    file
}

/// Tags of a mosaic of 6 rows and 8 columns: GBRG, black 119, white 4095; compression 1 is none, 7 lossless JPEG.
fn mosaic_tags(compression: u16) -> Vec<Entry> {
    vec![
        long(254, &[0]),
        long(256, &[8]),
        long(257, &[6]),
        short(258, &[16]),
        short(259, &[compression]),
        short(262, &[32803]),
        bytes_of(271, 2, b"Petzval\0"),
        bytes_of(272, 2, b"Test\0"),
        short(277, &[1]),
        long(278, &[6]),
        short(33421, &[2, 2]),
        bytes_of(33422, 1, &[1, 2, 0, 1]),
        bytes_of(50706, 1, &[1, 4, 0, 0]),
        bytes_of(50708, 2, b"Petzval Test\0"),
        short(50714, &[119]),
        short(50717, &[4095]),
    ]
}

/// The mosaic of [`mosaic_tags`], uncompressed, with an active area if given (top, left, bottom, right).
fn dng(active: Option<[u32; 4]>) -> (Vec<u16>, Vec<u8>) {
    let dn: Vec<u16> = (0..48).map(|i| 119 + 83 * i).collect();
    let mut entries = mosaic_tags(1);
    entries.extend(active.map(|area| long(50829, &area)));
    let file = tiff(&dn, entries);
    (dn, file)
}

#[test]
fn a_mosaic_is_read_with_its_tags() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.dng");
    let (dn, file) = dng(None);
    std::fs::write(&path, &file).unwrap();
    let frame = load_raw(&path).unwrap();
    assert_eq!((frame.height, frame.width, &frame.dn), (6, 8, &dn));
    assert_eq!(frame.info.cfa, Some(CfaPattern::GBRG));
    assert_eq!((frame.info.black_level_dn, frame.info.white_level_dn), (Some(119.0), Some(4095.0)));
    assert_eq!((frame.info.bits, frame.info.sensor.as_deref()), (Some(16), Some("Petzval Test")));

    // A sidecar overrides the file and adds values that the file lacks.
    std::fs::write(sidecar_path(&path), "bits = 12\nblack_level_dn = 120.5\npixel_um = 5.86\n").unwrap();
    let info = load_raw(&path).unwrap().info;
    assert_eq!((info.bits, info.black_level_dn, info.pixel_um), (Some(12), Some(120.5), Some(5.86)));
}

/// Noise in the numbers exercises differences of every length. The encoder is that of the reader's crate.
#[test]
fn a_losslessly_compressed_mosaic_is_read_to_the_bit() {
    let dn: Vec<u16> = (0..48u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as u16).collect();
    let encoder = rawler::ljpeg92::LjpegCompressor::new(&dn, 8, 6, 1, 16, 1, 0, 0).unwrap();
    let file = tiff_of_strip(&encoder.encode().unwrap(), mosaic_tags(7));
    let frame = decode(&file).map_err(|e| e.reason).unwrap();
    assert_eq!((frame.height, frame.width, &frame.dn), (6, 8, &dn));
    assert_eq!((frame.info.cfa, frame.info.white_level_dn), (Some(CfaPattern::GBRG), Some(4095.0)));
}

#[test]
fn masked_borders_are_cropped_and_the_mosaic_starts_in_the_active_area() {
    let (dn, file) = dng(Some([1, 3, 5, 8]));
    let frame = decode(&file).map_err(|e| e.reason).unwrap();
    assert_eq!((frame.height, frame.width), (4, 5));
    assert_eq!(frame.dn[..5], dn[8 + 3..8 + 8]);
    assert_eq!(frame.info.cfa, Some(CfaPattern::GBRG));
}

#[test]
fn impossible_directories_are_refused_before_pixels_are_read() {
    let says = |file: &[u8]| decode(file).unwrap_err().reason;
    assert!(says(b"no TIFF").contains("not a TIFF"));
    assert!(says(&tiff(&[0; 4], vec![long(256, &[2]), long(257, &[2])])).contains("no DNG version"));
    let vast = vec![long(256, &[60_000]), long(257, &[60_000]), bytes_of(50706, 1, &[1, 4, 0, 0])];
    assert!(says(&tiff(&[0; 4], vast)).contains("60000 x 60000 pixels"));
    let mut circle = dng(None).1;
    let (end, start) = (circle.len() - 4, circle[4..8].to_vec());
    circle[end..].copy_from_slice(&start);
    assert!(says(&circle).contains("circle"));
    let mut endless = dng(None).1;
    let count = end - 12 + 4;
    endless[count..count + 4].fill(0xff);
    assert!(says(&endless).contains("more than the file holds"));
}

/// Damaged files cause neither panics nor endless loops.
#[test]
fn damaged_files_are_errors_or_frames() {
    use rand::{RngExt, SeedableRng};
    let mutations: usize =
        std::env::var("PETZVAL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(5_000);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
    let (_, good) = dng(Some([1, 3, 5, 8]));
    let (mut frames, mut errors) = (0, 0);
    for _ in 0..mutations {
        let mut bytes = good.clone();
        for _ in 0..rng.random_range(1..4) {
            // The pixels are half of the file; damage the directory behind them more often.
            let from = if rng.random() { 0 } else { 104.min(bytes.len() - 1) };
            let at = rng.random_range(from..bytes.len());
            match rng.random_range(0..5) {
                0 => bytes[at] = rng.random(),
                1 => bytes[at] ^= 1 << rng.random_range(0..8),
                2 => bytes[at..].iter_mut().take(4).for_each(|b| *b = 0xff),
                3 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, rng.random()),
            }
        }
        match decode(&bytes) {
            Ok(frame) => {
                assert_eq!(frame.dn.len(), frame.height * frame.width);
                frames += 1;
            }
            Err(_) => errors += 1,
        }
    }
    assert!(frames > 0 && errors > 0, "{frames} frames, {errors} errors");
}
