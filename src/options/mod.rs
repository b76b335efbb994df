//! The options that several commands share.

pub mod audience;
pub mod output;
pub mod realtime;
pub mod scenario;
pub mod study;
