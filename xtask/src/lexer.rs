//! Splits Rust sources into words, signs and comments. Strings and characters are left out.

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// An identifier, a keyword or a number.
    Word,
    /// One character; `::` is one sign.
    Sign,
    /// A comment with its slashes, up to the end of the line or to `*/`.
    Comment,
}

/// A piece of a source.
#[derive(Clone, Debug)]
pub(super) struct Token {
    pub kind: Kind,
    pub text: String,
    /// The line it begins on, from 1.
    pub line: usize,
}

/// The tokens of a source, in order.
pub(super) fn lex(text: &str) -> Vec<Token> {
    let chars: Vec<char> = text.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let (mut tokens, mut i) = (Vec::new(), 0);
    // Lines are counted up to `counted`.
    let (mut line, mut counted) = (1, 0);
    while i < chars.len() {
        let c = at(i);
        let start = i;
        line += chars[counted..start].iter().filter(|c| **c == '\n').count();
        counted = start;
        let mut push = |kind: Kind, end: usize| {
            let text = chars[start..end.min(chars.len())].iter().collect();
            tokens.push(Token { kind, text, line });
        };
        if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && at(i) != '\n' {
                i += 1;
            }
            push(Kind::Comment, i);
        } else if c == '/' && at(i + 1) == '*' {
            while i < chars.len() && (at(i), at(i + 1)) != ('*', '/') {
                i += 1;
            }
            i += 2;
            push(Kind::Comment, i);
        } else if c.is_alphanumeric() || c == '_' {
            while at(i).is_alphanumeric() || at(i) == '_' {
                i += 1;
            }
            let word: String = chars[start..i].iter().collect();
            if is_raw_string(&word, &chars, i) {
                i = end_of_raw_string(&chars, i);
            } else {
                push(Kind::Word, i);
            }
        } else if c == '"' {
            i += 1;
            while i < chars.len() && at(i) != '"' {
                i += if at(i) == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' && (at(i + 1) == '\\' || at(i + 2) == '\'') {
            i += if at(i + 1) == '\\' { 3 } else { 2 };
            while i < chars.len() && at(i) != '\'' {
                i += 1;
            }
            i += 1;
        } else if c == ':' && at(i + 1) == ':' {
            i += 2;
            push(Kind::Sign, i);
        } else {
            i += 1;
            if !c.is_whitespace() {
                push(Kind::Sign, i);
            }
        }
    }
    tokens
}

fn is_raw_string(word: &str, chars: &[char], next: usize) -> bool {
    let after = chars[next..].iter().find(|c| **c != '#');
    ["r", "br"].contains(&word) && chars.get(next).is_some_and(|c| "\"#".contains(*c)) && after == Some(&'"')
}

fn end_of_raw_string(chars: &[char], start: usize) -> usize {
    let hashes = chars[start..].iter().take_while(|c| **c == '#').count();
    let closes = |i: usize| chars[i] == '"' && chars[i + 1..].iter().take(hashes).all(|c| *c == '#');
    let open = start + hashes + 1;
    (open..chars.len()).find(|i| closes(*i)).map_or(chars.len(), |i| i + 1 + hashes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_are_distinguished_from_slashes_in_strings_and_keep_their_lines() {
        let source = "let a = \"http://x\n\";\n/// One `//`\nlet b = r#\"// \"no\" \"#; // two\nlet c = '\"'; /* three */";
        let comments: Vec<(usize, String)> = lex(source)
            .into_iter()
            .filter(|token| token.kind == Kind::Comment)
            .map(|token| (token.line, token.text))
            .collect();
        let expected = [(3, "/// One `//`"), (4, "// two"), (5, "/* three */")];
        assert_eq!(comments, expected.map(|(line, text)| (line, text.to_owned())));
    }
}
