//! How fast this program is on this machine, beside what it could be.

pub mod round_trip;
pub mod sweep;
