//! Our domain of shared memory: who lives in it, and how it is kept clean.
//!
//! What a user's processes share lies below `/dev/shm/mtj_<uid>`, which nobody else may enter, or in
//! segments beside it whose names begin with `mtj_<uid>_`. iceoryx2 clears away after the dead, but not
//! after all of them: not after one that died while it was making or clearing away something. So
//! everything in the domain is made and taken down behind its *door*, a file lock that the kernel opens
//! if the holder dies. The process inside knows that what is half done there was left by crashed processes.

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

use super::{error::Refusal, resources};
use crate::bus::BusError;

/// Where segments of shared memory are files.
pub const SEGMENTS: &str = "/dev/shm";
/// How long to wait at the door. Nobody stays inside for more than some milliseconds.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often to try the lock.
const RETRY: Duration = Duration::from_millis(1);
/// How long somebody who was killed may take to be gone.
const DYING: Duration = Duration::from_secs(1);

/// A user's part of shared memory.
pub struct Domain {
    pub(super) config: Box<Config>,
    pub(super) root: PathBuf,
    /// What the names of our segments and files begin with.
    pub(super) prefix: String,
    door: File,
}

/// Somebody is inside: nobody else makes, takes down or clears away anything.
pub struct Inside<'a>(&'a Domain);

impl Drop for Inside<'_> {
    fn drop(&mut self) {
        // If this fails, the door opens when the process ends.
        let _ = self.0.door.unlock();
    }
}

impl Domain {
    /// The domain of this process' user.
    pub fn open() -> Result<Arc<Self>, BusError> {
        let user = fs::metadata("/proc/self").map_err(resources::failure("/proc"))?.uid();
        let name = format!("mtj_{user}");
        let root = Path::new(SEGMENTS).join(&name);
        claim(&root, user)?;
        let door = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(root.join("door"))
            .map_err(|error| resources::io(&root, &error))?;
        let prefix = name + "_";
        // Nothing of a configuration file for iceoryx2: the domain must be the same for everybody.
        let mut config = Config::default();
        let path = iceoryx2::prelude::Path::new(root.as_os_str().as_encoded_bytes());
        config.global.set_root_path(&path.map_err(resources::failure("the domain's directory"))?);
        config.global.prefix =
            FileName::new(prefix.as_bytes()).map_err(resources::failure("the domain's name"))?;
        // We do that ourselves, at the door.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Arc::new(Self { config: Box::new(config), root, prefix, door }))
    }

    /// A place for things that are known by their names, not by iceoryx2.
    pub fn directory(&self, name: &str) -> Result<PathBuf, BusError> {
        let directory = self.root.join(name);
        fs::create_dir_all(&directory).map_err(|error| resources::io(&self.root, &error))?;
        Ok(directory)
    }

