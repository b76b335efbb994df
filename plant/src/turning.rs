//! Wishes to change the running loop, carried out between two samples.

use std::time::{Duration, Instant};

use mtj_model::scenario::Override;
use mtj_protocol::{
    bus::BusError,
    knob::Knob,
    port::Answer,
    sample::{ChangeSample, Header, RequestSample, padded},
};

use crate::{
    agenda::Event,
    link::{Direction, Link},
    plant::Plant,
};

/// How many wishes are dealt with at a time, so that a flood of them does not hold the loop.
const AT_A_TIME: usize = 8;
/// How often to look for wishes while the run stands still.
const GLANCE: Duration = Duration::from_millis(20);

impl Plant<'_> {
    /// Deals with the wishes that have come; they are in effect from the sample at `time_ns` on, which has
    /// not been taken yet.
    pub(crate) fn attend(&mut self, time_ns: u64) -> Result<(), BusError> {
        for _ in 0..AT_A_TIME {
            let Some(request) = self.exchange.request()? else { break };
            let change = match self.knobs.answer_to(request.header.sequence) {
                Some(change) => change,
                None => {
                    let outcome = self.turn(&request, time_ns)?;
                    let header =
                        Header { time_ns, sequence: self.header.sequence + 1, ..self.header };
                    let outcome = outcome.as_ref().map_err(String::as_str).copied();
                    let change = ChangeSample::answer(header, &request, outcome);
                    self.knobs.remember(change);
                    change
                }
            };
            self.exchange.announce(&change)?;
        }
        Ok(())
    }

    /// Turns a knob; a reason, if it cannot be turned.
    fn turn(
        &mut self,
        request: &RequestSample,
        time_ns: u64,
    ) -> Result<Result<(), String>, BusError> {
        match Knob::of(request) {
            Err(reason) => return Ok(Err(reason)),
            Ok(Knob::Set(sets)) => return self.set(&sets),
            Ok(Knob::Pause) => self.knobs.is_paused = true,
            Ok(Knob::Resume) => self.knobs.is_paused = false,
            Ok(Knob::Reset) => self.knobs.is_reset = true,
            Ok(Knob::Kick { torque, milliseconds }) => {
                self.advance(time_ns);
                self.knobs.kicks += 1;
                self.simulator.disturb(padded(&torque));
                let end = time_ns + (milliseconds * 1e6).round() as u64;
                self.agenda.push(end, Event::Calm(self.knobs.kicks));
            }
        }
        Ok(Ok(()))
    }

    /// Takes on the scenario with some keys set anew.
    fn set(&mut self, sets: &[String]) -> Result<Result<(), String>, BusError> {
        let sets: Result<Vec<Override>, _> = sets.iter().map(|set| set.parse()).collect();
        let changed = sets.and_then(|sets| self.scenario.changed(&sets));
        let scenario = match changed {
            Ok(scenario) => scenario,
            Err(error) => return Ok(Err(error.to_string())),
        };
        let (links, seed) = (&scenario.link, scenario.seed);
        let link = |now, before, direction, link: &Link| {
            if now == before { Ok(link.clone()) } else { Link::new(now, direction, seed) }
        };
        let before = &self.scenario.link;
        let state_link = link(&links.state, &before.state, Direction::State, &self.state_link);
        let torque_link = link(&links.torque, &before.torque, Direction::Torque, &self.torque_link);
        match (state_link, torque_link) {
            (Ok(state_link), Ok(torque_link)) => {
                (self.state_link, self.torque_link) = (state_link, torque_link);
            }
            (Err(error), _) | (_, Err(error)) => return Ok(Err(error.to_string())),
        }
        self.sensor.set_noise(scenario.noise);
        self.actuator.adopt(&scenario);
        self.header.revision += 1;
        // Offered before the first sample of this revision, so whoever hears that sample can fetch it.
        self.exchange.renew(&scenario, self.header.revision)?;
        self.scenario = scenario;
        Ok(Ok(()))
    }

    /// Lets the run's time stand still at `time_ns` until it is to go on.
    pub(crate) fn stand_still(&mut self, time_ns: u64) -> Result<(), BusError> {
        let paused = Instant::now();
        while self.knobs.is_paused && !self.knobs.is_reset {
            // What is still under way to us was asked for before.
            if self.exchange.receive(Instant::now() + GLANCE)? == Some(Answer::Torque)
                && self.is_realtime()
            {
                self.note_answer();
                self.schedule(time_ns);
            }
            if !(self.proceed)() {
                self.stopped = true;
                break;
            }
            self.report_status(3)?;
            self.attend(time_ns)?;
        }
        self.clock.stood_still(paused.elapsed());
        self.next_status_ns = time_ns;
        Ok(())
    }

    /// The end of a kick, unless a newer one has begun.
    pub(crate) fn calm(&mut self, kick: u64) {
        if kick == self.knobs.kicks {
            self.simulator.disturb([0.0; _]);
        }
    }
}
