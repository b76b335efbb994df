//! The number of threads on which Zenoh reads and writes.

use std::{env, sync::Once};

/// The environment variable with Zenoh's layout of threads.
const LAYOUT: &str = "ZENOH_RUNTIME";

/// Makes Zenoh read and write on one thread, from its first session in this process on, unless the
/// user has set another layout.
///
/// A TLS link of Zenoh 1.10 uses one connection on the reading and the writing thread at once,
/// without a lock (zenoh #2557), which sooner or later corrupts a message or memory. On one thread
/// they alternate. QUIC has a lock of its own.
pub fn use_one_thread() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        if env::var_os(LAYOUT).is_none() {
            #[allow(unsafe_code, reason = "Zenoh takes this from the environment only")]
            // SAFETY: the standard library orders its own accesses; C code that reads the
            // environment, such as a name resolver, runs on threads that Zenoh has not started yet.
            unsafe {
                env::set_var(LAYOUT, "(rx: (worker_threads: 1), tx: (handover: rx))");
            }
        }
    });
}
