//! `cargo xtask results`: the tables of the book's results from their data, and the figures of its sentences checked against them.
//!
//! The data are `book/results/*.json` and `book/results/claims.toml`. `results` writes the tables of the pages, `--check` only compares, and
//! `--take FILE/TABLE RUN...` fills a table from the files `metrics.json` of finished runs; `--row ROW=CAMERA` behind the table fills one row.

mod claims;
mod data;
mod figure;
mod gap;
mod page;
mod rendered;
mod study;
mod take;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use claims::Claims;
use data::{Data, FOLDER};
use page::Filled;

/// Runs the chore with the words behind its name.
pub fn run(words: &[String]) -> Result<String, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match words.as_slice() {
        [] => write(root),
        ["--check"] => check(root),
        ["--take", key, "--row", row, runs @ ..] if !runs.is_empty() => {
            let runs: Vec<&Path> = runs.iter().map(Path::new).collect();
            take::take_row(root, key, row, &runs).map_err(|problem| vec![problem])?;
            write(root)
        }
        ["--take", key, runs @ ..] if !runs.is_empty() => {
            let runs: Vec<&Path> = runs.iter().map(Path::new).collect();
            take::take(root, key, &runs).map_err(|problem| vec![problem])?;
            write(root)
        }
        _ => Err(vec![
            "usage: cargo xtask results [--check | --take FILE/TABLE [--row ROW=CAMERA] RUN...]".to_owned(),
        ]),
    }
}

/// Writes the tables of all pages anew, unless there is a problem. Sentences stay as they are: their figures are checked.
fn write(root: &Path) -> Result<String, Vec<String>> {
    let made = make(root)?;
    if !made.problems.is_empty() {
        return Err(made.problems);
    }
    let mut changed = 0;
    for (page, filled) in made.pages.iter().filter(|(page, filled)| page.text != filled.text) {
        fs::write(root.join(&page.path), &filled.text).map_err(|e| vec![format!("{}: {e}", page.path)])?;
        changed += 1;
    }
    Ok(format!("{}; {changed} pages written", made.report))
}

/// Compares all pages with their data, and looks at what the rendered book would lack.
fn check(root: &Path) -> Result<String, Vec<String>> {
    let mut made = make(root)?;
    for (page, filled) in made.pages.iter().filter(|(page, filled)| page.text != filled.text) {
        let lines = page.text.lines().zip(filled.text.lines());
        let line = lines.take_while(|(before, after)| before == after).count() + 1;
        made.problems.push(format!(
            "{}:{line}: the table is not that of its data; run `cargo xtask results`",
            page.path
        ));
    }
    let pages: Vec<Page> = made.pages.into_iter().map(|(page, _)| page).collect();
    made.problems.extend(rendered::problems(&pages));
    if made.problems.is_empty() { Ok(made.report) } else { Err(made.problems) }
}

/// A page as it stands.
struct Page {
    /// Below the root of the workspace.
    path: String,
    text: String,
}

/// All pages as they should be.
struct Made {
    pages: Vec<(Page, Filled)>,
    problems: Vec<String>,
    report: String,
}

fn make(root: &Path) -> Result<Made, Vec<String>> {
    let one = |problem: String| vec![problem];
    let data = Data::read(root).map_err(one)?;
    let path = format!("{FOLDER}/claims.toml");
    let text = fs::read_to_string(root.join(&path)).map_err(|e| vec![format!("{path}: {e}")])?;
    let claims = Claims::parse(&text).map_err(|problem| vec![format!("{path}{problem}")])?;
    let pages = pages(root).map_err(one)?;
    let filled = |others: &[String]| -> Vec<Filled> {
        pages.iter().map(|page| page::fill(&page.path, &page.text, &data, &claims, others)).collect()
    };
    // First which tables the pages show by themselves, then the pages of the others.
    let shown: BTreeSet<String> = filled(&[]).into_iter().flat_map(|page| page.shown).collect();
    let all = data
        .files
        .iter()
        .flat_map(|(name, file)| file.tables.iter().map(move |table| format!("{name}/{}", table.key)));
    let others: Vec<String> = all.filter(|key| !shown.contains(key)).collect();
    let filled = filled(&others);
    let mut problems: Vec<String> = filled.iter().flat_map(|page| page.problems.clone()).collect();
    let on_a_page: BTreeSet<&String> = filled.iter().flat_map(|page| &page.shown).collect();
    problems.extend(others.iter().filter(|key| !on_a_page.contains(key)).map(|key| {
        let (file, _) = key.split_once('/').unwrap_or((key, ""));
        format!("table {key:?} stands on no page; write <!-- other tables {file} --> on one")
    }));
    problems.extend(claims.problems(root, &data));
    problems.extend(study::problems(root, &data));
    let figures: usize = filled.iter().map(|page| page.figures).sum();
    let report = format!(
        "results: {} tables, {figures} figures in sentences and {} claims agree with their data",
        on_a_page.len(),
        claims.claim.len()
    );
    Ok(Made { pages: pages.into_iter().zip(filled).collect(), problems, report })
}

/// The pages that may have marks: the book, and the files of Markdown beside it.
fn pages(root: &Path) -> Result<Vec<Page>, String> {
    let mut paths = Vec::new();
    let mut open = vec![root.join("book/src")];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))? {
            let path = entry.map_err(|e| e.to_string())?.path();
            if path.is_dir() { open.push(path) } else { paths.push(path) }
        }
    }
    let is_page = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "md");
    paths.retain(is_page);
    let beside = ["README.md", "CHANGELOG.md", "crates/petzval-python/README.md"];
    paths.extend(beside.iter().map(|path| root.join(path)).filter(|path| path.is_file()));
    paths.sort();
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let below = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().into_owned();
        Ok(Page { path: below, text })
    };
    paths.into_iter().map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pages_agree_with_their_data() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        if let Err(problems) = check(&root) {
            panic!("{}", problems.join("\n"));
        }
    }

    #[test]
    fn nothing_is_written_while_a_page_has_a_problem() {
        let root = std::env::temp_dir().join(format!("petzval-results-{}", std::process::id()));
        let table = r#"{"tables": [{"key": "cost", "title": "The cost", "command": "petzval bench", "version": "0.1.0",
            "date": "2026-11-27", "origin": "runs", "columns": [{"name": "part"}, {"name": "time"}], "rows": [["all", 17]]}]}"#;
        let page =
            "18<!-- figure speed/cost: all, time -->\n\n<!-- table speed/cost -->\n| old |\n<!-- end -->\n";
        let put = |path: &str, text: &str| {
            let path = root.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        put("book/results/claims.toml", "");
        put("book/results/speed.json", table);
        put("book/src/speed.md", page);
        let text = || fs::read_to_string(root.join("book/src/speed.md")).unwrap();
        assert!(write(&root).unwrap_err()[0].contains("the data say \"17\""));
        assert_eq!(text(), page);
        put("book/src/speed.md", &page.replace("18", "17"));
        assert!(write(&root).unwrap().ends_with("1 pages written"));
        assert!(text().contains("| all | 17 |"));
        put("book/src/speed.md", "No table.\n");
        assert!(write(&root).unwrap_err()[0].contains("\"speed/cost\" stands on no page"));
        fs::remove_dir_all(&root).unwrap();
    }

    #[test]
    fn words_that_are_no_call_are_refused() {
        let refused = |words: &[&str]| run(&words.iter().map(|word| word.to_string()).collect::<Vec<_>>());
        for words in [&["--chek"][..], &["--take"], &["--take", "image-quality/main"]] {
            assert!(refused(words).unwrap_err()[0].starts_with("usage:"));
        }
    }
}
