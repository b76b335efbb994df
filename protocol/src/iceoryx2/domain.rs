//! A user's domain of shared memory, and the lock that guards it.
//!
//! What a user's processes share lies below `/dev/shm/mtj_<uid>`, which no other user may enter, or
//! in segments beside it whose names begin with `mtj_<uid>_`. iceoryx2 cleans up after crashed
//! processes, but not after all of them: not after one that crashed while it was creating or
//! removing something. So all creation and removal happens under one file lock, which the kernel
//! releases if the holder dies. The process that holds it knows that anything incomplete was left
//! by a crashed process, and removes it.

use std::{
    fs::{self, DirBuilder, DirEntry, File, OpenOptions, Permissions, TryLockError},
    io,
    ops::{Deref, DerefMut},
    os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt, PermissionsExt},
    path::{Path, PathBuf},
    process,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use iceoryx2::prelude::{
    Config, FileName, Node, NodeBuilder, SemanticString as _, SignalHandlingMode, ipc,
};
use nix::fcntl::{FallocateFlags, fallocate};

use super::{
    error::{AttemptError, SharedMemoryError, failure},
    resources,
};
use crate::bus::BusError;

/// Where segments of shared memory are files.
pub(super) const SEGMENTS: &str = "/dev/shm";
/// How long to wait for the lock. No process holds it for more than some milliseconds.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often to try the lock.
const RETRY: Duration = Duration::from_millis(1);
/// How long the kernel may take to end a process that was killed.
const DYING: Duration = Duration::from_secs(1);

/// A user's part of shared memory.
pub(super) struct Domain {
    pub(super) config: Box<Config>,
    pub(super) root: PathBuf,
    /// What the names of our segments and files begin with.
    pub(super) prefix: String,
    user: u32,
    lock: DomainLock,
}

/// The file lock under which everything in the domain is created and removed.
///
/// Other versions of mtj, and other programs, lock the same file (`docs/wire.md`): it is called
/// `door`.
struct DomainLock {
    file: File,
    path: PathBuf,
}

impl DomainLock {
    fn open(root: &Path) -> Result<Self, SharedMemoryError> {
        let path = root.join("door");
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(&path)
            .map_err(SharedMemoryError::io(root))?;
        Ok(Self { file, path })
    }

    /// Waits for the lock.
    fn lock(&self) -> Result<(), SharedMemoryError> {
        let end = Instant::now() + PATIENCE;
        loop {
            match self.file.try_lock() {
                Ok(()) => {
                    // For the message below; nothing depends on it.
                    let name = format!("{:<10}", process::id());
                    let _ = self.file.write_all_at(name.as_bytes(), 0);
                    return Ok(());
                }
                Err(TryLockError::WouldBlock) if Instant::now() < end => thread::sleep(RETRY),
                Err(TryLockError::WouldBlock) => {
                    let holder = fs::read_to_string(&self.path).unwrap_or_default();
                    return Err(SharedMemoryError::Locked {
                        holder: holder.trim_end().to_owned(),
                        file: self.path.clone(),
                        patience: PATIENCE,
                    });
                }
                Err(TryLockError::Error(error)) => {
                    return Err(SharedMemoryError::io(&self.path)(error));
                }
            }
        }
    }

    fn unlock(&self) {
        // If this fails, the kernel releases the lock when the process ends.
        let _ = self.file.unlock();
    }
}

/// Holds the domain's lock: no other process creates or removes anything.
pub(super) struct LockGuard<'a>(&'a DomainLock);

impl Drop for LockGuard<'_> {
    fn drop(&mut self) {
        self.0.unlock();
    }
}

impl Domain {
    /// Opens the domain of this process' user.
    pub(super) fn open() -> Result<Arc<Self>, BusError> {
        let proc = Path::new("/proc/self");
        let user = fs::metadata(proc).map_err(SharedMemoryError::io(proc))?.uid();
        let name = format!("mtj_{user}");
        let root = Path::new(SEGMENTS).join(&name);
        claim(&root, user)?;
        let lock = DomainLock::open(&root)?;
        let prefix = name + "_";
        // Not from a configuration file for iceoryx2: all processes must agree on the domain.
        let mut config = Config::default();
        let path = iceoryx2::prelude::Path::new(root.as_os_str().as_encoded_bytes());
        config.global.set_root_path(&path.map_err(failure("the domain's directory"))?);
        config.global.prefix =
            FileName::new(prefix.as_bytes()).map_err(failure("the domain's name"))?;
        // We do that ourselves, under the lock.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Arc::new(Self { config: Box::new(config), root, prefix, user, lock }))
    }

    /// Creates the domain's directory again, if it is gone.
    pub(super) fn claim(&self) -> Result<(), SharedMemoryError> {
        claim(&self.root, self.user)
    }

    /// The other users with sessions on this machine, by their numbers.
    pub(super) fn other_users(&self) -> Vec<u32> {
        let user = |name: &str| name.strip_prefix("mtj_")?.parse().ok();
        let users = entries(Path::new(SEGMENTS)).filter_map(|(name, _)| user(&name));
        users.filter(|user| *user != self.user).collect()
    }

    /// A directory for files that iceoryx2 does not manage.
    pub(super) fn directory(&self, name: &str) -> Result<PathBuf, SharedMemoryError> {
        let directory = self.root.join(name);
        fs::create_dir_all(&directory).map_err(SharedMemoryError::io(&self.root))?;
        Ok(directory)
    }

