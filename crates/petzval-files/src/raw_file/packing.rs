//! Packed digital numbers: pixels of 1 to 16 bits in consecutive bytes.
//!
//! ```text
//! mipi   8 bits: a byte. 10, 12, 14 bits: a group of 4, 2, 4 pixels; first the upper 8 bits of each pixel, a byte each,
//!        then the lower bits of all of them, the first pixel in the lowest bits (MIPI CSI-2: RAW10, RAW12, RAW14)
//! lsb    bit j of pixel i is bit (i bits + j) of the row, counted from the lowest bit of the row's first byte
//!        (GenICam PFNC: Mono10p, Mono12p)
//! u16le  two bytes a pixel, the lower one first
//! u16be  two bytes a pixel, the upper one first
//! ```
//!
//! Every row starts at a new byte.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::frame::MOST_PIXELS;
use super::info::largest_dn;

/// Arrangement of digital numbers in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Packing {
    /// MIPI CSI-2: 8, 10, 12 or 14 bits.
    Mipi,
    /// Contiguous bits from the lowest on: 1 to 16 bits.
    Lsb,
    /// Two bytes, the lower one first.
    U16le,
    /// Two bytes, the upper one first.
    U16be,
}

impl Packing {
    /// The usual packing for a number of bits: MIPI for 8, 10, 12 and 14, two bytes from 16 on, else contiguous bits.
    pub fn for_bits(bits: u32) -> Self {
        match bits {
            8 | 10 | 12 | 14 => Self::Mipi,
            16.. => Self::U16le,
            _ => Self::Lsb,
        }
    }

    /// The name in a sidecar.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mipi => "mipi",
            Self::Lsb => "lsb",
            Self::U16le => "u16le",
            Self::U16be => "u16be",
        }
    }
}

/// Layout of the digital numbers in a packed file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PackedLayout {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Bits per pixel.
    pub bits: u32,
    /// Arrangement in bytes.
    pub packing: Packing,
    /// Bytes from the start of a row to the start of the next.
    pub row_stride_bytes: usize,
    /// Bytes in front of the first row.
    pub header_bytes: usize,
    /// Bytes behind the last row.
    pub footer_bytes: usize,
}

/// Why a layout or a frame cannot be packed or unpacked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PackingError {
    /// The packing does not support this number of bits.
    #[error("the packing {} has no {bits} bits per pixel, only {}", packing.name(), allowed(*packing))]
    Bits {
        /// The packing.
        packing: Packing,
        /// The requested bits.
        bits: u32,
    },
    /// Rows overlap.
    #[error("a row of {width} pixels takes {needed} bytes, but the next row begins after {stride}")]
    Stride {
        /// Columns.
        width: usize,
        /// Bytes of a row.
        needed: usize,
        /// Bytes between rows.
        stride: usize,
    },
    /// The frame has no pixels, or too many.
    #[error("{width} x {height} pixels: a frame has at least one pixel and at most 2^28")]
    Size {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// The length of the file contradicts its layout.
    #[error("the file has {got} bytes, but {width} x {height} pixels of {bits} bits as {} take {needed}", packing.name())]
    Length {
        /// Bytes of the file.
        got: usize,
        /// Bytes that the layout takes.
        needed: usize,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// Bits per pixel.
        bits: u32,
        /// The packing.
        packing: Packing,
    },
    /// A number does not fit in the bits.
    #[error("the value {dn} at row {row}, column {col} does not fit in {bits} bits")]
    Value {
        /// Row.
        row: usize,
        /// Column.
        col: usize,
        /// The digital number.
        dn: u16,
        /// Bits per pixel.
        bits: u32,
    },
}

/// The numbers of bits that a packing supports, in words.
fn allowed(packing: Packing) -> &'static str {
    match packing {
        Packing::Mipi => "8, 10, 12 and 14",
        Packing::Lsb | Packing::U16le | Packing::U16be => "1 to 16",
    }
}

/// Pixels and bytes of an independent group.
fn group(bits: u32, packing: Packing) -> (usize, usize) {
    match (packing, bits) {
        (Packing::Mipi, 10) => (4, 5),
        (Packing::Mipi, 12) => (2, 3),
        (Packing::Mipi, 14) => (4, 7),
        (Packing::Mipi, _) => (1, 1),
        (Packing::Lsb, bits) => (8, bits as usize),
        (Packing::U16le | Packing::U16be, _) => (1, 2),
    }
}

/// Bytes of a row. An incomplete last group takes a whole group in `mipi`; in `lsb` it ends with the last byte that holds a
/// bit.
fn row_bytes(width: usize, bits: u32, packing: Packing) -> usize {
    let (pixels, bytes) = group(bits, packing);
    match packing {
        Packing::Lsb => width.saturating_mul(bits as usize).div_ceil(8),
        _ => width.div_ceil(pixels).saturating_mul(bytes),
    }
}

