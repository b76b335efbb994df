//! Instructions, counted by valgrind's callgrind.
//!
//! A program starts itself once more under callgrind, which counts only inside `collected` and
//! writes what it counted whenever that function returns: a file a case, in the order of the cases.
//! So one run serves all cases, and nothing of the start or of a case's preparation is in a count.
//! The counts are the same in every run on one machine; another processor may take another path
//! through sine and exponential.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
    process::{self, Command, Stdio},
    sync::atomic::{AtomicU32, Ordering},
};

use crate::{case::Case, meter::Meter};

/// Steps that are counted for each case: twice over all states of a loop.
const STEPS: u32 = 128;

/// Instructions of one step of each case. `program` is started under callgrind with `arguments` and
/// must then call [`run`] with the same cases.
pub fn count(program: &Path, arguments: &[&str], cases: &[Case]) -> io::Result<Vec<f64>> {
    let folder = Folder::new()?;
    let out = folder.0.join("out");
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet"])
        // Two patterns for one function: of two options with the same pattern callgrind keeps one.
        .args(["--toggle-collect=*callgrind::collected*", "--dump-after=*::collected*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(program)
        .args(arguments)
        .stdin(Stdio::null())
        .status()
        .map_err(|error| io::Error::new(error.kind(), format!("valgrind: {error}")))?;
    if !status.success() {
        return Err(io::Error::other(format!("{} under valgrind: {status}", program.display())));
    }
    let count = |i: usize| {
        let text = fs::read_to_string(folder.0.join(format!("out.{}", i + 1)))?;
        let total =
            text.lines().find_map(|line| line.strip_prefix("totals: ")?.parse::<u64>().ok());
        let total = total.ok_or_else(|| io::Error::other("callgrind wrote no totals"))?;
        Ok(total as f64 / f64::from(STEPS))
    };
    (0..cases.len()).map(count).collect()
}

/// What the program does under callgrind.
pub fn run(cases: &[Case]) {
    for case in cases {
        case.measure(&mut Repeat);
    }
}

struct Repeat;

impl Meter for Repeat {
    fn measure(&mut self, mut step: impl FnMut()) {
        // Whatever is done only once, the dynamic linker's work for example.
        step();
        collected(step);
    }
}

/// What callgrind counts.
#[inline(never)]
fn collected(mut step: impl FnMut()) {
    for _ in 0..STEPS {
        step();
    }
}

/// A folder that is gone when it is no longer needed.
struct Folder(PathBuf);

impl Folder {
    fn new() -> io::Result<Self> {
        static MADE: AtomicU32 = AtomicU32::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let path = env::temp_dir().join(format!("mtj-callgrind-{}-{number}", process::id()));
        fs::create_dir_all(&path)?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}
