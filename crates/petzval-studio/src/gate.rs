//! Who is let in: whoever knows the token of this start, from a page of this address.

use std::net::SocketAddr;

use rand::RngExt;

use crate::http::Head;

/// Bytes of a token.
const TOKEN_BYTES: usize = 24;

/// The token of a start, and the names under which this server is reached.
pub struct Gate {
    token: String,
    cookie: String,
    hosts: Vec<String>,
}

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// It names another host: a page from elsewhere may have had its name resolved to this machine.
    Host,
    /// It comes from a page of another origin.
    Origin,
    /// It has no token.
    Token,
}

impl Refusal {
    /// What the reader is to know.
    pub fn message(self) -> &'static str {
        match self {
            Self::Host => "this address is for this machine alone; the request names another host\n",
            Self::Origin => "the request comes from a page of another origin\n",
            Self::Token => {
                "open the address that `petzval studio` printed: it holds the token of this start\n"
            }
        }
    }
}

impl Gate {
    /// A gate with a new token.
    pub fn new(address: SocketAddr) -> Self {
        let bytes: [u8; TOKEN_BYTES] = rand::rng().random();
        let port = address.port();
        Self {
            token: petzval_base::hex(&bytes),
            // Cookies are shared between the ports of a host.
            cookie: format!("petzval_studio_{port}"),
            hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}"), format!("[::1]:{port}")].into(),
        }
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// The header that keeps the token in the browser, for this address and for its own pages alone.
    pub fn cookie_header(&self) -> String {
        format!("{}={}; HttpOnly; SameSite=Strict; Path=/", self.cookie, self.token)
    }

    /// Whether a request is let in. One for the page itself may have the token in its address; every other one has it in its cookie. A request that
    /// changes something must name its origin.
    pub fn admits(&self, head: &Head, must_name_origin: bool) -> Result<(), Refusal> {
        let is_own = |host: &&str| self.hosts.iter().any(|own| own.eq_ignore_ascii_case(host));
        let host = head.one("host").filter(is_own).ok_or(Refusal::Host)?;
        match head.one("origin") {
            Some(origin) => {
                let origin = origin.strip_prefix("http://");
                if !origin.is_some_and(|origin| origin.eq_ignore_ascii_case(host)) {
                    return Err(Refusal::Origin);
                }
            }
            None if must_name_origin || head.all("origin").next().is_some() => return Err(Refusal::Origin),
            None => {}
        }
        let is_known = self.is_in_cookie(head) || head.path == "/" && self.is_in_query(&head.query);
        if is_known { Ok(()) } else { Err(Refusal::Token) }
    }

    fn is_in_cookie(&self, head: &Head) -> bool {
        head.all("cookie").flat_map(|line| line.split(';')).any(|cookie| {
            cookie
                .trim()
                .split_once('=')
                .is_some_and(|(name, value)| name == self.cookie && self.is_token(value))
        })
    }

    fn is_in_query(&self, query: &str) -> bool {
        query.split('&').filter_map(|part| part.strip_prefix("token=")).any(|value| self.is_token(value))
    }

    /// Compares in the same time whatever the text is.
    fn is_token(&self, text: &str) -> bool {
        let (own, text) = (self.token.as_bytes(), text.as_bytes());
        own.len() == text.len() && own.iter().zip(text).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_origin_and_token_are_all_needed() {
        let gate = Gate::new(SocketAddr::from(([127, 0, 0, 1], 8710)));
        let cookie = format!("other=1; petzval_studio_8710={}", gate.token());
        let enter = |target: &str, headers: &[(&str, &str)], must_name_origin: bool| {
            gate.admits(&Head::of(target, headers), must_name_origin)
        };
        let host = ("host", "localhost:8710");
        let own = ("origin", "http://localhost:8710");
        let known = ("cookie", cookie.as_str());
        assert_eq!(enter("/", &[host, known], false), Ok(()));
        assert_eq!(enter("/socket", &[host, known, own], true), Ok(()));
        assert_eq!(enter(&format!("/?token={}", gate.token()), &[host], false), Ok(()));
        // The token in an address opens the page alone.
        assert_eq!(enter(&format!("/state?token={}", gate.token()), &[host], false), Err(Refusal::Token));
        assert_eq!(enter("/", &[host], false), Err(Refusal::Token));
        assert_eq!(enter("/?token=", &[host], false), Err(Refusal::Token));
        assert_eq!(enter("/", &[host, ("cookie", "petzval_studio_8710=00")], false), Err(Refusal::Token));
        for foreign in ["localhost", "localhost:1", "example.org:8710", ""] {
            assert_eq!(enter("/", &[("host", foreign), known], false), Err(Refusal::Host));
        }
        assert_eq!(enter("/", &[known], false), Err(Refusal::Host));
        assert_eq!(enter("/", &[host, host, known], false), Err(Refusal::Host));
        for foreign in ["http://example.org", "null", "https://localhost:8710", "http://127.0.0.1:8710"] {
            assert_eq!(enter("/", &[host, known, ("origin", foreign)], false), Err(Refusal::Origin));
        }
        assert_eq!(enter("/", &[host, known, own, own], false), Err(Refusal::Origin));
        assert_eq!(enter("/upload", &[host, known], true), Err(Refusal::Origin));
    }
}
