//! The samples: messages of fixed size and layout.
//!
//! Every field is a little-endian `u32`, `u64` or `f64` and there is no padding, so that the bytes
//! on a wire and in shared memory are the same, and a program in any language can read them with
//! one table of offsets (see `docs/wire.md`). Lists are as long as the largest arm needs; the
//! counts in the header say how much of them is used.

use std::mem::offset_of;

#[cfg(feature = "iceoryx2")]
use iceoryx2::prelude::ZeroCopySend;
pub use mtj_model::matrix::padded;
use mtj_model::{MAX_AXES, MAX_ECHO, MAX_JOINTS, MAX_SIGNALS, law};
use serde::{Deserialize, Serialize};

/// Changes whenever the layout or the meaning of a sample does.
pub const VERSION: u32 = 5;

/// One number for each joint; entries past the count are zero.
pub type Joints = [f64; MAX_JOINTS];
/// One number for each task axis; entries past the count are zero.
pub type Axes = [f64; MAX_AXES];
/// The numbers that a law sends with its torque; entries past the count are zero.
pub type Echo = [f64; MAX_ECHO];
/// The signals of a law one after the other; entries past the last are zero.
pub type Signals = [f64; MAX_SIGNALS];
/// A short name, like [`Text`].
pub type Name = [[u8; 32]; 1];
/// UTF-8, filled up with zeros. In rows, because serde knows no arrays longer than 32.
pub type Text = [[u8; 32]; 12];
/// The name of a machine, like [`Text`].
pub type HostName = [[u8; 32]; 2];

/// A type that shared memory can hold as it is.
#[cfg(feature = "iceoryx2")]
pub trait Shareable: ZeroCopySend {}
#[cfg(feature = "iceoryx2")]
impl<T: ZeroCopySend> Shareable for T {}

/// A type that shared memory can hold as it is.
#[cfg(not(feature = "iceoryx2"))]
pub trait Shareable {}
#[cfg(not(feature = "iceoryx2"))]
impl<T> Shareable for T {}

/// A fixed-size message about one sampling instant.
pub trait Sample:
    Copy
    + Default
    + std::fmt::Debug
    + Send
    + Serialize
    + for<'de> Deserialize<'de>
    + Shareable
    + 'static
{
    /// The last part of the sample's key: `mtj/<session>/<topic>`.
    const TOPIC: &'static str;
    /// Whether only one process at a time may write the topic.
    const ONE_WRITER: bool;
    /// Whether a control loop waits for it.
    const CLOSES_THE_LOOP: bool;

    /// The header, with which every sample begins.
    fn header(&self) -> &Header;
    /// Whether all counts are within their limits.
    fn is_well_formed(&self) -> bool;
    /// Whether all numbers of the sample's vectors are finite.
    fn is_finite(&self) -> bool;
    /// Shows the fields after the header one by one, with lists cut to their counts: for records in
    /// self-describing formats.
    fn fields(&self, show: &mut dyn FnMut(&'static str, Field<'_>));
    /// The header, to be filled in.
    fn header_mut(&mut self) -> &mut Header;
    /// The field of this name, to be filled in from a record.
    fn field_mut(&mut self, name: &str) -> Option<FieldMut<'_>>;
}

