//! Computes the points of a study.

use std::{
    sync::{
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc,
    },
    thread,
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};
use mtj_model::scenario::ScenarioError;

use super::{
    plan::Plan,
    results::{self, Measured, Results, Row, Shard},
};
use crate::{experiment, session::Session};

/// Computes the points of a shard that have no row yet, in this process, on `threads` threads.
/// Returns whether all are there.
pub fn run_in_process(
    plan: &Plan,
    results: &mut Results,
    shard: Shard,
    threads: usize,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<bool, String> {
    let todo = todo(plan, results, shard);
    let bar = progress(plan, results, &todo);
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let (send, receive) = mpsc::sync_channel::<Row>(1024);
    let outcome = thread::scope(|scope| {
        for _ in 0..threads {
            let (todo, next, failed, send) = (&todo, &next, &failed, send.clone());
            scope.spawn(move || {
                let go_on = || proceed() && !failed.load(Ordering::Relaxed);
                while go_on() {
                    let Some(point) = todo.get(next.fetch_add(1, Ordering::Relaxed)) else { break };
                    let Some(measured) = measure(plan, *point, &go_on) else { break };
                    if send.send(results::row(plan, *point, &measured)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(send);
        for row in &receive {
            if let Err(error) = results.push(row) {
                failed.store(true, Ordering::Relaxed);
                // The others may be waiting to hand in theirs.
                for _ in &receive {}
                return Err(error);
            }
            bar.inc(1);
        }
        Ok(())
    });
    bar.abandon();
    outcome?;
    Ok(todo.iter().all(|point| results.has(*point)))
}

/// Computes the points of a shard that have no row yet over a real bus, one after the other.
pub fn run_over_bus(
    plan: &Plan,
    results: &mut Results,
    shard: Shard,
    session: &mut Session,
    proceed: &dyn Fn() -> bool,
) -> Result<bool, String> {
    let todo = todo(plan, results, shard);
    let bar = progress(plan, results, &todo);
    for point in &todo {
        let measured = match plan.scenario(*point) {
            Err(error) => Err(error.to_string()),
            Ok(scenario) => match session.run(&scenario, proceed) {
                Ok(Some(outcome)) => Ok(outcome.report),
                Ok(None) => break,
                Err(error) => Err(error.to_string()),
            },
        };
        results.push(results::row(plan, *point, &measured))?;
        bar.inc(1);
    }
    bar.abandon();
    Ok(todo.iter().all(|point| results.has(*point)))
}

/// One point in lockstep in this thread; `None` if it was interrupted.
pub fn measure(plan: &Plan, point: usize, proceed: &dyn Fn() -> bool) -> Option<Measured> {
    let scenario = match plan.scenario(point) {
        Ok(scenario) => scenario,
        Err(error) => return Some(Err(ScenarioError::to_string(&error))),
    };
    match experiment::run_direct(&scenario, false, proceed) {
        Ok(outcome) if outcome.interrupted => None,
        Ok(outcome) => Some(Ok(outcome.report)),
        Err(error) => Some(Err(error.to_string())),
    }
}

fn todo(plan: &Plan, results: &Results, shard: Shard) -> Vec<usize> {
    (0..plan.len()).filter(|point| shard.has(*point) && !results.has(*point)).collect()
}

fn progress(plan: &Plan, results: &Results, todo: &[usize]) -> ProgressBar {
    let bar = ProgressBar::new((results.len() + todo.len()) as u64);
    let template = "{prefix} {wide_bar} {pos}/{len} points, {per_sec}, {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_prefix(plan.name.clone());
    bar.inc(results.len() as u64);
    bar.reset_eta();
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}
