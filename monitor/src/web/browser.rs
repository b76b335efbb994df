//! Opens a page in the user's browser.

use std::{
    process::{Command, Stdio},
    thread,
};

use tracing::warn;

const OPENER: &str = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };

/// Asks the desktop to open `url`; if that fails, asks the user to.
pub(super) fn open(url: &str) {
    let started = Command::new(OPENER)
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let Ok(mut opener) = started else { return report_failure() };
    // The opener may run as long as the browser does.
    thread::spawn(move || {
        if !opener.wait().is_ok_and(|status| status.success()) {
            report_failure();
        }
    });
}

fn report_failure() {
    warn!("'{OPENER}' opened no browser; open the address above yourself");
}
