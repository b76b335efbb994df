//! Our domain of shared memory: who lives in it, and how it is kept clean.
//!
//! What a user's processes share lies below `/dev/shm/mtj_<uid>`, which nobody else may enter, or in
//! segments beside it whose names begin with `mtj_<uid>_`. iceoryx2 clears away after the dead, but not
//! after all of them: not after one that died while it was making or clearing away something. So
//! everything in the domain is made and taken down behind its *door*, a file lock that the kernel opens
//! if the holder dies. Whoever is inside knows that what is half done there was left by the dead.

use std::{
    collections::HashSet,
    fs::{self, DirBuilder, DirEntry, File, OpenOptions, Permissions, TryLockError},
    io,
    ops::Deref,
    os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt, PermissionsExt},
    path::{Path, PathBuf},
    process,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use iceoryx2::{
    node::{DeadNodeView, NodeCleanupFailure, NodeView},
    prelude::{
        CallbackProgression, Config, FileName, Node, NodeBuilder, NodeState, SemanticString as _,
        Service as _, SignalHandlingMode, ipc,
    },
};

use super::{refusal::Refusal, scarcity};
use crate::bus::BusError;

/// Where segments of shared memory are files.
const SEGMENTS: &str = "/dev/shm";
/// How long to wait at the door. Nobody stays inside for more than some milliseconds.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often to knock.
const KNOCK: Duration = Duration::from_millis(1);
/// How long somebody who was killed may take to be gone.
const DYING: Duration = Duration::from_secs(1);