    /// Waits for the lock. Deadlocks until the patience is over if the caller holds it.
    pub(super) fn lock(&self) -> Result<LockGuard<'_>, SharedMemoryError> {
        self.lock.lock()?;
        Ok(LockGuard(&self.lock))
    }

    /// Creates this process' node, after the cleanup of what crashed processes left.
    pub(super) fn join(self: &Arc<Self>) -> Result<Locked<Node<ipc::Service>>, SharedMemoryError> {
        let guard = self.lock()?;
        self.clean_up(&guard);
        resources::check(&self.root).map_err(SharedMemoryError::io(&self.root))?;
        let node = NodeBuilder::new()
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create()
            .map_err(|error| SharedMemoryError::diagnose(&self.root, "a node", error))?;
        self.close_to_others();
        drop(guard);
        Ok(self.locked(node))
    }

    /// Creates something under the lock. If the attempt fails because of a process that has just
    /// crashed or is ending, it is repeated after a cleanup.
    pub(super) fn create<T>(
        self: &Arc<Self>,
        mut attempt: impl FnMut() -> Result<T, AttemptError>,
    ) -> Result<Locked<T>, SharedMemoryError> {
        let end = Instant::now() + DYING;
        loop {
            let guard = self.lock()?;
            match attempt() {
                Ok(created) => return Ok(self.locked(created)),
                Err(AttemptError::Permanent(error)) => return Err(error),
                Err(AttemptError::Transient(error)) if Instant::now() >= end => return Err(error),
                Err(AttemptError::Transient(_)) => self.clean_up(&guard),
            }
            drop(guard);
            thread::sleep(10 * RETRY);
        }
    }

    /// Replaces something by a new one, which may fail; returns false, and does nothing, if another
    /// process holds the lock. For callers that have no time to wait.
    pub(super) fn try_replace<T>(
        self: &Arc<Self>,
        thing: &mut Option<Locked<T>>,
        attempt: impl FnOnce() -> Option<T>,
    ) -> bool {
        if self.lock.file.try_lock().is_err() {
            return false;
        }
        let created = attempt();
        // The old one locks the file once more, which succeeds at once, and unlocks it when it is
        // removed.
        *thing = None;
        self.lock.unlock();
        *thing = created.map(|created| self.locked(created));
        true
    }

    fn locked<T>(self: &Arc<Self>, thing: T) -> Locked<T> {
        Locked {
            _lock: LockOnDrop(Arc::clone(self)),
            thing,
            _unlock: UnlockOnDrop(Arc::clone(self)),
        }
    }

    /// The directory of everything but the segments.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// Allocates as much of a publisher's segment as this part of its readers can hold back, so that
    /// the publisher does not run out of memory later, when it could only be ended for it.
    pub(super) fn reserve(&self, publisher: u128, readers: Part) -> io::Result<()> {
        let end = format!("_{publisher}.data");
        let is_ours = |name: &str| name.starts_with(&self.prefix) && name.ends_with(&end);
        for (_, entry) in entries(Path::new(SEGMENTS)).filter(|(name, _)| is_ours(name)) {
            let segment = OpenOptions::new().read(true).write(true).open(entry.path())?;
            let length = segment.metadata()?.len() * readers.count as u64 / readers.most as u64;
            fallocate(&segment, FallocateFlags::empty(), 0, length as i64)?;
        }
        Ok(())
    }

    /// Closes the counter of nodes to other users; iceoryx2 lets all of them read and write it.
    fn close_to_others(&self) {
        for (name, entry) in entries(Path::new(SEGMENTS)) {
            if name.starts_with(&self.prefix) && name.ends_with(".global_mgmt") {
                // The cleanup of another process may have removed it.
                let _ = fs::set_permissions(entry.path(), Permissions::from_mode(0o600));
            }
        }
    }
}

/// A part of the readers that a topic may have.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) count: usize,
    pub(super) most: usize,
}

/// Cleans up when it is dropped: the last thing that a process does that leaves.
pub(super) struct CleanupOnDrop(pub(super) Arc<Domain>);

impl Drop for CleanupOnDrop {
    fn drop(&mut self) {
        if let Ok(guard) = self.0.lock() {
            self.0.clean_up(&guard);
        }
    }
}

/// Something in the domain that is removed under the lock, wherever and whenever it is dropped.
pub(super) struct Locked<T> {
    // Fields are dropped in this order.
    _lock: LockOnDrop,
    thing: T,
    _unlock: UnlockOnDrop,
}

impl<T> Deref for Locked<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.thing
    }
}

impl<T> DerefMut for Locked<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.thing
    }
}

struct LockOnDrop(Arc<Domain>);

impl Drop for LockOnDrop {
    fn drop(&mut self) {
        // If the lock cannot be had, the thing is removed all the same.
        let _ = self.0.lock.lock();
    }
}

struct UnlockOnDrop(Arc<Domain>);

impl Drop for UnlockOnDrop {
    fn drop(&mut self) {
        self.0.lock.unlock();
    }
}

/// The entries of a directory; none, if it cannot be read.
pub(super) fn entries(directory: &Path) -> impl Iterator<Item = (String, DirEntry)> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries.filter_map(|entry| Some((entry.file_name().into_string().ok()?, entry)))
}

/// Creates a directory that only this user may enter, or checks that it is one.
fn claim(directory: &Path, user: u32) -> Result<(), SharedMemoryError> {
    let io = SharedMemoryError::io(directory);
    match DirBuilder::new().mode(0o700).create(directory) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(io(error)),
        _ => {}
    }
    let found = fs::symlink_metadata(directory).map_err(io)?;
    if !found.is_dir() || found.uid() != user {
        return Err(SharedMemoryError::ForeignDirectory(directory.to_owned()));
    }
    if found.mode() & 0o077 != 0 {
        fs::set_permissions(directory, Permissions::from_mode(0o700)).map_err(io)?;
    }
    Ok(())
}
