//! The control laws, one file each, and their registry.

pub mod describe;
mod mb;
mod mtj;
mod tj;

pub use describe::{Description, Parameter, Per, Signal};

/// The registry: all laws, in the order in which they are listed.
pub const LAWS: &[&Description] = &[&tj::DESCRIPTION, &mtj::DESCRIPTION, &mb::DESCRIPTION];

/// The law of this name.
pub fn find(name: &str) -> Option<&'static Description> {
    LAWS.iter().copied().find(|law| law.name == name)
}
