//! Circles of modules inside a crate, found from the paths that their sources name.
//!
//! A module is a file. It uses another if its code names an item of it by a path that begins with `crate`, `super`, `self`
//! or one of its own children. A path that ends at a re-export counts as one to the module that defines the item, so a
//! parent that only re-exports its children is no part of a circle. Comments, strings and tests do not count.
//!
//! Folders are judged as a reader sees them, by the path as it is written: two neighbours in a folder, each a file or a folder with
//! all below it, must not use each other.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

use super::sources::{Module, ModulePath, read_modules};

/// Modules that use each other, directly or by way of others.
#[derive(Debug)]
pub struct Circle {
    /// What they are: modules or folders.
    pub what: &'static str,
    /// The modules, `emva::point` and so on; the root of the crate is `crate`.
    pub modules: Vec<String>,
    /// Who uses whom among them, with the name that is used.
    pub uses: Vec<String>,
}

impl fmt::Display for Circle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "circle of {}: {}", self.what, self.modules.join(", "))?;
        self.uses.iter().try_for_each(|one| write!(f, "\n    {one}"))
    }
}

/// Who uses whom, with a name that is used.
type Edges = BTreeMap<ModulePath, BTreeMap<ModulePath, String>>;

/// The circles of the modules below a folder of sources: first those of files, then those of folders.
pub fn find(sources: &Path) -> Vec<Circle> {
    let modules = read_modules(sources);
    let mut files = Edges::new();
    let mut rooms = Edges::new();
    for (own, module) in &modules {
        for path in &module.paths {
            let Some((target, name)) = resolve(&modules, own, path, 0) else { continue };
            if target != *own {
                files.entry(own.clone()).or_default().entry(target).or_insert(name);
            }
            if let Some((from, to)) = rooms_of(&modules, own, path) {
                let name = path.last().cloned().unwrap_or_default();
                rooms
                    .entry(from)
                    .or_default()
                    .entry(to)
                    .or_insert_with(|| format!("{name} in {}", shown(own)));
            }
        }
    }
    let mut found = circles("modules", &files);
    let more = circles("folders", &rooms);
    let is_new = |circle: &Circle| found.iter().all(|known| known.modules != circle.modules);
    let more: Vec<Circle> = more.into_iter().filter(is_new).collect();
    found.extend(more);
    found
}

/// The two neighbours in one folder that a path leads from and to, as a reader of the path sees it: re-exports are not followed.
fn rooms_of(
    modules: &BTreeMap<ModulePath, Module>,
    own: &ModulePath,
    path: &[String],
) -> Option<(ModulePath, ModulePath)> {
    let target = written(modules, own, path)?;
    let common = own.iter().zip(&target).take_while(|(a, b)| a == b).count();
    let is_apart = common < own.len() && common < target.len();
    is_apart.then(|| (own[..=common].to_vec(), target[..=common].to_vec()))
}

/// The module that a path names as it is written.
fn written(modules: &BTreeMap<ModulePath, Module>, from: &ModulePath, path: &[String]) -> Option<ModulePath> {
    let mut current = from.clone();
    for segment in path {
        match segment.as_str() {
            "crate" => current.clear(),
            "super" => {
                current.pop()?;
            }
            "self" => {}
            _ => {
                current.push(segment.clone());
                if !modules.contains_key(&current) {
                    current.pop();
                    break;
                }
            }
        }
    }
    Some(current)
}

/// Those that reach each other.
fn circles(what: &'static str, edges: &Edges) -> Vec<Circle> {
    let reached: BTreeMap<&ModulePath, BTreeSet<&ModulePath>> =
        edges.keys().map(|from| (from, reachable(from, edges))).collect();
    let mut found = Vec::new();
    let mut seen: BTreeSet<&ModulePath> = BTreeSet::new();
    for module in edges.keys() {
        if !reached[module].contains(module) || seen.contains(module) {
            continue;
        }
        let reaches = |other: &&ModulePath| reached.get(*other).is_some_and(|all| all.contains(module));
        let circle: Vec<&ModulePath> = reached[module].iter().copied().filter(reaches).collect();
        seen.extend(&circle);
        let uses = circle.iter().flat_map(|from| {
            let targets = edges[*from].iter().filter(|(to, _)| circle.contains(to));
            targets.map(|(to, name)| format!("{} uses {} ({name})", shown(from), shown(to)))
        });
        let modules = circle.iter().map(|m| shown(m)).collect();
        found.push(Circle { what, uses: uses.collect(), modules });
    }
    found
}

fn shown(module: &ModulePath) -> String {
    if module.is_empty() { "crate".to_owned() } else { module.join("::") }
}

/// Modules that can be reached from one, itself only by a circle.
fn reachable<'a>(from: &ModulePath, edges: &'a Edges) -> BTreeSet<&'a ModulePath> {
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn circles_of(files: &[(&str, &str)]) -> Vec<Circle> {
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
        let found = circles_of(&[
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
        assert!(circles_of(&[("lib.rs", lib), children[0], children[1]]).is_empty());
        // A parent whose own code needs the child that uses it is.
        let lib = "pub mod a; mod b; pub use a::A; fn f(_: b::B) {} pub struct Own;";
        let child = ("b.rs", "pub struct B(super::Own);");
        let found = circles_of(&[("lib.rs", lib), children[0], child]);
        assert_eq!(found[0].modules, ["crate", "b"]);
    }

    #[test]
    fn folders_that_use_each_other_by_different_files_are_a_circle() {
        let found = circles_of(&[
            ("lib.rs", "mod a; mod b;"),
            ("a/mod.rs", "mod one; mod two; pub use two::Two;"),
            ("a/one.rs", "pub struct One(crate::b::B);"),
            ("a/two.rs", "pub struct Two;"),
            ("b.rs", "pub struct B(crate::a::Two);"),
        ]);
        assert_eq!(found.len(), 1);
        assert_eq!(
            (found[0].what, &found[0].modules[..]),
            ("folders", &["a".to_owned(), "b".to_owned()][..])
        );
        assert_eq!(found[0].uses, ["a uses b (B in a::one)", "b uses a (Two in b)"]);
        // Neighbours inside a folder count as well, those in different folders do not.
        let found = circles_of(&[
            ("lib.rs", "mod a; mod b; "),
            ("a/mod.rs", "mod one; mod two;"),
            ("a/one.rs", "pub struct One(super::two::Two);"),
            ("a/two.rs", "pub struct Two(Option<Box<super::one::One>>, crate::b::B);"),
            ("b.rs", "pub struct B;"),
        ]);
        assert_eq!(found.iter().map(|c| (c.what, c.modules.len())).collect::<Vec<_>>(), [("modules", 2)]);
    }
}
