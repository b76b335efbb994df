//! The HTTP server: its routes and its connections.

use std::{convert::Infallible, io::ErrorKind, sync::Arc, time::Duration};

use axum::{
    Extension, Router,
    extract::{FromRef, Request, State, WebSocketUpgrade},
    http::{HeaderName, HeaderValue, StatusCode, Uri, header},
    middleware::{self, Next},
    response::Response,
    routing::{get, post},
};
use hyper::server::conn::http1;
use hyper_util::{rt::TokioIo, service::TowerToHyperService};
use tokio::{
    net::{TcpListener, TcpStream},
    sync::{OwnedSemaphorePermit, Semaphore},
    time::{sleep, timeout},
};

use super::{access::AccessControl, broadcast::Broadcaster, page, requests, saving, store::Cursor};
use crate::{recording::SaveHandle, requests::RequestHandle};

/// The most connections at once.
const CONNECTIONS: usize = 256;
/// The longest time for one HTTP request, unless it becomes a dashboard's WebSocket.
const TIMEOUT: Duration = Duration::from_secs(30);
/// The longest time for a connection that is refused because there are too many.
const REFUSAL_TIMEOUT: Duration = Duration::from_secs(1);
/// The longest message from a dashboard, bytes; dashboards send none.
const LONGEST: usize = 4096;

/// The page may load only its own files and what it draws itself; no other page may embed it.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The state that the server's routes share.
#[derive(Clone)]
pub(super) struct Server {
    pub access: AccessControl,
    /// Sends requests to the plant, unless the dashboard is read-only.
    pub requests: Option<RequestHandle>,
    /// Saves the last seconds, if a recorder keeps them.
    pub saves: Option<SaveHandle>,
    pub live: Broadcaster,
}

impl FromRef<Server> for AccessControl {
    fn from_ref(server: &Server) -> Self {
        server.access.clone()
    }
}

impl FromRef<Server> for Option<RequestHandle> {
    fn from_ref(server: &Server) -> Self {
        server.requests.clone()
    }
}

impl FromRef<Server> for Option<SaveHandle> {
    fn from_ref(server: &Server) -> Self {
        server.saves.clone()
    }
}

/// Counts a connection as long as it lasts; `None` if there are too many.
type Permit = Option<Arc<OwnedSemaphorePermit>>;

impl Server {
    /// Serves all connections, for ever.
    pub(super) async fn serve(self, listener: TcpListener) {
        let live = self.live.clone();
        tokio::join!(live.run(), self.accept(listener));
    }

    async fn accept(self, listener: TcpListener) {
        let permits = Arc::new(Semaphore::new(CONNECTIONS));
        let router = self.router();
        loop {
            match listener.accept().await {
                Ok((stream, _)) => {
                    let permit = Arc::clone(&permits).try_acquire_owned().ok().map(Arc::new);
                    tokio::spawn(answer(stream, router.clone(), permit));
                }
                // The client gave up before its connection was accepted.
                Err(error) if error.kind() == ErrorKind::ConnectionAborted => {}
                // Too many open files: some of the connections will end.
                Err(_) => sleep(REFUSAL_TIMEOUT).await,
            }
        }
    }

    fn router(self) -> Router {
        page::routes()
            .route("/live", get(live))
            .route("/knob", post(requests::post))
            .route("/save", post(saving::post))
            .layer(middleware::from_fn_with_state(self.clone(), admit))
            .layer(middleware::map_response(secure))
            .with_state(self)
    }
}

/// Answers the one request of a connection.
async fn answer(stream: TcpStream, router: Router, permit: Permit) {
    // Fails only if the client has gone.
    let _ = stream.set_nodelay(true);
    let limit = if permit.is_some() { TIMEOUT } else { REFUSAL_TIMEOUT };
    let service = TowerToHyperService::new(router.layer(Extension(permit)));
    let connection =
        http1::Builder::new().serve_connection(TokioIo::new(stream), service).with_upgrades();
    // An error means that the client went away early.
    let _ = timeout(limit, connection).await;
}

/// Passes a request on, or responds with the reason why not.
async fn admit(
    State(server): State<Server>,
    Extension(permit): Extension<Permit>,
    request: Request,
    next: Next,
) -> Response {
    if permit.is_none() {
        let reason = "too many connections; close a dashboard and try again";
        return requests::refuse(StatusCode::SERVICE_UNAVAILABLE, reason);
    }
    match server.access.check_origin(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(denial) => requests::refuse(denial.status, denial.reason),
    }
}

async fn secure(mut response: Response) -> Result<Response, Infallible> {
    let headers: [(HeaderName, &'static str); 5] = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        // Another version of the program has another version of the page.
        (header::CACHE_CONTROL, "no-store"),
    ];
    if response.status() != StatusCode::SWITCHING_PROTOCOLS {
        // One request a connection, so that an idle browser uses none of them.
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    for (name, value) in headers {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    Ok(response)
}

/// `GET /live`, or `GET /live?run=…&since=…` for a page that reconnects: the connection becomes a
/// dashboard's WebSocket.
async fn live(
    State(server): State<Server>,
    Extension(permit): Extension<Permit>,
    address: Uri,
    socket: WebSocketUpgrade,
) -> Response {
    let known = address.query().and_then(Cursor::of_query).unwrap_or_default();
    socket.max_message_size(LONGEST).max_frame_size(LONGEST).on_upgrade(move |socket| async move {
        server.live.serve(socket, known).await;
        drop(permit);
    })
}
