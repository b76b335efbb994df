//! The edge: what passed a gate needs no more checks inside.

use mtj_model::scenario::Scenario;

use crate::sample::{Sample, VERSION};

/// What a gate makes of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Newer than everything before it.
    Fresh,
    /// The newest one once more.
    Repeated,
    /// Not acceptable.
    Refused(Fault),
}

/// Why a sample is not acceptable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Written by a program with another protocol version: this one.
    Version(u32),
    /// Counts out of range.
    Malformed,
    /// From another incarnation of the plant, or for one.
    Run,
    /// About an arm with another number of joints or task axes.
    Arm,
    /// Not finite.
    NotFinite,
    /// Older than the newest.
    Stale,
    /// The newest one once more, though nobody asked for it.
    Duplicate,
    /// The answer to a state that was not sent.
    Unasked,
    /// From a controller that is not in charge.
    NotInCharge,
}

impl Fault {
    /// What to tell the user, once.
    pub fn sentence(self) -> String {
        let sentence = match self {
            Self::Version(version) => {
                return format!(
                    "it has protocol version {version}, this program has {VERSION}; run the same \
                     version of mtj in the whole session"
                );
            }
            Self::Malformed => "it is not a sample",
            Self::Run => "it belongs to another run of the plant",
            Self::Arm => "it is about an arm with another number of joints",
            Self::NotFinite => "it holds a number that is not finite",
            Self::Stale => "it is older than the newest one",
            Self::Duplicate => "it was heard before",
            Self::Unasked => "it answers a state that was not sent",
            Self::NotInCharge => "it is from a controller that is not in charge",
        };
        sentence.to_owned()
    }
}

/// Lets only acceptable samples of one run pass, each later than the one before.
#[derive(Clone, Copy, Debug)]
pub struct Gate {
    run: u64,
    arm: Option<(u32, u32)>,
    newest: Option<u64>,
    refused: u64,
}

impl Gate {
    /// A gate for the samples of `run`.
    pub fn new(run: u64) -> Self {
        Self { run, arm: None, newest: None, refused: 0 }
    }

    /// The same gate, which lets only samples about the arm and the task of a scenario pass.
    pub fn for_scenario(self, scenario: &Scenario) -> Self {
        let (joints, axes) = (scenario.arm.links.len(), scenario.task.axes.len());
        Self { arm: Some((joints as u32, axes as u32)), ..self }
    }

    /// Judges a sample and, if it is fresh, remembers it as the newest.
    pub fn judge<S: Sample>(&mut self, sample: &S) -> Verdict {
        self.judge_if(sample, |_| None)
    }

    /// The same, where the owner knows more of what is not acceptable about samples of our run.
    pub fn judge_if<S: Sample>(
        &mut self,
        sample: &S,
        objection: impl FnOnce(&S) -> Option<Fault>,
    ) -> Verdict {
        let header = sample.header();
        let is_ours = header.run == self.run;
        let is_of_our_arm = self.arm.is_none_or(|arm| arm == (header.joints, header.axes));
        let fault = match fault(sample) {
            fault @ Some(Fault::Version(_) | Fault::Malformed) => fault,
            _ if !is_ours => Some(Fault::Run),
            _ if !is_of_our_arm => Some(Fault::Arm),
            not_finite => objection(sample).or(not_finite),
        };
        if let Some(fault) = fault {
            return self.refuse(fault);
        }
        match self.newest {
            Some(newest) if header.sequence < newest => self.refuse(Fault::Stale),
            Some(newest) if header.sequence == newest => Verdict::Repeated,
            _ => {
                self.newest = Some(header.sequence);
                Verdict::Fresh
            }
        }
    }

    /// How many samples were refused.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// The sequence number of the newest sample that passed.
    pub fn newest(&self) -> Option<u64> {
        self.newest
    }

    /// Counts a sample that is not acceptable for a reason that a gate cannot know.
    pub fn refuse(&mut self, fault: Fault) -> Verdict {
        self.refused += 1;
        Verdict::Refused(fault)
    }
}

/// What is wrong with a sample on its own, whatever run it belongs to.
pub fn fault<S: Sample>(sample: &S) -> Option<Fault> {
    let header = sample.header();
    if header.version != VERSION {
        return Some(Fault::Version(header.version));
    }
    if !sample.is_well_formed() {
        return Some(Fault::Malformed);
    }
    (!sample.is_finite()).then_some(Fault::NotFinite)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{Header, StateSample, TorqueSample};

    #[test]
    fn an_echo_has_at_most_seven_numbers() {
        let header = Header { version: VERSION, joints: 2, axes: 2, ..Header::default() };
        for (echo_count, expected) in [(0, None), (7, None), (8, Some(Fault::Malformed))] {
            let state = StateSample { header, echo_count, ..Default::default() };
            let torque = TorqueSample { header, echo_count, ..Default::default() };
            assert_eq!((fault(&state), fault(&torque)), (expected, expected), "{echo_count}");
        }
    }

    #[test]
    fn the_sentence_on_another_version_names_both() {
        let sample = TorqueSample::default();
        let sentence = fault(&sample).map(Fault::sentence).unwrap_or_default();
        let both = format!("protocol version 0, this program has {VERSION};");
        assert!(sentence.contains(&both), "{sentence}");
    }
}
