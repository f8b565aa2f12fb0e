//! A page that grows, for a browser on this machine.

use std::net::Ipv4Addr;
use std::process::ExitCode;

use petzval::jobs::JobError;
use tiny_http::{Header, Method, Response, Server};

use super::failure::Failure;
use super::output;

/// Answers every request for `/` with the page as it then is, until a signal ends the process. Other machines cannot reach it.
pub fn serve(port: u16, page: impl Fn() -> Result<String, JobError>) -> Result<ExitCode, Failure> {
    let server = Server::http((Ipv4Addr::LOCALHOST, port)).map_err(|error| {
        Failure::input(
            format!("port {port}: {error}"),
            "choose another with --port; 0 takes any that is free",
        )
    })?;
    outln!("http://{}/ shows the run as it grows; Ctrl-C ends this, and not the run", server.server_addr());
    if output::is_lost() {
        return Ok(ExitCode::SUCCESS);
    }
    for request in server.incoming_requests() {
        let is_asked_for = matches!(request.method(), Method::Get | Method::Head) && request.url() == "/";
        let (status, text, kind) = match is_asked_for.then(&page) {
            Some(Ok(page)) => (200, page, "text/html; charset=utf-8"),
            Some(Err(error)) => (500, error.to_string(), "text/plain; charset=utf-8"),
            None => (404, "the page is at /".to_owned(), "text/plain; charset=utf-8"),
        };
        let mut response = Response::from_string(text).with_status_code(status);
        for header in [format!("Content-Type: {kind}"), "Cache-Control: no-store".to_owned()] {
            if let Ok(header) = header.parse::<Header>() {
                response.add_header(header);
            }
        }
        // A browser that has gone meanwhile is no failure.
        let _ = request.respond(response);
    }
    Ok(ExitCode::SUCCESS)
}
