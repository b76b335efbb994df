//! What a process holds.

use std::fs;

/// What a process holds.
#[derive(Clone, Copy, Debug)]
pub struct Holdings {
    pub descriptors: usize,
    /// Mapped files and shared memory. What is mapped without a name is the stacks of threads that
    /// come and go with work and the allocator's arenas: `memory_kb` counts what is in use of
    /// those.
    pub mappings: usize,
    pub memory_kb: usize,
}

impl Holdings {
    /// Of this process.
    pub fn of(pid: u32) -> Self {
        let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
        let maps = fs::read_to_string(format!("/proc/{pid}/maps")).unwrap();
        let resident = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap();
        Self {
            descriptors: fs::read_dir(format!("/proc/{pid}/fd")).unwrap().count(),
            mappings: maps.lines().filter(|line| line.contains('/')).count(),
            memory_kb: resident.trim().trim_end_matches(" kB").parse().unwrap(),
        }
    }

    /// It holds no more than before, but for a few.
    pub fn assert_not_above(self, before: Self) {
        assert!(self.descriptors <= before.descriptors + 4, "{before:?}, then {self:?}");
        assert!(self.mappings <= before.mappings + 4, "{before:?}, then {self:?}");
        assert!(self.memory_kb <= before.memory_kb + 4096, "{before:?}, then {self:?}");
    }
}
