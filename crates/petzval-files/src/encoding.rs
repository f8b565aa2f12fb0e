//! Decodes the text of lens and glass files, which do not state their encoding.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// Bytes that are examined in a file without a byte order mark.
const SAMPLE: usize = 512;

/// The text of a file in UTF-8, in UTF-16 (with a byte order mark, or if most bytes at odd or at even places are zero), or
/// else in Windows-1252, which includes Latin-1.
///
/// Bytes that are not text become U+FFFD; the reader of the format reports them where they matter.
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let (encoding, mark) = Encoding::for_bom(bytes).unwrap_or_else(|| (guess(bytes), 0));
    encoding.decode_without_bom_handling(&bytes[mark..]).0
}

fn guess(bytes: &[u8]) -> &'static Encoding {
    let sample = &bytes[..bytes.len().min(SAMPLE)];
    let zeros = |first: usize| {
        let all = sample.iter().skip(first).step_by(2);
        let zero = all.clone().filter(|b| **b == 0).count();
        2 * zero > all.count()
    };
    match (zeros(0), zeros(1)) {
        (false, true) => UTF_16LE,
        (true, false) => UTF_16BE,
        _ if Encoding::utf8_valid_up_to(bytes) == bytes.len() => UTF_8,
        _ => WINDOWS_1252,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, to_bytes: fn(u16) -> [u8; 2]) -> Vec<u8> {
        text.encode_utf16().flat_map(to_bytes).collect()
    }

    #[test]
    fn text_is_read_in_every_encoding_of_lens_files() {
        let text = "NAME Gaußlinse\r\nUNIT MM";
        let (low, high) = (utf16(text, u16::to_le_bytes), utf16(text, u16::to_be_bytes));
        for bytes in [text.as_bytes(), &low, &high, &[&[0xff, 0xfe], low.as_slice()].concat()] {
            assert_eq!(decode(bytes), text);
        }
        assert_eq!(decode(&[&[0xef, 0xbb, 0xbf], text.as_bytes()].concat()), text);
        assert_eq!(decode(b"NAME Gau\xdflinse"), "NAME Gaußlinse");
        assert_eq!(decode(b""), "");
    }
}
