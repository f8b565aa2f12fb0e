//! A page of the book: its tables stand between marks, and its figures have marks behind them. Marks are comments, which a reader does not see.
//!
//! ```text
//! <!-- table image-quality/main -->        the table of the data, up to <!-- end -->
//! <!-- claims -->                          the table of all claims, up to <!-- end -->
//! <!-- other tables speed -->              every table of speed.json that no page shows by itself, up to <!-- end -->
//! 0.86 dB<!-- figure image-quality/main-gain: nominal, PSNR -->
//! 1e-9 mm<!-- claim optiland-rays -->
//! ```

use std::collections::BTreeSet;

use super::claims::Claims;
use super::data::{Column, Data, FOLDER, Table};
use super::figure::Figure;

/// The end of a table of a page.
const END: &str = "<!-- end -->";

/// How comments begin that are no marks.
const OTHER_COMMENTS: [&str; 1] = ["From here on this page is made from the program"];

/// A page with its tables anew.
#[derive(Debug, Default)]
pub(super) struct Filled {
    pub text: String,
    /// Problems, each with the path and line of the page.
    pub problems: Vec<String>,
    /// Tables that the page shows.
    pub shown: BTreeSet<String>,
    /// Figures in its sentences.
    pub figures: usize,
}

/// Writes the tables of a page, and checks the figures in its sentences. `others` are the tables that no other page shows.
pub(super) fn fill(path: &str, text: &str, data: &Data, claims: &Claims, others: &[String]) -> Filled {
    let mut filled = Filled::default();
    let mut lines = text.lines().enumerate();
    let mut is_code = false;
    while let Some((number, line)) = lines.next() {
        filled.text += line;
        filled.text.push('\n');
        is_code ^= line.trim_start().starts_with("```");
        if is_code {
            continue;
        }
        let place = format!("{path}:{}", number + 1);
        match block(line, data, claims, others) {
            None => check_figures(line, &place, data, claims, &mut filled),
            Some(Err(problem)) => filled.problems.push(format!("{place}: {problem}")),
            Some(Ok((block, shown))) => {
                filled.shown.extend(shown);
                // Drop the old table only if its end is known: without it the lines behind are text.
                if has_end(lines.clone().map(|(_, line)| line)) {
                    lines.any(|(_, line)| line.trim() == END);
                    filled.text += &format!("\n{block}\n{END}\n");
                } else {
                    filled.problems.push(format!("{place}: the table has no end; write {END} behind it"));
                }
            }
        }
    }
    filled
}

/// Whether the end of a block stands in the lines behind its first, before another block begins.
fn has_end<'a>(mut lines: impl Iterator<Item = &'a str>) -> bool {
    let next = lines.find(|line| line.trim() == END || is_block(line));
    next.is_some_and(|line| line.trim() == END)
}

/// The words of a line that is a mark and nothing else.
fn mark(line: &str) -> Option<&str> {
    line.trim().strip_prefix("<!-- ")?.strip_suffix(" -->")
}

/// Whether a line begins a block.
fn is_block(line: &str) -> bool {
    mark(line).is_some_and(|mark| {
        mark.starts_with("table ") || mark.starts_with("other tables ") || mark == "claims"
    })
}

/// The text of a block and the tables that it shows, if a line begins one.
fn block(
    line: &str,
    data: &Data,
    claims: &Claims,
    others: &[String],
) -> Option<Result<(String, Vec<String>), String>> {
    let name = mark(line)?;
    if let Some(key) = name.strip_prefix("table ") {
        return Some(data.table(key).map(|table| (table_text(table), vec![key.to_owned()])));
    }
    if let Some(file) = name.strip_prefix("other tables ") {
        return Some(others_of(file, data, others));
    }
    (name == "claims").then(|| claims.text(data).map(|text| (text, Vec::new())))
}

/// Every table of a file that no page shows by itself, with their keys.
fn others_of(file: &str, data: &Data, others: &[String]) -> Result<(String, Vec<String>), String> {
    let Some(known) = data.files.get(file) else {
        let files: Vec<&str> = data.files.keys().map(String::as_str).collect();
        return Err(format!("other tables: {FOLDER} has no {file}.json; it has {}", files.join(", ")));
    };
    let (mut text, mut shown) = (Vec::new(), Vec::new());
    for table in &known.tables {
        let key = format!("{file}/{}", table.key);
        if others.contains(&key) {
            text.push(format!("## {}\n\n{}", table.key, table_text(table)));
            shown.push(key);
        }
    }
    Ok((text.join("\n"), shown))
}

/// A table in Markdown, with its title before it and its origin behind it.
fn table_text(table: &Table) -> String {
    let heads: Vec<String> = table.columns.iter().map(Column::head).collect();
    let mut text = format!("*{}*\n\n{}\n|{}\n", table.title, row_text(&heads), "---|".repeat(heads.len()));
    for row in &table.rows {
        let cells = row.iter().zip(&table.columns);
        let cells: Vec<String> = cells
            .map(|(cell, column)| cell.as_ref().map_or(String::new(), |cell| cell.text(column)))
            .collect();
        text += &row_text(&cells);
        text.push('\n');
    }
    format!("{text}\n<small>{}</small>\n", table.source())
}

