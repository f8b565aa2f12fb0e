//! Raw frames from Adobe Digital Negatives, read by the crate `rawler` (LGPL 2.1, hence behind a cargo feature).

mod directories;

use std::panic::{AssertUnwindSafe, catch_unwind};

use rawler::decoders::dng::DngDecoder;
use rawler::decoders::{Decoder, RawDecodeParams};
use rawler::formats::tiff::GenericTiffReader;
use rawler::rawimage::{RawImage, RawPhotometricInterpretation};
use rawler::rawsource::RawSource;
use rawler::{CFA, Orientation, RawImageData};

use super::frame::{RawFrame, Unreadable};
use super::info::RawInfo;
use petzval_camera::sensor::CfaPattern;

const HINT: &str = "give a DNG with one mosaicked or monochrome frame of digital numbers";

/// Reads the active area of the frame, without masked borders.
pub(super) fn decode(bytes: &[u8]) -> Result<RawFrame, Unreadable> {
    let unreadable = |reason: String| Unreadable { reason, hint: HINT };
    let chain = directories::check(bytes).map_err(unreadable)?;
    // The reader panics on some damaged files.
    let read = catch_unwind(AssertUnwindSafe(|| read(bytes, chain)));
    let (image, exposure_s) =
        read.unwrap_or_else(|_| Err("the reader of DNG files failed".to_owned())).map_err(unreadable)?;
    if image.cpp != 1 {
        return Err(unreadable(format!("{} numbers per pixel: the frame is no longer a mosaic", image.cpp)));
    }
    let RawImageData::Integer(dn) = &image.data else {
        return Err(unreadable("the frame has floating-point values, not digital numbers".to_owned()));
    };
    if dn.is_empty() || dn.len() != image.height * image.width {
        return Err(unreadable(format!("{} numbers in {} x {} pixels", dn.len(), image.width, image.height)));
    }

    // Crop to the active area, where the file's mosaic begins.
    let (top, left, height, width) = match image.active_area {
        Some(area) => (area.p.y, area.p.x, area.d.h, area.d.w),
        None => (0, 0, image.height, image.width),
    };
    let fits =
        |start: usize, size: usize, all: usize| size > 0 && start.checked_add(size).is_some_and(|e| e <= all);
    if !fits(top, height, image.height) || !fits(left, width, image.width) {
        let reason =
            format!("an active area of {width} x {height} at row {top}, column {left} of a smaller frame");
        return Err(unreadable(reason));
    }
    let rows = dn.chunks_exact(image.width).skip(top).take(height);
    let active = rows.flat_map(|row| &row[left..left + width]).copied().collect();
    let info = RawInfo { exposure_s, ..info(&image, top, left) };
    Ok(RawFrame { height, width, dn: active, info })
}

/// The frame and its exposure time, s.
fn read(bytes: &[u8], chain: usize) -> Result<(RawImage, Option<f64>), String> {
    let source = RawSource::new_from_slice(bytes);
    let tiff =
        GenericTiffReader::new(&mut source.reader(), 0, 0, Some(chain), &[]).map_err(|e| e.to_string())?;
    let decoder = DngDecoder::new(&source, tiff, rawler::global_loader()).map_err(|e| e.to_string())?;
    let params = RawDecodeParams::default();
    let image = decoder.raw_image(&source, &params, false).map_err(|e| e.to_string())?;
    let time = decoder.raw_metadata(&source, &params).ok().and_then(|data| data.exif.exposure_time);
    let seconds = time.map(|t| f64::from(t.n) / f64::from(t.d)).filter(|s| (0.0..=1e6).contains(s));
    Ok((image, seconds))
}

/// Sensor and levels from the tags. If a number is out of range, only the mosaic is kept.
fn info(image: &RawImage, top: usize, left: usize) -> RawInfo {
    let cfa = match &image.photometric {
        RawPhotometricInterpretation::Cfa(config) => mosaic(&config.cfa, top, left),
        RawPhotometricInterpretation::BlackIsZero => Some(CfaPattern::MONO),
        RawPhotometricInterpretation::LinearRaw => None,
    };
    let levels = &image.blacklevel.levels;
    let black = levels.iter().map(|level| f64::from(level.n) / f64::from(level.d.max(1))).sum::<f64>();
    let white = image.whitelevel.0.first().map(|level| f64::from(*level));
    let name = format!("{} {}", image.make, image.model);
    let info = RawInfo {
        sensor: Some(name.trim().to_owned()).filter(|name| !name.is_empty()),
        bits: (1..=16).contains(&image.bps).then_some(image.bps as u32),
        cfa,
        black_level_dn: (!levels.is_empty()).then(|| black / levels.len() as f64),
        black_tile_dn: black_tile(image, cfa),
        white_level_dn: white,
        orientation: (2..=8).find(|exif| Orientation::from_u16(u16::from(*exif)) == image.orientation),
        ..RawInfo::default()
    };
    if info.validate().is_ok() { info } else { RawInfo { cfa: info.cfa, ..RawInfo::default() } }
}

/// The black level of each pixel of the mosaic's tile, from the first pixel of the active area, where they differ. The file's levels repeat
/// from the corner of the active area (DNG 1.7, BlackLevelRepeatDim).
fn black_tile(image: &RawImage, cfa: Option<CfaPattern>) -> Option<Vec<f64>> {
    let cfa = cfa?;
    let black = &image.blacklevel;
    let (rows, cols, planes) = (black.height, black.width, black.cpp.max(1));
    let level = |row: usize, col: usize| {
        let level = black.levels.get((row % rows * cols + col % cols) * planes)?;
        Some(f64::from(level.n) / f64::from(level.d.max(1)))
    };
    let is_whole = rows > 0 && cols > 0 && cfa.rows().is_multiple_of(rows) && cfa.cols().is_multiple_of(cols);
    if !is_whole {
        return None;
    }
    let tile: Option<Vec<f64>> =
        (0..cfa.rows() * cfa.cols()).map(|i| level(i / cfa.cols(), i % cfa.cols())).collect();
    tile.filter(|tile| tile.iter().any(|dn| *dn != tile[0]))
}

/// The mosaic from the first pixel of the active area. The reader has shifted the file's mosaic by the position of that
/// area; shifting it on to a whole tile undoes this.
fn mosaic(cfa: &CFA, top: usize, left: usize) -> Option<CfaPattern> {
    let (rows, cols) = (cfa.height, cfa.width);
    if rows == 0 || cols == 0 {
        return None;
    }
    let whole = |offset: usize, side: usize| (side - offset % side) % side;
    let moved = cfa.shift(whole(left, cols), whole(top, rows));
    // Colours are the numbers 0, 1, 2 for red, green, blue; other filters are not supported.
    let letter = |row, col| ['R', 'G', 'B'].get(moved.color_at(row, col)).copied();
    let row = |row| (0..cols).map(|col| letter(row, col)).collect::<Option<String>>();
    (0..rows).map(row).collect::<Option<Vec<_>>>()?.join("/").parse().ok()
}

#[cfg(test)]
mod tests;
