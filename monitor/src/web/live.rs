//! What dashboards are sent, twenty times a second.
//!
//! The pulse makes one frame of what the board has published and shares it among all dashboards.
//! A dashboard that has just come, or that did not read for a while, gets from the board what it does
//! not have yet; then it goes on with frames. So nobody waits for anybody, nothing is queued for
//! those who do not read, and no gap stays in anybody's plots.

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
    board::{Board, Cursor, News, Step},
    frame,
};

/// Between two frames.
const PERIOD: Duration = Duration::from_millis(50);
/// Every so many frames hold histograms.
const HISTOGRAM: u64 = 10;
/// How many frames a dashboard may be behind before it looks at the board again.
const FRAMES: usize = 32;
/// How many bins are taken from the board at once: little enough for a slow line to take it in time.
const CHUNK: usize = 250;
/// How long a socket may take nothing.
const PATIENCE: Duration = Duration::from_secs(10);

/// The board where the monitor's loop and the server both reach it.
#[derive(Clone, Default)]
pub struct Shared(Arc<Mutex<Board>>);

impl Shared {
    /// Held for moments only: the monitor's loop waits for it.
    pub fn lock(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One step of the board, ready to be sent.
struct Frame {
    step: Step,
    messages: Vec<Utf8Bytes>,
}

/// Makes frames and hands them out.
#[derive(Clone)]
pub struct Live {
    board: Shared,
    hello: Utf8Bytes,
    frames: broadcast::Sender<Arc<Frame>>,
}

impl Live {
    /// Shows a board, after a first message.
    pub fn new(board: Shared, hello: String) -> Self {
        Self { board, hello: hello.into(), frames: broadcast::channel(FRAMES).0 }
    }

    /// Makes frames for ever.
    pub async fn beat(&self) {
        let mut interval = interval(PERIOD);
        interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            interval.tick().await;
            let dashboards = self.frames.receiver_count();
            let (step, news, now) = {
                let mut board = self.board.lock();
                let step = board.publish();
                if dashboards == 0 {
                    continue;
                }
                let has_histogram = step.after.publication.is_multiple_of(HISTOGRAM);
                (step, board.news_of(&step), frame::now(&board, dashboards, has_histogram))
            };
            let mut messages = words(&news);
            messages.push(now.into());
            // Nobody is there any more; the next who come look at the board.
            let _ = self.frames.send(Arc::new(Frame { step, messages }));
        }
    }

    /// Shows the board to a dashboard until it goes, or takes nothing for too long.
    pub async fn show(&self, mut socket: WebSocket, mut known: Cursor) {
        let mut frames = self.frames.subscribe();
        if send(&mut socket, self.hello.clone()).await.is_err() {
            return;
        }
        loop {
            if self.catch_up(&mut socket, &mut known).await.is_err() {
                return;
            }
            if follow(&mut socket, &mut frames, &mut known).await.is_err() {
                return;
            }
        }
    }

    /// Sends all that was published and is not known.
    async fn catch_up(&self, socket: &mut WebSocket, known: &mut Cursor) -> Result<(), Gone> {
        loop {
            let news = self.board.lock().news(known, CHUNK);
            for message in words(&news) {
                send(socket, message).await?;
            }
            *known = news.cursor;
            if news.is_all {
                return Ok(());
            }
        }
    }
}

/// Passes frames on for as long as each is the next one to what is known.
async fn follow(
    socket: &mut WebSocket,
    frames: &mut broadcast::Receiver<Arc<Frame>>,
    known: &mut Cursor,
) -> Result<(), Gone> {
    loop {
        tokio::select! {
            frame = frames.recv() => match frame {
                Ok(frame) if frame.step.after.publication <= known.publication => {}
                Ok(frame) if frame.step.before.publication == known.publication => {
                    for message in &frame.messages {
                        send(socket, message.clone()).await?;
                    }
                    *known = frame.step.after;
                }
                Ok(_) | Err(RecvError::Lagged(_)) => return Ok(()),
                Err(RecvError::Closed) => return Err(Gone),
            },
            // A page says nothing; but that it goes, and pings, are heard here.
            said = socket.recv() => match said {
                Some(Ok(Message::Close(_)) | Err(_)) | None => return Err(Gone),
                Some(Ok(_)) => {}
            },
        }
    }
}

/// The dashboard has gone, or is as good as gone.
struct Gone;

async fn send(socket: &mut WebSocket, message: Utf8Bytes) -> Result<(), Gone> {
    match timeout(PATIENCE, socket.send(Message::Text(message))).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => Err(Gone),
    }
}

fn words(news: &News) -> Vec<Utf8Bytes> {
    let scenario = news.scenario.iter().map(|offered| frame::scenario(offered));
    let bins = (!news.bins.is_empty()).then(|| frame::bins(news));
    let marks = news.marks.iter().map(frame::mark);
    scenario.chain(bins).chain(marks).map(Utf8Bytes::from).collect()
}
