//! Raw frames as NumPy arrays of two axes, rows and columns.

use npyz::{Deserialize, NpyFile, Order, WriterBuilder};

use super::frame::{AnyFrame, MOST_PIXELS, RawFrame, Unreadable};
use super::info::{MOST_BITS, RawInfo, largest_dn};
use crate::npy_array::check_header;

const HINT: &str = "save the frame with numpy.save as a C array of two axes, rows and columns, of dtype uint16, or uint32 for more than 16 bits";

/// Largest number of digits in the shape of a frame. The header of a frame has fewer.
const MOST_DIGITS: usize = 18;

/// Reads an array of whole numbers below 2^24, of any integer or floating-point type of NumPy.
pub(super) fn decode(bytes: &[u8]) -> Result<AnyFrame, Unreadable> {
    let unreadable = |reason: String| Unreadable { reason, hint: HINT };
    check_header(bytes, MOST_DIGITS).map_err(unreadable)?;
    let array = NpyFile::new(bytes).map_err(|e| unreadable(e.to_string()))?;
    let &[height, width] = array.shape() else {
        return Err(unreadable(format!("an array of {} axes", array.shape().len())));
    };
    let (pixels, order, kind) = (height * width, array.order(), array.dtype());
    if pixels == 0 || pixels > MOST_PIXELS {
        return Err(unreadable(format!("{width} x {height} pixels: none, or more than 2^28")));
    }
    // Check that the file holds the data before memory is allocated for them.
    let each = kind.num_bytes().unwrap_or(0);
    let held = array.into_inner();
    if held.len() as u64 != pixels * each as u64 {
        let reason = format!(
            "{} bytes of data, and {width} x {height} numbers take {}",
            held.len(),
            pixels * each as u64
        );
        return Err(unreadable(reason));
    }
    let stored = numbers(bytes, &kind.descr()).map_err(unreadable)?;
    let (height, width, most) = (height as usize, width as usize, f64::from(largest_dn(MOST_BITS)));
    let mut dn = Vec::with_capacity(stored.len());
    for row in 0..height {
        for col in 0..width {
            let value = match order {
                Order::C => stored[row * width + col],
                Order::Fortran => stored[col * height + row],
            };
            if !(0.0..=most).contains(&value) || value.fract() != 0.0 {
                return Err(unreadable(format!(
                    "the value {value} at row {row}, column {col} is not a whole number from 0 to {most}"
                )));
            }
            dn.push(value as u32);
        }
    }
    let bits = (each == 1).then_some(8);
    Ok(AnyFrame::of(RawFrame { height, width, dn, info: RawInfo { bits, ..RawInfo::default() } }))
}

/// All numbers of the array as f64, in the order of the file.
fn numbers(bytes: &[u8], kind: &str) -> Result<Vec<f64>, String> {
    fn of<T: Deserialize>(bytes: &[u8], wide: fn(T) -> f64) -> Result<Vec<f64>, String> {
        let array = NpyFile::new(bytes).map_err(|e| e.to_string())?;
        let data = array.data::<T>().map_err(|e| e.to_string())?;
        data.map(|value| value.map(wide)).collect::<Result<_, _>>().map_err(|e| e.to_string())
    }
    // Compare NumPy's name of the type without quotes and byte order: 'u2', 'f4'.
    match kind.trim_matches('\'').trim_start_matches(['<', '>', '|', '=']) {
        "u1" => of::<u8>(bytes, f64::from),
        "u2" => of::<u16>(bytes, f64::from),
        "u4" => of::<u32>(bytes, f64::from),
        "u8" => of::<u64>(bytes, |v| v as f64),
        "i2" => of::<i16>(bytes, f64::from),
        "i4" => of::<i32>(bytes, f64::from),
        "i8" => of::<i64>(bytes, |v| v as f64),
        "f4" => of::<f32>(bytes, f64::from),
        "f8" => of::<f64>(bytes, |v| v),
        _ => Err(format!("an array of {kind}, not of numbers")),
    }
}

/// The bytes of an array of `<u2`.
pub(super) fn encode(frame: &RawFrame) -> Result<Vec<u8>, Unreadable> {
    let unwritable = |e: std::io::Error| Unreadable { reason: e.to_string(), hint: "write a TIFF" };
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype();
    let shape = [frame.height as u64, frame.width as u64];
    let mut writer = options.shape(&shape).writer(&mut bytes).begin_nd().map_err(unwritable)?;
    writer.extend(frame.dn.iter().copied()).map_err(unwritable)?;
    writer.finish().map_err(unwritable)?;
    Ok(bytes)
}
