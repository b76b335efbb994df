//! Requests to save what a ring recorder holds.

use std::{
    fmt, io,
    sync::mpsc::{self, Receiver, Sender},
    thread,
};

use tokio::{
    signal::unix::{SignalKind, signal},
    sync::oneshot,
};

/// Why nothing was saved.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// No message has come yet.
    #[error("nothing was heard yet that could be saved")]
    Nothing,
    /// The file cannot be written.
    #[error("{file}: {reason}")]
    Write {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// The monitor ends.
    #[error("the monitor is stopping")]
    Stopping,
}

/// The file that was saved, or why there is none.
pub type SaveOutcome = Result<String, SaveError>;

type Reply = Box<dyn FnOnce(SaveOutcome) + Send>;

/// Asks a ring recorder to save, from any thread.
#[derive(Clone, Debug)]
pub struct SaveHandle(Sender<SaveRequest>);

/// One request to save.
pub(super) struct SaveRequest {
    /// What asks for it.
    pub origin: &'static str,
    pub reply: Reply,
}

impl fmt::Debug for SaveRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SaveRequest").field("origin", &self.origin).finish_non_exhaustive()
    }
}

impl SaveHandle {
    /// A handle, and where its requests come out.
    pub(super) fn new() -> (Self, Receiver<SaveRequest>) {
        let (sender, receiver) = mpsc::channel();
        (Self(sender), receiver)
    }

    /// Asks to save; `origin` says who asks. `reply` is called once, when the file is written.
    pub fn save(&self, origin: &'static str, reply: impl FnOnce(SaveOutcome) + Send + 'static) {
        let request = SaveRequest { origin, reply: Box::new(reply) };
        if let Err(mpsc::SendError(SaveRequest { reply, .. })) = self.0.send(request) {
            reply(Err(SaveError::Stopping));
        }
    }
}

/// Saves at each SIGUSR1, until the result is dropped.
pub(super) fn on_signal(handle: SaveHandle) -> io::Result<oneshot::Sender<()>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let mut signals = {
        let _entered = runtime.enter();
        signal(SignalKind::user_defined1())?
    };
    let (stop, mut stopped) = oneshot::channel::<()>();
    let save = move || {
        runtime.block_on(async {
            loop {
                tokio::select! {
                    // What became of it is logged.
                    Some(()) = signals.recv() => handle.save("SIGUSR1", drop),
                    _ = &mut stopped => return,
                }
            }
        });
    };
    thread::Builder::new().name("mtj-save-signal".to_owned()).spawn(save)?;
    Ok(stop)
}
