//! What shared memory needs of a machine, and what to say when it is short of it.

use std::{
    fmt::Debug,
    fs::{self, File},
    io::{self, Write},
    path::Path,
};

use nix::errno::Errno;

use crate::bus::BusError;

/// How much memory somebody who joins touches in the next moments, at most.
const MEMORY: usize = 16 << 20;
/// How many descriptors a process may need for a session that is full.
const DESCRIPTORS: usize = 128;

/// Whether there is enough of everything. Memory that is not there is noticed only when it is touched,
/// by a signal that ends the process; so we try before. Only inside.
pub fn check(root: &Path) -> Result<(), BusError> {
    let descriptors: io::Result<Vec<File>> =
        (0..DESCRIPTORS).map(|_| File::open("/dev/null")).collect();
    drop(descriptors.map_err(|error| self::io(root, &error))?);
    try_memory(&root.join("trial")).map_err(|error| self::io(root, &error))
}

fn try_memory(path: &Path) -> io::Result<()> {
    let mut trial = File::create(path)?;
    // It has no name any more when it grows, so nothing stays of it if we are killed.
    fs::remove_file(path)?;
    let chunk = [0; 1 << 16];
    for _ in 0..MEMORY / chunk.len() {
        trial.write_all(&chunk)?;
    }
    Ok(())
}

/// The sentence for an error of the system's at the domain's directory.
pub fn io(root: &Path, error: &io::Error) -> BusError {
    BusError::Transport(match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ENOSPC | Errno::ENOMEM | Errno::EDQUOT) => format!(
            "shared memory is full: /dev/shm has not {} MB left, which a process needs to join; remove what \
             is in it, or make it larger (mount -o remount,size=…; in a container --shm-size)",
            MEMORY >> 20
        ),
        Some(Errno::EMFILE | Errno::ENFILE) => format!(
            "there are no file descriptors left: shared memory needs up to {DESCRIPTORS} more in this \
             process; allow it more with 'ulimit -n'"
        ),
        _ => format!("shared memory, {}: {error}", root.display()),
    })
}

/// What went wrong, said as well as can be.
pub fn explain(root: &Path, what: &str, error: &dyn Debug) -> BusError {
    match check(root) {
        Err(scarce) => scarce,
        Ok(()) => BusError::Transport(format!("shared memory, {what}: {error:?}")),
    }
}

/// The sentence for what should not happen.
pub fn failure<E: Debug>(what: &str) -> impl FnOnce(E) -> BusError {
    move |error| BusError::Transport(format!("shared memory, {what}: {error:?}"))
}
