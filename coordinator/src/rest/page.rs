//! What does not change: the page for people, the description of the service, and the sign of life.

use axum::http::header;
use axum::response::{Html, IntoResponse};

/// `GET /`
pub(crate) async fn page() -> impl IntoResponse {
    // The page needs nothing but itself and this service; whatever else it is made to load or to
    // sit in is refused by the browser.
    let policy = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
                  img-src 'self'; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; \
                  form-action 'none'";
    ([(header::CONTENT_SECURITY_POLICY, policy)], Html(include_str!("page.html")))
}

/// `GET /openapi.json`
pub(crate) async fn openapi() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "application/json")], include_str!("openapi.json"))
}

/// `GET /healthz`
pub(crate) async fn healthz() -> &'static str {
    "ok\n"
}
