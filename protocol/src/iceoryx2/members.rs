//! The members of a session: one file each, locked for as long as its process lives.
//!
//! iceoryx2 knows living processes too, but to ask it takes longer than a plant has between two
//! samples.

use std::{
    any::Any,
    collections::BTreeSet,
    fs::{self, File, OpenOptions, TryLockError},
    io::ErrorKind,
    os::unix::fs::OpenOptionsExt,
    path::PathBuf,
};

use super::{domain::Domain, error::SharedMemoryError};
use crate::{
    bus::{Attendance, BusError, Sessions},
    member::Member,
};

/// The files of members, of one session or of all.
pub(super) struct Members {
    directory: PathBuf,
    /// What the names of their files begin with.
    prefix: String,
}

impl Members {
    /// The members of one session.
    pub(super) fn of(domain: &Domain, session: &str) -> Result<Self, SharedMemoryError> {
        let directory = domain.directory("members")?;
        Ok(Self { directory, prefix: format!("{session}.") })
    }

    /// The members of every session.
    pub(super) fn of_all(domain: &Domain) -> Result<Self, SharedMemoryError> {
        Ok(Self { directory: domain.directory("members")?, prefix: String::new() })
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
        let file =
            OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&path);
        let file = file.map_err(io)?;
        file.lock().map_err(io)?;
        Ok(Box::new(Announcement { path, _file: file }))
    }
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
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
            // If no descriptor is left to find out, the lease decides.
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

struct Announcement {
    path: PathBuf,
    _file: File,
}

impl Drop for Announcement {
    fn drop(&mut self) {
        // An unlocked file counts for nothing, even if it cannot be removed.
        let _ = fs::remove_file(&self.path);
    }
}
