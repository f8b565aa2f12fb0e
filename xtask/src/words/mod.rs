//! The words of comments: no sentence is too long, and none uses a word that `words.toml` refuses.

mod comments;
mod list;
mod sentences;

use std::fmt;
use std::fs;
use std::path::Path;

use crate::files::rust_files;
use crate::lexer::{Kind, Token, lex};
use list::{HouseWord, List};
use sentences::Sentence;

/// A sentence or a name to rewrite.
#[derive(Debug)]
struct Finding {
    /// The file, below the root of the workspace.
    path: String,
    line: usize,
    /// The sentence, or the name.
    text: String,
    /// What is wrong with it.
    what: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}\n    {}", self.path, self.line, self.what, self.text)
    }
}

/// Checks every source of the workspace; the report on success, all findings otherwise.
pub fn check() -> Result<String, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let text =
        fs::read_to_string(root.join("xtask/words.toml")).map_err(|e| vec![format!("words.toml: {e}")])?;
    let list = List::read(&text).map_err(|e| vec![format!("words.toml: {e}")])?;
    let mut findings = Vec::new();
    let (mut files, mut count) = (0, 0);
    for folder in ["crates", "xtask"] {
        for path in rust_files(&root.join(folder)) {
            let text = fs::read_to_string(&path).map_err(|e| vec![format!("{}: {e}", path.display())])?;
            let below = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().into_owned();
            files += 1;
            count += check_source(&below, &text, &list, &mut findings);
        }
    }
    let (notes, mut problems) = list.except(&mut findings);
    problems.extend(findings.iter().map(Finding::to_string));
    let report = format!("{count} sentences of comments in {files} files");
    let lines: Vec<String> = notes.into_iter().map(|note| format!("    {note}")).collect();
    if problems.is_empty() {
        Ok([vec![format!("words: {report}")], lines].concat().join("\n"))
    } else {
        Err([problems, vec![format!("{report}, {} findings", findings.len())], lines].concat())
    }
}

/// Adds the findings of a source; the number of its sentences.
fn check_source(path: &str, text: &str, list: &List, findings: &mut Vec<Finding>) -> usize {
    let tokens = lex(text);
    let paragraphs = comments::paragraphs(&tokens);
    let sentences: Vec<Sentence> = paragraphs.iter().flat_map(|p| sentences::split(p)).collect();
    let mut add = |line: usize, text: String, what: String| {
        findings.push(Finding { path: path.to_owned(), line, text, what });
    };
    for sentence in &sentences {
        let count = sentence.count();
        if count > list.most_words {
            let what = format!("{count} words in a sentence, {} at most", list.most_words);
            add(sentence.line(), sentence.text(), what);
        }
        for word in &list.word {
            if let Some((line, form)) = house_word(sentence, word) {
                add(line, sentence.text(), format!("\"{form}\": {}", word.instead));
            }
        }
    }
    for (token, form, word) in house_names(&tokens, list) {
        add(token.line, token.text.clone(), format!("\"{form}\" in a name: {}", word.instead));
    }
    sentences.len()
}

/// The first use of a refused word in a sentence: its line and form.
fn house_word<'a>(sentence: &Sentence, word: &'a HouseWord) -> Option<(usize, &'a str)> {
    let bare = |text: &str| text.trim_matches(|c: char| !c.is_alphanumeric()).to_lowercase();
    let words: Vec<String> = sentence.words.iter().map(|word| bare(&word.text)).collect();
    for start in 0..words.len() {
        for form in &word.forms {
            let phrase: Vec<&str> = form.split(' ').collect();
            let Some(used) = words.get(start..start + phrase.len()) else { continue };
            let is_standard = words[start..].iter().any(|later| word.unless.contains(later));
            if used == phrase && !is_standard {
                return Some((sentence.words[start].line, form));
            }
        }
    }
    None
}

/// Names that hold a refused word as one of their parts, each once per file.
fn house_names<'a>(tokens: &'a [Token], list: &'a List) -> Vec<(&'a Token, &'a str, &'a HouseWord)> {
    let mut found: Vec<(&Token, &str, &HouseWord)> = Vec::new();
    for token in tokens.iter().filter(|token| token.kind == Kind::Word) {
        let parts = parts_of(&token.text);
        for word in list.word.iter().filter(|word| word.in_names) {
            let form = word.forms.iter().find(|form| parts.contains(form));
            let is_standard = parts.iter().any(|part| word.unless.contains(part));
            let is_new = found.iter().all(|(known, ..)| known.text != token.text);
            if let Some(form) = form.filter(|_| is_new && !is_standard) {
                found.push((token, form, word));
            }
        }
    }
    found
}

/// The words of a name, in lower case: `is_askedFor` is `is`, `asked`, `for`.
fn parts_of(name: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    let mut was_lower = false;
    for c in name.chars() {
        if c == '_' || (c.is_uppercase() && was_lower) {
            parts.push(String::new());
        }
        was_lower = c.is_lowercase();
        if let Some(part) = parts.last_mut()
            && c != '_'
        {
            part.extend(c.to_lowercase());
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: &str = "most_words = 8\n[[word]]\nforms = [\"tells\", \"told\"]\nunless = [\"apart\", \"from\"]\ninstead = \"says\"\nin_names = true\n[[word]]\nforms = [\"what there is\"]\ninstead = \"name it\"";

    fn found(source: &str) -> Vec<(usize, String)> {
        let list = List::read(LIST).unwrap();
        let mut findings = Vec::new();
        check_source("a.rs", source, &list, &mut findings);
        findings.into_iter().map(|f| (f.line, f.what)).collect()
    }

    #[test]
    fn sentences_above_the_limit_are_found_over_the_lines_of_a_paragraph() {
        let source = "/// One two three four five.\n/// One two three four five\n/// six `x y z` seven eight: nine.\nfn f() {}";
        assert_eq!(found(source), [(2, "9 words in a sentence, 8 at most".to_owned())]);
        assert!(found("/// One two three four five six seven eight.\n/// One.\nfn f() {}").is_empty());
    }

    #[test]
    fn house_words_are_found_where_they_stand_and_standard_phrases_are_not() {
        assert_eq!(found("// It says\n// \"Told\".\n"), [(2, "\"told\": says".to_owned())]);
        assert_eq!(
            found("/// Gathers what there\n/// is.\n"),
            [(1, "\"what there is\": name it".to_owned())]
        );
        assert!(found("// It tells A from B.\n// `told`\nlet a = \"told\";").is_empty());
    }

    #[test]
    fn names_are_read_by_their_parts() {
        let twice = found("fn is_told() { isTold(); is_told(); let untold = 1; told_apart(); }");
        assert_eq!(
            twice,
            [(1, "\"told\" in a name: says".to_owned()), (1, "\"told\" in a name: says".to_owned())]
        );
    }
}
