//! Sends updates of the store to all dashboards, twenty times a second.
//!
//! The broadcaster encodes what the store has published and sends the result to all dashboards. A
//! dashboard that is new or has fallen behind first gets everything since its last position from
//! the store, then goes on with the broadcast updates. So no dashboard waits for another one,
//! nothing is queued for a dashboard that does not read, and no plot has a gap.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use axum::extract::ws::{Message, Utf8Bytes, WebSocket};
use tokio::{
    sync::broadcast::{self, error::RecvError},
    time::{MissedTickBehavior, interval, timeout},
};

use super::{
    page_json,
    store::{Cursor, Publication, Store, Update},
};

/// Time between two updates.
const PERIOD: Duration = Duration::from_millis(50);
/// Every tenth update holds histograms.
const HISTOGRAM: u64 = 10;
/// How many updates a dashboard may be behind before it reads from the store again.
const QUEUE: usize = 32;
/// How many bins are read from the store at once: few enough for a slow line to take them in time.
const CHUNK: usize = 250;
/// How long a socket may accept no data.
const TIMEOUT: Duration = Duration::from_secs(10);

/// The store, shared by the monitor's loop and the server.
#[derive(Clone, Default)]
pub(super) struct SharedStore(Arc<Mutex<Store>>);

impl SharedStore {
    /// Locks the store; only for moments, since the monitor's loop waits for it.
    pub(super) fn lock(&self) -> MutexGuard<'_, Store> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A publication of the store as JSON.
struct EncodedUpdate {
    publication: Publication,
    messages: Vec<Utf8Bytes>,
}

/// Sends updates to all dashboards.
#[derive(Clone)]
pub(super) struct Broadcaster {
    store: SharedStore,
    hello: Utf8Bytes,
    updates: broadcast::Sender<Arc<EncodedUpdate>>,
}

impl Broadcaster {
    /// Sends updates of a store; each dashboard gets `hello` first.
    pub(super) fn new(store: SharedStore, hello: String) -> Self {
        Self { store, hello: hello.into(), updates: broadcast::channel(QUEUE).0 }
    }

    /// Publishes and sends updates for ever.
    pub(super) async fn run(&self) {
        let mut interval = interval(PERIOD);
        interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            interval.tick().await;
            let dashboards = self.updates.receiver_count();
            let (publication, update, now) = {
                let mut store = self.store.lock();
                let publication = store.publish();
                if dashboards == 0 {
                    continue;
                }
                let has_histogram = publication.after.number.is_multiple_of(HISTOGRAM);
                let now = page_json::now(&store, dashboards, has_histogram);
                (publication, store.update_of(&publication), now)
            };
            let mut messages = encode(&update);
            messages.push(now.into());
            // Fails if all dashboards have gone meanwhile; the next ones read from the store.
            let _ = self.updates.send(Arc::new(EncodedUpdate { publication, messages }));
        }
    }

    /// Serves a dashboard that has everything up to `known`, until it goes or accepts no data.
    pub(super) async fn serve(&self, mut socket: WebSocket, mut known: Cursor) {
        let mut updates = self.updates.subscribe();
        if send(&mut socket, self.hello.clone()).await.is_err() {
            return;
        }
        loop {
            if self.catch_up(&mut socket, &mut known).await.is_err() {
                return;
            }
            if forward(&mut socket, &mut updates, &mut known).await.is_err() {
                return;
            }
        }
    }

    /// Sends everything that was published after `known`.
    async fn catch_up(&self, socket: &mut WebSocket, known: &mut Cursor) -> Result<(), Gone> {
        loop {
            let update = self.store.lock().update_since(known, CHUNK);
            for message in encode(&update) {
                send(socket, message).await?;
            }
            *known = update.cursor;
            if update.is_complete {
                return Ok(());
            }
        }
    }
}

/// Forwards updates as long as each is the successor of `known`.
async fn forward(
    socket: &mut WebSocket,
    updates: &mut broadcast::Receiver<Arc<EncodedUpdate>>,
    known: &mut Cursor,
) -> Result<(), Gone> {
    loop {
        tokio::select! {
            update = updates.recv() => match update {
                Ok(update) if update.publication.after.number <= known.number => {}
                Ok(update) if update.publication.before.number == known.number => {
                    for message in &update.messages {
                        send(socket, message.clone()).await?;
                    }
                    *known = update.publication.after;
                }
                Ok(_) | Err(RecvError::Lagged(_)) => return Ok(()),
                Err(RecvError::Closed) => return Err(Gone),
            },
            // A page sends nothing itself, but its browser sends pings and closes the socket.
            message = socket.recv() => match message {
                Some(Ok(Message::Close(_)) | Err(_)) | None => return Err(Gone),
                Some(Ok(_)) => {}
            },
        }
    }
}

/// The dashboard has closed its socket, or reads nothing.
struct Gone;

async fn send(socket: &mut WebSocket, message: Utf8Bytes) -> Result<(), Gone> {
    match timeout(TIMEOUT, socket.send(Message::Text(message))).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => Err(Gone),
    }
}

fn encode(update: &Update) -> Vec<Utf8Bytes> {
    let scenario = update.scenario.iter().map(|offered| page_json::scenario(offered));
    let bins = (!update.bins.is_empty()).then(|| page_json::bins(update));
    let changes = update.changes.iter().map(page_json::change);
    scenario.chain(bins).chain(changes).map(Utf8Bytes::from).collect()
}
