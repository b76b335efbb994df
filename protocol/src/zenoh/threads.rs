//! The threads on which Zenoh works.
//!
//! Zenoh reads and writes a TLS link on two threads without the lock that TLS needs
//! (eclipse-zenoh/zenoh#2557, open in 1.10): a write that meets a read finds the link's state in pieces,
//! and closes the link, or takes the process down. Where one thread does both, they never meet.

use std::{env, sync::Once};

use zenoh::Config;

/// Where Zenoh, when it is first used, looks for what its threads are to be.
const VARIABLE: &str = "ZENOH_RUNTIME";
/// The thread that receives sends, too, and there is one.
const ONE_FOR_BOTH: &str = "(rx: (worker_threads: 1), tx: (handover: rx))";

/// Sees to it that one thread receives and sends, where a session may have TLS links; to be called before the
/// first session is opened. What the user has set stays.
pub(super) fn settle(config: &Config) {
    static ONCE: Once = Once::new();
    let speaks_tls = ["listen/endpoints", "connect/endpoints"]
        .iter()
        .any(|key| config.get_json(key).is_ok_and(|endpoints| endpoints.contains("tls/")));
    if speaks_tls && env::var_os(VARIABLE).is_none() {
        ONCE.call_once(|| {
            #[allow(unsafe_code, reason = "Zenoh takes this from the environment only")]
            // SAFETY: the standard library locks the environment, and nothing that reads it without that
            // lock runs before the first session is opened.
            unsafe {
                env::set_var(VARIABLE, ONE_FOR_BOTH);
            }
        });
    }
}
