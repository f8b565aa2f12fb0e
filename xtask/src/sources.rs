//! The modules of a crate, and the paths that their code names.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::files::rust_files;
use super::lexer::{Kind, Token, lex};

/// The path of a module below its crate: `["emva", "point"]`.
pub(super) type ModulePath = Vec<String>;

/// What is known about one module.
#[derive(Default)]
pub(super) struct Module {
    /// Names that `use` brings in, with the path they stand for.
    pub imports: BTreeMap<String, Vec<String>>,
    /// Paths of `use module::*`.
    pub globs: Vec<Vec<String>>,
    /// Paths that the code names, beside those that it only re-exports.
    pub paths: Vec<Vec<String>>,
    /// Items that the module defines.
    pub items: BTreeSet<String>,
}

/// The modules of the sources below a folder, by path.
pub(super) fn read_modules(sources: &Path) -> BTreeMap<ModulePath, Module> {
    let mut tokens: BTreeMap<ModulePath, Vec<String>> = BTreeMap::new();
    let mut tests: BTreeSet<ModulePath> = BTreeSet::new();
    for file in rust_files(sources) {
        let Some(path) = module_path(sources, &file) else { continue };
        let (code, test_files) = without_tests(tokenize(&fs::read_to_string(&file).unwrap_or_default()));
        tests.extend(test_files.into_iter().map(|name| path.iter().cloned().chain([name]).collect()));
        tokens.entry(path).or_default().extend(code);
    }
    tokens.retain(|path, _| !tests.iter().any(|test: &ModulePath| path.starts_with(test)));
    let names: BTreeSet<ModulePath> = tokens.keys().cloned().collect();
    let children = |path: &ModulePath| -> BTreeSet<String> {
        let below = names.iter().filter(|n| n.len() == path.len() + 1 && n.starts_with(path));
        below.filter_map(|n| n.last().cloned()).collect()
    };
    tokens.iter().map(|(path, code)| (path.clone(), read_module(code, &children(path)))).collect()
}

/// `src/emva/point.rs` is `["emva", "point"]`; programs beside the library have no module path.
fn module_path(sources: &Path, file: &Path) -> Option<ModulePath> {
    let below = file.strip_prefix(sources).ok()?.with_extension("");
    let mut path: ModulePath = below.iter().map(|s| s.to_string_lossy().into_owned()).collect();
    if path.first().is_some_and(|first| first == "bin") || path == ["main"] {
        return None;
    }
    if path == ["lib"] || path.last().is_some_and(|last| last == "mod") {
        path.pop();
    }
    Some(path)
}

/// Words and signs of the code, without comments, strings and characters; `::` is one sign.
fn tokenize(text: &str) -> Vec<String> {
    let is_code = |token: &Token| token.kind != Kind::Comment;
    lex(text).into_iter().filter(is_code).map(|token| token.text).collect()
}

/// The code without `#[cfg(test)]` items, and the names of the files that hold only tests.
fn without_tests(tokens: Vec<String>) -> (Vec<String>, Vec<String>) {
    let test = ["#", "[", "cfg", "(", "test", ")", "]"];
    let (mut kept, mut files, mut i) = (Vec::new(), Vec::new(), 0);
    while i < tokens.len() {
        if !tokens[i..].iter().take(test.len()).map(String::as_str).eq(test) {
            kept.push(tokens[i].clone());
            i += 1;
            continue;
        }
        // Up to the end of the item: a semicolon or the closing brace.
        i += test.len();
        let (mut depth, start) = (0usize, i);
        while i < tokens.len() {
            match tokens[i].as_str() {
                "{" => depth += 1,
                "}" => depth = depth.saturating_sub(1),
                _ => {}
            }
            i += 1;
            if depth == 0 && [";", "}"].contains(&tokens[i - 1].as_str()) {
                break;
            }
        }
        let item = &tokens[start..i];
        if let Some(place) = item.iter().position(|t| t == "mod")
            && item.last().is_some_and(|t| t == ";")
        {
            files.push(item[place + 1].clone());
        }
    }
    (kept, files)
}

