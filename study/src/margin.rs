//! The margin that gains are chosen with.

/// The loop must stand this many times the latency.
pub const MARGIN: f64 = 1.5;
