//! A frame of digital numbers, and the limits of its size.

use super::info::{RawInfo, largest_dn};
use crate::picture_file::MOST_PICTURE_BYTES;
use petzval_camera::sensor::{Raw, SensorModel};

/// Largest number of pixels of a frame, 2^28: 512 MiB of digital numbers.
pub(crate) const MOST_PIXELS: u64 = 1 << 28;

/// Largest number of bytes to which a byte of a file can expand: LZW with codes of 12 bits stays below, deflate far below.
pub(super) const MOST_EXPANSION: u64 = 4096;

/// Memory that a decoder may use in addition to the picture, bytes.
pub(super) const WORK_SPACE: u64 = 1 << 20;

/// Bytes that a pixel of a frame takes at the end of its reading, when its numbers of 16 bits become numbers of 32.
const WIDENING_BYTES: u64 = 6;

/// Refuses a frame of so many columns and rows whose reading takes more memory than that of a picture may: `held_bytes` of its file, and
/// `decoding_bytes` for each pixel as long as the file is held.
pub(super) fn check_memory(
    (width, height): (u64, u64),
    held_bytes: u64,
    decoding_bytes: u64,
) -> Result<(), Unreadable> {
    let pixels = width.saturating_mul(height);
    let decoding = held_bytes.saturating_add(pixels.saturating_mul(decoding_bytes));
    let bytes = decoding.max(pixels.saturating_mul(WIDENING_BYTES));
    if bytes <= MOST_PICTURE_BYTES {
        return Ok(());
    }
    let reason = format!(
        "the frame of {width} x {height} pixels takes {:.1} GB of memory to read, and at most {:.0} GB are used",
        bytes as f64 / 1e9,
        MOST_PICTURE_BYTES as f64 / 1e9
    );
    Err(Unreadable { reason, hint: "cut it into parts" })
}

/// A frame of digital numbers with its metadata. Numbers of up to 24 bits are `u32`.
#[derive(Debug, Clone, PartialEq)]
pub struct RawFrame<T = u16> {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Digital numbers, row by row.
    pub dn: Vec<T>,
    /// Camera and exposure, from the file and its sidecar.
    pub info: RawInfo,
}

impl RawFrame {
    /// The frame in numbers of 32 bits.
    pub fn widened(self) -> RawFrame<u32> {
        let Self { height, width, dn, info } = self;
        RawFrame { height, width, dn: dn.into_iter().map(u32::from).collect(), info }
    }

    /// A simulated frame with the metadata of its sensor and exposure. Digital numbers are rounded, because a simulation
    /// without noise gives fractions, and clipped to 0..65535.
    pub fn from_raw(raw: &Raw, sensor: &SensorModel) -> Self {
        let (exposure, placement) = (&raw.capture.exposure, &raw.capture.placement);
        Self {
            height: raw.height,
            width: raw.width,
            dn: raw.dn.iter().map(|v| v.round().clamp(0.0, 65535.0) as u16).collect(),
            info: RawInfo {
                sensor: Some(sensor.name.clone()),
                bits: Some(sensor.bits),
                // A window of the sensor may begin anywhere in its mosaic.
                cfa: Some(sensor.cfa.starting_at(placement.row, placement.col)),
                black_level_dn: Some(sensor.black_level_dn),
                black_tile_dn: None,
                // The lowest saturated whole number.
                white_level_dn: Some(sensor.white_level_dn(shortest(exposure.linear_gain)).floor()),
                exposure_s: Some(shortest(exposure.time_s)),
                linear_gain: Some(shortest(exposure.linear_gain)),
                pixel_um: Some(sensor.pixel_um),
                temperature_c: None,
                orientation: None,
                companding: None,
                calibration: None,
            },
        }
    }
}

impl RawFrame<u32> {
    /// The same frame in numbers of 16 bits, if they fit.
    pub fn in_16_bits(self) -> Option<RawFrame> {
        match AnyFrame::of(self) {
            AnyFrame::Narrow(frame) => Some(frame),
            AnyFrame::Wide(_) => None,
        }
    }
}

impl<T: Copy + Into<u32>> RawFrame<T> {
    /// The first digital number that `bits` cannot hold: its row, column and value.
    pub fn beyond(&self, bits: u32) -> Option<(usize, usize, u32)> {
        self.first_above(largest_dn(bits))
    }

    /// The first digital number above another: its row, column and value.
    pub(super) fn first_above(&self, most: u32) -> Option<(usize, usize, u32)> {
        let at = self.dn.iter().position(|dn| (*dn).into() > most)?;
        Some((at / self.width, at % self.width, self.dn[at].into()))
    }
}

/// A frame as a file holds it.
pub(super) enum AnyFrame {
    /// Every number fits in 16 bits.
    Narrow(RawFrame),
    /// Some do not.
    Wide(RawFrame<u32>),
}

impl AnyFrame {
    /// A frame of numbers of any size.
    pub fn of(RawFrame { height, width, dn, info }: RawFrame<u32>) -> Self {
        if dn.iter().all(|dn| *dn <= u16::MAX.into()) {
            let dn = dn.into_iter().map(|dn| dn as u16).collect();
            Self::Narrow(RawFrame { height, width, dn, info })
        } else {
            Self::Wide(RawFrame { height, width, dn, info })
        }
    }

    /// The frame in numbers of 32 bits.
    pub fn widened(self) -> RawFrame<u32> {
        match self {
            Self::Narrow(frame) => frame.widened(),
            Self::Wide(frame) => frame,
        }
    }
}

/// The shortest decimal of a 32-bit float: 0.005 and not 0.004999999888.
pub fn shortest(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

/// Why bytes cannot be decoded to a frame, or a frame cannot be encoded; the caller adds the file.
pub(super) struct Unreadable {
    pub reason: String,
    pub hint: &'static str,
}
