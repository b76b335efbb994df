//! An exchange without a bus: the controller is a function.

use std::{fmt, time::Instant};

use mtj_protocol::{
    admission::{Admission, AdmissionFilter, Rejection},
    bus::BusError,
    port::{Answer, Exchange},
    sample::{StateSample, StatusSample, TorqueSample},
};

/// Calls a function for each state and hands its result back as the answer, through the same
/// admission as any other torque.
pub struct Direct<F> {
    respond: F,
    filter: AdmissionFilter,
    torque: TorqueSample,
    answer: Option<Answer>,
}

impl<F> fmt::Debug for Direct<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Direct").field("torque", &self.torque).finish_non_exhaustive()
    }
}

impl<E, F> Direct<F>
where
    E: Into<Box<dyn std::error::Error + Send + Sync>>,
    F: FnMut(&StateSample) -> Result<TorqueSample, E>,
{
    /// An exchange with `respond` for one `run`.
    pub fn new(run: u64, respond: F) -> Self {
        Self {
            respond,
            filter: AdmissionFilter::new(run),
            torque: TorqueSample::default(),
            answer: None,
        }
    }
}

impl<E, F> Exchange for Direct<F>
where
    E: Into<Box<dyn std::error::Error + Send + Sync>>,
    F: FnMut(&StateSample) -> Result<TorqueSample, E>,
{
    fn send(&mut self, state: &mut StateSample) -> Result<(), BusError> {
        self.torque = (self.respond)(state).map_err(|error| BusError::Controller(error.into()))?;
        self.answer = match self.filter.admit(&self.torque) {
            Admission::Fresh => Some(Answer::Torque),
            Admission::Rejected(Rejection::NotFinite) => Some(Answer::NotFinite),
            Admission::Repeated | Admission::Rejected(_) => None,
        };
        Ok(())
    }

    fn receive(&mut self, _until: Instant) -> Result<Option<Answer>, BusError> {
        Ok(self.answer.take())
    }

    fn torque(&self) -> &TorqueSample {
        &self.torque
    }

    fn report(&mut self, _status: &StatusSample) -> Result<(), BusError> {
        Ok(())
    }

    fn rejected(&self) -> u64 {
        self.filter.rejected()
    }
}
