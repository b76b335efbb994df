//! How the two ends of a loop that this program starts run in real time.

use clap::Args;
use mtj_model::scenario::Wait;
use mtj_options::RealtimeOptions;
use mtj_protocol::bus::BusError;

/// How the two ends of a loop run in real time
#[derive(Args, Clone, Debug, Default)]
pub struct LoopRealtime {
    /// Real-time priority of plant and controller, 1 to 99 (SCHED_FIFO)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    pub priority: Option<u8>,
    /// The processors on which plant and controller stay, counted from 0
    #[arg(long, value_name = "CORE,CORE", value_parser = two_cores)]
    pub cpu: Option<(usize, usize)>,
    /// Keep the memory of plant and controller from being paged out, and fault it in beforehand
    #[arg(long)]
    pub lock_memory: bool,
}

impl LoopRealtime {
    /// Refuses two ends that spin on one processor: neither would let the other run.
    pub fn check(&self, wait: Wait) -> Result<(), BusError> {
        match self.cpu {
            Some((plant, controller)) if plant == controller && wait == Wait::Spin => {
                let sentence = format!(
                    "--cpu {plant},{controller}: with bus.wait = \"spin\" plant and controller need a \
                     processor each; name two, or choose --wait hybrid"
                );
                Err(BusError::of(sentence, true))
            }
            _ => Ok(()),
        }
    }

    /// What is for the plant.
    pub fn plant(&self) -> RealtimeOptions {
        self.end(self.cpu.map(|(plant, _)| plant))
    }

    /// What is for the controller.
    pub fn controller(&self) -> RealtimeOptions {
        self.end(self.cpu.map(|(_, controller)| controller))
    }

    fn end(&self, cpu: Option<usize>) -> RealtimeOptions {
        RealtimeOptions { priority: self.priority, cpu, lock_memory: self.lock_memory }
    }
}

fn two_cores(text: &str) -> Result<(usize, usize), String> {
    let cores = text.split_once(',').and_then(|(plant, controller)| {
        Some((plant.trim().parse().ok()?, controller.trim().parse().ok()?))
    });
    cores.ok_or_else(|| "two numbers, the plant's core and the controller's, like 0,1".to_owned())
}
