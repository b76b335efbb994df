//! `mtj up`: the loop in three processes, in real time, with a live view.

use std::io::{self, Write};

use clap::Args;
use mtj_model::scenario::BusKind;

use super::run::launch_roles;
use crate::{
    failure::Failure,
    launcher::{Launch, Show},
    options::{audience::AudienceOptions, realtime::LoopRealtime, scenario::ScenarioOptions},
};

/// Start plant, controller and monitor in real time, with a live view; Ctrl-C ends all three
#[derive(Args, Debug)]
pub struct Up {
    #[command(flatten)]
    scenario: ScenarioOptions,
    #[command(flatten)]
    audience: AudienceOptions,
    #[command(flatten)]
    realtime: LoopRealtime,
    /// Without the dashboard in a browser
    #[arg(long, conflicts_with_all = ["web", "open"])]
    no_web: bool,
}

/// How long the demonstration goes on unless the user sets a duration.
const UNTIL_STOPPED: &str = "duration=365 d";

impl Up {
    /// Runs until Ctrl-C, or for the duration that was set.
    pub fn run(mut self) -> Result<(), Failure> {
        let set = &mut self.scenario.set;
        let sets =
            |set: &[String], key: &str| set.iter().any(|text| text.trim_start().starts_with(key));
        if !sets(set, "duration") {
            set.push(UNTIL_STOPPED.to_owned());
        }
        if !sets(set, "timing.clock") {
            set.push("timing.clock=realtime".to_owned());
        }
        let mut scenario = self.scenario.load()?;
        if scenario.bus.kind == BusKind::Local {
            // Three processes need a bus between them.
            self.scenario.bus.session.bus = Some(BusKind::Iceoryx2.name().to_owned());
            scenario = self.scenario.load()?;
        }
        let greeting = format!(
            "mtj up: {} under {} over {}, T_s = {:?}; Ctrl-C ends it, 'mtj set KEY=VALUE' changes it",
            scenario.name,
            scenario.law.law.description().name,
            scenario.bus.kind.name(),
            scenario.timing.sample_period
        );
        // Where `mtj set` and further monitors look without being told.
        let bus = &mut self.scenario.bus;
        bus.session.session.get_or_insert_with(|| scenario.bus.session.clone());
        if scenario.bus.kind == BusKind::Zenoh && scenario.bus.config.is_none() {
            bus.listen = scenario.bus.listen_endpoints().into_iter().next();
        }
        if !self.no_web {
            self.audience.web = self.audience.web.wanted();
        }
        let monitor = Some(Show { greeting, arguments: self.audience.arguments() });
        let launch = Launch {
            options: self.scenario,
            keeps_open: true,
            trace: None,
            monitor,
            realtime: self.realtime,
        };
        let report = launch_roles(launch, &scenario)?;
        Ok(write!(io::stdout(), "{report}")?)
    }
}
