//! Admission of samples: what a port has accepted needs no more checks behind it.

use mtj_model::scenario::Scenario;

use crate::sample::{Sample, VERSION};

/// Whether a filter admits a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// Newer than every sample before it.
    Fresh,
    /// The newest sample once more.
    Repeated,
    /// Not acceptable.
    Rejected(Rejection),
}

/// Why a sample is not acceptable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// A program with this other protocol version wrote it.
    #[error(
        "it has protocol version {0}, this program has {VERSION}; run the same version of mtj in \
         the whole session"
    )]
    Version(u32),
    /// Counts out of range.
    #[error("it is not a sample")]
    Malformed,
    /// From another incarnation of the plant, or for one.
    #[error("it belongs to another run of the plant")]
    Run,
    /// About an arm with another number of joints or task axes.
    #[error("it is about an arm with another number of joints or a task with other axes")]
    Arm,
    /// A number is infinite or not a number.
    #[error("it holds a number that is not finite")]
    NotFinite,
    /// Older than the newest sample.
    #[error("it is older than the newest one")]
    Stale,
    /// The newest sample once more, without a repeated state that asks for it.
    #[error("it is a duplicate")]
    Duplicate,
    /// The answer to a state that was not sent.
    #[error("it answers a state that was not sent")]
    Unasked,
    /// The answer does not return what was sent with its state.
    #[error(
        "it does not return the time_ns, revision and sent_ns of the state that it answers, as \
         docs/wire.md asks for"
    )]
    Echo,
    /// From a controller that is not the leader.
    #[error("it is from a controller that is not the leader")]
    NotLeader,
}

/// Admits the acceptable samples of one run, each later than the one before.
#[derive(Clone, Copy, Debug)]
pub struct AdmissionFilter {
    run: u64,
    /// Numbers of joints and task axes.
    arm: Option<(u32, u32)>,
    newest: Option<u64>,
    rejected: u64,
}

impl AdmissionFilter {
    /// A filter for the samples of `run`.
    pub fn new(run: u64) -> Self {
        Self { run, arm: None, newest: None, rejected: 0 }
    }

    /// Restricts the filter to samples about the arm and the task of a scenario.
    pub fn for_scenario(self, scenario: &Scenario) -> Self {
        let (joints, axes) = (scenario.arm.links.len(), scenario.task.axes.len());
        Self { arm: Some((joints as u32, axes as u32)), ..self }
    }

    /// Checks a sample, counts it if it is rejected, and records the newest sequence number.
    pub fn admit<S: Sample>(&mut self, sample: &S) -> Admission {
        self.admit_if(sample, |_| None)
    }

    /// Like [`Self::admit`], with an additional check of the caller's for samples of this run.
    pub fn admit_if<S: Sample>(
        &mut self,
        sample: &S,
        objection: impl FnOnce(&S) -> Option<Rejection>,
    ) -> Admission {
        let header = sample.header();
        let is_of_run = header.run == self.run;
        let is_of_arm = self.arm.is_none_or(|arm| arm == (header.joints, header.axes));
        let rejection = match check(sample).err() {
            rejection @ Some(Rejection::Version(_) | Rejection::Malformed) => rejection,
            _ if !is_of_run => Some(Rejection::Run),
            _ if !is_of_arm => Some(Rejection::Arm),
            not_finite => objection(sample).or(not_finite),
        };
        if let Some(rejection) = rejection {
            return self.reject(rejection);
        }
        match self.newest {
            Some(newest) if header.sequence < newest => self.reject(Rejection::Stale),
            Some(newest) if header.sequence == newest => Admission::Repeated,
            _ => {
                self.newest = Some(header.sequence);
                Admission::Fresh
            }
        }
    }

    /// How many samples were rejected.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// Counts a sample that the caller rejects for a reason that the filter cannot know.
    pub fn reject(&mut self, rejection: Rejection) -> Admission {
        self.rejected += 1;
        Admission::Rejected(rejection)
    }
}

/// Checks a sample on its own, whatever run it belongs to.
pub fn check<S: Sample>(sample: &S) -> Result<(), Rejection> {
    let header = sample.header();
    if header.version != VERSION {
        Err(Rejection::Version(header.version))
    } else if !sample.is_well_formed() {
        Err(Rejection::Malformed)
    } else if !sample.is_finite() {
        Err(Rejection::NotFinite)
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{Header, StateSample, TorqueSample};

    #[test]
    fn an_echo_has_at_most_seven_numbers() {
        let header = Header { version: VERSION, joints: 2, axes: 2, ..Header::default() };
        for (echo_count, expected) in [(0, Ok(())), (7, Ok(())), (8, Err(Rejection::Malformed))] {
            let state = StateSample { header, echo_count, ..Default::default() };
            let torque = TorqueSample { header, echo_count, ..Default::default() };
            assert_eq!((check(&state), check(&torque)), (expected, expected), "{echo_count}");
        }
    }

    #[test]
    fn the_sentence_on_another_version_names_both() {
        let sentence = check(&TorqueSample::default()).map_err(|error| error.to_string());
        let both = format!("protocol version 0, this program has {VERSION};");
        assert!(sentence.as_ref().is_err_and(|sentence| sentence.contains(&both)), "{sentence:?}");
    }
}
