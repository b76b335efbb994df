//! The samples that travel, fixed in size and layout.
//!
//! Every field is a little-endian `u32`, `u64` or `f64` and there is no padding, so that the bytes
//! on a wire and in shared memory are the same, and a program in any language can read them with
//! one table of offsets (see `docs/wire.md`). Lists are as long as the largest arm; the counts in
//! the header say how much of them is meant.

#[cfg(feature = "iceoryx2")]
use iceoryx2::prelude::ZeroCopySend;
use mtj_model::{MAX_AXES, MAX_JOINTS};
use serde::{Deserialize, Serialize};

/// Changes whenever the layout or the meaning of a sample does.
pub const VERSION: u32 = 1;

/// One number for each joint; entries past the count are zero.
pub type Joints = [f64; MAX_JOINTS];
/// One number for each task axis; entries past the count are zero.
pub type Axes = [f64; MAX_AXES];

/// What may lie in shared memory as it is.
#[cfg(feature = "iceoryx2")]
pub trait Shareable: ZeroCopySend {}
#[cfg(feature = "iceoryx2")]
impl<T: ZeroCopySend> Shareable for T {}

/// What may lie in shared memory as it is.
#[cfg(not(feature = "iceoryx2"))]
pub trait Shareable {}
#[cfg(not(feature = "iceoryx2"))]
impl<T> Shareable for T {}

/// A fixed-size message about one sampling instant.
pub trait Sample:
    Copy + std::fmt::Debug + Send + Serialize + for<'de> Deserialize<'de> + Shareable + 'static
{
    /// The last part of the sample's key: `mtj/<session>/<topic>`.
    const TOPIC: &'static str;
    /// Whether only one process at a time may write the topic.
    const ONE_WRITER: bool;

    /// What every sample begins with.
    fn header(&self) -> &Header;
    /// The sample's vectors, which must all be finite.
    fn vectors(&self) -> impl Iterator<Item = &[f64]>;
}

macro_rules! sample {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[cfg_attr(feature = "iceoryx2", derive(ZeroCopySend))]
        pub struct $name { $($(#[$field_doc])* pub $field: $type,)* }
    };
}

sample! {
    /// What every sample begins with.
    Header {
        /// [`VERSION`] of the writer.
        version: u32,
        /// How many joints the arm has, 1 to 7.
        joints: u32,
        /// How many task axes there are, 1 to 6.
        axes: u32,
        /// Unused, zero.
        reserved: u32,
        /// The plant's incarnation: drawn afresh each time a plant starts.
        run: u64,
        /// Counts the sampling instants of a run from zero.
        sequence: u64,
        /// The sampling instant, ns since the run began.
        time_ns: u64,
    }
}

sample! {
    /// Plant to controller: the measured state at a sampling instant.
    StateSample {
        /// Which instant.
        header: Header,
        /// When the plant sent this, by its own clock; echoed by the torque sample.
        sent_ns: u64,
        /// Latency of the command applied last, sample instant to application, ns; 0 before any.
        latency_ns: u64,
        /// State sent to torque received, of the torque received last, ns; 0 before any.
        round_trip_ns: u64,
        /// The part of `round_trip_ns` spent inside the controller.
        residence_ns: u64,
        /// Measured joint angles, rad.
        position: Joints,
        /// Measured joint velocities, rad/s.
        velocity: Joints,
        /// The task force in effect at the sampling instant, N.
        applied: Axes,
        /// The mean task force over the memory step that ends at the sampling instant, N.
        delivered: Axes,
    }
}

sample! {
    /// Controller to plant: the answer to one state sample.
    TorqueSample {
        /// The state sample's, except for the version.
        header: Header,
        /// The state sample's `sent_ns`.
        state_sent_ns: u64,
        /// State received to torque sent, by the controller's own clock.
        residence_ns: u64,
        /// τ = Jᵀ Q̂, N m.
        torque: Joints,
        /// Q̂, N: the plant holds it with the torque and echoes what was in effect.
        force: Axes,
    }
}

sample! {
    /// Controller to monitors: how the law saw the instant it answered.
    ErrorSample {
        /// The state sample's, except for the version.
        header: Header,
        /// 0 tj, 1 mtj, 2 mb.
        law: u64,
        /// e = desired − actual, m, as the law used it.
        error: Axes,
        /// ė, m/s.
        error_rate: Axes,
        /// The regulating factor k on each axis.
        factor: Axes,
        /// What mtj added, h = k · memory, N.
        memory: Axes,
    }
}

sample! {
    /// Plant to monitors: the truth about the arm and the book-keeping of the run.
    StatusSample {
        /// The latest sampling instant.
        header: Header,
        /// 0 waiting for a controller, 1 running, 2 finished.
        phase: u64,
        /// Commands asked for, applied, lost, late and rejected so far.
        sent: u64,
        /// Commands that came into effect.
        applied: u64,
        /// Commands that never came.
        lost: u64,
        /// Commands that came after the next sampling instant.
        late: u64,
        /// Torque samples that were not acceptable.
        rejected: u64,
        /// Sampling instants the plant reached only after the next was due.
        deadline_misses: u64,
        /// How often commands stayed away for longer than the command timeout.
        timeouts: u64,
        /// True joint angles, rad.
        position: Joints,
        /// True joint velocities, rad/s.
        velocity: Joints,
        /// Torque in effect, N m.
        torque: Joints,
    }
}

macro_rules! implement_sample {
    ($($name:ident, $topic:literal, one writer $one:literal: $($field:ident),*;)*) => {
        $(impl Sample for $name {
            const TOPIC: &'static str = $topic;
            const ONE_WRITER: bool = $one;
            fn header(&self) -> &Header {
                &self.header
            }
            fn vectors(&self) -> impl Iterator<Item = &[f64]> {
                [$(self.$field.as_slice()),*].into_iter()
            }
        })*
    };
}

implement_sample! {
    StateSample, "state", one writer true: position, velocity, applied, delivered;
    TorqueSample, "torque", one writer false: torque, force;
    ErrorSample, "error", one writer false: error, error_rate, factor, memory;
    StatusSample, "status", one writer true: position, velocity, torque;
}

impl Header {
    /// The same instant, stamped with our own version: what an answer begins with.
    pub fn answer(&self) -> Self {
        Self { version: VERSION, reserved: 0, ..*self }
    }
}

/// The first entries of a list that may be shorter, zeros after them.
pub fn padded<const N: usize>(values: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}
