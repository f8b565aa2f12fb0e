//! Tables as comma-separated values.

/// Comma-separated values (RFC 4180) with line feeds: rows of fields, the head first.
///
/// A field with a comma, a quote or a line break is quoted; all others stay as they are. (This is the engine of the crate `csv`, which
/// itself adds a reader that no file of ours needs.)
pub fn csv_text<Row, Field>(rows: impl IntoIterator<Item = Row>) -> String
where
    Row: IntoIterator<Item = Field>,
    Field: AsRef<str>,
{
    let mut text = Vec::new();
    let mut writer = csv_core::Writer::new();
    for row in rows {
        let mut fields = row.into_iter().peekable();
        while let Some(field) = fields.next() {
            let field = field.as_ref().as_bytes();
            // Make room for two quotes, for every character as a doubled quote, and for the end of the field.
            let start = text.len();
            text.resize(start + 2 * field.len() + 4, 0);
            let (_, _, of_field) = writer.field(field, &mut text[start..]);
            let after = &mut text[start + of_field..];
            let ending =
                if fields.peek().is_some() { writer.delimiter(after) } else { writer.terminator(after) };
            text.truncate(start + of_field + ending.1);
        }
    }
    String::from_utf8_lossy(&text).into_owned()
}

/// A number as a field; empty where there is none.
pub fn csv_number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use csv_core::{ReadRecordResult, Reader};

    #[test]
    fn only_fields_that_need_it_are_quoted() {
        let rows = [
            ["camera", "psnr_db", "note (dB)"],
            ["as drawn", "31.25", ""],
            ["a, b", "say \"so\"", "two\nlines"],
            ["return\r", " spaces ", "semi;colon"],
        ];
        assert_eq!(
            csv_text(rows),
            "camera,psnr_db,note (dB)\nas drawn,31.25,\n\"a, b\",\"say \"\"so\"\"\",\"two\nlines\"\n\"return\r\", spaces ,semi;colon\n"
        );
        assert_eq!(csv_text([["head"]; 0]), "");
        assert_eq!([csv_number(Some(0.1)), csv_number(Some(2.0)), csv_number(None)], ["0.1", "2", ""]);
    }

    #[test]
    fn what_is_written_is_read_again() {
        let fields = ["", ",", "\"", "\"\"", "\"\"\"\"\"\"", "\r\n", "a\"b,c\nd", "plain", "µ,"];
        let rows: Vec<[&str; 2]> = fields.iter().flat_map(|a| fields.map(|b| [*a, b])).collect();
        let text = csv_text(&rows);
        let (mut reader, mut rest) = (Reader::new(), text.as_bytes());
        for row in &rows {
            let (mut read, mut ends) = ([0; 64], [0; 4]);
            let (result, taken, _, count) = reader.read_record(rest, &mut read, &mut ends);
            assert_eq!((result, count), (ReadRecordResult::Record, 2), "{row:?}");
            assert_eq!([&read[..ends[0]], &read[ends[0]..ends[1]]], row.map(str::as_bytes));
            rest = &rest[taken..];
        }
        assert_eq!(rest, b"");
    }
}
