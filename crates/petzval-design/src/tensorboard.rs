//! Event files of TensorBoard: records of scalars that `tensorboard --logdir` draws as curves.
//!
//! A file is a sequence of records in the framing of TensorFlow's TFRecord: length (u64, little-endian), masked CRC-32C of the length,
//! data, masked CRC-32C of the data. The data are a message `Event` of Protocol Buffers with a time, a step, and either the version of
//! the format or a `Summary` of tagged numbers.
//!
//! Sources: `tensorflow/core/lib/io/record_writer.cc` for the framing and the mask, `tensorflow/core/util/event.proto` and
//! `tensorflow/core/framework/summary.proto` for the numbers of the fields.

/// What stands in the name of a file by which TensorBoard knows it.
pub(crate) const FILE_MARK: &str = "tfevents";

/// The record that a file begins with: the version of the format. `time_s`: seconds since 1970.
pub(crate) fn version_record(time_s: f64) -> Vec<u8> {
    let mut event = Message::default();
    event.double(EVENT_WALL_TIME, time_s);
    event.bytes(EVENT_FILE_VERSION, b"brain.Event:2");
    framed(&event.0)
}

/// A record of scalars at one step, each with its tag, such as `network/total`. `time_s`: seconds since 1970.
pub(crate) fn scalar_record(time_s: f64, step: u64, scalars: &[(String, f64)]) -> Vec<u8> {
    let mut summary = Message::default();
    for (tag, value) in scalars {
        let mut of_tag = Message::default();
        of_tag.bytes(VALUE_TAG, tag.as_bytes());
        // The format holds numbers of single precision.
        of_tag.float(VALUE_SIMPLE, *value as f32);
        summary.bytes(SUMMARY_VALUE, &of_tag.0);
    }
    let mut event = Message::default();
    event.double(EVENT_WALL_TIME, time_s);
    event.varint(EVENT_STEP, step);
    event.bytes(EVENT_SUMMARY, &summary.0);
    framed(&event.0)
}

// Numbers of the fields.
const EVENT_WALL_TIME: u64 = 1;
const EVENT_STEP: u64 = 2;
const EVENT_FILE_VERSION: u64 = 3;
const EVENT_SUMMARY: u64 = 5;
const SUMMARY_VALUE: u64 = 1;
const VALUE_TAG: u64 = 1;
const VALUE_SIMPLE: u64 = 2;

/// A message of Protocol Buffers, field by field.
#[derive(Default)]
struct Message(Vec<u8>);

impl Message {
    /// The number of a field with how its value is stored: 0 varint, 1 eight bytes, 2 bytes with their length, 5 four bytes.
    fn field(&mut self, number: u64, kind: u64) {
        self.number(number << 3 | kind);
    }

    /// A whole number in groups of seven bits, the lowest first.
    fn number(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn varint(&mut self, number: u64, value: u64) {
        self.field(number, 0);
        self.number(value);
    }

    fn double(&mut self, number: u64, value: f64) {
        self.field(number, 1);
        self.0.extend(value.to_le_bytes());
    }

    fn float(&mut self, number: u64, value: f32) {
        self.field(number, 5);
        self.0.extend(value.to_le_bytes());
    }

    fn bytes(&mut self, number: u64, value: &[u8]) {
        self.field(number, 2);
        self.number(value.len() as u64);
        self.0.extend(value);
    }
}

/// A record with its length and its sums.
fn framed(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    let mut record = length.to_vec();
    record.extend(masked(crc32c::crc32c(&length)).to_le_bytes());
    record.extend(data);
    record.extend(masked(crc32c::crc32c(data)).to_le_bytes());
    record
}

/// A sum as it is stored: turned and moved, so that the sum of data that holds sums is not its own.
fn masked(sum: u32) -> u32 {
    sum.rotate_right(15).wrapping_add(0xa282_ead8)
}

#[cfg(test)]
mod tests {
    use petzval_base::hex;

    use super::*;

    /// Written by the `RecordWriter` and the messages of the package tensorboard 2.21.0.
    #[test]
    fn records_are_those_of_tensorboard() {
        assert_eq!(hex(&version_record(1.5)), VERSION);
        assert_eq!(
            hex(&scalar_record(1.5, 300, &[("a/b".to_owned(), 0.25), ("c".to_owned(), -2.0)])),
            SCALARS
        );
    }

    const VERSION: &str = "1800000000000000a37f4b2209000000000000f83f1a0d627261696e2e4576656e743a322a28646c";
    const SCALARS: &str = "2400000000000000422b804d09000000000000f83f10ac022a160a0a0a03612f62150000803e0a080a016315000000c0820519bf";
}