fn read_module(tokens: &[String], children: &BTreeSet<String>) -> Module {
    const ITEMS: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "const", "static", "union"];
    let mut module = Module::default();
    let mut re_exports: Vec<(String, Vec<String>)> = Vec::new();
    let mut words: BTreeSet<&str> = BTreeSet::new();
    let mut i = 0;
    while i < tokens.len() {
        let (token, before) = (tokens[i].as_str(), i.checked_sub(1).map_or("", |b| tokens[b].as_str()));
        if token == "use" && before != "<" {
            let end = (i..tokens.len()).find(|e| tokens[*e] == ";").unwrap_or(tokens.len());
            let is_public = before == "pub" || before == ")";
            for (name, path) in use_tree(&tokens[i + 1..end], &[]) {
                if name == "*" {
                    module.globs.push(path.clone());
                } else {
                    module.imports.insert(name.clone(), path.clone());
                }
                if is_public { re_exports.push((name, path)) } else { module.paths.push(path) }
            }
            i = end + 1;
            continue;
        }
        // The name of a module is no use of an item that has the same name.
        if token == "mod" {
            i += 2;
            continue;
        }
        if ITEMS.contains(&token)
            && let Some(name) = tokens.get(i + 1)
        {
            module.items.insert(name.clone());
            i += 2;
            continue;
        }
        let begins = before != "::" && tokens.get(i + 1).is_some_and(|t| t == "::");
        if begins && (["crate", "super", "self"].contains(&token) || children.contains(token)) {
            let mut path = vec![token.to_owned()];
            while tokens.get(i + 1).is_some_and(|t| t == "::")
                && tokens.get(i + 2).is_some_and(|t| t.starts_with(|c: char| c.is_alphabetic() || c == '_'))
            {
                path.push(tokens[i + 2].clone());
                i += 2;
            }
            module.paths.push(path);
        } else {
            words.insert(token);
        }
        i += 1;
    }
    // A re-export is a use of its own only if the code names it.
    let named = re_exports.into_iter().filter(|(name, _)| words.contains(name.as_str()));
    module.paths.extend(named.map(|(_, path)| path));
    module.paths.retain(|path| {
        path.first().is_some_and(|f| ["crate", "super", "self"].contains(&f.as_str()) || children.contains(f))
    });
    module
}

/// The names that a `use` brings in with their full paths; `*` for all of a module.
fn use_tree(tokens: &[String], prefix: &[String]) -> Vec<(String, Vec<String>)> {
    // Split at the commas outside of braces.
    let mut found = Vec::new();
    let (mut depth, mut start) = (0usize, 0);
    for end in 0..=tokens.len() {
        match tokens.get(end).map(String::as_str) {
            Some("{") => depth += 1,
            Some("}") => depth -= 1,
            Some(",") | None if depth == 0 => {
                found.extend(use_branch(&tokens[start..end], prefix));
                start = end + 1;
            }
            _ => {}
        }
    }
    found
}

fn use_branch(tokens: &[String], prefix: &[String]) -> Vec<(String, Vec<String>)> {
    if let Some(open) = tokens.iter().position(|t| t == "{") {
        let own = tokens[..open].iter().filter(|t| *t != "::").cloned();
        let path: Vec<String> = prefix.iter().cloned().chain(own).collect();
        return use_tree(&tokens[open + 1..tokens.len() - 1], &path);
    }
    let (named, alias) = match tokens.iter().position(|t| t == "as") {
        Some(place) => (&tokens[..place], tokens.get(place + 1).cloned()),
        None => (tokens, None),
    };
    let own = named.iter().filter(|t| *t != "::").cloned();
    let mut path: Vec<String> = prefix.iter().cloned().chain(own).collect();
    let Some(last) = path.last().cloned() else { return Vec::new() };
    if last == "*" || (last == "self" && path.len() > 1) {
        path.pop();
    }
    let name = if last == "self" { path.last().cloned().unwrap_or_default() } else { last };
    vec![(alias.unwrap_or(name), path)]
}
