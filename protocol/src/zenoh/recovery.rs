//! What makes a session work again within a second after the network failed.
//!
//! Both ends of a link that was cut must give it up, and the client must open another one: what TCP or
//! QUIC would send again by themselves, they send again later and later. A link is given up when
//! nothing was heard for the lease; then the client tries again, and again, each time from the start.
//! So after the network's return it takes one attempt, or a lease if that was not over, at the most.

use std::{
    fs,
    os::fd::{BorrowedFd, RawFd},
    sync::mpsc::{self, RecvTimeoutError, Sender},
    thread,
    time::Duration,
};

use socket2::SockRef;

use crate::bus::BusError;

/// The keys of a Zenoh configuration that decide how long an interruption lasts, times in ms.
///
/// Opening a link takes four to five round trips of the network; where they take longer than a tenth of
/// a second, it needs a longer `open_timeout`, in a configuration of the user's own.
pub(super) const SETTINGS: [(&str, &str); 4] = [
    ("transport/link/tx/lease", "500"),
    ("transport/link/tx/keep_alive", "4"),
    ("transport/unicast/open_timeout", "500"),
    ("connect/retry", "{ period_init_ms: 50, period_max_ms: 50, period_increase_factor: 1 }"),
];

/// How often to look for new links: before the lease of one can be over.
const PERIOD: Duration = Duration::from_millis(200);

/// Sees to it that no link lingers.
///
/// Zenoh lets TCP linger for ten seconds (`TCP_LINGER_TIMEOUT` in zenoh-link-tcp and -tls, which no
/// setting changes): closing a link that was cut then holds the thread that receives from everybody,
/// and the link's peer is refused, until what was sent last is acknowledged. Without it the system
/// sends the rest by itself.
pub(super) struct Unlingering {
    _until_dropped: Sender<()>,
}

impl Unlingering {
    /// From now on, for as long as the result lives.
    pub fn begin() -> Result<Self, BusError> {
        let (_until_dropped, dropped) = mpsc::channel();
        thread::Builder::new()
            .name("unlinger".to_owned())
            .spawn(move || {
                while dropped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                    unlinger();
                }
            })
            .map_err(|error| BusError::Transport(format!("a thread for Zenoh: {error}")))?;
        Ok(Self { _until_dropped })
    }
}

/// Only Zenoh makes sockets linger here, and it does not say which they are.
fn unlinger() {
    let Ok(descriptors) = fs::read_dir("/proc/self/fd") else { return };
    let numbers =
        descriptors.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    for number in numbers.filter(|number: &RawFd| *number >= 0) {
        #[allow(unsafe_code, reason = "Zenoh owns the socket and does not lend it")]
        // SAFETY: used at once, for two system calls. If Zenoh closes the socket meanwhile, they fail or
        // concern another one of this process, of which nothing is changed but that it does not linger.
        let descriptor = unsafe { BorrowedFd::borrow_raw(number) };
        let socket = SockRef::from(&descriptor);
        if let Ok(Some(_)) = socket.linger() {
            // A socket that cannot be changed is gone.
            let _ = socket.set_linger(None);
        }
    }
}
