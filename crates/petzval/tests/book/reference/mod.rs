//! The reference pages of the book: what stands below their mark is what the program says.
//!
//! `PETZVAL_WRITE_REFERENCE=1 cargo test --release -p petzval --test book reference` writes them anew. What stands above the mark is written by hand, in the page.

mod command_line;
mod events;
mod experiment_file;
mod files;
mod groups;
mod jobs;
mod markdown;
pub mod schema_rows;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::common::{read, snapshot};

/// The line between what is written by hand and what the program says.
const MARK: &str = "<!-- From here on this page is made from the program; a test compares both. -->";

/// A page of the reference.
pub struct Page {
    /// Its file, below the folder of the reference.
    path: String,
    /// What stands above the mark where nobody has to write anything; empty for a page with words of its own.
    frame: String,
    /// What stands below the mark.
    generated: String,
}

/// Words on a page that is to be read, not only searched.
const MOST_WORDS: usize = 2500;

/// Words that are written by hand, on all pages together.
const MOST_WORDS_BY_HAND: usize = 2000;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/reference")
}

fn pages() -> Vec<Page> {
    let parts =
        [command_line::pages(), experiment_file::pages(), files::pages(), events::pages(), jobs::pages()];
    parts.into_iter().flatten().collect()
}

#[test]
fn the_reference_is_what_the_program_says() {
    let writes = std::env::var_os("PETZVAL_WRITE_REFERENCE").is_some();
    let (mut wrong, mut long, mut by_hand, mut expected) = (Vec::new(), Vec::new(), 0, BTreeSet::new());
    for Page { path, frame, generated } in pages() {
        let file = folder().join(&path);
        let before = std::fs::read_to_string(&file).unwrap_or_default();
        let own = before.split(MARK).next().unwrap_or_default().trim_end().to_owned();
        let head = if frame.is_empty() { own.clone() } else { frame.trim_end().to_owned() };
        let page = format!("{head}\n\n{MARK}\n\n{}\n", generated.trim());
        if writes && before != page {
            std::fs::create_dir_all(file.parent().expect("a folder")).expect("a new folder");
            std::fs::write(&file, &page).expect("a page");
        } else if before != page {
            wrong.push(path.clone());
        }
        let words = page.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count();
        if words > MOST_WORDS {
            long.push(format!("{path}: {words}"));
        }
        by_hand += own.split_whitespace().count() * usize::from(frame.is_empty());
        expected.insert(PathBuf::from(path));
    }
    let hint = "PETZVAL_WRITE_REFERENCE=1 cargo test --release -p petzval --test book reference";
    assert!(wrong.is_empty(), "{wrong:?} are not what the program says; `{hint}` writes them anew");
    assert!(long.is_empty(), "pages of more than {MOST_WORDS} words, to be shared out: {}", long.join(", "));
    assert!(by_hand <= MOST_WORDS_BY_HAND, "{by_hand} words are written by hand");
    let here = snapshot(&folder()).into_keys().filter(|path| path.extension().is_some_and(|end| end == "md"));
    let here: BTreeSet<PathBuf> =
        here.map(|path| path.strip_prefix(folder()).expect("below the folder").to_owned()).collect();
    assert_eq!(here, expected, "pages that nothing makes, or that are missing");
}

#[test]
fn the_summary_lists_every_page_of_the_reference() {
    let summary = read(&folder().join("../SUMMARY.md"));
    for Page { path, .. } in pages() {
        assert!(
            summary.contains(&format!("(reference/{path})")),
            "book/src/SUMMARY.md does not list reference/{path}"
        );
    }
}
