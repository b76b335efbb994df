//! The members of a session: one file each, locked for as long as its process lives.
//!
//! iceoryx2 knows living processes too, but to ask it takes longer than a plant has between two
//! samples.

use std::{
    any::Any,
    collections::BTreeSet,
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, ErrorKind},
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{self, RecvTimeoutError, Sender},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use super::{domain::Domain, error::SharedMemoryError};
use crate::{
    bus::{Attendance, BusError, Sessions},
    member::Member,
};

/// How often to look whether the file of a member is still there.
const LOOK: Duration = Duration::from_millis(250);

/// The directory of the files.
const MEMBERS: &str = "members";

/// The files of members, of one session or of all.
pub(super) struct Members {
    domain: Arc<Domain>,
    directory: PathBuf,
    /// What the names of their files begin with.
    prefix: String,
}

impl Members {
    /// The members of one session.
    pub(super) fn of(domain: &Arc<Domain>, session: &str) -> Result<Self, SharedMemoryError> {
        Self::with_prefix(domain, format!("{session}."))
    }

    /// The members of every session.
    pub(super) fn of_all(domain: &Arc<Domain>) -> Result<Self, SharedMemoryError> {
        Self::with_prefix(domain, String::new())
    }

    fn with_prefix(domain: &Arc<Domain>, prefix: String) -> Result<Self, SharedMemoryError> {
        let directory = domain.directory(MEMBERS)?;
        Ok(Self { domain: Arc::clone(domain), directory, prefix })
    }

    /// What follows the prefix in the file names of living members.
    fn living(&self) -> Result<Vec<String>, SharedMemoryError> {
        let mut names = Vec::new();
        let entries = fs::read_dir(&self.directory);
        for entry in entries.map_err(SharedMemoryError::io(&self.directory))?.flatten() {
            let name = entry.file_name();
            let Some(rest) = name.to_str().and_then(|name| name.strip_prefix(&self.prefix)) else {
                continue;
            };
            if File::open(entry.path()).is_ok_and(|file| is_locked(&file)) {
                names.push(rest.to_owned());
            }
        }
        Ok(names)
    }

    /// The file of a member.
    fn path(&self, member: &Member) -> PathBuf {
        self.directory.join(format!("{}{}", self.prefix, member.to_string().replace('/', ".")))
    }

    /// Announces a member; requires the domain's lock.
    pub(super) fn announce(&self, member: &Member) -> Result<Box<dyn Any>, SharedMemoryError> {
        let io = SharedMemoryError::io(&self.directory);
        let path = self.path(member);
        let file = locked_file(&path).map_err(io)?;
        Ok(Box::new(Announcement::keep(path, file, Arc::clone(&self.domain))))
    }
}

/// Creates a file that is locked for as long as it is open.
fn locked_file(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(path)?;
    file.lock()?;
    Ok(file)
}

/// Whether the process that created a file lives: the kernel unlocks the file when the process
/// dies.
fn is_locked(file: &File) -> bool {
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

impl Attendance for Members {
    fn present(&mut self) -> Result<Vec<Member>, BusError> {
        let living = self.living()?;
        Ok(living.iter().filter_map(|name| name.replace('.', "/").parse().ok()).collect())
    }

    fn is_present(&mut self, member: &Member) -> Result<bool, BusError> {
        match File::open(self.path(member)) {
            Ok(file) => Ok(is_locked(&file)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(!self.directory.exists()),
            // If that cannot be found out, because no descriptor is left or somebody removed the
            // directory, the lease decides.
            Err(_) => Ok(true),
        }
    }
}

impl Sessions for Members {
    fn names(&mut self) -> Result<BTreeSet<String>, BusError> {
        let living = self.living()?;
        let session = |name: &String| Some(name.split_once('.')?.0.to_owned());
        Ok(living.iter().filter_map(session).collect())
    }
}

/// The file of a member.
///
/// A thread puts it back if somebody removes it, as a log-out does with all shared memory of a user:
/// the roles go on with what they have mapped, and no second plant may come to their session.
struct Announcement {
    path: PathBuf,
    /// Locked.
    _file: Arc<Mutex<File>>,
    keeper: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Announcement {
    fn keep(path: PathBuf, file: File, domain: Arc<Domain>) -> Self {
        let file = Arc::new(Mutex::new(file));
        let (until_dropped, dropped) = mpsc::channel();
        let (kept_path, kept_file) = (path.clone(), Arc::clone(&file));
        let keep = move || {
            let mut is_told = false;
            while dropped.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if !kept_path.exists() {
                    put_back(&domain, &kept_path, &kept_file, &mut is_told);
                }
            }
        };
        let thread = thread::Builder::new().name("announcement".to_owned()).spawn(keep);
        Self { path, _file: file, keeper: thread.ok().map(|thread| (until_dropped, thread)) }
    }
}

/// Creates the file of a member once more; if that fails, the next look tries again.
fn put_back(domain: &Domain, path: &Path, kept: &Mutex<File>, is_told: &mut bool) {
    if !std::mem::replace(is_told, true) {
        tracing::warn!(
            "somebody removed {}, as a log-out does with a user's shared memory: the loop goes on, \
             but nobody can join it any more; start the session anew when it suits you",
            domain.root().display()
        );
    }
    if domain.claim().is_err() || domain.directory(MEMBERS).is_err() {
        return;
    }
    if let Ok(file) = locked_file(path) {
        *kept.lock().unwrap_or_else(PoisonError::into_inner) = file;
    }
}

impl Drop for Announcement {
    fn drop(&mut self) {
        if let Some((until_dropped, thread)) = self.keeper.take() {
            drop(until_dropped);
            // It cannot panic, and ends at once.
            let _ = thread.join();
        }
        // An unlocked file counts for nothing, even if it cannot be removed.
        let _ = fs::remove_file(&self.path);
    }
}