/// A field of a sample as a record shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Field<'a> {
    /// A count, a code or nanoseconds.
    Count(u64),
    /// A number for each joint or each task axis.
    Numbers(&'a [f64]),
    /// Words.
    Text(&'a str),
}

/// A field of a sample that is filled in from a record.
#[derive(Debug, PartialEq)]
pub enum FieldMut<'a> {
    /// A count, a code or nanoseconds.
    Count(&'a mut u64),
    /// A number for each joint or each task axis, as many as there can be.
    Numbers(&'a mut [f64]),
    /// Words in the form of [`text`].
    Text(&'a mut [[u8; 32]]),
}

/// Shows one field of a sample, by the name of its type.
macro_rules! show {
    (u64, $sample:ident, $field:ident, $show:ident) => {
        $show(stringify!($field), Field::Count($sample.$field))
    };
    (Joints, $sample:ident, $field:ident, $show:ident) => {
        $show(stringify!($field), numbers(&$sample.$field, u64::from($sample.header.joints)))
    };
    (Axes, $sample:ident, $field:ident, $show:ident) => {
        $show(stringify!($field), numbers(&$sample.$field, u64::from($sample.header.axes)))
    };
    (Echo, $sample:ident, $field:ident, $show:ident) => {
        $show(stringify!($field), numbers(&$sample.$field, $sample.echo_count))
    };
    (Signals, $sample:ident, $field:ident, $show:ident) => {
        $sample.show_signals($show)
    };
    ($text:ident, $sample:ident, $field:ident, $show:ident) => {
        $show(stringify!($field), Field::Text(text_of(&$sample.$field)))
    };
}

/// One field of a sample to be filled in, by the name of its type.
macro_rules! fill {
    (u64, $field:expr) => {
        FieldMut::Count(&mut $field)
    };
    (Joints, $field:expr) => {
        FieldMut::Numbers(&mut $field)
    };
    (Axes, $field:expr) => {
        FieldMut::Numbers(&mut $field)
    };
    (Echo, $field:expr) => {
        FieldMut::Numbers(&mut $field)
    };
    (Signals, $field:expr) => {
        FieldMut::Numbers(&mut $field)
    };
    ($text:ident, $field:expr) => {
        FieldMut::Text(&mut $field)
    };
}

/// The first `count` numbers of a list.
fn numbers(list: &[f64], count: u64) -> Field<'_> {
    Field::Numbers(&list[..list.len().min(count as usize)])
}

macro_rules! sample {
    ($(#[$doc:meta])* $name:ident {
        $(#[$header_doc:meta])* header: Header,
        $($(#[$field_doc:meta])* $field:ident: $type:ident,)*
    }) => {
        layout! { $(#[$doc])* $name {
            $(#[$header_doc])* header: Header,
            $($(#[$field_doc])* $field: $type,)*
        } }

        impl $name {
            fn show_fields(&self, show: &mut dyn FnMut(&'static str, Field<'_>)) {
                $(show!($type, self, $field, show);)*
            }
            fn named_field_mut(&mut self, name: &str) -> Option<FieldMut<'_>> {
                match name {
                    $(stringify!($field) => Some(fill!($type, self.$field)),)*
                    _ => None,
                }
            }
        }
    };
}

macro_rules! layout {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[cfg_attr(feature = "iceoryx2", derive(ZeroCopySend))]
        pub struct $name { $($(#[$field_doc])* pub $field: $type,)* }

        impl $name {
            /// The fields in order: name, type and offset in bytes.
            pub const LAYOUT: &'static [(&'static str, &'static str, usize)] =
                &[$((stringify!($field), stringify!($type), offset_of!($name, $field)),)*];
        }
    };
}

layout! {
    /// The header, with which every sample begins.
    Header {
        /// [`VERSION`] of the writer.
        version: u32,
        /// How many joints the arm has, 1 to 7.
        joints: u32,
        /// How many task axes there are, 1 to 6.
        axes: u32,
        /// How often the plant's scenario was changed in this run.
        revision: u32,
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
        /// The number of the controller that leads; 0 if none does: then the first to answer
        /// becomes the leader.
        leader: u64,
        /// 1 while no command has come for longer than the command timeout: earlier echoes do not
        /// count any more, and k is zero.
        timed_out: u64,
        /// How many numbers the echo has.
        echo_count: u64,
        /// Measured joint angles, rad.
        position: Joints,
        /// Measured joint velocities, rad/s.
        velocity: Joints,
        /// The echo in effect at the sampling instant.
        applied: Echo,
        /// The mean of the echo over the memory step that ends at the sampling instant.
        delivered: Echo,
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
        /// The controller's number, which no other has; not 0.
        controller: u64,
        /// How many numbers the echo has, 0 to 7.
        echo_count: u64,
        /// τ, N m.
        torque: Joints,
        /// Numbers of the law's choice, like its task force Q̂: the plant holds them with the
        /// torque, scales them with it, and returns what was in effect.
        echo: Echo,
    }
}

sample! {
    /// Controller to monitors: the tracking error that the law used, and its signals.
    ErrorSample {
        /// The state sample's, except for the version.
        header: Header,
        /// The name of the law, as in scenarios.
        law: Name,
        /// e = desired − actual, m, as the law used it.
        error: Axes,
        /// ė, m/s.
        error_rate: Axes,
        /// The law's signals, in the order of its description.
        signals: Signals,
    }
}

sample! {
    /// Plant to monitors: the true state of the arm and the counts of the run.
    StatusSample {
        /// The latest sampling instant.
        header: Header,
        /// 0 waiting for a controller, 1 running, 2 finished, 3 paused, 4 diverged: over, and waiting
        /// for a reset, 5 stopped at a joint limit until it is resumed or reset.
        phase: u64,
        /// Commands asked for so far.
        sent: u64,
        /// Commands that came into effect.
        applied: u64,
        /// Commands that never came.
        lost: u64,
        /// Commands that were too old to act when they came.
        too_old: u64,
        /// Commands that came after the next sampling instant.
        late: u64,
        /// Torque samples that were not acceptable.
        rejected: u64,
        /// Sampling instants that the plant reached after the next was due.
        deadline_misses: u64,
        /// How often the plant did not run for a while: the run's time stood still meanwhile.
        stalls: u64,
        /// The longest of these times, ns.
        longest_stall_ns: u64,
        /// How often no command came for longer than the command timeout.
        timeouts: u64,
        /// How often the leader changed.
        takeovers: u64,
        /// True joint angles, rad.
        position: Joints,
        /// True joint velocities, rad/s.
        velocity: Joints,
        /// Torque in effect, N m.
        torque: Joints,
    }
}

/// The phase of a run, as [`StatusSample`] carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The plant waits for a controller.
    Waiting,
    /// The arm moves.
    Running,
    /// The run is over.
    Finished,
    /// An operator paused the run.
    Paused,
    /// The arm diverged: the run is over, and the plant waits for a reset.
    Diverged,
    /// A joint left its limits: the arm brakes until it is resumed or reset.
    Stopped,
}

impl Phase {
    /// All phases, in the order of their numbers on the wire.
    pub const ALL: [Self; 6] =
        [Self::Waiting, Self::Running, Self::Finished, Self::Paused, Self::Diverged, Self::Stopped];

    /// The phase in one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Paused => "paused",
            Self::Diverged => "diverged",
            Self::Stopped => "stopped",
        }
    }
}

impl StatusSample {
    /// The phase of the run; `None` for one that this program does not know.
    pub fn phase(&self) -> Option<Phase> {
        Phase::ALL.get(self.phase as usize).copied()
    }
}

sample! {
    /// Operator to plant: a request to change the running loop.
    RequestSample {
        /// The run that is meant; `sequence` is a number of the operator's choice that identifies
        /// the request.
        header: Header,
        /// 0 set, 1 pause, 2 resume, 3 reset, 4 kick.
        action: u64,
        /// How long a kick lasts, ns.
        duration_ns: u64,
        /// A kick's disturbance torque, N m.
        torque: Joints,
        /// What to set: `key=value` on each line, like law.memory.policy=delivered.
        text: Text,
    }
}

sample! {
    /// Plant to all: the answer to a request.
    ChangeSample {
        /// The sampling instant from which on it is in effect.
        header: Header,
        /// The request's number.
        request: u64,
        /// Its action.
        action: u64,
        /// 0 refused, 1 in effect.
        accepted: u64,
        /// As in the request.
        duration_ns: u64,
        /// As in the request.
        torque: Joints,
        /// What was set; if refused, why.
        text: Text,
    }
}

sample! {
    /// Any role to monitors, once a second: its presence in the session.
    PresenceSample {
        /// The instant that the role handled last.
        header: Header,
        /// 0 plant, 1 controller.
        role: u64,
        /// Its process id.
        process: u64,
        /// When it joined, ns since 1970, by its own clock.
        since_ns: u64,
        /// Its number, which no other has: a controller's is in its torques.
        id: u64,
        /// The controller with the highest becomes the leader.
        precedence: u64,
        /// The machine it runs on.
        host: HostName,
    }
}

macro_rules! implement_sample {
    ($($name:ident, $topic:literal, one writer $one:literal, loop $loop:literal: $($field:ident),* $(=> $count:ident)?;)*) => {
        $(impl Sample for $name {
            const TOPIC: &'static str = $topic;
            const ONE_WRITER: bool = $one;
            const CLOSES_THE_LOOP: bool = $loop;
            fn header(&self) -> &Header {
                &self.header
            }
            #[inline]
            fn is_finite(&self) -> bool {
                // Without an early exit, so that the compiler can vectorize it.
                true $(& self.$field.iter().fold(true, |all, x| all & x.is_finite()))*
            }
            fn is_well_formed(&self) -> bool {
                self.header.is_well_formed() $(&& self.$count <= MAX_ECHO as u64)?
            }
            fn fields(&self, show: &mut dyn FnMut(&'static str, Field<'_>)) {
                self.show_fields(show);
            }
            fn header_mut(&mut self) -> &mut Header {
                &mut self.header
            }
            fn field_mut(&mut self, name: &str) -> Option<FieldMut<'_>> {
                self.named_field_mut(name)
            }
        })*
    };
}

implement_sample! {
    StateSample, "state", one writer true, loop true: position, velocity, applied, delivered => echo_count;
    TorqueSample, "torque", one writer false, loop true: torque, echo => echo_count;
    ErrorSample, "error", one writer false, loop false: error, error_rate, signals;
    StatusSample, "status", one writer true, loop false: position, velocity, torque;
    RequestSample, "request", one writer false, loop false: torque;
    ChangeSample, "change", one writer true, loop false: torque;
    PresenceSample, "presence", one writer false, loop false: ;
}

impl StateSample {
    /// The number of the controller that leads; `None` if any may answer.
    pub fn leader(&self) -> Option<u64> {
        Some(self.leader).filter(|leader| *leader != 0)
    }
}

impl ErrorSample {
    /// The description of the law; `None` for a law that this program does not have.
    pub fn description(&self) -> Option<&'static law::Description> {
        law::find(text_of(&self.law))
    }

    /// The law's signals with their numbers; empty for a law that this program does not have.
    pub fn signals(&self) -> impl Iterator<Item = (&'static law::Signal, &[f64])> {
        let (joints, axes) = (self.header.joints as usize, self.header.axes as usize);
        let description = self.description().into_iter();
        description.flat_map(move |law| law.cut(&self.signals, joints, axes))
    }

    /// The numbers of one signal, if the law has it.
    pub fn signal(&self, key: &str) -> Option<&[f64]> {
        self.signals().find(|(signal, _)| signal.key == key).map(|(_, numbers)| numbers)
    }

    /// Shows each signal under its own name, or all as one where the law is not known.
    fn show_signals(&self, show: &mut dyn FnMut(&'static str, Field<'_>)) {
        if self.description().is_none() {
            return show("signals", Field::Numbers(&self.signals));
        }
        for (signal, numbers) in self.signals() {
            show(signal.key, Field::Numbers(numbers));
        }
    }
}

impl Header {
    /// Whether its counts are within their limits.
    pub fn is_well_formed(&self) -> bool {
        let within = |count: u32, most: usize| (1..=most as u32).contains(&count);
        within(self.joints, MAX_JOINTS) && within(self.axes, MAX_AXES)
    }

    /// The header of an answer: the same instant, with our own version.
    pub fn answer(&self) -> Self {
        Self { version: VERSION, ..*self }
    }

    /// Shows the header field by field, as [`Sample::fields`] does with what follows it.
    pub fn fields(&self, show: &mut dyn FnMut(&'static str, Field<'_>)) {
        let Self { version, joints, axes, revision, run, sequence, time_ns } = *self;
        for (name, count) in [
            ("version", u64::from(version)),
            ("joints", u64::from(joints)),
            ("axes", u64::from(axes)),
            ("revision", u64::from(revision)),
            ("run", run),
            ("sequence", sequence),
            ("time_ns", time_ns),
        ] {
            show(name, Field::Count(count));
        }
    }
}

/// Words as a sample carries them, cut where they do not fit.
pub fn text<const ROWS: usize>(words: &str) -> [[u8; 32]; ROWS] {
    let mut rows = [[0; 32]; ROWS];
    write_text(&mut rows, words);
    rows
}

/// Writes words into empty rows, cut where they do not fit.
pub fn write_text(rows: &mut [[u8; 32]], words: &str) {
    let fits = |length: &usize| words.is_char_boundary(*length);
    let length = (0..=words.len().min(rows.len() * 32)).rev().find(fits).unwrap_or(0);
    rows.as_flattened_mut()[..length].copy_from_slice(&words.as_bytes()[..length]);
}

/// The words that a sample carries, up to the first byte that is not UTF-8.
pub fn text_of<const ROWS: usize>(rows: &[[u8; 32]; ROWS]) -> &str {
    let bytes = rows.as_flattened();
    let length = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    match std::str::from_utf8(&bytes[..length]) {
        Ok(words) => words,
        Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    }
}
