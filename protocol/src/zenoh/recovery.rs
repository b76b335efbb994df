//! The recovery of a session within a second after the network failed.
//!
//! Both ends of a link that was cut must close it, and the client must open another one, because
//! TCP and QUIC retransmit at longer and longer intervals. Each end closes a link that was silent
//! for the lease; then the client tries to connect until it succeeds. So after the network's
//! return, recovery takes one attempt, and the rest of the lease at most.

use std::{
    fs,
    os::fd::{BorrowedFd, RawFd},
    sync::mpsc::{self, RecvTimeoutError, Sender},
    thread,
    time::Duration,
};

use socket2::SockRef;

use super::ZenohError;

/// The keys of a Zenoh configuration that limit an interruption, times in ms.
///
/// Opening a link takes four to five round trips. If a round trip takes longer than 0.1 s, a
/// configuration file must set a longer `open_timeout`.
pub(super) const SETTINGS: [(&str, &str); 4] = [
    ("transport/link/tx/lease", "500"),
    ("transport/link/tx/keep_alive", "4"),
    ("transport/unicast/open_timeout", "500"),
    ("connect/retry", "{ period_init_ms: 50, period_max_ms: 50, period_increase_factor: 1 }"),
];

/// How often to look for new links: more often than a lease can lapse.
const PERIOD: Duration = Duration::from_millis(200);

/// A thread that switches lingering off on Zenoh's sockets, until this is dropped.
///
/// Zenoh lets TCP linger for ten seconds (`TCP_LINGER_TIMEOUT` in zenoh-link-tcp and -tls, which no
/// setting changes). Closing a link that was cut then blocks the thread that receives from all
/// peers, and the link's peer is refused, until the last bytes are acknowledged. Without lingering
/// the system sends the rest by itself.
pub(super) struct LingerGuard {
    _until_dropped: Sender<()>,
}

impl LingerGuard {
    /// Starts the thread.
    pub(super) fn start() -> Result<Self, ZenohError> {
        let (_until_dropped, dropped) = mpsc::channel();
        thread::Builder::new()
            .name("linger".to_owned())
            .spawn(move || {
                while dropped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                    switch_lingering_off();
                }
            })
            .map_err(ZenohError::Thread)?;
        Ok(Self { _until_dropped })
    }
}

/// Switches lingering off on all sockets of this process: only Zenoh's linger, and it does not tell
/// which they are.
fn switch_lingering_off() {
    let Ok(descriptors) = fs::read_dir("/proc/self/fd") else { return };
    let numbers =
        descriptors.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    for number in numbers.filter(|number: &RawFd| *number >= 0) {
        #[allow(unsafe_code, reason = "Zenoh owns the socket and does not lend it")]
        // SAFETY: the descriptor is used at once, for two system calls. If Zenoh closes the socket
        // meanwhile, they fail, or concern another socket of this process, which then does not
        // linger either.
        let descriptor = unsafe { BorrowedFd::borrow_raw(number) };
        let socket = SockRef::from(&descriptor);
        if let Ok(Some(_)) = socket.linger() {
            // A socket that cannot be changed is closed.
            let _ = socket.set_linger(None);
        }
    }
}
