//! Close a robot's control loop over a bus, and study what sample period and latency do to it.
//!
//! A **plant** moves an arm and takes samples of its state. A **controller** answers each with a
//! torque. Samples travel over a **bus**: a function call, shared memory, or a network. How old a
//! torque is when it acts, and what a law remembers of its previous one, decides how well the arm
//! follows its path. This crate is the command `mtj` as a library: the same loops, laws, memories
//! and studies, from Rust.
//!
//! # A first loop
//!
//! A [`Scenario`] is one experiment as data: arm, desired motion, law, links, clock. It is a
//! built-in name or a TOML file, with any key changed. [`run`] runs it in this process:
//!
//! ```
//! use mtj::{Scenario, run};
//!
//! let sent = Scenario::load("sampled/mtj", &["timing.clock=lockstep".parse()?])?;
//! let late = sent.changed(&["link.torque.latency=1ms".parse()?])?;
//! let error = |scenario| Ok::<_, mtj::PlantError>(run(scenario)?.report.rms_error_m.unwrap());
//!
//! // A millisecond of latency costs eq. (16), which remembers what it sent, a factor of ten.
//! assert!(error(&late)? > 9.0 * error(&sent)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! In `lockstep` time is virtual, and one scenario gives one trajectory bit for bit, on every bus.
//! In `realtime` samples are taken on deadlines, and answers arrive when they arrive.
//!
//! # Memories
//!
//! MTJ adds k times the previous command to a PD law in task space, eq. (16). *Which* previous
//! command is the **memory policy**: what the controller `sent`, what was `applied` when the sample
//! was taken, or what was `delivered` on the mean since the last one. Eq. (11) adds an acceleration
//! term, and **prediction** aims at the instant at which the torque takes effect:
//!
//! ```
//! # use mtj::{Scenario, run};
//! # let scenario = Scenario::load("sampled/mtj", &["timing.clock=lockstep".parse()?])?;
//! let late = scenario.changed(&["link.torque.latency=1ms".parse()?])?;
//! let mut errors = Vec::new();
//! for remedy in [
//!     "law.memory.policy=sent",
//!     "law.memory.policy=delivered",
//!     "law.acceleration=true", // eq. (11)
//! ] {
//!     errors.push(run(&late.changed(&[remedy.parse()?])?)?.report.rms_error_m.unwrap());
//! }
//! assert!(errors[0] > errors[1] && errors[1] > errors[2]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A law, an engine, a bus of your own
//!
//! | what | trait | how to write one | how to run it |
//! |---|---|---|---|
//! | a law | [`model::law::Equation`] | [`model::law`] | [`Controller::with_law`], then [`run_with`] |
//! | an engine, what the torques move | [`plant::engine::Engine`] | [`plant::engine`] | [`run_with`] |
//! | an arm | [`model::arm::Arm`] | [`model::arm`] | in laws and responders, which are generic over it |
//! | a task, what of the tip is controlled | [`model::task::Task`] | [`model::task`] | the same |
//! | a bus | [`protocol::bus::Bus`] | [`protocol::bus`] | [`controller::serve::serve()`] at one end, a [`PlantPort`] at the other |
//!
//! [`PlantPort`]: protocol::port::PlantPort
//!
//! # Over a bus, and between machines
//!
//! The ends of a loop on a bus are [`plant::plant::run`] and [`controller::serve::serve()`]; the
//! bus is [`protocol::transport::AnyBus`], as the scenario's table `bus` says: iceoryx2 on one
//! machine, Zenoh between machines. The example `05_two_machines` is both ends in one page.
//!
//! # Studies
//!
//! A [`Plan`] is a scenario and axes; [`study::sweep`] computes its points side by side in the
//! lanes of the processor's vectors, [`study::report`] draws the results. [`study::predict`] says
//! how much latency a loop should stand, [`study::tune`] proposes gains, [`study::best`] compares laws,
//! each with its best gains.
//!
//! # Examples
//!
//! Numbered, in `examples/`; `docs/library.md` shows what each prints and draws.
//!
//! | `cargo run --release --example …` | |
//! |---|---|
//! | `01_loop` | a loop in ten lines |
//! | `02_latency_and_memories` | what a memory makes of latency |
//! | `03_own_law` | a law of your own beside the built-in ones |
//! | `04_own_engine` | joints with friction that no model knows |
//! | `05_two_machines` | plant and controller in two processes, over Zenoh |
//! | `06_study` | a map over sample period and latency |
//!
//! # Crates
//!
//! Each module here is a crate of its own; a program that needs only the mathematics uses
//! `mtj-model`, which has neither clock nor network.

#![warn(clippy::print_stderr, clippy::print_stdout)]

pub use mtj_controller as controller;
pub use mtj_figure as figure;
pub use mtj_model as model;
pub use mtj_monitor as monitor;
pub use mtj_plant as plant;
pub use mtj_protocol as protocol;
pub use mtj_study as study;

pub use mtj_controller::Controller;
pub use mtj_model::scenario::{Override, Scenario, ScenarioError};
pub use mtj_plant::{
    engine::{Engine, engine},
    error::PlantError,
    plant::Outcome,
    report::Report,
};
pub use mtj_study::{StudyError, sweep::plan::Plan};

/// Runs a scenario in this process, with a trace: by plain calls in lockstep, in two threads over
/// the local bus in real time.
///
/// # Errors
///
/// A link that cannot be emulated, or a law that cannot answer.
pub fn run(scenario: &Scenario) -> Result<Outcome, PlantError> {
    mtj_study::experiment::run(
        &here(scenario)?,
        plant::plant::Watch { trace: true, ..Default::default() },
        &|| true,
    )
}

/// The scenario on the bus that a run within this process has.
fn here(scenario: &Scenario) -> Result<Scenario, ScenarioError> {
    let local = Override::text("bus.kind", "local");
    Scenario::parse(&scenario.name, scenario.text(), &[local])
}

/// Runs a scenario in lockstep in this process, with a trace, with a controller or an engine of
/// your own.
///
/// [`Controller::new`] and [`engine`] are those that the scenario names.
///
/// # Errors
///
/// A link that cannot be emulated, or a law that cannot answer.
///
/// # Examples
///
/// ```
/// use mtj::{Controller, Scenario, engine, run, run_with};
///
/// let scenario = Scenario::load("sampled/mtj", &["timing.clock=lockstep".parse()?])?;
/// let by_hand = run_with(&scenario, Controller::new(&scenario), engine(&scenario))?;
/// assert_eq!(by_hand.trace, run(&scenario)?.trace);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run_with(
    scenario: &Scenario,
    controller: Controller,
    engine: Box<dyn Engine>,
) -> Result<Outcome, PlantError> {
    mtj_study::experiment::run_with(&here(scenario)?, controller, engine, true, &|| true)
}
