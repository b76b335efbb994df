//! When a role is to stop: Ctrl-C, SIGTERM, or the end of the process that started it.

use std::{
    io::Read,
    sync::atomic::{AtomicBool, Ordering},
    thread,
};

static STOP: AtomicBool = AtomicBool::new(false);

/// Whether the process may go on. One flag for the whole process, as signals are.
#[derive(Clone, Copy, Debug)]
pub struct Shutdown;

impl Shutdown {
    /// From now on Ctrl-C, SIGTERM and SIGHUP ask the process to stop instead of ending it at once.
    pub fn on_signals() -> Self {
        // Fails only if a handler is installed already, which then does the same.
        let _ = ctrlc::set_handler(|| Self.request());
        Self
    }

    /// Also stops when standard input ends, as it does when the launcher that holds its other end
    /// dies, however it dies.
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

    /// Whether nobody has asked to stop.
    pub fn proceed(self) -> bool {
        !STOP.load(Ordering::Relaxed)
    }
}
