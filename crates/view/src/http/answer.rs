//! Bodies and headers of answers.

use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt as _, Full};
use hyper::body::Bytes;
use hyper::header::{ALLOW, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue};
use hyper::{Response, StatusCode};
use serde_json::{Value, json};
use tokio::sync::OwnedSemaphorePermit;

use crate::refusal::Refusal;

pub(super) type Body = UnsyncBoxBody<Bytes, std::io::Error>;
pub(super) type Answer = Response<Body>;

const JSON: &str = "application/json";
const HTML: &str = "text/html; charset=utf-8";
const BYTES: &str = "application/octet-stream";

/// What the page may do: run what is in it, ask this server, save a picture; and no other page may frame it. Its modules are
/// `data:` addresses in an import map.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; \
     img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The page.
pub(super) fn html(text: String) -> Answer {
    let mut answer = answer(StatusCode::OK, HTML, text.into());
    answer.headers_mut().insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(PAGE_POLICY));
    answer
}

pub(super) fn json(value: &Value) -> Answer {
    answer(StatusCode::OK, JSON, value.to_string().into())
}

/// `permit`: of the memory, which lasts as long as the bytes.
pub(super) fn bytes(bytes: Vec<u8>, permit: Option<OwnedSemaphorePermit>) -> Answer {
    let held = Held { bytes, _permit: permit };
    answer(StatusCode::OK, BYTES, Bytes::from_owner(held))
}

pub(super) fn nothing() -> Answer {
    let mut answer = answer(StatusCode::NO_CONTENT, BYTES, Bytes::new());
    answer.headers_mut().remove(CONTENT_TYPE);
    answer
}

/// `allowed`: the methods that the address answers.
pub(super) fn refusal(refusal: &Refusal, allowed: &'static str) -> Answer {
    let status = StatusCode::from_u16(refusal.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    let mut answer = answer(status, JSON, json!({ "error": refusal.line }).to_string().into());
    if status == StatusCode::METHOD_NOT_ALLOWED {
        answer.headers_mut().insert(ALLOW, HeaderValue::from_static(allowed));
    }
    answer
}

fn answer(status: StatusCode, content_type: &'static str, bytes: Bytes) -> Answer {
    let mut answer = Response::new(Full::new(bytes).map_err(|never| match never {}).boxed_unsync());
    *answer.status_mut() = status;
    answer.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(content_type));
    answer
}

/// What all answers have: they are asked for again, taken for what they are called, and kept from other origins.
pub(super) fn with_usual_headers(mut answer: Answer) -> Answer {
    let usual = [
        (CACHE_CONTROL, "no-cache"),
        (HeaderName::from_static("x-content-type-options"), "nosniff"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("referrer-policy"), "no-referrer"),
    ];
    for (name, value) in usual {
        answer.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    answer
}

struct Held {
    bytes: Vec<u8>,
    _permit: Option<OwnedSemaphorePermit>,
}

impl AsRef<[u8]> for Held {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}
