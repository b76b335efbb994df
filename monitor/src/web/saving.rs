//! Requests to save the last seconds over HTTP.

use axum::{
    extract::State,
    http::{HeaderMap, StatusCode},
    response::Response,
};
use serde_json::json;
use tokio::sync::oneshot;

use super::{
    access::AccessControl,
    requests::{refuse, respond},
};
use crate::recording::{SaveError, SaveHandle};

/// `POST /save`: saves the last seconds in a file and responds with its name.
pub(super) async fn post(
    State(access): State<AccessControl>,
    State(saves): State<Option<SaveHandle>>,
    headers: HeaderMap,
) -> Response {
    if let Err(denial) = access.check_token(&headers) {
        return refuse(denial.status, denial.reason);
    }
    let Some(saves) = saves else {
        return refuse(StatusCode::NOT_FOUND, "this monitor was started without --record-last");
    };
    let (sender, outcome) = oneshot::channel();
    // Sending fails only if the page has gone meanwhile.
    saves.save("the dashboard", move |outcome| drop(sender.send(outcome)));
    match outcome.await.unwrap_or(Err(SaveError::Stopping)) {
        Ok(file) => respond(StatusCode::OK, &json!({ "accepted": true, "file": file })),
        Err(error) => refuse(status(&error), &error.to_string()),
    }
}

fn status(error: &SaveError) -> StatusCode {
    match error {
        SaveError::Nothing => StatusCode::CONFLICT,
        SaveError::Write { .. } => StatusCode::INSUFFICIENT_STORAGE,
        SaveError::Stopping => StatusCode::SERVICE_UNAVAILABLE,
    }
}
