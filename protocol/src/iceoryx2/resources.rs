//! What shared memory needs of a machine.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::Path,
};

/// How much memory a process that joins touches at first, at most, bytes.
pub(super) const MEMORY: usize = 16 << 20;
/// The longest scenario, bytes.
pub(super) const MAX_OFFER: usize = 65536;
/// How many descriptors a process may need for a session that is full.
pub(super) const DESCRIPTORS: usize = 128;

/// Checks that there are enough descriptors and memory; requires the domain's lock.
///
/// A lack of memory shows only when the memory is touched, by a signal that ends the process.
pub(super) fn check(root: &Path) -> io::Result<()> {
    let descriptors: io::Result<Vec<File>> =
        (0..DESCRIPTORS).map(|_| File::open("/dev/null")).collect();
    drop(descriptors?);
    try_memory(&root.join("trial"))
}

fn try_memory(path: &Path) -> io::Result<()> {
    let mut trial = File::create(path)?;
    // The file has lost its name when it grows, so nothing stays of it if the process is killed.
    fs::remove_file(path)?;
    let chunk = [0; 1 << 16];
    for _ in 0..MEMORY / chunk.len() {
        trial.write_all(&chunk)?;
    }
    Ok(())
}
