//! Numbered files: `run-0001.mcap`, `run-0002.mcap`, ….

use std::{
    ffi::OsStr,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

/// Creates one file after another beside a path; no file that exists is overwritten.
#[derive(Debug)]
pub(super) struct NumberedFiles {
    path: PathBuf,
    newest: u32,
}

impl NumberedFiles {
    /// Continues after the highest number that the folder has.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let mut files = Self { path: path.to_owned(), newest: 0 };
        for entry in fs::read_dir(files.folder())? {
            let number = files.number_of(&entry?.file_name());
            files.newest = files.newest.max(number.unwrap_or(0));
        }
        Ok(files)
    }

    /// Creates the next file; also returns its path and its number.
    pub(super) fn create(&mut self) -> io::Result<(PathBuf, u32, File)> {
        loop {
            self.newest = self.newest.checked_add(1).ok_or(io::ErrorKind::FileTooLarge)?;
            let path = self.numbered(self.newest);
            match File::create_new(&path) {
                Ok(file) => return Ok((path, self.newest, file)),
                // Another program has made it meanwhile.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Creates the next file and removes it again: an error comes before a file is needed.
    pub(super) fn check(&mut self) -> io::Result<()> {
        let (path, number, _) = self.create()?;
        self.newest = number - 1;
        fs::remove_file(path)
    }

    fn folder(&self) -> &Path {
        let parent = self.path.parent().filter(|parent| !parent.as_os_str().is_empty());
        parent.unwrap_or(Path::new("."))
    }

    fn numbered(&self, number: u32) -> PathBuf {
        let mut name = self.path.file_stem().unwrap_or_default().to_owned();
        name.push(format!("-{number:04}"));
        if let Some(extension) = self.path.extension() {
            name.push(".");
            name.push(extension);
        }
        self.path.with_file_name(name)
    }

    /// The number in a file's name; `None` for another file.
    fn number_of(&self, name: &OsStr) -> Option<u32> {
        let stem = self.path.file_stem()?.to_str()?;
        let number =
            Path::new(name).file_stem()?.to_str()?.strip_prefix(stem)?.strip_prefix('-')?;
        let number = number.parse().ok()?;
        (self.numbered(number).file_name() == Some(name)).then_some(number)
    }
}
