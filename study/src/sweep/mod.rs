//! Studies: a scenario, and axes over any of its keys.
//!
//! [`plan`] says which points there are, [`runner`] computes them, [`results`] keeps them safe on disk.

pub mod axis;
pub mod builtin;
pub mod lanes;
pub mod plan;
pub mod results;
pub mod runner;
