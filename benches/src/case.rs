//! What is measured.

use std::fmt;

use crate::{answer, law::Law, meter::Meter, step};

/// The numbers of links that are measured.
pub const LINKS: std::ops::RangeInclusive<usize> = 2..=7;

/// How often each time is measured, with all others in between: a machine is slow for seconds at a
/// stretch.
pub const PASSES: usize = 3;

/// One law in one setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// What surrounds the law.
    pub setting: Setting,
    /// Links of the arm; in the paper's setting task axes too.
    pub links: usize,
    /// The law.
    pub law: Law,
}

/// What surrounds a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// Measured state in, torque out, for a planar arm: what a control loop pays.
    Loop {
        /// Whose task force mtj remembers: a value of `law.memory.policy`.
        memory: &'static str,
        /// Whether the law aims at the instant its torque takes effect.
        prediction: bool,
    },
    /// The paper's: as many task axes as joints, full matrices, and the error, J, J⁻¹, H, C and J̇
    /// q̇ given.
    Paper,
}

impl Setting {
    /// The loop under the paper's memory, without prediction.
    pub const LOOP: Self = Self::Loop { memory: "sent", prediction: false };

    /// Every loop: each memory, with and without prediction.
    pub fn loops() -> impl Iterator<Item = Self> {
        [false, true].into_iter().flat_map(|prediction| {
            ["sent", "applied", "delivered"].map(|memory| Self::Loop { memory, prediction })
        })
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Loop { memory, prediction: false } => write!(f, "loop, {memory}"),
            Self::Loop { memory, prediction: true } => write!(f, "loop, {memory}, predicting"),
            Self::Paper => f.write_str("paper"),
        }
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} links, {}", self.setting, self.links, self.law)
    }
}

impl Case {
    /// Whether there is such a law: mb inverts the Jacobian, which in the plane is square only for
    /// two links, and the paper has no tdc.
    pub fn exists(&self) -> bool {
        match (self.setting, self.law) {
            (Setting::Paper, law) => law != Law::Tdc,
            (Setting::Loop { .. }, law) => law != Law::Mb || self.links == answer::AXES,
        }
    }

    /// The cases of some settings, in the order in which they are measured.
    pub fn all(settings: impl Iterator<Item = Setting>) -> Vec<Self> {
        let of = |setting| {
            let laws = move |links| Law::ALL.map(|law| Self { setting, links, law });
            LINKS.flat_map(laws)
        };
        settings.flat_map(of).filter(Self::exists).collect()
    }

    /// Under which group criterion files what it measures in a setting and a pass.
    pub fn group(setting: Setting, pass: usize) -> String {
        format!("{setting}, pass {pass}")
    }

    /// Hands one step of the case to `meter`.
    pub fn measure<M: Meter>(&self, meter: &mut M) {
        match self.setting {
            Setting::Loop { memory, prediction } => {
                answer::measure(self.links, self.law, memory, prediction, meter);
            }
            Setting::Paper => step::measure(self.links, self.law, meter),
        }
    }
}