/// A user's part of shared memory.
pub struct Domain {
    config: Box<Config>,
    root: PathBuf,
    /// What the names of our segments and files begin with.
    prefix: String,
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
        let user = fs::metadata("/proc/self").map_err(scarcity::failure("/proc"))?.uid();
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
            .map_err(|error| scarcity::io(&root, &error))?;
        let prefix = name + "_";
        // Nothing of a configuration file for iceoryx2: the domain must be the same for everybody.
        let mut config = Config::default();
        let path = iceoryx2::prelude::Path::new(root.as_os_str().as_encoded_bytes());
        config.global.set_root_path(&path.map_err(scarcity::failure("the domain's directory"))?);
        config.global.prefix =
            FileName::new(prefix.as_bytes()).map_err(scarcity::failure("the domain's name"))?;
        // We do that ourselves, at the door.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Arc::new(Self { config: Box::new(config), root, prefix, door }))
    }

    /// A place for things that are known by their names, not by iceoryx2.
    pub fn directory(&self, name: &str) -> Result<PathBuf, BusError> {
        let directory = self.root.join(name);
        fs::create_dir_all(&directory).map_err(|error| scarcity::io(&self.root, &error))?;
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
                Err(TryLockError::WouldBlock) if Instant::now() < end => thread::sleep(KNOCK),
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
                Err(TryLockError::Error(error)) => return Err(scarcity::io(&self.root, &error)),
            }
        }
    }

    /// Moves in, after clearing away what the dead left behind.
    pub fn settle(self: &Arc<Self>) -> Result<Indoors<Node<ipc::Service>>, BusError> {
        let inside = self.enter()?;
        self.sweep(&inside);
        scarcity::check(&self.root)?;
        let node = NodeBuilder::new()
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create()
            .map_err(|error| scarcity::explain(&self.root, "a node", &error))?;
        self.close_to_others();
        drop(inside);
        Ok(self.keep(node))
    }

    /// Makes something inside. Where that fails because of somebody who has just died, or was dying when
    /// we looked, it is tried again after clearing away what he left.
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
            thread::sleep(10 * KNOCK);
        }
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

    /// Clears away what belongs to nobody who lives.
    fn sweep(&self, _inside: &Inside<'_>) {
        // If there are no means to look, whoever comes next will sweep.
        let Some((mut residents, dead)) = self.residents() else { return };
        // Segments first: iceoryx2 waits for ever for one whose maker died before it had a size.
        self.sweep_segments(&residents);
        for node in dead {
            // Without its details iceoryx2 would seek it in another domain.
            let is_whole = node.details().is_some();
            let id = node.id().value();
            match node.try_remove_stale_resources() {
                Ok(()) | Err(NodeCleanupFailure::ResourcesAlreadyCleanedUp) => {}
                // The next one may do better, as long as it can be found.
                Err(_) if is_whole && !residents.processes.is_empty() => {
                    residents.nodes.insert(id);
                }
                Err(_) => {}
            }
        }
        self.sweep_services(&residents);
        for (name, entry) in entries(&self.root.join("nodes")) {
            let name = name.strip_prefix(&self.prefix).unwrap_or(&name);
            if !numbers(name).any(|id| residents.nodes.contains(&id)) {
                remove(&entry.path());
            }
        }
        for (_, entry) in entries(&self.root.join("members")) {
            if File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok()) {
                remove(&entry.path());
            }
        }
    }

    /// Who lives here, and who died. None if that cannot be known.
    fn residents(&self) -> Option<(Residents, Vec<DeadNodeView<ipc::Service>>)> {
        let (mut found, mut dead) = (Residents::default(), Vec::new());
        let listed = Node::<ipc::Service>::list(&self.config, |node| {
            let id = node.node_id().value();
            if let NodeState::Dead(node) = node {
                dead.push(node);
            } else {
                found.nodes.insert(id);
                found.processes.insert(process_of(id));
            }
            CallbackProgression::Continue
        });
        listed.ok().map(|()| (found, dead))
    }

    /// Removes segments and sockets of the dead, and what they did not finish.
    fn sweep_segments(&self, residents: &Residents) {
        for (name, entry) in entries(Path::new(SEGMENTS)).chain(entries(&self.root)) {
            let Some(name) = name.strip_prefix(&self.prefix) else { continue };
            let is_used = if residents.processes.is_empty() {
                false
            } else if name.ends_with(".dynamic") || name.ends_with(".global_mgmt") {
                // A service may outlive its maker. It may be read when it is finished.
                entry.metadata().is_ok_and(|file| file.len() > 0 && file.mode() & 0o400 != 0)
            } else {
                numbers(name).all(|id| residents.processes.contains(&process_of(id)))
            };
            if !is_used {
                remove(&entry.path());
            }
        }
    }

    /// Removes the services that nobody uses, and what is left of any.
    fn sweep_services(&self, residents: &Residents) {
        let services = self.services();
        if residents.processes.is_empty() {
            entries(&self.root.join("services")).for_each(|(_, entry)| remove(&entry.path()));
        } else if let Some(used) = services {
            for (name, entry) in entries(Path::new(SEGMENTS)) {
                let Some(name) = name.strip_prefix(&self.prefix) else { continue };
                if name.ends_with(".dynamic") && !numbers(name).any(|id| used.contains(&id)) {
                    remove(&entry.path());
                }
            }
        }
    }

    /// The numbers of the services that somebody uses, after removing all others. None if there is one
    /// that cannot be read.
    fn services(&self) -> Option<HashSet<u128>> {
        let (mut used, mut hashes, mut unused) = (HashSet::new(), HashSet::new(), HashSet::new());
        let listed = ipc::Service::list(&self.config, |service| {
            let hash = service.static_details.service_hash().as_str().to_owned();
            let nodes = service.dynamic_details.into_iter().flat_map(|details| details.nodes);
            if nodes.into_iter().any(|node| !matches!(node, NodeState::Dead(_))) {
                used.insert(service.static_details.unique_service_id().value());
                hashes.insert(hash);
            } else {
                unused.insert(hash);
            }
            CallbackProgression::Continue
        });
        let mut is_known = listed.is_ok();
        for (name, entry) in entries(&self.root.join("services")) {
            let name = name.strip_prefix(&self.prefix).unwrap_or(&name);
            let hash = name.strip_suffix(".service").unwrap_or(name);
            // It becomes read-only when it is complete.
            let is_complete = entry.metadata().is_ok_and(|file| file.mode() & 0o777 == 0o400);
            if unused.contains(hash) || !is_complete {
                remove(&entry.path());
            } else if !hashes.contains(hash) {
                is_known = false;
            }
        }
        is_known.then_some(used)
    }
}

/// Sweeps when it is dropped: the last thing that somebody does who leaves.
pub struct Broom(pub Arc<Domain>);

impl Drop for Broom {
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

#[derive(Default)]
struct Residents {
    nodes: HashSet<u128>,
    processes: HashSet<u32>,
}

/// The process that gave something its number.
fn process_of(id: u128) -> u32 {
    (id >> 64) as u32
}

/// The numbers in a name.
fn numbers(name: &str) -> impl Iterator<Item = u128> {
    name.split(['_', '.']).filter_map(|part| part.parse().ok())
}

/// What is in a directory; nothing, if it cannot be read.
fn entries(directory: &Path) -> impl Iterator<Item = (String, DirEntry)> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries.filter_map(|entry| Some((entry.file_name().into_string().ok()?, entry)))
}

/// Removes a file or a directory. It may have gone already; if it cannot be removed, the next may try.
fn remove(path: &Path) {
    let _ = match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() => fs::remove_dir_all(path),
        _ => fs::remove_file(path),
    };
}

/// Makes a directory that is ours alone, or makes sure that it is.
fn claim(directory: &Path, user: u32) -> Result<(), BusError> {
    match DirBuilder::new().mode(0o700).create(directory) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
            return Err(scarcity::io(directory, &error));
        }
        _ => {}
    }
    let refuse = |error: io::Error| scarcity::io(directory, &error);
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
