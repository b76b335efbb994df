//! The server: its routes, and the connections it takes.

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

use super::{board::Cursor, guard::Guard, knobs, live::Live, page};
use crate::desk::Counter;

/// How many connections there may be at once.
const CONNECTIONS: usize = 256;
/// How long a connection may take over one request, unless it becomes a dashboard.
const PATIENCE: Duration = Duration::from_secs(30);
/// How long somebody for whom there is no room may take to hear so.
const BRIEF: Duration = Duration::from_secs(1);
/// The longest a dashboard may say at once; it has nothing to say.
const LONGEST: usize = 4096;

/// The page may load nothing but its own files and what it draws itself, and nobody may frame it.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What requests are answered from.
#[derive(Clone)]
pub struct Server {
    /// Who may do what.
    pub guard: Guard,
    /// Where knobs are handed in, if any may be turned.
    pub counter: Option<Counter>,
    /// What dashboards see.
    pub live: Live,
}

impl FromRef<Server> for Guard {
    fn from_ref(server: &Server) -> Self {
        server.guard.clone()
    }
}

impl FromRef<Server> for Option<Counter> {
    fn from_ref(server: &Server) -> Self {
        server.counter.clone()
    }
}

/// Held as long as a connection lasts.
type Room = Option<Arc<OwnedSemaphorePermit>>;

impl Server {
    /// Serves everybody who connects, for ever.
    pub async fn serve(self, listener: TcpListener) {
        let live = self.live.clone();
        tokio::join!(live.beat(), self.accept(listener));
    }

    async fn accept(self, listener: TcpListener) {
        let rooms = Arc::new(Semaphore::new(CONNECTIONS));
        let router = self.router();
        loop {
            match listener.accept().await {
                Ok((stream, _)) => {
                    let room = Arc::clone(&rooms).try_acquire_owned().ok().map(Arc::new);
                    tokio::spawn(answer(stream, router.clone(), room));
                }
                // A connection that was given up before it was taken.
                Err(error) if error.kind() == ErrorKind::ConnectionAborted => {}
                // Out of files: some of the connections will end.
                Err(_) => sleep(BRIEF).await,
            }
        }
    }

    fn router(self) -> Router {
        page::routes()
            .route("/live", get(live))
            .route("/knob", post(knobs::turn))
            .layer(middleware::from_fn_with_state(self.clone(), admit))
            .layer(middleware::map_response(secure))
            .with_state(self)
    }
}

/// Answers the one request of a connection.
async fn answer(stream: TcpStream, router: Router, room: Room) {
    // What is sent is wanted now; fails only if the other end is gone.
    let _ = stream.set_nodelay(true);
    let patience = if room.is_some() { PATIENCE } else { BRIEF };
    let service = TowerToHyperService::new(router.layer(Extension(room)));
    let connection =
        http1::Builder::new().serve_connection(TokioIo::new(stream), service).with_upgrades();
    // Ends with an error where somebody goes away in the middle of something.
    let _ = timeout(patience, connection).await;
}

/// Lets a request in, or says why not.
async fn admit(
    State(server): State<Server>,
    Extension(room): Extension<Room>,
    request: Request,
    next: Next,
) -> Response {
    if room.is_none() {
        let reason = "too many connections; close a dashboard and try again";
        return knobs::refuse(StatusCode::SERVICE_UNAVAILABLE, reason);
    }
    match server.guard.admit(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => knobs::refuse(refusal.status, refusal.reason),
    }
}

async fn secure(mut response: Response) -> Result<Response, Infallible> {
    let headers: [(HeaderName, &'static str); 5] = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        // The next version of the program has the next version of the page.
        (header::CACHE_CONTROL, "no-store"),
    ];
    if response.status() != StatusCode::SWITCHING_PROTOCOLS {
        // One request a connection: an idle browser keeps nobody out.
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    for (name, value) in headers {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    Ok(response)
}

/// `GET /live`, or `GET /live?run=…&since=…` for a page that comes back: from here on the connection
/// is a dashboard's.
async fn live(
    State(server): State<Server>,
    Extension(room): Extension<Room>,
    address: Uri,
    socket: WebSocketUpgrade,
) -> Response {
    let known = address.query().and_then(Cursor::of_query).unwrap_or_default();
    socket.max_message_size(LONGEST).max_frame_size(LONGEST).on_upgrade(move |socket| async move {
        server.live.show(socket, known).await;
        drop(room);
    })
}
