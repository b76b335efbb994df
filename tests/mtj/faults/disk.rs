//! A shared memory of one test's own, on a disk that becomes full.

use std::{
    fs::{self, File},
    io::Write,
    path::{Path, PathBuf},
    process::Command,
};

use nix::sched::{CloneFlags, unshare};

use crate::needs;

const SHARED_MEMORY: &str = "/dev/shm";

/// The directory of shared memory. For root it is one of this thread's own, and of what it starts;
/// for others nothing is removed and nothing fills it.
#[derive(Clone, Debug)]
pub struct Disk {
    is_own: bool,
}

impl Disk {
    /// Mounts it.
    pub fn mount() -> Self {
        let is_own = needs::is_root() && unshare(CloneFlags::CLONE_NEWNS).is_ok();
        if is_own {
            run("mount", &["--make-rprivate", "/"]);
            let options = ["-t", "tmpfs", "-o", "size=128m,mode=1777", "tmpfs", SHARED_MEMORY];
            run("mount", &options);
        }
        Self { is_own }
    }

    /// Where it is.
    pub fn path(&self) -> &'static Path {
        Path::new(SHARED_MEMORY)
    }

    /// Fills it to the last byte.
    pub fn fill(&self) {
        if self.is_own {
            let mut file = File::create(self.filling()).unwrap();
            for size in [1 << 16, 1 << 12, 1] {
                while file.write_all(&vec![0; size]).is_ok() {}
            }
        }
    }

    /// Makes room again.
    pub fn make_room(&self) {
        let _ = fs::remove_file(self.filling());
    }

    /// Takes the directories of all sessions away.
    pub fn hide(&self) {
        for path in self.directories() {
            fs::rename(&path, hidden(&path)).unwrap();
        }
    }

    /// Puts them back, in place of those that were made meanwhile.
    pub fn show(&self) {
        if !self.is_own {
            return;
        }
        for entry in fs::read_dir(SHARED_MEMORY).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if let Some(name) = name.strip_prefix(HIDDEN) {
                let back = self.path().join(name);
                let _ = fs::remove_dir_all(&back);
                fs::rename(path, back).unwrap();
            }
        }
    }

    /// Removes the directories of all sessions.
    pub fn remove(&self) {
        for path in self.directories() {
            let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        }
    }

    fn directories(&self) -> Vec<PathBuf> {
        if !self.is_own {
            return Vec::new();
        }
        let entries = fs::read_dir(SHARED_MEMORY).unwrap().flatten().map(|entry| entry.path());
        entries
            .filter(|path| path.file_name().unwrap().to_string_lossy().starts_with("mtj_"))
            .collect()
    }

    fn filling(&self) -> PathBuf {
        self.path().join("filling")
    }
}

const HIDDEN: &str = "hidden-";

fn hidden(path: &Path) -> PathBuf {
    path.with_file_name(format!("{HIDDEN}{}", path.file_name().unwrap().to_string_lossy()))
}

fn run(program: &str, arguments: &[&str]) {
    assert!(Command::new(program).args(arguments).status().unwrap().success(), "{arguments:?}");
}
