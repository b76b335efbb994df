//! Numbers that tell one incarnation of a plant from another.

use std::time::SystemTime;

/// A number that no other incarnation of a plant has: the time in nanoseconds and the process id.
pub fn fresh() -> u64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    (now.as_nanos() as u64) ^ (u64::from(std::process::id()) << 40)
}
