//! Files of the studio's folder, for the page to show: reports, pictures, logs.

use std::io::{Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};

use serde_json::json;

use crate::folder::Folder;
use crate::http::Answer;

/// Where the files are.
pub const PREFIX: &str = "/files/";

/// Most bytes of a file that is sent at once.
const MOST: u64 = 64 << 20;

/// What a page of the folder may do: show itself with the pictures in it, and run its own script, without an origin, and so without the cookie of the
/// studio. Only the page of the studio may hold it in a frame.
const POLICY: &str = "sandbox allow-scripts allow-popups; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                      img-src data: blob:; font-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// Endings of the files that are sent, and their kinds.
const KINDS: [(&str, &str); 13] = [
    ("html", "text/html; charset=utf-8"),
    ("png", "image/png"),
    ("jpg", "image/jpeg"),
    ("jpeg", "image/jpeg"),
    ("webp", "image/webp"),
    ("bmp", "image/bmp"),
    ("svg", "image/svg+xml"),
    ("json", "application/json"),
    ("jsonl", "text/plain; charset=utf-8"),
    ("csv", "text/plain; charset=utf-8"),
    ("toml", "text/plain; charset=utf-8"),
    ("txt", "text/plain; charset=utf-8"),
    ("md", "text/plain; charset=utf-8"),
];

/// A file by its path in the address. With `?from=BYTE`, at most [`MOST`] bytes from there on; without, the whole file, or a refusal.
pub fn file(folder: &Folder, path: &str, query: &str) -> Answer {
    let Some(path) = place(folder, path) else {
        return Answer::plain("403 Forbidden", "this path leads out of the folder of the studio");
    };
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    let Some((_, kind)) = KINDS.iter().find(|(known, _)| *known == ending) else {
        return Answer::plain("415 Unsupported Media Type", "files of this ending are not shown");
    };
    let from = query.split('&').find_map(|part| part.strip_prefix("from=")?.parse::<u64>().ok());
    match read(&path, from) {
        Ok(Part::TooLarge(bytes)) => {
            let message = format!(
                "this file has {} MB, and at most {} MB of it are sent at once: name the first byte, as in ?from=0",
                bytes >> 20,
                MOST >> 20
            );
            Answer::plain("413 Content Too Large", message)
        }
        Ok(Part::Bytes(body)) => {
            let headers = [
                ("Content-Type", (*kind).to_owned()),
                ("Content-Security-Policy", POLICY.to_owned()),
                ("X-Content-Type-Options", "nosniff".to_owned()),
                ("Referrer-Policy", "no-referrer".to_owned()),
                ("Cache-Control", "no-store".to_owned()),
            ];
            Answer { status: "200 OK", headers: headers.to_vec(), body }
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            Answer::plain("404 Not Found", "there is no such file")
        }
        Err(error) => Answer::plain("500 Internal Server Error", error.to_string()),
    }
}

/// The sheets in the folder: pages that jobs wrote, by their paths, the newest first.
pub fn sheets(folder: &Folder) -> Answer {
    let (mut found, mut left) = (Vec::new(), MOST_ENTRIES);
    collect(folder.path(), 0, &mut left, &mut found);
    found.sort_by(|a: &Sheet, b| b.changed.cmp(&a.changed).then_with(|| a.path.cmp(&b.path)));
    found.truncate(MOST_SHEETS);
    let sheet = |sheet: &Sheet| {
        let path = sheet.path.strip_prefix(folder.path()).unwrap_or(&sheet.path);
        json!({"path": path.to_string_lossy(), "changed_s": sheet.changed, "bytes": sheet.bytes})
    };
    Answer::json(&json!(found.iter().map(sheet).collect::<Vec<_>>()))
}

/// Most pages that are listed, and how deep they are looked for.
const MOST_SHEETS: usize = 500;
const DEEPEST: usize = 4;

/// Most entries that are looked at in all folders together: one may hold a data set.
const MOST_ENTRIES: usize = 20_000;

struct Sheet {
    path: PathBuf,
    /// Seconds since 1970.
    changed: u64,
    bytes: u64,
}

/// Adds the sheets in a folder and below it. Files come before folders, so that a data set beside a sheet does not hide it. `left` entries may
/// still be looked at.
fn collect(folder: &Path, depth: usize, left: &mut usize, found: &mut Vec<Sheet>) {
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if *left == 0 {
            return;
        }
        *left -= 1;
        let (path, Ok(kind)) = (entry.path(), entry.file_type()) else { continue };
        let is_hidden = entry.file_name().to_string_lossy().starts_with('.');
        if kind.is_dir() && depth < DEEPEST && !is_hidden {
            folders.push(path);
        } else if kind.is_file()
            && path.extension().is_some_and(|ending| ending == "html")
            && let Ok(data) = entry.metadata()
        {
            let changed = data.modified().ok().and_then(|at| at.duration_since(std::time::UNIX_EPOCH).ok());
            found.push(Sheet { path, changed: changed.map_or(0, |at| at.as_secs()), bytes: data.len() });
        }
    }
    for below in folders {
        collect(&below, depth + 1, left, found);
    }
}

