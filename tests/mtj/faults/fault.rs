//! What can happen to a loop, drawn from a seed.

use crate::session::chance::Chance;

/// What can happen to a loop.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// Keys are set while it runs.
    Set(String),
    /// N m, the limit on both joints.
    Limit(u64),
    /// ms.
    Timeout(u64),
    /// Both controllers are stopped, and so many ms later the timeout becomes so many ms.
    Silence(u64, u64),
    /// A role is stopped for so many ms.
    Stop(usize, u64),
    /// A role is killed, and another one started so many ms later.
    Kill(usize, u64),
    /// The link between the plant and the other roles is cut for so many ms, where there is one.
    Cut(u64),
    /// The plant has no descriptors for so many ms.
    NoDescriptors(u64),
    /// Directories of shared memory are not where they were for so many ms.
    Moved(u64),
    /// They are removed for good: nobody can join the plant any more.
    Removed,
    /// The disk on which shared memory and the recording are is full for so many ms.
    FullDisk(u64),
    /// Somebody sends torques that are none.
    Hostile(u64),
    /// An operator pauses the run for so many ms.
    Pause(u64),
    Kick,
}

pub const CONTROLLER: usize = 0;
pub const STANDBY: usize = 1;
pub const MONITOR: usize = 2;
pub const PLANT: usize = 3;

impl Fault {
    pub fn draw(chance: &mut Chance) -> Self {
        let mut one_of =
            |words: &[&str]| words[chance.below(words.len() as u64) as usize].to_owned();
        let set = one_of(&[
            "link.torque.latency=20ms",
            "link.torque.latency=0s",
            "link.state.latency=5ms",
            "link.state.latency=0s",
            "link.torque.dropout=0.3",
            "link.torque.dropout=0.0",
            "link.state.dropout=0.2",
            "safety.on_timeout=zero",
            "safety.on_timeout=hold",
            "safety.on_timeout=damp",
            "law.kind=tj law.kp=60 law.kd=120",
            "law.kind=mtj law.kp=30 law.kd=60",
            "law.memory.policy=delivered",
            "law.memory.policy=sent",
            "timing.sample_period=4ms",
            "timing.sample_period=10ms",
            "law.prediction.horizon=measured",
            "trajectory.radius=1.0 trajectory.blend=300ms",
            "trajectory.angular_frequency=1.5",
        ]);
        match chance.below(16) {
            0..3 => Self::Set(set),
            3 => Self::Limit(2 + chance.below(30)),
            4 => Self::Timeout(60 + chance.below(200)),
            5 => Self::Stop(
                [CONTROLLER, STANDBY, MONITOR][chance.below(3) as usize],
                chance.below(400),
            ),
            6 => Self::Stop(PLANT, chance.below(400)),
            7 | 8 => Self::Kill(
                [CONTROLLER, STANDBY, MONITOR][chance.below(3) as usize],
                chance.below(300),
            ),
            9 => Self::NoDescriptors(chance.below(400)),
            10 => Self::Hostile(1 + chance.below(50)),
            11 => Self::Cut(chance.below(800)),
            12 => Self::FullDisk(chance.below(300)),
            14 => Self::Silence(chance.below(150), 60 + chance.below(60)),
            13 if chance.below(8) == 0 => Self::Removed,
            13 => Self::Moved(chance.below(300)),
            _ if chance.below(2) == 0 => Self::Pause(chance.below(300)),
            _ => Self::Kick,
        }
    }
}
