//! Measurements of this program's own speed, on the machine it runs on.

pub mod sweep;
