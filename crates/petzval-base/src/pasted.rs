//! Paths as words of a shell, for commands that messages print.

use std::path::Path;

/// A path as it can be pasted into a shell: one with spaces is quoted, bytes that a terminal would obey or not show are written by their numbers.
pub fn pasted(path: &Path) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,:@%".contains(c) || (cfg!(windows) && c == '\\');
    match path.to_str() {
        Some(text) if text.chars().all(is_plain) => text.to_owned(),
        Some(text) if !text.chars().any(is_obeyed) => format!("'{}'", text.replace('\'', "'\\''")),
        _ => {
            let byte = |byte: &u8| match byte {
                b'\'' | b'\\' => format!("\\{}", char::from(*byte)),
                b' '..=b'~' => char::from(*byte).to_string(),
                other => format!("\\x{other:02x}"),
            };
            let text: String = path.as_os_str().as_encoded_bytes().iter().map(byte).collect();
            format!("$'{text}'")
        }
    }
}

/// Whether a terminal obeys a character in place of showing it: control characters, and those that turn the direction of text.
pub fn is_obeyed(c: char) -> bool {
    let turns_direction =
        matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || turns_direction
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shell reads what is pasted as the path itself.
    #[cfg(unix)]
    #[test]
    fn pasted_paths_are_those_of_the_shell() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;

        for name in [
            &b"a/b.toml"[..],
            b"a\\b.toml",
            b"it's mine",
            b"a\nb\x1b[31m",
            b"\xff'\\ \xc3\xbc",
            "gr\u{202e}ün".as_bytes(),
        ] {
            let pasted = pasted(Path::new(OsStr::from_bytes(name)));
            assert!(!pasted.contains(is_obeyed), "{pasted}");
            let shell =
                std::process::Command::new("bash").args(["-c", &format!("printf %s {pasted}")]).output();
            if let Ok(shell) = shell {
                assert_eq!(shell.stdout, name, "{pasted}");
            }
        }
    }
}
