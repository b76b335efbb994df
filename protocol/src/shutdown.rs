//! The request to stop a role: by Ctrl-C, SIGTERM, or the end of the process that started it.

use std::{
    io::Read,
    sync::atomic::{AtomicBool, Ordering},
    thread,
};

static STOP: AtomicBool = AtomicBool::new(false);

/// The flag that asks the process to stop. There is one for the whole process, as for signals.
#[derive(Clone, Copy, Debug)]
pub struct Shutdown;

impl Shutdown {
    /// Makes Ctrl-C, SIGTERM and SIGHUP ask the process to stop instead of ending it at once.
    pub fn on_signals() -> Self {
        // Fails only if a handler is installed already, which then does the same.
        let _ = ctrlc::set_handler(|| Self.request());
        Self
    }

    /// Also stops the process when standard input ends, as it does when the launcher dies.
    pub fn when_stdin_closes(self) -> Self {
        thread::spawn(move || {
            let mut byte = [0];
            while std::io::stdin().read(&mut byte).is_ok_and(|count| count > 0) {}
            self.request();
        });
        self
    }

    /// Asks the process to stop.
    pub fn request(self) {
        STOP.store(true, Ordering::Relaxed);
    }

    /// Whether the process may go on.
    pub fn proceed(self) -> bool {
        !STOP.load(Ordering::Relaxed)
    }
}