impl PackedLayout {
    /// The layout without gaps, header and footer.
    pub fn tight(height: usize, width: usize, bits: u32, packing: Packing) -> Self {
        let row_stride_bytes = row_bytes(width, bits, packing);
        Self { height, width, bits, packing, row_stride_bytes, header_bytes: 0, footer_bytes: 0 }
    }

    /// Checks that the layout is possible, and returns the size of the file in bytes.
    pub fn file_bytes(&self) -> Result<usize, PackingError> {
        let &Self { height, width, bits, packing, row_stride_bytes: stride, .. } = self;
        let fits = match packing {
            Packing::Mipi => [8, 10, 12, 14].contains(&bits),
            _ => (1..=16).contains(&bits),
        };
        if !fits {
            return Err(PackingError::Bits { packing, bits });
        }
        let size = PackingError::Size { height, width };
        let pixels = (height as u64).checked_mul(width as u64).ok_or(size.clone())?;
        if pixels == 0 || pixels > MOST_PIXELS {
            return Err(size);
        }
        let needed = row_bytes(width, bits, packing);
        if stride < needed {
            return Err(PackingError::Stride { width, needed, stride });
        }
        let rows = stride.checked_mul(height).ok_or(size.clone())?;
        let framed = rows.checked_add(self.header_bytes).and_then(|n| n.checked_add(self.footer_bytes));
        framed.ok_or(size)
    }
}

/// Checks the length of a packed file. The padding after the last row may be missing.
pub(super) fn check_length(layout: &PackedLayout, got: u64) -> Result<(), PackingError> {
    let &PackedLayout { height, width, bits, packing, row_stride_bytes: stride, .. } = layout;
    let needed = layout.file_bytes()?;
    let unpadded = needed - (stride - row_bytes(width, bits, packing));
    if got == needed as u64 || got == unpadded as u64 {
        return Ok(());
    }
    let got = usize::try_from(got).unwrap_or(usize::MAX);
    Err(PackingError::Length { got, needed, height, width, bits, packing })
}

/// The digital numbers of a packed file.
///
/// The file must have exactly the bytes of its layout, except that the padding after the last row may be missing.
pub(super) fn unpack(layout: &PackedLayout, bytes: &[u8]) -> Result<Vec<u16>, PackingError> {
    let &PackedLayout { height, width, bits, packing, row_stride_bytes: stride, .. } = layout;
    check_length(layout, bytes.len() as u64)?;
    let row = row_bytes(width, bits, packing);
    let mut dn = Vec::with_capacity(height * width);
    let max = largest_dn(bits);
    for r in 0..height {
        let start = layout.header_bytes + r * stride;
        unpack_row(&bytes[start..start + row], width, bits, packing, &mut dn);
        // A number in two bytes may exceed the bits of the converter: the layout is wrong then.
        let line = &dn[r * width..];
        if let Some(col) = line.iter().position(|v| u32::from(*v) > max) {
            return Err(PackingError::Value { row: r, col, dn: line[col], bits });
        }
    }
    Ok(dn)
}

fn unpack_row(row: &[u8], width: usize, bits: u32, packing: Packing, dn: &mut Vec<u16>) {
    match packing {
        Packing::U16le => dn.extend(row.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]))),
        Packing::U16be => dn.extend(row.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]]))),
        Packing::Lsb => {
            let (mut held, mut count) = (0u32, 0);
            let mut bytes = row.iter();
            for _ in 0..width {
                while count < bits {
                    held |= u32::from(*bytes.next().unwrap_or(&0)) << count;
                    count += 8;
                }
                dn.push((held & largest_dn(bits)) as u16);
                held >>= bits;
                count -= bits;
            }
        }
        Packing::Mipi => {
            let (pixels, size) = group(bits, packing);
            let low = bits - 8;
            for (g, bytes) in row.chunks_exact(size).enumerate() {
                let tail = bytes[pixels..].iter().rev().fold(0u32, |all, b| all << 8 | u32::from(*b));
                for (i, upper) in bytes[..pixels.min(width - g * pixels)].iter().enumerate() {
                    let lower = tail >> (i as u32 * low) & ((1 << low) - 1);
                    dn.push((u32::from(*upper) << low | lower) as u16);
                }
            }
        }
    }
}

/// The bytes of a frame in a layout. Padding, header and footer are zero.
pub(super) fn pack(layout: &PackedLayout, dn: &[u16]) -> Result<Vec<u8>, PackingError> {
    let &PackedLayout { height, width, bits, packing, row_stride_bytes: stride, .. } = layout;
    let length = layout.file_bytes()?;
    if dn.len() != height * width {
        return Err(PackingError::Size { height, width });
    }
    let max = largest_dn(bits);
    if let Some(at) = dn.iter().position(|v| u32::from(*v) > max) {
        return Err(PackingError::Value { row: at / width, col: at % width, dn: dn[at], bits });
    }
    let mut bytes = vec![0u8; length];
    let row = row_bytes(width, bits, packing);
    for (r, line) in dn.chunks_exact(width).enumerate() {
        let start = layout.header_bytes + r * stride;
        pack_row(line, bits, packing, &mut bytes[start..start + row]);
    }
    Ok(bytes)
}

