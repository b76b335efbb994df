//! Measurements of this program on this machine.

pub(crate) mod round_trip;
pub(crate) mod sweep;
