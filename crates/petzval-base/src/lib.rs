//! The foundation of every other crate. It holds no physics.
//!
//! | module | holds |
//! |---|---|
//! | [`FileError`] | an error in a file: line, key, value, and a hint |
//! | [`IoError`], [`InFile`] | an error of the system, or in the text of a file, with the path |
//! | [`reason_and_hint`] | the parts of an error that is one text |
//! | [`Cancel`] | the flag that stops long work |
//! | [`Tally`] | how much of parallel work is done, reported in ascending order |
//! | [`parameter`] | the description of a number that a user may set: unit, range, scale, default, sentence |
//! | [`read_whole`], [`read_text`], [`open_file`] | read files, and refuse what may have no end |
//! | [`write_whole`], [`create_whole`] | write a file completely or not at all; the second only where none is |
//! | [`WorkLock`] | a lock on a folder in which one process works |
//! | [`lossy_path`] | writes paths that are not UTF-8 |
//! | [`PartFolder`], [`sweep_parts`] | what is not whole yet, and the removal of what killed processes have left of it |
//! | [`simd`] | chooses the instruction set of the vector kernels |
//! | [`random`] | random numbers as a function of seed, frame, stage and place |
//! | [`counted`] | a number with its noun |
//! | [`time_text`] | a time in hours, minutes or seconds |
//! | [`pasted`] | a path as a word of a shell |
//! | [`hex`] | bytes in hexadecimal digits |
//! | [`csv_text`] | a table as comma-separated values |
//! | [`table`] | the interval of an ascending table around a value, and what lies between its entries |
//! | [`statistics`] | the median; minimum and maximum that pass on what is no number |

mod at_path;
mod cancel;
mod counted;
mod csv_text;
mod file_error;
mod hex;
pub mod lossy_path;
pub mod parameter;
mod part;
mod pasted;
pub mod random;
pub mod simd;
pub mod statistics;
pub mod table;
mod tally;
mod time_text;
mod whole_file;
mod work_lock;

pub use at_path::{InFile, IoError};
pub use cancel::{Cancel, Cancelled};
pub use counted::counted;
pub use csv_text::{csv_number, csv_text};
pub use file_error::{FileError, SMALLER_NUMBER, WHOLE_NUMBERS_OF_TOML, nearest, quote, reason_and_hint};
pub use hex::hex;
pub use part::{LONGEST_NAME, PartFolder, sweep_parts, sweep_parts_in};
pub use pasted::{is_obeyed, pasted};
pub use tally::Tally;
pub use time_text::time_text;
pub use whole_file::{create_whole, open_file, read_at_most, read_text, read_whole, write_whole};
pub use work_lock::WorkLock;
