//! Decodes text: of lens and glass files, which do not state their encoding, and of labels, where no letter may be guessed.

use std::borrow::Cow;

use encoding_rs::{Encoding, REPLACEMENT, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};
use petzval_base::FileError;

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

/// The text of a file in UTF-8, or in UTF-16 as [`decode`] knows it. Fails at the first line that is no such text.
pub(crate) fn decode_strictly(bytes: &[u8]) -> Result<Cow<'_, str>, FileError> {
    let (encoding, mark) = Encoding::for_bom(bytes).unwrap_or_else(|| match guess(bytes) {
        encoding if encoding == WINDOWS_1252 => (UTF_8, 0),
        encoding => (encoding, 0),
    });
    decode_whole(encoding, &bytes[mark..])
}

/// The text of an XML file: in the encoding that it declares, else as [`decode_strictly`] reads it. Fails where the encoding is not known.
pub(crate) fn decode_xml(bytes: &[u8]) -> Result<Cow<'_, str>, FileError> {
    let declared = match Encoding::for_bom(bytes) {
        None if guess(bytes) != UTF_16LE && guess(bytes) != UTF_16BE => declared_encoding(bytes),
        _ => None,
    };
    // ASCII is a part of UTF-8, and other letters are none of it.
    let Some(label) =
        declared.filter(|label| !["ascii", "us-ascii"].contains(&label.to_ascii_lowercase().as_str()))
    else {
        return decode_strictly(bytes);
    };
    match Encoding::for_label(label.as_bytes()).filter(|encoding| *encoding != REPLACEMENT) {
        // Some programs declare UTF-16 and write UTF-8. Text whose declaration can be read here is not UTF-16.
        Some(encoding) if encoding == UTF_16LE || encoding == UTF_16BE => decode_strictly(bytes),
        Some(encoding) => decode_whole(encoding, bytes),
        None => {
            Err(FileError::at_line(1, &label, "this encoding is not known").hint("save the file as UTF-8"))
        }
    }
}

/// The encoding that an XML declaration names: `<?xml version="1.0" encoding="GBK"?>`.
fn declared_encoding(bytes: &[u8]) -> Option<String> {
    let head = bytes.strip_prefix(b"<?xml")?;
    let end = head.windows(2).position(|pair| pair == b"?>")?;
    let head = std::str::from_utf8(&head[..end]).ok()?;
    let (_, behind) = head.split_once("encoding")?;
    let value = behind.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    Some(value[1..].split_once(quote)?.0.to_owned())
}

/// The text of bytes without a mark, or the first line that cannot be decoded.
fn decode_whole<'a>(encoding: &'static Encoding, bytes: &'a [u8]) -> Result<Cow<'a, str>, FileError> {
    if let Some(text) = encoding.decode_without_bom_handling_and_without_replacement(bytes) {
        return Ok(text);
    }
    let (text, _) = encoding.decode_without_bom_handling(bytes);
    let is_wrong = |(_, line): &(u32, &str)| line.contains(char::REPLACEMENT_CHARACTER);
    let (line, record) = (1..).zip(text.lines()).find(is_wrong).unwrap_or((1, ""));
    let message = format!("this is not text in {}", encoding.name());
    let hint = "save the file as UTF-8: a letter that is guessed is another name of a class";
    Err(FileError::at_line(line, record, message).hint(hint))
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

    #[test]
    fn labels_are_never_guessed() {
        let text = "0 0.5\nFußgänger";
        let (low, high) = (utf16(text, u16::to_le_bytes), utf16(text, u16::to_be_bytes));
        for bytes in [text.as_bytes(), &low, &high, &[b"\xef\xbb\xbf", text.as_bytes()].concat()] {
            assert_eq!(decode_strictly(bytes).unwrap(), text);
        }
        let error = decode_strictly(b"0 0.5\nFu\xdfg\xe4nger\n").unwrap_err();
        assert_eq!((error.line, error.message.as_str()), (Some(2), "this is not text in UTF-8"));
        // Half of a character of two units.
        assert!(decode_strictly(b"\xff\xfea\0\x3d\xd8").is_err());
    }

    #[test]
    fn xml_is_read_in_the_encoding_that_it_declares() {
        let with = |encoding: &str, bytes: &[u8]| {
            let head = format!("<?xml version=\"1.0\" encoding={encoding}?>");
            decode_xml(&[head.as_bytes(), bytes].concat()).map(|text| text[head.len()..].to_owned())
        };
        // 行人, pedestrian.
        assert_eq!(with("\"GBK\"", b"\xd0\xd0\xc8\xcb").unwrap(), "\u{884c}\u{4eba}");
        assert_eq!(with("'Shift_JIS'", b"\x8e\xd4").unwrap(), "\u{8eca}");
        assert_eq!(with("\"ISO-8859-1\"", b"\xe4").unwrap(), "ä");
        assert_eq!(with("\"utf-8\"", "ä".as_bytes()).unwrap(), "ä");
        for (encoding, bytes, needle) in [
            ("\"utf-8\"", &b"\xe4"[..], "not text in UTF-8"),
            ("\"us-ascii\"", b"\xe4", "not text in UTF-8"),
            ("\"GBK\"", b"\xff", "not text in GBK"),
            ("\"utf-16\"", b"\xe4", "not text in UTF-8"),
            ("\"klingon\"", b"a", "not known"),
            ("\"iso-2022-kr\"", b"a", "not known"),
        ] {
            let error = with(encoding, bytes).unwrap_err();
            assert!(error.message.contains(needle) && error.line == Some(1), "{encoding}: {error}");
        }
        let unmarked = utf16("<?xml version=\"1.0\" encoding=\"UTF-16\"?><a/>", u16::to_le_bytes);
        assert!(decode_xml(&unmarked).unwrap().ends_with("<a/>"));
        assert_eq!(decode_xml("<a>ä</a>".as_bytes()).unwrap(), "<a>ä</a>");
    }
}
