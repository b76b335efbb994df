//! Requests to the plant over HTTP.

use std::time::Duration;

use axum::{
    body::{self, Body},
    extract::{self, State},
    http::{StatusCode, header::CONTENT_TYPE},
    response::{IntoResponse, Response},
};
use mtj_protocol::{
    request::{Request, RequestError},
    sample::ChangeSample,
};
use serde_json::{Value, json};
use tokio::{sync::oneshot, time::timeout};

use super::access::AccessControl;
use crate::requests::{NoAnswer, Outcome, RequestHandle};

/// The longest body, bytes.
const LONGEST: usize = 16 * 1024;
/// How long a body may take to arrive.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Why a body is not a request that could be sent to a plant.
#[derive(Debug, thiserror::Error)]
enum BodyError {
    #[error("a knob's Content-Type is application/json")]
    ContentType,
    #[error("the request is too long, or was never finished")]
    Incomplete,
    #[error("there is no such knob: {0}")]
    Json(#[from] serde_json::Error),
    #[error(transparent)]
    Invalid(#[from] RequestError),
}

/// `POST /knob`: sends a request to the plant and responds with the plant's answer.
pub(super) async fn post(
    State(access): State<AccessControl>,
    State(requests): State<Option<RequestHandle>>,
    request: extract::Request,
) -> Response {
    if let Err(denial) = access.check_token(request.headers()) {
        return refuse(denial.status, denial.reason);
    }
    // Without a handle there is no token, so the access control has denied the request.
    let Some(requests) = requests else {
        return refuse(StatusCode::FORBIDDEN, "this monitor turns no knobs");
    };
    let knob = match read(request).await {
        Ok(knob) => knob,
        Err(error) => return refuse(StatusCode::BAD_REQUEST, &error.to_string()),
    };
    match send(&requests, knob).await {
        Ok(change) => respond_with(&change),
        Err(error) => refuse(StatusCode::GATEWAY_TIMEOUT, &error.to_string()),
    }
}

async fn read(request: extract::Request<Body>) -> Result<Request, BodyError> {
    let kind = request.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
    if !kind.is_some_and(|kind| kind.starts_with("application/json")) {
        return Err(BodyError::ContentType);
    }
    let bytes = body::to_bytes(request.into_body(), LONGEST);
    let Ok(Ok(bytes)) = timeout(TIMEOUT, bytes).await else {
        return Err(BodyError::Incomplete);
    };
    let knob: Request = serde_json::from_slice(&bytes)?;
    knob.check()?;
    Ok(knob)
}

async fn send(requests: &RequestHandle, knob: Request) -> Outcome {
    let (sender, outcome) = oneshot::channel();
    // Sending fails only if the page has gone meanwhile.
    requests.send(knob, move |outcome| drop(sender.send(outcome)));
    outcome.await.unwrap_or(Err(NoAnswer::Stopping))
}

fn respond_with(change: &ChangeSample) -> Response {
    match change.outcome() {
        Ok(()) => {
            let time = change.header.time_ns as f64 * 1e-9;
            let body = json!({ "accepted": true, "time": time, "words": change.words() });
            respond(StatusCode::OK, &body)
        }
        Err(reason) => refuse(StatusCode::UNPROCESSABLE_ENTITY, reason),
    }
}

/// The response to a request that was not accepted, with the reason as one sentence.
pub(super) fn refuse(status: StatusCode, reason: &str) -> Response {
    respond(status, &json!({ "accepted": false, "reason": reason }))
}

/// A response of JSON.
pub(super) fn respond(status: StatusCode, body: &Value) -> Response {
    (status, [(CONTENT_TYPE, "application/json")], body.to_string()).into_response()
}