fn row_text(cells: &[String]) -> String {
    format!("| {} |", cells.join(" | "))
}

impl Column {
    fn head(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{}, {}", self.name, self.unit) }
    }
}

impl Table {
    /// Seeds, command, version and date, for a reader.
    fn source(&self) -> String {
        let is_spread = self.rows.iter().flatten().flatten().any(|figure| figure.spread().is_some());
        let seeds: Vec<String> = self.seeds.iter().map(u64::to_string).collect();
        let seeds = match seeds.as_slice() {
            [] => String::new(),
            [one] => format!("Seed {one}. "),
            _ => format!("Seeds {}. ", seeds.join(", ")),
        };
        let spread = if is_spread && self.seeds.len() > 1 {
            "`+-` is the standard deviation over the seeds. "
        } else {
            ""
        };
        let renewed = self.renewed.iter().map(|renewed| {
            format!(" The row *{}* is newer: Petzval {}, {}.", renewed.row, renewed.version, renewed.date)
        });
        let renewed: String = renewed.collect();
        format!(
            "{seeds}{spread}Made by `{}`, Petzval {}, {}.{renewed}",
            self.command, self.version, self.date
        )
    }
}

/// Checks every mark of a line against the text before it, and that every other comment is known.
fn check_figures(line: &str, place: &str, data: &Data, claims: &Claims, filled: &mut Filled) {
    let mut rest = line;
    let mut before = String::new();
    while let Some((text, behind)) = rest.split_once("<!--") {
        before += text;
        // A sample of a mark in a sentence.
        if before.matches('`').count() % 2 == 1 {
            before += "<!--";
            rest = behind;
            continue;
        }
        let Some((comment, behind)) = behind.split_once("-->") else {
            filled
                .problems
                .push(format!("{place}: a comment that its line does not end; write --> behind it"));
            break;
        };
        rest = behind;
        let mark =
            comment.strip_prefix(' ').and_then(|comment| comment.strip_suffix(' ')).unwrap_or_default();
        let forms = if let Some(address) = mark.strip_prefix("figure ") {
            data.figure(address).map(|(figure, column): (&Figure, _)| figure.forms(column))
        } else if let Some(key) = mark.strip_prefix("claim ") {
            claims.forms(key, data)
        } else {
            if !OTHER_COMMENTS.iter().any(|known| mark.starts_with(known)) {
                filled.problems.push(format!(
                    "{place}: <!--{comment}--> is no mark here: the file of the check, xtask/src/results/page.rs, shows how each is written"
                ));
            }
            continue;
        };
        filled.figures += 1;
        if mark.contains("--") {
            filled.problems.push(format!(
                "{place}: {mark}: a comment of Markdown holds no \"--\"; name the row without it"
            ));
        }
        match forms {
            Err(problem) => filled.problems.push(format!("{place}: {problem}")),
            Ok(forms) if forms.iter().any(|form| ends_with(&before, form)) => {}
            Ok(forms) => {
                let written = before.trim_end().chars().rev().take(40).collect::<Vec<_>>();
                let written: String = written.into_iter().rev().collect();
                filled.problems.push(format!(
                    "{place}: {mark}: the text says \"...{written}\", the data say {:?}; change the text, or the data if they are new",
                    forms.first().map_or("", String::as_str)
                ));
            }
        }
    }
}

