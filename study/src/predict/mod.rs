//! Theory beside measurement: the sampled loop linearised, and how much latency it should stand.

pub mod linear;
pub mod measure;
pub mod path;
