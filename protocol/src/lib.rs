//! Samples, and the buses that carry them between the processes of a session.
//!
//! ```text
//! port         what each role may send and receive    PlantPort, ControllerPort, MonitorPort, …
//! request      changes to a running loop              set, pause, resume, reset, kick
//! admission    which samples a port accepts           version, run, order, finite numbers
//! transport    the bus that a scenario names          AnyBus: local, iceoryx2, zenoh
//! bus          the trait that moves samples           Bus, Writer, Reader, Offering; Shared
//! member       a participant of a session             role, id, precedence
//! certificate  validity and key of a certificate      X.509 in PEM (feature `zenoh`)
//! codec        samples as bytes                       bincode, fixed-width little-endian
//! sample       the samples                            repr(C), no pointers, no padding
//! ```
//!
//! Besides, `options` and `realtime` have the command line options that all roles share, `shutdown`
//! the request to stop, and `warn_once` warnings that are given once.
//!
//! Each layer uses only the layers below it. To write a bus of your own, start at [`bus`].

#![warn(clippy::print_stderr, clippy::print_stdout)]

pub mod admission;
pub mod bus;
#[cfg(feature = "zenoh")]
pub mod certificate;
pub mod codec;
#[cfg(feature = "iceoryx2")]
pub mod iceoryx2;
pub mod local;
mod mailbox;
pub mod member;
pub mod port;
pub mod realtime;
pub mod request;
pub mod sample;
pub mod shutdown;
pub mod stall;
pub mod transport;
pub mod warn_once;
#[cfg(feature = "zenoh")]
pub mod zenoh;

/// Implements `Debug` with the name alone, for types that hold trait objects.
macro_rules! debug_by_name {
    ($($name:ident),* $(,)?) => {
        $(impl std::fmt::Debug for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.debug_struct(stringify!($name)).finish_non_exhaustive()
            }
        })*
    };
}
pub(crate) use debug_by_name;
