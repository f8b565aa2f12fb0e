//! Circles of modules inside a crate, found from the paths that their sources name.
//!
//! A module is a file. It uses another if its code names an item of it by a path that begins with `crate`, `super`, `self`
//! or one of its own children. A path that ends at a re-export counts as one to the module that defines the item, so a
//! parent that only re-exports its children is no part of a circle. Comments, strings and tests do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::path::Path;

use super::layers::rust_files;

/// The path of a module below its crate: `["emva", "point"]`.
type ModulePath = Vec<String>;

/// Modules that use each other, directly or by way of others.
#[derive(Debug)]
pub struct Circle {
    /// The modules, `emva::point` and so on; the root of the crate is `crate`.
    pub modules: Vec<String>,
    /// Who uses whom among them, with the name that is used.
    pub uses: Vec<String>,
}

impl fmt::Display for Circle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "circle of modules: {}", self.modules.join(", "))?;
        self.uses.iter().try_for_each(|one| write!(f, "\n    {one}"))
    }
}

/// What is known about one module.
#[derive(Default)]
struct Module {
    /// Names that `use` brings in, with the path they stand for.
    imports: BTreeMap<String, Vec<String>>,
    /// Paths of `use module::*`.
    globs: Vec<Vec<String>>,
    /// Paths that the code names, beside those that it only re-exports.
    paths: Vec<Vec<String>>,
    /// Items that the module defines.
    items: BTreeSet<String>,
}

/// The circles of the modules below a folder of sources.
pub fn find(sources: &Path) -> Vec<Circle> {
    let modules = read_modules(sources);
    let mut edges: BTreeMap<&ModulePath, BTreeMap<ModulePath, String>> = BTreeMap::new();
    for (own, module) in &modules {
        for path in &module.paths {
            let Some((target, name)) = resolve(&modules, own, path, 0) else { continue };
            if target != *own {
                edges.entry(own).or_default().entry(target).or_insert(name);
            }
        }
    }

    // Two modules are in one circle if each reaches the other.
    let reached: BTreeMap<&ModulePath, BTreeSet<&ModulePath>> =
        modules.keys().map(|from| (from, reachable(from, &edges))).collect();
    let mut found = Vec::new();
    let mut seen: BTreeSet<&ModulePath> = BTreeSet::new();
    for module in modules.keys() {
        if !reached[module].contains(module) || seen.contains(module) {
            continue;
        }
        let circle: Vec<&ModulePath> =
            reached[module].iter().copied().filter(|other| reached[other].contains(module)).collect();
        seen.extend(&circle);
        let uses = circle.iter().flat_map(|from| {
            let targets = edges[*from].iter().filter(|(to, _)| circle.contains(to));
            targets.map(|(to, name)| format!("{} uses {} ({name})", shown(from), shown(to)))
        });
        found.push(Circle { uses: uses.collect(), modules: circle.iter().map(|m| shown(m)).collect() });
    }
    found
}

fn shown(module: &ModulePath) -> String {
    if module.is_empty() { "crate".to_owned() } else { module.join("::") }
}

/// Modules that can be reached from one, itself only by a circle.
fn reachable<'a>(
    from: &ModulePath,
    edges: &'a BTreeMap<&ModulePath, BTreeMap<ModulePath, String>>,
) -> BTreeSet<&'a ModulePath> {
    let (mut found, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(module) = open.pop() {
        for target in edges.get(module).into_iter().flat_map(BTreeMap::keys) {
            if found.insert(target) {
                open.push(target);
            }
        }
    }
    found
}