    /// Waits until nobody else is inside. Not to be called by somebody who is.
    pub fn enter(&self) -> Result<Inside<'_>, BusError> {
        let end = Instant::now() + PATIENCE;
        loop {
            match self.door.try_lock() {
                Ok(()) => {
                    // For the sentence below; nothing depends on it.
                    let name = format!("{:<10}", process::id());
                    let _ = self.door.write_all_at(name.as_bytes(), 0);
                    return Ok(Inside(self));
                }
                Err(TryLockError::WouldBlock) if Instant::now() < end => thread::sleep(RETRY),
                Err(TryLockError::WouldBlock) => {
                    let holder = fs::read_to_string(self.root.join("door")).unwrap_or_default();
                    return Err(BusError::Transport(format!(
                        "shared memory: process {} has held {} for {} s while it starts or ends; if it is \
                         stopped, let it go on or kill it",
                        holder.trim_end(),
                        self.root.join("door").display(),
                        PATIENCE.as_secs()
                    )));
                }
                Err(TryLockError::Error(error)) => return Err(resources::io(&self.root, &error)),
            }
        }
    }

    /// Moves in, after clearing away what the dead left behind.
    pub fn settle(self: &Arc<Self>) -> Result<Indoors<Node<ipc::Service>>, BusError> {
        let inside = self.enter()?;
        self.sweep(&inside);
        resources::check(&self.root)?;
        let node = NodeBuilder::new()
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create()
            .map_err(|error| resources::explain(&self.root, "a node", &error))?;
        self.close_to_others();
        drop(inside);
        Ok(self.keep(node))
    }

    /// Makes something inside. Where that fails because of somebody who has just died, or was dying when
    /// we looked, it is tried again after clearing away what that process left.
    pub fn make<T>(
        self: &Arc<Self>,
        mut attempt: impl FnMut() -> Result<T, Refusal>,
    ) -> Result<Indoors<T>, BusError> {
        let end = Instant::now() + DYING;
        loop {
            let inside = self.enter()?;
            match attempt() {
                Ok(made) => return Ok(self.keep(made)),
                Err(Refusal::Final(error)) => return Err(error),
                Err(Refusal::Perhaps(error)) if Instant::now() >= end => return Err(error),
                Err(Refusal::Perhaps(_)) => self.sweep(&inside),
            }
            drop(inside);
            thread::sleep(10 * RETRY);
        }
    }

    /// Takes something down and makes something else in its place, which may fail, unless somebody is inside just
    /// now; returns whether it was done. For those who have no time to wait.
    pub fn replace<T>(
        self: &Arc<Self>,
        thing: &mut Option<Indoors<T>>,
        attempt: impl FnOnce() -> Option<T>,
    ) -> bool {
        if self.door.try_lock().is_err() {
            return false;
        }
        let made = attempt();
        // Who is inside already enters at once, and leaves when that is taken down.
        *thing = None;
        drop(Inside(self));
        *thing = made.map(|made| self.keep(made));
        true
    }

    fn keep<T>(self: &Arc<Self>, thing: T) -> Indoors<T> {
        Indoors { _shut: Shut(Arc::clone(self)), thing, _open: Open(Arc::clone(self)) }
    }

    /// Where everything is but the segments themselves.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Allocates the part of a publisher's segment that it uses first, a `share` of the whole, so that it
    /// will not find out in the middle of the loop that there is no memory. We alone write to it.
    pub fn reserve(&self, publisher: u128, share: usize) -> io::Result<()> {
        let end = format!("_{publisher}.data");
        let is_ours = |name: &str| name.starts_with(&self.prefix) && name.ends_with(&end);
        for (_, entry) in entries(Path::new(SEGMENTS)).filter(|(name, _)| is_ours(name)) {
            let segment = OpenOptions::new().read(true).write(true).open(entry.path())?;
            let length = segment.metadata()?.len() / share as u64;
            let mut page = [0; 4096];
            for offset in (0..length).step_by(page.len()) {
                let read = segment.read_at(&mut page, offset)?;
                segment.write_all_at(&page[..read], offset)?;
            }
        }
        Ok(())
    }

    /// iceoryx2 lets everybody read and write the counter of nodes.
    fn close_to_others(&self) {
        for (name, entry) in entries(Path::new(SEGMENTS)) {
            if name.starts_with(&self.prefix) && name.ends_with(".global_mgmt") {
                // It may be gone already, if another process has swept.
                let _ = fs::set_permissions(entry.path(), Permissions::from_mode(0o600));
            }
        }
    }
}

/// Sweeps when it is dropped: the last thing that somebody does who leaves.
pub struct Cleanup(pub Arc<Domain>);

impl Drop for Cleanup {
    fn drop(&mut self) {
        if let Ok(inside) = self.0.enter() {
            self.0.sweep(&inside);
        }
    }
}

/// Something in the domain that is taken down behind the door, wherever and whenever it is dropped.
pub struct Indoors<T> {
    // Fields are dropped in this order.
    _shut: Shut,
    thing: T,
    _open: Open,
}

impl<T> Deref for Indoors<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.thing
    }
}

impl<T> DerefMut for Indoors<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.thing
    }
}

struct Shut(Arc<Domain>);

impl Drop for Shut {
    fn drop(&mut self) {
        // If nobody answers the door, it is taken down all the same.
        if let Ok(inside) = self.0.enter() {
            std::mem::forget(inside);
        }
    }
}

struct Open(Arc<Domain>);

impl Drop for Open {
    fn drop(&mut self) {
        drop(Inside(&self.0));
    }
}

/// What is in a directory; nothing, if it cannot be read.
pub fn entries(directory: &Path) -> impl Iterator<Item = (String, DirEntry)> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries.filter_map(|entry| Some((entry.file_name().into_string().ok()?, entry)))
}

/// Makes a directory that is ours alone, or makes sure that it is.
fn claim(directory: &Path, user: u32) -> Result<(), BusError> {
    match DirBuilder::new().mode(0o700).create(directory) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            return Err(resources::io(directory, &error));
        }
        _ => {}
    }
    let refuse = |error: io::Error| resources::io(directory, &error);
    let found = fs::symlink_metadata(directory).map_err(refuse)?;
    if !found.is_dir() || found.uid() != user {
        return Err(BusError::Settings(format!(
            "{} is not a directory of this user; have it removed, it is where mtj keeps what its processes \
             share",
            directory.display()
        )));
    }
    if found.mode() & 0o077 != 0 {
        fs::set_permissions(directory, Permissions::from_mode(0o700)).map_err(refuse)?;
    }
    Ok(())
}
