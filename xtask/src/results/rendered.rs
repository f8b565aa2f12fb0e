//! What the rendered book would lack: pages that its summary does not list, and targets of links that lie outside its folder.

use super::Page;

/// The folder of the book, below the root of the workspace.
const BOOK: &str = "book/src/";

/// The list of all pages, in that folder.
const SUMMARY: &str = "SUMMARY.md";

/// A problem for each page that is not listed, and for each link that leaves the book.
pub(super) fn problems(pages: &[Page]) -> Vec<String> {
    let of_book =
        || pages.iter().filter_map(|page| Some((page.path.strip_prefix(BOOK)?, page.text.as_str())));
    let summary = of_book().find(|(path, _)| *path == SUMMARY).map_or("", |(_, text)| text);
    let mut problems = Vec::new();
    for (path, text) in of_book() {
        if path != SUMMARY && !summary.contains(&format!("({path})")) {
            problems.push(format!(
                "{BOOK}{path}: {BOOK}{SUMMARY} does not list it, so the book has no such page"
            ));
        }
        let leaving = targets(text).into_iter().filter(|(_, target)| leaves(path, target));
        problems.extend(leaving.map(|(line, target)| {
            format!(
                "{BOOK}{path}:{line}: {target} lies outside the book; name the file in words, or link a page"
            )
        }));
    }
    problems
}

/// The targets of links and pictures outside of code, with their lines.
fn targets(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut is_code = false;
    for (number, line) in text.lines().enumerate() {
        is_code ^= line.trim_start().starts_with("```");
        if is_code {
            continue;
        }
        for (at, _) in line.match_indices("](") {
            let is_sample = line[..at].matches('`').count() % 2 == 1;
            if let (false, Some((target, _))) = (is_sample, line[at + 2..].split_once(')')) {
                found.push((number + 1, target));
            }
        }
    }
    found
}

/// Whether a relative target goes up further than its page is deep in the book.
fn leaves(page: &str, target: &str) -> bool {
    let is_relative = !target.contains("://") && !target.starts_with("mailto:");
    let (path, _) = target.split_once('#').unwrap_or((target, ""));
    let mut depth = page.matches('/').count() as i64;
    is_relative
        && path.split('/').any(|part| {
            depth += match part {
                ".." => -1,
                "." | "" => 0,
                _ => 1,
            };
            depth < 0
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_listed_and_links_stay_in_the_book() {
        let page = |path: &str, text: &str| Page { path: path.to_owned(), text: text.to_owned() };
        let with = |text: &str| {
            problems(&[
                page("README.md", "[up](../else.md)"),
                page("book/src/SUMMARY.md", "- [One](how-to/one.md)\n"),
                page("book/src/how-to/one.md", text),
            ])
        };
        let right = "[a](../b.md#c) ![d](../images/./e.png) [f](https://g.h/../..) `[i](../../j)`\n```text\n[k](../../l)\n```\n";
        assert_eq!(with(right), [""; 0]);
        let found = with("\n[data](../../../data/photos/README.md)\n");
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with("book/src/how-to/one.md:2: ../../../data"), "{found:?}");
        let found = problems(&[page("book/src/two.md", "")]);
        assert!(found[0].starts_with("book/src/two.md: book/src/SUMMARY.md does not list it"), "{found:?}");
    }
}
