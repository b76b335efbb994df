//! On how many threads Zenoh reads and writes.

use std::{env, sync::Once};

/// Where Zenoh looks how to lay out its threads.
const LAYOUT: &str = "ZENOH_RUNTIME";

/// Has Zenoh read and write on one thread, from its first session in this process on. Who has laid out its
/// threads himself is left alone.
///
/// A TLS link of Zenoh 1.10 hands one connection to the reading and the writing thread at once, without a
/// lock (zenoh #2557): sooner or later a message is torn or memory is. On one thread they take turns.
/// QUIC has a lock of its own.
pub fn take_turns() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        if env::var_os(LAYOUT).is_none() {
            #[allow(unsafe_code, reason = "Zenoh takes this from the environment only")]
            // SAFETY: the standard library orders its own accesses; C code that reads the environment, such as
            // a resolver of names, runs on threads that Zenoh has not started yet.
            unsafe {
                env::set_var(LAYOUT, "(rx: (worker_threads: 1), tx: (handover: rx))");
            }
        }
    });
}
