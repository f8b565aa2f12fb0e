//! Arrays of floating-point numbers in NumPy's format: every precision, byte order and memory order.

use half::f16;
use npyz::{Deserialize, NpyFile, Order};
use schemars::JsonSchema;
use serde::{Deserialize as Read, Serialize};

use crate::float_file::npy_bytes;

/// Longest header that is read, bytes; NumPy writes 128 for up to four axes.
const MOST_HEADER: usize = 1024;

/// Largest number of brackets in a header.
const MOST_BRACKETS: usize = 4;

/// Largest number of digits in the shape of an array of floats: its product fits in 64 bits.
const MOST_DIGITS: usize = 18;

/// Precision of the numbers in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Read, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FloatType {
    /// 16 bits: 11 of precision.
    Float16,
    /// 32 bits: 24 of precision.
    Float32,
    /// 64 bits: 53 of precision.
    #[default]
    Float64,
}

/// An array of floats, the last axis fastest.
#[derive(Debug)]
pub(crate) struct FloatArray {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
    /// Precision in the file.
    pub precision: FloatType,
}

/// Reads an array of float16, float32 or float64 with at most `most` numbers.
pub(crate) fn read_floats(bytes: &[u8], most: usize) -> Result<FloatArray, String> {
    check_header(bytes, MOST_DIGITS)?;
    let array = NpyFile::new(bytes).map_err(|e| format!("not a .npy file: {e}"))?;
    let shape: Vec<usize> = array.shape().iter().map(|side| *side as usize).collect();
    let strides: Vec<usize> = array.strides().iter().map(|stride| *stride as usize).collect();
    let count = shape.iter().try_fold(1_usize, |n, side| n.checked_mul(*side));
    let Some(count) = count.filter(|n| (1..=most).contains(n)) else {
        return Err(format!("an array of shape {shape:?}: none, or more than {most} numbers"));
    };
    let (kind, order) = (array.dtype(), array.order());
    let precision = match kind.descr().trim_matches('\'').trim_start_matches(['<', '>', '=']) {
        "f2" => FloatType::Float16,
        "f4" => FloatType::Float32,
        "f8" => FloatType::Float64,
        _ => return Err(format!("numbers of type {}, not float16, float32 or float64", kind.descr())),
    };
    // Check that the file holds the numbers before memory is allocated for them.
    let (held, each) = (array.into_inner().len(), kind.num_bytes().unwrap_or(0));
    if held != count * each {
        return Err(format!("{held} bytes of data, and shape {shape:?} takes {}", count * each));
    }
    let stored = match precision {
        FloatType::Float16 => numbers::<f16>(bytes, f64::from)?,
        FloatType::Float32 => numbers::<f32>(bytes, f64::from)?,
        FloatType::Float64 => numbers::<f64>(bytes, |value| value)?,
    };
    let values = if order == Order::C { stored } else { in_c_order(&stored, &shape, &strides) };
    Ok(FloatArray { shape, values, precision })
}

/// The bytes of an array of this shape, the last axis fastest, in a precision.
pub(crate) fn float_bytes(shape: &[u64], values: &[f64], precision: FloatType) -> std::io::Result<Vec<u8>> {
    match precision {
        FloatType::Float16 => {
            npy_bytes(shape, &values.iter().map(|value| f16::from_f64(*value)).collect::<Vec<_>>())
        }
        FloatType::Float32 => npy_bytes(shape, &values.iter().map(|value| *value as f32).collect::<Vec<_>>()),
        FloatType::Float64 => npy_bytes(shape, values),
    }
}

/// All numbers in the order of the file.
fn numbers<T: Deserialize>(bytes: &[u8], wide: fn(T) -> f64) -> Result<Vec<f64>, String> {
    let array = NpyFile::new(bytes).map_err(|e| e.to_string())?;
    let data = array.data::<T>().map_err(|e| e.to_string())?;
    data.map(|value| value.map(wide)).collect::<Result<_, _>>().map_err(|e| e.to_string())
}

/// Numbers at any strides, put in the order of the last axis fastest.
fn in_c_order(stored: &[f64], shape: &[usize], strides: &[usize]) -> Vec<f64> {
    let mut index = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(stored.len());
    for _ in 0..stored.len() {
        ordered.push(stored[index.iter().zip(strides).map(|(i, stride)| i * stride).sum::<usize>()]);
        for (i, side) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < *side {
                break;
            }
            *i = 0;
        }
    }
    ordered
}

