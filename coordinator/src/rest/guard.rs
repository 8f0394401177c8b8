//! Who may do what: the token, and the defence of the user's browser against foreign pages.
//!
//! A page of a stranger that the user happens to look at can make the browser send requests to a
//! service on the user's own machine: as a plain form (cross-site request), or after its name has
//! been made to point there (DNS rebinding). Browsers say whose page it is in `Origin`, and whose
//! service they believe to talk to in `Host`. So:
//!
//! - on loopback, `Host` must be `localhost` or a numeric address, in every request;
//! - what changes state and bears an `Origin` must come from a page of this very service, reached
//!   by `localhost` or a numeric address — or bear the token, which no foreign page has.

use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures::StreamExt;

use super::Rest;
use super::problem::Problem;

/// Most bytes that are read of a request that is refused.
const REFUSED_BYTES_MAX: usize = 64 << 20;

/// How long that may take.
const REFUSED_TIMEOUT: Duration = Duration::from_secs(5);

/// What requests are checked against.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    /// Hash of the token: two hashes are compared in the same time whatever they are.
    token: Option<blake3::Hash>,
    is_loopback: bool,
}

impl Guard {
    pub(crate) fn new(token: Option<&str>, address: SocketAddr) -> Self {
        let token = token.map(|token| blake3::hash(token.as_bytes()));
        Self { token, is_loopback: address.ip().is_loopback() }
    }

    fn check(&self, request: &Request) -> Result<(), Problem> {
        let headers = request.headers();
        let host = host(request);
        self.check_host(host.as_ref())?;
        if request.method().is_safe() {
            return Ok(());
        }
        self.check_token(headers)?;
        if self.token.is_some() { Ok(()) } else { check_origin(headers, host.as_ref()) }
    }

    fn check_host(&self, host: Option<&Authority>) -> Result<(), Problem> {
        if !self.is_loopback || host.is_none_or(is_local_name) {
            return Ok(());
        }
        Err(Problem::misdirected(
            "this coordinator listens on loopback; address it as localhost or 127.0.0.1",
        ))
    }

    fn check_token(&self, headers: &HeaderMap) -> Result<(), Problem> {
        let Some(expected) = self.token else { return Ok(()) };
        let Some(given) = bearer(headers) else {
            return Err(Problem::unauthorized(
                "this changes state: send the header `authorization: Bearer TOKEN`",
            ));
        };
        if blake3::hash(given) == expected {
            Ok(())
        } else {
            Err(Problem::unauthorized("the token is wrong; use the one the coordinator was given"))
        }
    }
}

/// The check before every handler.
pub(crate) async fn check(State(rest): State<Rest>, request: Request, next: Next) -> Response {
    match rest.guard.check(&request) {
        Ok(()) => next.run(request).await,
        Err(problem) => {
            read_away(request).await;
            problem.into_response()
        }
    }
}

/// Reads the body of a request that is refused, within limits: who still sends sees a broken
/// connection otherwise, and not the answer.
async fn read_away(request: Request) {
    let mut body = request.into_body().into_data_stream();
    let reading = async {
        let mut left = REFUSED_BYTES_MAX;
        while let Some(Ok(chunk)) = body.next().await {
            let Some(rest) = left.checked_sub(chunk.len()) else { return };
            left = rest;
        }
    };
    // Who is slower than that does without the answer.
    let _is_read = tokio::time::timeout(REFUSED_TIMEOUT, reading).await;
}

/// What changes state must not come from a foreign page.
fn check_origin(headers: &HeaderMap, host: Option<&Authority>) -> Result<(), Problem> {
    let site = headers.get("sec-fetch-site").map(|site| site.as_bytes());
    let origin = headers.get(header::ORIGIN);
    if origin.is_none() && !matches!(site, Some(b"cross-site" | b"same-site")) {
        return Ok(());
    }
    let origin = origin.and_then(|origin| origin.to_str().ok()).and_then(authority_of);
    match (origin, host) {
        (Some(origin), Some(host)) if origin == *host && is_local_name(host) => Ok(()),
        _ => Err(Problem::foreign(
            "a page of another site must not change anything here; use this service's own page, \
             reached by localhost or a numeric address, or a token",
        )),
    }
}

