//! How a role gets a processor to itself, and keeps its memory.

use clap::Args;
use mtj_protocol::realtime::Realtime;

/// How a role runs in real time
#[derive(Args, Clone, Debug, Default)]
pub struct RealtimeOptions {
    /// Real-time priority, 1 to 99: nothing of a lower one delays the role (SCHED_FIFO)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    pub priority: Option<u8>,
    /// The processor on which the role's loop stays, counted from 0
    #[arg(long, value_name = "CORE")]
    pub cpu: Option<usize>,
    /// Keep the role's memory from being paged out, and fault it in beforehand
    #[arg(long)]
    pub lock_memory: bool,
}

impl RealtimeOptions {
    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let mut arguments = Vec::new();
        if let Some(priority) = self.priority {
            arguments.extend(["--priority".to_owned(), priority.to_string()]);
        }
        if let Some(core) = self.cpu {
            arguments.extend(["--cpu".to_owned(), core.to_string()]);
        }
        if self.lock_memory {
            arguments.push("--lock-memory".to_owned());
        }
        arguments
    }
}

impl From<&RealtimeOptions> for Realtime {
    fn from(options: &RealtimeOptions) -> Self {
        let RealtimeOptions { priority, cpu, lock_memory } = *options;
        Self { priority, cpu, lock_memory }
    }
}
