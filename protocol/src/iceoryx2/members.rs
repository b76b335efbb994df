//! The members of a session: a file for each, locked for as long as its process lives.
//!
//! iceoryx2 knows who lives too, but to ask it costs more than a plant can spend between two samples.

use std::{
    any::Any,
    collections::BTreeSet,
    fs::{self, File, OpenOptions, TryLockError},
    io::ErrorKind,
    os::unix::fs::OpenOptionsExt,
    path::PathBuf,
};

use super::{domain::Domain, resources};
use crate::{
    bus::{Attendance, BusError, Sessions},
    member::Member,
};

/// The files of members.
pub struct Members {
    directory: PathBuf,
    /// What the names of their files begin with.
    prefix: String,
}

impl Members {
    pub fn of(domain: &Domain, session: &str) -> Result<Self, BusError> {
        let directory = domain.directory("members")?;
        Ok(Self { directory, prefix: format!("{session}.") })
    }

    /// Those of every session.
    pub fn of_all(domain: &Domain) -> Result<Self, BusError> {
        Ok(Self { directory: domain.directory("members")?, prefix: String::new() })
    }

    /// What follows the prefix in the names of those who live.
    fn living(&self) -> Result<Vec<String>, BusError> {
        let refuse = |error| resources::io(&self.directory, &error);
        let mut names = Vec::new();
        for entry in fs::read_dir(&self.directory).map_err(refuse)?.flatten() {
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

    /// Announces a member. Only inside.
    pub fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
        let refuse = |error| resources::io(&self.directory, &error);
        let path = self.path(member);
        let file =
            OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&path);
        let file = file.map_err(refuse)?;
        file.lock().map_err(refuse)?;
        Ok(Box::new(Announcement { path, _file: file }))
    }
}

/// Whether the process that made a file lives: the kernel unlocks it when the process dies.
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
            // Without a descriptor left to find out, the lease decides.
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
        // Unlocked it counts for nothing, even if it cannot be removed.
        let _ = fs::remove_file(&self.path);
    }
}