fn authority_of(origin: &str) -> Option<Authority> {
    origin.split_once("://")?.1.parse().ok()
}

fn host(request: &Request) -> Option<Authority> {
    let named =
        request.headers().get(header::HOST).and_then(|host| host.to_str().ok()?.parse().ok());
    named.or_else(|| request.uri().authority().cloned())
}

/// A name that no stranger can make point here: a numeric address, or localhost.
fn is_local_name(host: &Authority) -> bool {
    let name = host.host().trim_start_matches('[').trim_end_matches(']');
    let is_numeric = name.parse::<IpAddr>().is_ok();
    is_numeric || name.eq_ignore_ascii_case("localhost")
}

fn bearer(headers: &HeaderMap) -> Option<&[u8]> {
    let value = headers.get(header::AUTHORIZATION)?.as_bytes();
    let (scheme, token) = value.split_at_checked(7)?;
    scheme.eq_ignore_ascii_case(b"bearer ").then(|| token.trim_ascii())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;
    use axum::http::StatusCode;

    fn checked(guard: &Guard, method: &str, headers: &[(&str, &str)]) -> Option<StatusCode> {
        let mut request = Request::builder().method(method).uri("/api/v1/jobs");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.body(Body::empty()).expect("a valid request");
        guard.check(&request).err().map(|problem| problem.into_response().status())
    }

    fn guard(token: Option<&str>, address: &str) -> Guard {
        Guard::new(token, address.parse().expect("an address"))
    }

    #[test]
    fn foreign_pages_change_nothing() {
        let open = guard(None, "0.0.0.0:80");
        let local = guard(None, "127.0.0.1:80");
        let forbidden = Some(StatusCode::FORBIDDEN);
        let host = ("host", "127.0.0.1:80");
        for guard in [&open, &local] {
            assert_eq!(checked(guard, "POST", &[host]), None);
            assert_eq!(checked(guard, "POST", &[host, ("origin", "http://127.0.0.1:80")]), None);
            assert_eq!(checked(guard, "GET", &[host, ("origin", "http://evil.example")]), None);
            for origin in ["http://evil.example", "null", "http://127.0.0.1:8080", "http://"] {
                assert_eq!(checked(guard, "POST", &[host, ("origin", origin)]), forbidden);
            }
            assert_eq!(
                checked(guard, "DELETE", &[host, ("sec-fetch-site", "cross-site")]),
                forbidden
            );
        }
        let rebound = [("host", "evil.example"), ("origin", "http://evil.example")];
        assert_eq!(checked(&open, "POST", &rebound), forbidden);
        assert_eq!(checked(&open, "POST", &rebound[..1]), None, "compose uses names");
        assert_eq!(checked(&local, "GET", &rebound[..1]), Some(StatusCode::MISDIRECTED_REQUEST));
        assert_eq!(checked(&local, "GET", &[("host", "localhost:80")]), None);
        assert_eq!(checked(&local, "GET", &[("host", "[::1]:80")]), None);
    }

    #[test]
    fn the_token_guards_what_changes_state() {
        let guard = guard(Some("secret"), "0.0.0.0:80");
        let unauthorized = Some(StatusCode::UNAUTHORIZED);
        assert_eq!(checked(&guard, "GET", &[]), None);
        assert_eq!(checked(&guard, "POST", &[]), unauthorized);
        for wrong in ["Bearer", "Bearer ", "Bearer secre", "Basic secret", "secret"] {
            assert_eq!(checked(&guard, "DELETE", &[("authorization", wrong)]), unauthorized);
        }
        assert_eq!(checked(&guard, "POST", &[("authorization", "bearer secret")]), None);
    }
}
