//! Opens a page in the user's browser.

use std::{
    process::{Command, Stdio},
    thread,
};

const OPENER: &str = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };

/// Asks the desktop to open `url`; where there is none, the user is told to.
pub fn open(url: &str) {
    let started = Command::new(OPENER)
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let Ok(mut opener) = started else { return complain() };
    // It may stay as long as the browser does.
    thread::spawn(move || {
        if !opener.wait().is_ok_and(|status| status.success()) {
            complain();
        }
    });
}

fn complain() {
    eprintln!("mtj monitor: '{OPENER}' opened no browser; open the address above yourself");
}