/// Refuses headers on which the crate's reader would fail: very long ones, deeply nested brackets, and shapes of more than `most_digits`
/// digits, whose product does not fit in 64 bits.
pub(crate) fn check_header(bytes: &[u8], most_digits: usize) -> Result<(), String> {
    let cut = || "the file ends in its header".to_owned();
    let (start, length) = match bytes.get(6).ok_or_else(cut)? {
        1 => (10, bytes.get(8..10).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]])))),
        _ => (12, bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)),
    };
    let length = length.ok_or_else(cut)?;
    if length > MOST_HEADER {
        return Err(format!("a header of {length} bytes"));
    }
    let header = bytes.get(start..start + length).ok_or_else(cut)?;
    let deepest = header.iter().filter(|b| matches!(b, b'(' | b'[' | b'{')).count();
    let shape = header.windows(5).position(|w| w == b"shape").map_or(header, |at| &header[at..]);
    if deepest > MOST_BRACKETS || shape.iter().filter(|b| b.is_ascii_digit()).count() > most_digits {
        return Err("the header is not that of an array of numbers".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file as NumPy writes it.
    fn file(kind: &str, is_fortran: &str, shape: &str, data: Vec<u8>) -> Vec<u8> {
        let text = format!("{{'descr': '{kind}', 'fortran_order': {is_fortran}, 'shape': {shape}, }}");
        let head = format!("{text:<117}\n");
        [&b"\x93NUMPY\x01\x00\x76\x00"[..], head.as_bytes(), &data].concat()
    }

    #[test]
    fn every_float_and_every_order_is_read() {
        let wanted = [0.5, 0.25, 2.0, -1.0, 0.125, 3.0];
        let le = |v: f64| v.to_le_bytes();
        for (kind, data) in [
            ("<f8", wanted.iter().flat_map(|v| le(*v)).collect::<Vec<u8>>()),
            (">f8", wanted.iter().flat_map(|v| v.to_be_bytes()).collect()),
            ("<f4", wanted.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect()),
            (">f4", wanted.iter().flat_map(|v| (*v as f32).to_be_bytes()).collect()),
            ("<f2", wanted.iter().flat_map(|v| f16::from_f64(*v).to_le_bytes()).collect()),
            (">f2", wanted.iter().flat_map(|v| f16::from_f64(*v).to_be_bytes()).collect()),
        ] {
            let array = read_floats(&file(kind, "False", "(2, 3)", data), 10).unwrap();
            assert_eq!((array.shape, array.values), (vec![2, 3], wanted.to_vec()), "{kind}");
        }
        // Columns first: element [row][column] lies at row + 2 column.
        let turned = [0, 3, 1, 4, 2, 5].iter().flat_map(|i: &usize| le(wanted[*i])).collect();
        assert_eq!(read_floats(&file("<f8", "True", "(2, 3)", turned), 10).unwrap().values, wanted);
    }

    #[test]
    fn what_is_written_is_read() {
        let values = [0.5, 0.25, 1.0, 0.0];
        for precision in [FloatType::Float16, FloatType::Float32, FloatType::Float64] {
            let array = read_floats(&float_bytes(&[4, 1], &values, precision).unwrap(), 4).unwrap();
            assert_eq!((array.shape, array.precision), (vec![4, 1], precision));
            assert_eq!(array.values, values);
        }
    }

    #[test]
    fn other_arrays_are_refused_with_what_they_are() {
        for (bytes, says) in [
            (file("<i4", "False", "(1,)", vec![0; 4]), "numbers of type '<i4'"),
            (file("<c8", "False", "(1,)", vec![0; 8]), "numbers of type '<c8'"),
            (file("<f8", "False", "(2,)", vec![0; 8]), "8 bytes of data, and shape [2] takes 16"),
            (file("<f8", "False", "(0, 3)", vec![]), "shape [0, 3]"),
            (file("<f8", "False", "(11,)", vec![0; 88]), "more than 10"),
            (file("<f8", "False", "(999999999, 9999999999)", vec![]), "not that of an array"),
            (b"no array".to_vec(), "the file ends in its header"),
            (b"\x93NUMPY\x01\x00".to_vec(), "the file ends in its header"),
        ] {
            let error = read_floats(&bytes, 10).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }
}
