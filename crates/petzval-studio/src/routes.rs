//! What the server answers under which address.

use std::io;
use std::net::TcpStream;
use std::time::Duration;

use serde_json::json;

use crate::files;
use crate::gate::Refusal;
use crate::http::{Answer, Head, read_body, read_head};
use crate::page;
use crate::shared::Shared;
use crate::socket;

/// Most bytes of a picture that is sent.
const MOST_UPLOAD: usize = 64 << 20;

/// Time in which a picture must arrive.
const TO_UPLOAD: Duration = Duration::from_secs(60);

/// Answers the request of a connection.
pub fn answer(stream: &TcpStream, number: u64, shared: &Shared) -> io::Result<()> {
    let Some((head, rest)) = read_head(stream)? else {
        return Answer::plain("400 Bad Request", "this is no request for a page").send(stream, true);
    };
    let is_reading = matches!(head.method.as_str(), "GET" | "HEAD");
    let admitted = shared.gate.admits(&head, !is_reading || head.path == "/socket");
    let mut answer = match (admitted, head.method.as_str(), head.path.as_str()) {
        (Err(refusal), ..) => refused(refusal),
        (Ok(()), "GET", "/socket") => {
            return socket::serve(stream, number, &head, rest, shared);
        }
        (Ok(()), "POST", "/upload") => upload(stream, &head, rest, shared)?,
        (Ok(()), "GET" | "HEAD", "/state") => state(shared),
        (Ok(()), "GET" | "HEAD", "/sheets") => files::sheets(&shared.folder),
        (Ok(()), "GET" | "HEAD", path) if path.starts_with(files::PREFIX) => {
            // Its headers are its own: a page of the folder is no page of the studio.
            let answer = files::file(&shared.folder, &path[files::PREFIX.len()..], &head.query);
            return answer.send(stream, head.method != "HEAD");
        }
        (Ok(()), "GET" | "HEAD", path) => page::file(path.trim_start_matches('/')),
        (Ok(()), ..) => Answer::plain("405 Method Not Allowed", "the page can only be read"),
    };
    answer.headers.extend(page::headers());
    if head.path == "/" && admitted.is_ok() {
        answer.headers.push(("Set-Cookie", shared.gate.cookie_header()));
    }
    answer.send(stream, head.method != "HEAD")
}

fn refused(refusal: Refusal) -> Answer {
    Answer::plain("403 Forbidden", refusal.message())
}

/// What the page needs before its first call.
fn state(shared: &Shared) -> Answer {
    let Shared { folder, opened, first, .. } = shared;
    Answer::json(&json!({
        "version": env!("CARGO_PKG_VERSION"),
        "folder": folder.path().display().to_string(),
        "files": folder.lens_files(),
        "opened": opened,
        "first": first,
    }))
}

/// Keeps a picture that the page sends.
fn upload(stream: &TcpStream, head: &Head, rest: Vec<u8>, shared: &Shared) -> io::Result<Answer> {
    let Some(length) = head.one("content-length").and_then(|length| length.parse::<usize>().ok()) else {
        return Ok(Answer::plain("411 Length Required", "the size of the picture is missing"));
    };
    if length > MOST_UPLOAD {
        let message = format!("a picture may have {} MB at most", MOST_UPLOAD >> 20);
        return Ok(Answer::plain("413 Content Too Large", message));
    }
    let bytes = read_body(stream, rest, length, TO_UPLOAD)?;
    Ok(match shared.uploads.keep(&bytes) {
        Ok(name) => Answer::json(&json!({"photo": name})),
        Err(error) => Answer::plain("507 Insufficient Storage", error.to_string()),
    })
}
