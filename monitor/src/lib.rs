//! Watches a session: subscribes to everything that is said in it, says nothing itself.

pub mod options;
pub mod view;
pub mod watch;
