//! Numbers that JSON does not have: `NaN` and `Infinity`, which Python writes, and numbers beyond the range of f64.

/// What such a number becomes: a text of the length of `NaN`.
const MARK: &[u8; 3] = b"\"?\"";

/// The text of [`MARK`].
pub(super) const NO_NUMBER: &str = "?";

/// Replaces each such number by the text [`NO_NUMBER`] and spaces, so that a reader finds a defect of one value instead of giving up the
/// file. Every other byte keeps its line and column.
pub(super) fn mark_numbers(bytes: &mut [u8]) {
    let mut i = 0;
    while i < bytes.len() {
        match bytes[i] {
            b'"' => i = after_text(bytes, i),
            b'-' | b'+' | b'0'..=b'9' | b'N' | b'I' | b'n' | b'i' => {
                let end = i + bytes[i..].iter().take_while(|b| is_of_word(**b)).count();
                if is_no_number(&bytes[i..end]) {
                    bytes[i..end].fill(b' ');
                    bytes[i..i + MARK.len()].copy_from_slice(MARK);
                }
                i = end;
            }
            _ => i += 1,
        }
    }
}

fn is_of_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.')
}

/// The place behind the text whose quotation mark is at `start`.
fn after_text(bytes: &[u8], start: usize) -> usize {
    let mut i = start + 1;
    while i < bytes.len() {
        match bytes[i] {
            b'"' => return i + 1,
            b'\\' => i += 2,
            _ => i += 1,
        }
    }
    bytes.len()
}

fn is_no_number(word: &[u8]) -> bool {
    // Short words of digits are the common case.
    if word.len() < MARK.len() || (word.len() < 300 && !word.iter().any(u8::is_ascii_alphabetic)) {
        return false;
    }
    // This takes `NaN`, `nan`, `inf`, `-Infinity` and 1e999, as the parser of Rust does.
    let number = std::str::from_utf8(word).ok().and_then(|word| word.parse::<f64>().ok());
    number.is_some_and(|number| !number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marked(text: &str) -> String {
        let mut bytes = text.as_bytes().to_vec();
        mark_numbers(&mut bytes);
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn only_numbers_outside_texts_change_and_places_stay() {
        assert_eq!(marked("[NaN, -Infinity, 1e999, 1e9]"), r#"["?", "?"      , "?"  , 1e9]"#);
        let kept = r#"{"NaN": [null, true, -1.5e-3, 12], "a\"Infinity": "inf"}"#;
        assert_eq!(marked(kept), kept);
        for cut in 0..kept.len() {
            assert_eq!(marked(&kept[..cut]).len(), cut);
        }
        assert_eq!(marked("-"), "-");
        let long = format!("[{}]", "9".repeat(400));
        assert_eq!(marked(&long).trim_end_matches(']').trim_end(), "[\"?\"");
    }
}
