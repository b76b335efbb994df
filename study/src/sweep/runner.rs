//! Computes the points of a study.

use std::{
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread,
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};
use mtj_model::scenario::Scenario;
use mtj_plant::plant::Outcome;

use super::{
    lanes,
    plan::Plan,
    points::PointSet,
    results::{self, Measured, ResultRow, Results, Shard},
};
use crate::{best, error::StudyError};

/// The points that a thread takes at a time: enough to fill its lanes many times, and few enough
/// that the threads end together.
const CHUNK: std::ops::RangeInclusive<usize> = 16..=512;

/// The same where gains are searched: a point is some hundred runs.
const SEARCHED: std::ops::RangeInclusive<usize> = 1..=16;

/// Computes the points of a shard that have no row yet, in this process, on `threads` threads; in
/// [`lanes`] where `timing.integration_step` is "auto". Returns whether all are there.
pub fn run_in_process(
    plan: &Plan,
    results: &mut Results,
    shard: Shard,
    threads: usize,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<bool, StudyError> {
    let todo = Todo::of(plan, results, shard);
    let bar = progress(plan, results, &todo);
    let in_lanes = |point| plan.scenario(point).is_ok_and(|s| s.timing.tolerance.is_some());
    let (fewest, most) = match plan.best {
        Some(_) => (*SEARCHED.start(), *SEARCHED.end()),
        None if todo.points().next().is_some_and(in_lanes) => (*CHUNK.start(), *CHUNK.end()),
        None => (1, *CHUNK.end()),
    };
    let chunk = (todo.count / (4 * threads)).clamp(fewest, most);
    let points = Mutex::new(todo.points());
    let next = || -> Vec<usize> {
        points.lock().unwrap_or_else(PoisonError::into_inner).by_ref().take(chunk).collect()
    };
    let failed = AtomicBool::new(false);
    let (send, receive) = mpsc::sync_channel::<ResultRow>(1024);
    let outcome = thread::scope(|scope| {
        for _ in 0..threads {
            let (next, failed, send) = (&next, &failed, send.clone());
            scope.spawn(move || {
                let go_on = || proceed() && !failed.load(Ordering::Relaxed);
                while go_on() {
                    let some = next();
                    if some.is_empty() {
                        break;
                    }
                    rows(plan, &some, &go_on, &mut |row| {
                        if send.send(row).is_err() {
                            failed.store(true, Ordering::Relaxed);
                        }
                    });
                }
            });
        }
        drop(send);
        for row in &receive {
            if let Err(error) = results.push(&row) {
                failed.store(true, Ordering::Relaxed);
                // The others may be waiting to send theirs.
                for _ in &receive {}
                return Err(error);
            }
            bar.inc(1);
        }
        Ok(())
    });
    bar.abandon();
    outcome?;
    Ok(todo.is_done(results))
}

/// Computes the points of a shard that have no row yet, one after the other, by `run`: over a real
/// bus. `run` returns nothing if it was asked to stop.
pub fn run_one_by_one(
    plan: &Plan,
    results: &mut Results,
    shard: Shard,
    run: &mut dyn FnMut(&Scenario) -> Result<Option<Outcome>, StudyError>,
) -> Result<bool, StudyError> {
    let todo = Todo::of(plan, results, shard);
    let bar = progress(plan, results, &todo);
    for point in todo.points() {
        let measured = match plan.scenario(point) {
            Err(error) => Err(error.into()),
            Ok(scenario) => match run(&scenario) {
                Ok(Some(outcome)) => Ok(outcome.report),
                Ok(None) => break,
                Err(error) => Err(error),
            },
        };
        results.push(&results::row(plan, point, &measured))?;
        bar.inc(1);
    }
    bar.abandon();
    Ok(todo.is_done(results))
}

/// The rows of some points, computed in this thread.
fn rows(
    plan: &Plan,
    points: &[usize],
    proceed: &dyn Fn() -> bool,
    on_row: &mut dyn FnMut(ResultRow),
) {
    match &plan.best {
        None => measure(plan, points, proceed, &mut |point, measured| {
            on_row(results::row(plan, point, &measured));
        }),
        Some(best) => best::measure(plan, best, points, proceed, &mut |point, found| {
            on_row(best::row(plan, best, point, found));
        }),
    }
}

/// Some points in this thread, in lanes or not as [`lanes::shape`] has it; `on_result` takes each
/// as it comes.
pub fn measure(
    plan: &Plan,
    points: &[usize],
    proceed: &dyn Fn() -> bool,
    on_result: &mut dyn FnMut(usize, Measured),
) {
    let (mut numbers, mut scenarios) = (Vec::new(), Vec::new());
    for point in points {
        match plan.scenario(*point) {
            Ok(scenario) => {
                numbers.push(*point);
                scenarios.push(scenario);
            }
            Err(error) => on_result(*point, Err(error.into())),
        }
    }
    lanes::measure(&scenarios, proceed, &mut |number, measured| {
        on_result(numbers[number], measured);
    });
}

/// The points of a shard that have no row yet.
struct Todo {
    shard: Shard,
    /// How many points the study has.
    all: usize,
    done: PointSet,
    count: usize,
}

impl Todo {
    fn of(plan: &Plan, results: &Results, shard: Shard) -> Self {
        let (all, done) = (plan.len(), results.done().clone());
        Self { shard, all, count: shard.points(all).len() - done.len(), done }
    }

    fn points(&self) -> impl Iterator<Item = usize> {
        self.shard.points(self.all).filter(|point| !self.done.has(*point))
    }

    /// Whether all of them have their row now.
    fn is_done(&self, results: &Results) -> bool {
        results.len() == self.done.len() + self.count
    }
}

fn progress(plan: &Plan, results: &Results, todo: &Todo) -> ProgressBar {
    let bar = ProgressBar::new((results.len() + todo.count) as u64);
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
