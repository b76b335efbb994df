//! The controller that answers once more.

use mtj_controller::Controller;
use mtj_model::scenario::{Override, Scenario, ScenarioError};
use mtj_protocol::{
    port::Offered,
    sample::{Header, TorqueSample},
};

use super::{
    ReplayError,
    findings::{Findings, Instant},
    pairs::Pair,
};

/// Follows a recorded run with a controller of its own.
pub(crate) struct ReplayController<'a> {
    set: &'a [Override],
    /// Run, revision and scenario, of the newest run and of the one that is answered.
    scenarios: Vec<(u64, u32, Scenario)>,
    run_state: Option<RunState>,
}

struct RunState {
    run: u64,
    revision: u32,
    controller: Controller,
    /// The number of the recorded one.
    recorded: u64,
    /// Some of what the recorded controller remembers is not known yet.
    is_joining: bool,
}

impl<'a> ReplayController<'a> {
    /// Answers as the recorded scenarios say, with `set` laid over them.
    pub(crate) fn new(set: &'a [Override]) -> Self {
        Self { set, scenarios: Vec::new(), run_state: None }
    }

    /// Adds a scenario, to which later states belong.
    pub(crate) fn learn(&mut self, offered: &Offered) -> Result<(), ScenarioError> {
        let Offered { run, revision, scenario } = offered;
        let scenario = Scenario::parse(&scenario.name, scenario.text(), self.set)?;
        // Answers of the run before may still come.
        let before = self.run_state.as_ref().map(|part| part.run);
        self.scenarios.retain(|(known, ..)| known == run || Some(*known) == before);
        self.scenarios.push((*run, *revision, scenario));
        Ok(())
    }

    /// Whether it has the scenario of a sample.
    pub(crate) fn knows(&self, header: &Header) -> bool {
        scenario_of(&self.scenarios, header).is_some()
    }

    /// Answers a state and compares the answer with the recorded one.
    pub(crate) fn answer(
        &mut self,
        pair: &Pair,
        findings: &mut Findings,
    ) -> Result<(), ReplayError> {
        let Pair { state, torque, after_gap } = pair;
        let refuse = |source| ReplayError::Law { at: Instant::of(&state.header), source };
        let Some((revision, scenario)) = scenario_of(&self.scenarios, &state.header) else {
            findings.without_scenario += 1;
            self.run_state = None;
            return Ok(());
        };
        let is_new = self.run_state.as_ref().is_none_or(|part| part.run != state.header.run);
        let part = self.run_state.get_or_insert_with(|| RunState::new(torque, revision, scenario));
        if is_new {
            *part = RunState::new(torque, revision, scenario);
        } else if part.revision != revision {
            part.revision = revision;
            part.controller.reconfigure(scenario);
        }
        if !is_new && part.recorded != torque.controller {
            // Whether it had been standing by or had just started shows only now.
            findings.takeovers += 1;
            part.recorded = torque.controller;
            part.is_joining = true;
        }
        part.is_joining |= after_gap;
        if part.is_joining {
            part.controller.resume_from(state, torque).map_err(refuse)?;
            // What is latched at the beginning of a memory step lasts until the next.
            let step = scenario.law.memory.step.as_nanos() as u64;
            let period = scenario.timing.sample_period.as_nanos() as u64;
            part.is_joining = state.header.time_ns % step >= period;
            findings.joined += 1;
            return Ok(());
        }
        let answer = part.controller.respond(state).map_err(refuse)?;
        findings.compare(torque, answer, is_same(answer, torque));
        Ok(())
    }
}

impl RunState {
    fn new(torque: &TorqueSample, revision: u32, scenario: &Scenario) -> Self {
        Self {
            run: torque.header.run,
            revision,
            controller: Controller::new(scenario),
            recorded: torque.controller,
            is_joining: torque.header.sequence > 0,
        }
    }
}

/// The scenario of a state: the next one known if its own is not, as in the roles.
fn scenario_of<'s>(
    scenarios: &'s [(u64, u32, Scenario)],
    header: &Header,
) -> Option<(u32, &'s Scenario)> {
    scenarios
        .iter()
        .filter(|(run, revision, _)| *run == header.run && *revision >= header.revision)
        .min_by_key(|(_, revision, _)| *revision)
        .map(|(_, revision, scenario)| (*revision, scenario))
}

/// To the last bit.
fn is_same(answer: &TorqueSample, recorded: &TorqueSample) -> bool {
    answer.torque.map(f64::to_bits) == recorded.torque.map(f64::to_bits)
}
