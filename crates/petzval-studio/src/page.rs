//! The page: files that are built from `page/` and travel with the program.

use include_dir::{Dir, include_dir};

use crate::http::Answer;

static PAGE: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/page/dist");

/// What the page may load and do: its own files, and pictures that it draws itself. No other page may hold it in a frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
                      connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; frame-src 'self'; frame-ancestors 'none'";

/// Headers of every answer.
pub fn headers() -> Vec<(&'static str, String)> {
    let headers = [
        ("Content-Security-Policy", POLICY),
        ("X-Content-Type-Options", "nosniff"),
        ("Referrer-Policy", "no-referrer"),
        ("X-Frame-Options", "DENY"),
    ];
    headers.map(|(name, value)| (name, value.to_owned())).to_vec()
}

/// A file of the page; the page itself under the empty name.
pub fn file(name: &str) -> Answer {
    let name = if name.is_empty() { "index.html" } else { name };
    let Some(file) = PAGE.get_file(name) else {
        return Answer::plain("404 Not Found", "there is no such file");
    };
    // The names of its parts hold digests of their contents.
    let caching =
        if name.starts_with("assets/") { "private, max-age=31536000, immutable" } else { "no-store" };
    let headers = [("Content-Type", kind(name)), ("Cache-Control", caching)];
    let headers = headers.map(|(name, value)| (name, value.to_owned())).to_vec();
    Answer { status: "200 OK", headers, body: file.contents().to_vec() }
}

fn kind(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("json") => "application/json",
        _ => "application/octet-stream",
    }
}
