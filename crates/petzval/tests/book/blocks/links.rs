//! Links between pages lead to pages and headings that are there.

use std::collections::BTreeSet;
use std::path::Path;

use super::{pages, root};

/// The anchors of a page: its headings as mdBook and GitHub write them.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut in_block = false;
    for line in page.lines() {
        in_block ^= line.trim_start().starts_with("```");
        let heading = line.trim_start_matches('#');
        if in_block || heading.len() == line.len() || !heading.starts_with(' ') {
            continue;
        }
        let kept = |c: char| c.is_alphanumeric() || c == '-' || c == '_' || c == ' ';
        let id: String = unlinked(heading.trim()).to_lowercase().chars().filter(|c| kept(*c)).collect();
        found.insert(id.replace(' ', "-"));
    }
    found
}

/// A heading without the targets of its links.
fn unlinked(heading: &str) -> String {
    let mut out = String::new();
    let mut rest = heading;
    while let Some((before, after)) = rest.split_once("](") {
        out += before;
        rest = after.split_once(')').map_or("", |(_, after)| after);
    }
    out + rest
}

/// The targets of the links of a page, with their lines.
fn targets(page: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut in_block = false;
    for (number, line) in page.lines().enumerate() {
        in_block ^= line.trim_start().starts_with("```");
        if in_block {
            continue;
        }
        for (at, _) in line.match_indices("](") {
            // A link inside of code is no link.
            if line[..at].matches('`').count() % 2 == 0
                && let Some((target, _)) = line[at + 2..].split_once(')')
            {
                found.push((number + 1, target.to_owned()));
            }
        }
    }
    found
}

#[test]
fn links_lead_to_pages_and_headings() {
    let root = root();
    let all = pages();
    let mut problems = Vec::new();
    for (name, text) in &all {
        for (line, target) in targets(text) {
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let path = if file.is_empty() {
                root.join(name)
            } else {
                root.join(name).parent().unwrap_or(Path::new(".")).join(file)
            };
            let Ok(path) = path.canonicalize() else {
                problems.push(format!("{name}:{line}: {target} is not there"));
                continue;
            };
            let there = all.iter().find(|(other, _)| root.join(other) == path);
            if let (false, Some((_, there))) = (anchor.is_empty(), there)
                && !anchors(there).contains(anchor)
            {
                problems.push(format!("{name}:{line}: {target}: no such heading"));
            }
        }
    }
    assert!(problems.is_empty(), "{} links lead nowhere:\n{}", problems.len(), problems.join("\n"));
}

#[test]
fn headings_have_the_anchors_of_mdbook() {
    let page = "# `lens show LENS`\n## The [stop](a.md#b)'s place\n```text\n# no heading\n```\n";
    assert_eq!(anchors(page), ["lens-show-lens", "the-stops-place"].map(str::to_owned).into());
    assert_eq!(targets("a [b](c.md#d) `[e](f)`\n"), [(1, "c.md#d".to_owned())]);
}
