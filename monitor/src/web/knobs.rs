//! Knobs, turned over HTTP.

use std::time::Duration;

use axum::{
    body::{self, Body},
    extract::{Request, State},
    http::{StatusCode, header::CONTENT_TYPE},
    response::{IntoResponse, Response},
};
use mtj_protocol::{request, sample::ChangeSample};
use serde_json::{Value, json};
use tokio::{sync::oneshot, time::timeout};

use super::guard::Guard;
use crate::desk::Counter;

/// The longest request.
const LONGEST: usize = 16 * 1024;
/// How long a request may take to arrive.
const PATIENCE: Duration = Duration::from_secs(5);

/// `POST /knob`: asks the plant, and answers with what it says.
pub async fn turn(
    State(guard): State<Guard>,
    State(counter): State<Option<Counter>>,
    request: Request,
) -> Response {
    if let Err(refusal) = guard.trust(request.headers()) {
        return refuse(refusal.status, refusal.reason);
    }
    // The guard trusts nobody where there is no counter.
    let Some(counter) = counter else {
        return refuse(StatusCode::FORBIDDEN, "this monitor turns no knobs");
    };
    let kind = request.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
    if !kind.is_some_and(|kind| kind.starts_with("application/json")) {
        return refuse(StatusCode::BAD_REQUEST, "a knob's Content-Type is application/json");
    }
    let knob = match read(request.into_body()).await {
        Ok(knob) => knob,
        Err(reason) => return refuse(StatusCode::BAD_REQUEST, &reason),
    };
    match ask(&counter, knob).await {
        Ok(change) => answer(&change),
        Err(reason) => refuse(StatusCode::GATEWAY_TIMEOUT, &reason),
    }
}

async fn read(body: Body) -> Result<request::Request, String> {
    let Ok(Ok(bytes)) = timeout(PATIENCE, body::to_bytes(body, LONGEST)).await else {
        return Err("the request is too long, or was never finished".to_owned());
    };
    let knob: request::Request = serde_json::from_slice(&bytes)
        .map_err(|error| format!("there is no such knob: {error}"))?;
    knob.check().map_err(|error| error.to_string())?;
    Ok(knob)
}

async fn ask(counter: &Counter, knob: request::Request) -> Result<ChangeSample, String> {
    let (sender, outcome) = oneshot::channel();
    // Nobody listens any more if the page has gone meanwhile.
    counter.turn(knob, move |outcome| drop(sender.send(outcome)));
    outcome.await.unwrap_or_else(|_| Err("the monitor is stopping".to_owned()))
}

fn answer(change: &ChangeSample) -> Response {
    match change.outcome() {
        Ok(()) => {
            let time = change.header.time_ns as f64 * 1e-9;
            let body = json!({ "accepted": true, "time": time, "words": change.words() });
            respond(StatusCode::OK, &body)
        }
        Err(reason) => refuse(StatusCode::UNPROCESSABLE_ENTITY, reason),
    }
}

/// A refusal, with one sentence that says why.
pub fn refuse(status: StatusCode, reason: &str) -> Response {
    respond(status, &json!({ "accepted": false, "reason": reason }))
}

fn respond(status: StatusCode, body: &Value) -> Response {
    (status, [(CONTENT_TYPE, "application/json")], body.to_string()).into_response()
}
