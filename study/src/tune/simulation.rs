//! Many simulations at once: in lanes, on all cores.

use std::{
    num::NonZero,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use mtj_model::scenario::Scenario;
use mtj_plant::report::Report;

use crate::sweep::lanes;

/// How many simulations a thread takes at a time: enough to fill its lanes.
const CHUNK: usize = 16;

/// The reports of scenarios; `None` for one that cannot be run, or was not when `proceed` returned
/// false.
pub(crate) fn reports(
    scenarios: &[Scenario],
    proceed: &(dyn Fn() -> bool + Sync),
) -> Vec<Option<Report>> {
    let next = AtomicUsize::new(0);
    let reports = Mutex::new(vec![None; scenarios.len()]);
    let work = || {
        while proceed() {
            let first = next.fetch_add(CHUNK, Ordering::Relaxed);
            let last = scenarios.len().min(first + CHUNK);
            let Some(chunk) = scenarios.get(first..last).filter(|chunk| !chunk.is_empty()) else {
                break;
            };
            lanes::measure(chunk, proceed, &mut |number, measured| {
                let mut reports = reports.lock().unwrap_or_else(PoisonError::into_inner);
                reports[first + number] = measured.ok();
            });
        }
    };
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    thread::scope(|scope| {
        for _ in 0..cores.min(scenarios.len().div_ceil(CHUNK)) {
            scope.spawn(work);
        }
    });
    reports.into_inner().unwrap_or_else(PoisonError::into_inner)
}