/// Whether a text ends with a figure that is not the end of a longer number.
fn ends_with(text: &str, figure: &str) -> bool {
    let Some(before) = text.strip_suffix(figure) else { return false };
    !before.ends_with(|c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | ',' | '-' | '+'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::data::DataFile;

    const TABLES: &str = r#"{"tables": [{"key": "gain", "title": "The gain", "command": "petzval design --seed N", "seeds": [1, 2],
        "version": "0.1.0", "date": "2026-11-27", "origin": "runs",
        "columns": [{"name": "against"}, {"name": "PSNR", "unit": "dB", "decimals": 2, "signed": true}],
        "rows": [["nominal", {"mean": 0.86, "deviation": 0.06}], ["perfect", null]]},
        {"key": "cost", "title": "The cost", "command": "petzval bench",
        "version": "0.1.0", "date": "2026-11-27", "origin": "runs",
        "columns": [{"name": "part"}, {"name": "time", "unit": "ms"}], "rows": [["all", 17]]}]}"#;
    const CLAIMS: &str = "[[claim]]\nkey = 'rays'\nsays = 'Rays agree'\nfigure = '1e-9 mm'\nmade_by = 'a test'\ndate = '2026-11-27'\ndata = 'Cargo.toml'\nholds = 'x'\n";

    fn filled(text: &str) -> Filled {
        let file = DataFile::parse(TABLES).unwrap();
        let data = Data { files: [("quality".to_owned(), file)].into() };
        fill("page.md", text, &data, &Claims::parse(CLAIMS).unwrap(), &["quality/cost".to_owned()])
    }

    #[test]
    fn a_table_is_written_between_its_marks_and_again_to_the_same_text() {
        let page = "Before.\n\n<!-- table quality/gain -->\n| what | ever |\n<!-- end -->\n\nBehind.\n";
        let once = filled(page);
        assert_eq!(once.problems, [""; 0]);
        let expected = "Before.\n\n<!-- table quality/gain -->\n\n*The gain*\n\n| against | PSNR, dB |\n|---|---|\n\
            | nominal | +0.86 +- 0.06 |\n| perfect |  |\n\n\
            <small>Seeds 1, 2. `+-` is the standard deviation over the seeds. Made by `petzval design --seed N`, Petzval 0.1.0, 2026-11-27.</small>\n\n\
            <!-- end -->\n\nBehind.\n";
        assert_eq!(once.text, expected);
        assert_eq!(once.shown, ["quality/gain".to_owned()].into());
        assert_eq!(filled(&once.text).text, once.text);
    }

    #[test]
    fn a_table_without_its_end_keeps_the_text_behind_it() {
        let page = "<!-- table quality/gain -->\n| old |\n\nProse between.\n\n<!-- table quality/cost -->\n| old |\n<!-- end -->\n\nProse behind.\n";
        let page = filled(page);
        assert_eq!(page.problems.len(), 1, "{:?}", page.problems);
        assert!(page.problems[0].starts_with("page.md:1: the table has no end"), "{:?}", page.problems);
        assert!(
            page.text.contains("| old |\n\nProse between.\n\n<!-- table quality/cost -->\n\n*The cost*"),
            "{}",
            page.text
        );
        assert!(page.text.ends_with("<!-- end -->\n\nProse behind.\n"));
        let last = filled("<!-- table quality/gain -->\n| old |\n\nProse behind.\n");
        assert!(last.text.ends_with("| old |\n\nProse behind.\n"), "{}", last.text);
    }

    #[test]
    fn tables_that_no_page_shows_have_one_of_their_own() {
        let page = filled("<!-- other tables quality -->\n<!-- end -->\n");
        assert!(page.text.contains("-->\n\n## cost\n\n*The cost*"), "{}", page.text);
        assert!(page.text.contains("| all | 17 |\n\n<small>Made by `petzval bench`"), "{}", page.text);
        assert_eq!(page.shown, ["quality/cost".to_owned()].into());
        let problems = filled("<!-- other tables detection -->\n<!-- end -->\n").problems;
        assert!(problems[0].contains("no detection.json; it has quality"), "{problems:?}");
    }

    #[test]
    fn figures_of_sentences_are_those_of_the_data() {
        let of = |text: &str| format!("{text}<!-- figure quality/gain: nominal, PSNR -->, and more");
        for right in ["It leads by 0.86 dB", "by +0.86 +- 0.06 dB", "(0.86"] {
            let page = filled(&of(right));
            assert_eq!((page.problems.as_slice(), page.figures), ([].as_slice(), 1), "{right}");
        }
        for wrong in ["by 0.87 dB", "by 10.86 dB", "by -0.86 dB", "by 0.86 %"] {
            let page = filled(&of(wrong));
            assert!(page.problems[0].starts_with("page.md:1: figure quality/gain"), "{:?}", page.problems);
            assert!(page.problems[0].contains("the data say \"+0.86 +- 0.06 dB\""), "{:?}", page.problems);
        }
        let claim = |text: &str| filled(&format!("Rays agree to {text}<!-- claim rays -->.")).problems;
        assert_eq!(claim("1e-9 mm"), [""; 0]);
        assert_eq!(claim("1e-8 mm").len(), 1);
    }

    #[test]
    fn marks_that_lead_nowhere_are_named_with_their_line() {
        let problem = |text: &str| filled(text).problems.concat();
        assert!(problem("\n<!-- table quality/main -->\n<!-- end -->").starts_with("page.md:2: table"));
        assert!(problem("<!-- table quality/gain -->\n").contains("the table has no end"));
        assert!(problem("1<!-- claim other -->").contains("page.md:1: claim \"other\""));
        assert!(problem("1<!-- claim --other -->").contains("a comment of Markdown holds no"));
        // A mark that is misspelt, or stands where it means nothing.
        for unknown in [
            "<!-- tabel quality/gain -->",
            "1<!--claim rays-->",
            "1<!-- claims rays -->",
            "1<!-- figures quality/gain: nominal, PSNR -->",
            "See <!-- table quality/gain -->",
            "<!-- end -->",
            "<!-- to do -->",
        ] {
            assert!(problem(unknown).contains("is no mark here"), "{unknown}: {:?}", problem(unknown));
        }
        assert!(problem("1e-9 mm<!-- claim rays").contains("does not end"));
        let other = "<!-- From here on this page is made from the program; a test compares both. -->";
        assert_eq!(problem(other), "");
        assert_eq!(problem("Write `<!-- claim KEY -->` behind it, and `<!-- table X -->`."), "");
        // A sample of code shows marks, and has none.
        assert_eq!(problem("```text\n<!-- table quality/main -->\n1<!-- claim other -->\n```\n"), "");
    }
}
