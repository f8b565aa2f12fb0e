//! Raw frames as NumPy arrays of two axes, rows and columns.

use npyz::{Deserialize, NpyFile, Order, WriterBuilder};

use super::frame::{AnyFrame, MOST_PIXELS, RawFrame, Unreadable, check_memory};
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
    // The file, the numbers in 32 bits, and a copy of them in the order of rows or in 16 bits.
    let copy = if order == Order::Fortran { 4 } else { 2 };
    check_memory((width, height), bytes.len() as u64, 4 + copy)?;
    let (height, width) = (height as usize, width as usize);
    let place = |at: usize| match order {
        Order::C => (at / width, at % width),
        Order::Fortran => (at % height, at / height),
    };
    let stored = numbers(bytes, &kind.descr(), &place).map_err(unreadable)?;
    let dn = match order {
        Order::C => stored,
        Order::Fortran => (0..height * width).map(|at| stored[at % width * height + at / width]).collect(),
    };
    let bits = (each == 1).then_some(8);
    Ok(AnyFrame::of(RawFrame { height, width, dn, info: RawInfo { bits, ..RawInfo::default() } }))
}

/// All numbers of the array, in the order of the file, in which a number has its row and column by `place`. Fails at the first that is no digital
/// number.
fn numbers(bytes: &[u8], kind: &str, place: &dyn Fn(usize) -> (usize, usize)) -> Result<Vec<u32>, String> {
    fn of<T: Deserialize>(
        bytes: &[u8],
        whole: &dyn Fn(usize, f64) -> Result<u32, String>,
        wide: fn(T) -> f64,
    ) -> Result<Vec<u32>, String> {
        let array = NpyFile::new(bytes).map_err(|e| e.to_string())?;
        let mut all = Vec::with_capacity(array.shape().iter().product::<u64>() as usize);
        for (at, value) in array.data::<T>().map_err(|e| e.to_string())?.enumerate() {
            all.push(whole(at, wide(value.map_err(|e| e.to_string())?))?);
        }
        Ok(all)
    }
    let most = f64::from(largest_dn(MOST_BITS));
    let whole = |at: usize, value: f64| {
        if (0.0..=most).contains(&value) && value.fract() == 0.0 {
            return Ok(value as u32);
        }
        let (row, col) = place(at);
        Err(format!("the value {value} at row {row}, column {col} is not a whole number from 0 to {most}"))
    };
    // Compare NumPy's name of the type without quotes and byte order: 'u2', 'f4'.
    match kind.trim_matches('\'').trim_start_matches(['<', '>', '|', '=']) {
        "u1" => of::<u8>(bytes, &whole, f64::from),
        "u2" => of::<u16>(bytes, &whole, f64::from),
        "u4" => of::<u32>(bytes, &whole, f64::from),
        "u8" => of::<u64>(bytes, &whole, |v| v as f64),
        "i2" => of::<i16>(bytes, &whole, f64::from),
        "i4" => of::<i32>(bytes, &whole, f64::from),
        "i8" => of::<i64>(bytes, &whole, |v| v as f64),
        "f4" => of::<f32>(bytes, &whole, f64::from),
        "f8" => of::<f64>(bytes, &whole, |v| v),
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