/// The file of a path; none if it leads out of the folder.
fn place(folder: &Folder, path: &str) -> Option<PathBuf> {
    let path = decoded(path)?;
    let plain = Path::new(&path).components().all(|part| matches!(part, Component::Normal(_)));
    (plain && folder.holds(&path)).then(|| folder.path().join(path))
}

/// Text whose bytes are written as `%41`; none for what is no UTF-8.
fn decoded(text: &str) -> Option<String> {
    let (mut bytes, mut rest) = (Vec::with_capacity(text.len()), text.as_bytes());
    while let Some((first, after)) = rest.split_first() {
        if *first == b'%' {
            let digits = std::str::from_utf8(after.get(..2)?).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &after[2..];
        } else {
            bytes.push(*first);
            rest = after;
        }
    }
    String::from_utf8(bytes).ok()
}

/// What is read of a file.
enum Part {
    Bytes(Vec<u8>),
    /// The file has so many bytes, and no place in it was named.
    TooLarge(u64),
}

fn read(path: &Path, from: Option<u64>) -> std::io::Result<Part> {
    let mut file = petzval_base::open_file(path)?;
    let data = file.metadata()?;
    if !data.is_file() {
        return Err(std::io::ErrorKind::NotFound.into());
    }
    if from.is_none() && data.len() > MOST {
        return Ok(Part::TooLarge(data.len()));
    }
    file.seek(SeekFrom::Start(from.unwrap_or(0)))?;
    let mut bytes = Vec::new();
    file.take(MOST).read_to_end(&mut bytes)?;
    Ok(Part::Bytes(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_the_folder_are_sent_and_no_other() {
        let (outside, inside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let folder = Folder::new(inside.path()).unwrap();
        std::fs::write(outside.path().join("secret.txt"), "x").unwrap();
        std::fs::create_dir(inside.path().join("a b")).unwrap();
        std::fs::write(inside.path().join("a b/page.html"), "<p>whole").unwrap();
        std::fs::write(inside.path().join("key.pem"), "x").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(outside.path(), inside.path().join("link")).unwrap();
        let status = |path: &str| file(&folder, path, "").status;
        let page = file(&folder, "a%20b/page.html", "");
        assert_eq!((page.status, page.body.as_slice()), ("200 OK", &b"<p>whole"[..]));
        assert!(
            page.headers
                .iter()
                .any(|(name, value)| *name == "Content-Security-Policy" && value.contains("sandbox"))
        );
        assert_eq!(file(&folder, "a%20b/page.html", "from=3").body, b"whole");
        assert_eq!(status("a%20b/none.html"), "404 Not Found");
        assert!(status("key.pem").starts_with("415"));
        let absolute = format!("/{}", outside.path().join("secret.txt").display());
        for wrong in
            ["../secret.txt", "%2e%2e/secret.txt", "a%20b/../../x.txt", "%zz.txt", "%ff.txt", "%2", &absolute]
        {
            assert!(status(wrong).starts_with("403"), "{wrong}");
        }
        if cfg!(unix) {
            assert!(status("link/secret.txt").starts_with("403"));
        }
        let listed = String::from_utf8(sheets(&folder).body).unwrap();
        assert!(listed.contains("a b/page.html") && !listed.contains("secret"), "{listed}");
    }

    #[test]
    fn a_file_that_is_too_large_is_refused_whole_and_sent_in_parts() {
        let inside = tempfile::tempdir().unwrap();
        let folder = Folder::new(inside.path()).unwrap();
        let large = std::fs::File::create(inside.path().join("log.jsonl")).unwrap();
        large.set_len(MOST + 5).unwrap();
        let whole = file(&folder, "log.jsonl", "");
        assert!(whole.status.starts_with("413"), "{}", whole.status);
        assert!(String::from_utf8(whole.body).unwrap().contains("64 MB"));
        let from = |byte: u64| file(&folder, "log.jsonl", &format!("from={byte}"));
        assert_eq!((from(0).status, from(0).body.len() as u64), ("200 OK", MOST));
        assert_eq!(from(MOST).body, [0; 5]);
        // One that has just the size is sent whole.
        large.set_len(MOST).unwrap();
        assert_eq!(file(&folder, "log.jsonl", "").body.len() as u64, MOST);
    }

    #[test]
    fn the_limit_of_entries_holds_for_all_folders_together() {
        let inside = tempfile::tempdir().unwrap();
        for folder in 0..5 {
            let path = inside.path().join(folder.to_string());
            std::fs::create_dir(&path).unwrap();
            for sheet in 0..10 {
                std::fs::write(path.join(format!("{sheet}.html")), "x").unwrap();
            }
        }
        std::fs::write(inside.path().join("own.html"), "x").unwrap();
        let found = |entries: usize| {
            let (mut found, mut left) = (Vec::new(), entries);
            collect(inside.path(), 0, &mut left, &mut found);
            (found.len(), left)
        };
        // Six entries of the folder itself, then those below.
        assert_eq!(found(1000), (51, 1000 - 56));
        assert_eq!(found(6), (1, 0));
        assert_eq!(found(20), (15, 0));
    }
}
