//! Checks the picture directories of a TIFF file before data are read or memory is allocated according to them.

/// Largest expansion of a byte of a DNG, bytes: a pixel of lossless JPEG takes at least a bit, deflate reaches a thousand.
const MOST_EXPANSION: u64 = 4096;

/// Largest number of directories in a file; cameras write a few.
const MOST_DIRECTORIES: usize = 64;

/// Tags that hold offsets of further directories: SubIFDs, Exif, GPS, interoperability.
const POINTERS: [u16; 4] = [330, 34665, 34853, 40965];

const WIDTH: u16 = 256;
const HEIGHT: u16 = 257;
const SAMPLES: u16 = 277;
const TILE_WIDTH: u16 = 322;
const TILE_HEIGHT: u16 = 323;
const DNG_VERSION: u16 = 50706;

/// Bytes of a value, by the number of its type. Types unknown to TIFF count as bytes.
fn value_bytes(kind: u16) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 => 8,
        _ => 1,
    }
}

/// Reads numbers of a TIFF file in its byte order.
struct Numbers<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl Numbers<'_> {
    fn at<const N: usize>(&self, at: u64) -> Option<[u8; N]> {
        let at = usize::try_from(at).ok()?;
        self.bytes.get(at..at.checked_add(N)?)?.try_into().ok()
    }

    fn u16(&self, at: u64) -> Option<u16> {
        let bytes = self.at(at)?;
        Some(if self.little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn u32(&self, at: u64) -> Option<u32> {
        let bytes = self.at(at)?;
        Some(if self.little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }
}

/// Checks that the chain of directories ends, that values are not longer than the file, and that pictures are not larger
/// than the file's bytes can expand to. Returns the number of directories in the main chain.
pub(super) fn check(bytes: &[u8]) -> Result<usize, String> {
    let numbers = match bytes.get(..4) {
        Some(b"II*\0") => Numbers { bytes, little: true },
        Some(b"MM\0*") => Numbers { bytes, little: false },
        _ => return Err("the file is not a TIFF file, and so not a DNG".to_owned()),
    };
    let most_pixels = MOST_EXPANSION.saturating_mul(bytes.len() as u64).min(super::super::frame::MOST_PIXELS);
    let cut = || "the file ends in its header".to_owned();
    let first = numbers.u32(4).ok_or_else(cut)?;
    let (mut chain, mut seen, mut is_dng) = (0, 0, false);
    // Offsets of directories that are still to be checked, and whether each is in the main chain.
    let mut open = vec![(first, true)];
    while let Some((place, chained)) = open.pop() {
        seen += 1;
        chain += usize::from(chained);
        if seen > MOST_DIRECTORIES {
            return Err("more picture directories than any camera writes, or they run in a circle".to_owned());
        }
        let Some(entries) = numbers.u16(u64::from(place)) else { continue };
        let start = u64::from(place) + 2;
        // Read the entries of the directory: picture size, and offsets of further directories.
        let (mut sides, mut tile, mut samples) = ([0, 0], [0, 0], 1);
        for entry in 0..u64::from(entries) {
            let at = start + 12 * entry;
            let (Some(tag), Some(kind), Some(count)) =
                (numbers.u16(at), numbers.u16(at + 2), numbers.u32(at + 4))
            else {
                break;
            };
            let length = value_bytes(kind) * u64::from(count);
            if length > bytes.len() as u64 {
                return Err(format!("tag {tag} has {count} values, more than the file holds"));
            }
            let inside = length <= 4;
            let value = match (kind, inside) {
                (3 | 8, true) => numbers.u16(at + 8).map(u32::from),
                (_, true) => numbers.u32(at + 8),
                (_, false) => numbers.u32(at + 8).and_then(|far| numbers.u32(u64::from(far))),
            };
            let value = u64::from(value.unwrap_or(0));
            match tag {
                WIDTH => sides[0] = value,
                HEIGHT => sides[1] = value,
                TILE_WIDTH => tile[0] = value,
                TILE_HEIGHT => tile[1] = value,
                SAMPLES => samples = value,
                DNG_VERSION => is_dng |= chained,
                _ if POINTERS.contains(&tag) => {
                    let far = numbers.u32(at + 8).map_or(0, u64::from);
                    let from = if inside { at + 8 } else { far };
                    for i in 0..u64::from(count).min(MOST_DIRECTORIES as u64 + 1) {
                        open.extend(numbers.u32(from + 4 * i).map(|place| (place, false)));
                    }
                }
                _ => {}
            }
        }
        // Compare the size of picture and tile with the file, then follow the chain.
        for [width, height] in [sides, tile] {
            let pixels = width.checked_mul(height).and_then(|n| n.checked_mul(samples.max(1)));
            if pixels.is_none_or(|pixels| pixels > most_pixels) {
                return Err(format!("{width} x {height} pixels in a file of {} bytes", bytes.len()));
            }
        }
        if chained && let Some(next) = numbers.u32(start + 12 * u64::from(entries)).filter(|next| *next != 0)
        {
            open.push((next, true));
        }
    }
    if is_dng { Ok(chain) } else { Err("the file has no DNG version: it is another kind of TIFF".to_owned()) }
}