/// The module that defines what a path names, and the name.
fn resolve(
    modules: &BTreeMap<ModulePath, Module>,
    from: &ModulePath,
    path: &[String],
    depth: usize,
) -> Option<(ModulePath, String)> {
    let mut current = from.clone();
    let mut rest = path.iter().peekable();
    // The beginning of the path.
    loop {
        match rest.peek().map(|s| s.as_str()) {
            Some("crate") => current.clear(),
            Some("super") => {
                current.pop()?;
            }
            Some("self") => {}
            _ => break,
        }
        rest.next();
    }
    // Down through modules, and through re-exports to where an item is defined.
    let mut last = String::from("self");
    while let Some(segment) = rest.next() {
        last.clone_from(segment);
        let child: ModulePath = current.iter().cloned().chain([segment.clone()]).collect();
        if modules.contains_key(&child) {
            current = child;
            continue;
        }
        let module = modules.get(&current)?;
        if depth < 8 && !module.items.contains(segment) {
            let remaining: Vec<String> = rest.cloned().collect();
            if let Some(import) = module.imports.get(segment) {
                let onward: Vec<String> = import.iter().cloned().chain(remaining).collect();
                return if is_own(modules, &current, import) {
                    resolve(modules, &current, &onward, depth + 1)
                } else {
                    None
                };
            }
            for glob in module.globs.iter().filter(|glob| is_own(modules, &current, glob)) {
                let onward: Vec<String> = glob.iter().cloned().chain([segment.clone()]).collect();
                let target = resolve(modules, &current, &onward, depth + 1);
                if let Some((target, name)) = target
                    && modules[&target].items.contains(&name)
                {
                    return Some((target, name));
                }
            }
        }
        break;
    }
    Some((current, last))
}

/// Whether a path leads into this crate.
fn is_own(modules: &BTreeMap<ModulePath, Module>, from: &ModulePath, path: &[String]) -> bool {
    let Some(first) = path.first() else { return false };
    let child: ModulePath = from.iter().cloned().chain([first.clone()]).collect();
    ["crate", "super", "self"].contains(&first.as_str()) || modules.contains_key(&child)
}

fn read_modules(sources: &Path) -> BTreeMap<ModulePath, Module> {
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
    let chars: Vec<char> = text.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let (mut tokens, mut i) = (Vec::new(), 0);
    while i < chars.len() {
        let c = at(i);
        let start = i;
        if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && at(i) != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            while i < chars.len() && (at(i), at(i + 1)) != ('*', '/') {
                i += 1;
            }
            i += 2;
        } else if c.is_alphanumeric() || c == '_' {
            while at(i).is_alphanumeric() || at(i) == '_' {
                i += 1;
            }
            let word: String = chars[start..i].iter().collect();
            match is_raw_string(&word, &chars, i) {
                true => i = end_of_raw_string(&chars, i),
                false => tokens.push(word),
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
            tokens.push("::".to_owned());
            i += 2;
        } else {
            if !c.is_whitespace() {
                tokens.push(c.to_string());
            }
            i += 1;
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
                match is_public {
                    true => re_exports.push((name, path)),
                    false => module.paths.push(path),
                }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn circles(files: &[(&str, &str)]) -> Vec<Circle> {
        let name = format!("petzval-circles-{}-{}", std::process::id(), files[0].1.len());
        let folder = std::env::temp_dir().join(name);
        for (file, text) in files {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let found = find(&folder);
        fs::remove_dir_all(&folder).unwrap();
        found
    }

    #[test]
    fn modules_that_use_each_other_are_a_circle() {
        let found = circles(&[
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "use super::b::{B, Other as O}; pub struct A(B);"),
            ("b.rs", "pub struct B(Option<Box<crate::a::A>>); pub struct Other;"),
            ("c.rs", "use crate::a::A; pub struct C(A);"),
        ]);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].modules, ["a", "b"]);
        assert_eq!(found[0].uses, ["a uses b (B)", "b uses a (A)"]);
    }

    #[test]
    fn a_parent_that_only_re_exports_is_in_no_circle() {
        let lib = "pub mod a; mod b; pub use a::A; pub use b::*;";
        let children = [
            ("a.rs", "/// See [`crate::B`].\npub struct A; const C: char = '\"'; // use super::b::B;"),
            ("b.rs", "use super::A; pub struct B(A); #[cfg(test)] mod tests { use super::*; }"),
        ];
        assert!(circles(&[("lib.rs", lib), children[0], children[1]]).is_empty());
        // A parent whose own code needs the child that uses it is.
        let lib = "pub mod a; mod b; pub use a::A; fn f(_: b::B) {} pub struct Own;";
        let child = ("b.rs", "pub struct B(super::Own);");
        let found = circles(&[("lib.rs", lib), children[0], child]);
        assert_eq!(found[0].modules, ["crate", "b"]);
    }
}
