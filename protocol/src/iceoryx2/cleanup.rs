//! The cleanup of the domain: every process that joins or leaves removes what crashed processes
//! left.

use std::{
    collections::HashSet,
    fs::{self, File},
    os::unix::fs::MetadataExt,
    path::Path,
};

use iceoryx2::{
    node::{DeadNodeView, NodeCleanupFailure, NodeView},
    prelude::{CallbackProgression, Node, NodeState, Service as _, ipc},
};

use super::domain::{Domain, LockGuard, SEGMENTS, entries};

impl Domain {
    /// Removes everything that belongs to no living process.
    pub(super) fn clean_up(&self, _guard: &LockGuard<'_>) {
        // If this process cannot find out, the next one cleans up.
        let Some((mut living, dead)) = self.nodes() else { return };
        // Segments first: iceoryx2 waits for ever for one whose creator crashed before it had a
        // size.
        self.remove_segments(&living);
        for node in dead {
            // Without its details iceoryx2 would look for it in another domain.
            let is_whole = node.details().is_some();
            let id = node.id().value();
            match node.try_remove_stale_resources() {
                Ok(()) | Err(NodeCleanupFailure::ResourcesAlreadyCleanedUp) => {}
                // Keep its files, so that the next process can find it and try again.
                Err(_) if is_whole && !living.processes.is_empty() => {
                    living.nodes.insert(id);
                }
                Err(_) => {}
            }
        }
        self.remove_services(&living);
        for (name, entry) in entries(&self.root.join("nodes")) {
            let name = name.strip_prefix(&self.prefix).unwrap_or(&name);
            if !numbers(name).any(|id| living.nodes.contains(&id)) {
                remove(&entry.path());
            }
        }
        for (_, entry) in entries(&self.root.join("members")) {
            if File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok()) {
                remove(&entry.path());
            }
        }
    }

    /// The living nodes, and those of crashed processes. `None` if that cannot be known.
    fn nodes(&self) -> Option<(Living, Vec<DeadNodeView<ipc::Service>>)> {
        let (mut found, mut dead) = (Living::default(), Vec::new());
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

    /// Removes segments and sockets of crashed processes, and what they did not complete.
    fn remove_segments(&self, living: &Living) {
        for (name, entry) in entries(Path::new(SEGMENTS)).chain(entries(&self.root)) {
            let Some(name) = name.strip_prefix(&self.prefix) else { continue };
            let is_used = if living.processes.is_empty() {
                false
            } else if name.ends_with(".dynamic") || name.ends_with(".global_mgmt") {
                // A service may outlive its creator. It becomes readable when it is complete.
                entry.metadata().is_ok_and(|file| file.len() > 0 && file.mode() & 0o400 != 0)
            } else {
                numbers(name).all(|id| living.processes.contains(&process_of(id)))
            };
            if !is_used {
                remove(&entry.path());
            }
        }
    }

    /// Removes the services that no living process uses, and their remains.
    fn remove_services(&self, living: &Living) {
        let services = self.services();
        if living.processes.is_empty() {
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

    /// Removes unused services, and returns the numbers of those in use. `None` if one cannot be
    /// read.
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

/// The nodes and processes that live.
#[derive(Default)]
struct Living {
    nodes: HashSet<u128>,
    processes: HashSet<u32>,
}

/// The process that assigned an id.
fn process_of(id: u128) -> u32 {
    (id >> 64) as u32
}

/// The numbers in a name.
fn numbers(name: &str) -> impl Iterator<Item = u128> {
    name.split(['_', '.']).filter_map(|part| part.parse().ok())
}

/// Removes a file or a directory, if it is still there. If that fails, the next process tries
/// again.
fn remove(path: &Path) {
    let _ = match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() => fs::remove_dir_all(path),
        _ => fs::remove_file(path),
    };
}