fn pack_row(line: &[u16], bits: u32, packing: Packing, row: &mut [u8]) {
    match packing {
        Packing::U16le => {
            row.chunks_exact_mut(2).zip(line).for_each(|(b, v)| b.copy_from_slice(&v.to_le_bytes()));
        }
        Packing::U16be => {
            row.chunks_exact_mut(2).zip(line).for_each(|(b, v)| b.copy_from_slice(&v.to_be_bytes()));
        }
        Packing::Lsb => {
            for (i, v) in line.iter().enumerate() {
                let bit = i * bits as usize;
                let spread = u32::from(*v) << (bit % 8);
                for (byte, part) in row[bit / 8..].iter_mut().zip(spread.to_le_bytes()) {
                    *byte |= part;
                }
            }
        }
        Packing::Mipi => {
            let (pixels, size) = group(bits, packing);
            let low = bits - 8;
            for (bytes, values) in row.chunks_exact_mut(size).zip(line.chunks(pixels)) {
                let mut tail = 0u32;
                for (i, v) in values.iter().enumerate() {
                    bytes[i] = (v >> low) as u8;
                    tail |= (u32::from(*v) & ((1 << low) - 1)) << (i as u32 * low);
                }
                let tail = tail.to_le_bytes();
                bytes[pixels..].iter_mut().zip(tail).for_each(|(byte, part)| *byte = part);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected bytes by the layouts of MIPI CSI-2 (RAW10, RAW12, RAW14) and PFNC (Mono12p).
    #[test]
    fn packed_bytes_match_the_standards() {
        let pack_row_of =
            |bits, packing, dn: &[u16]| pack(&PackedLayout::tight(1, dn.len(), bits, packing), dn).unwrap();
        // 10 bits: the upper bytes, then the 2 low bits of each, the first pixel in the lowest bits.
        let ten = [0b11_0000_0001, 0b00_1111_1110, 0b10_1010_1011, 0b01_0101_0100];
        assert_eq!(
            pack_row_of(10, Packing::Mipi, &ten),
            [0b1100_0000, 0b0011_1111, 0b1010_1010, 0b0101_0101, 0b00_11_10_01]
        );
        assert_eq!(pack_row_of(12, Packing::Mipi, &[0xabc, 0x123]), [0xab, 0x12, 0x3c]);
        assert_eq!(pack_row_of(14, Packing::Mipi, &[0x3fff, 0, 0, 0]), [0xff, 0, 0, 0, 0x3f, 0, 0]);
        assert_eq!(pack_row_of(14, Packing::Mipi, &[0, 0x3f, 0, 0]), [0, 0, 0, 0, 0xc0, 0x0f, 0]);
        assert_eq!(pack_row_of(12, Packing::Lsb, &[0xabc, 0x123]), [0xbc, 0x3a, 0x12]);
        assert_eq!(pack_row_of(12, Packing::U16be, &[0xabc]), [0x0a, 0xbc]);
        assert_eq!(pack_row_of(12, Packing::U16le, &[0xabc]), [0xbc, 0x0a]);
    }

    #[test]
    fn bytes_of_rows_with_an_incomplete_last_group() {
        assert_eq!(row_bytes(3, 12, Packing::Mipi), 6);
        assert_eq!(row_bytes(3, 12, Packing::Lsb), 5);
        assert_eq!(row_bytes(5, 10, Packing::Mipi), 10);
    }

    #[test]
    fn impossible_layouts_are_refused_before_memory_is_allocated() {
        let tight = PackedLayout::tight(4, 6, 12, Packing::Mipi);
        assert!(matches!(
            PackedLayout { bits: 16, ..tight }.file_bytes(),
            Err(PackingError::Bits { bits: 16, .. })
        ));
        assert!(matches!(
            PackedLayout { row_stride_bytes: 8, ..tight }.file_bytes(),
            Err(PackingError::Stride { .. })
        ));
        for (height, width) in [(0, 6), (usize::MAX, 6), (1 << 20, 1 << 20), (4, usize::MAX)] {
            assert!(PackedLayout::tight(height, width, 12, Packing::Lsb).file_bytes().is_err());
        }
        assert!(PackedLayout { header_bytes: usize::MAX, ..tight }.file_bytes().is_err());
        assert!(matches!(unpack(&tight, &[0; 35]), Err(PackingError::Length { got: 35, needed: 36, .. })));
    }
}
