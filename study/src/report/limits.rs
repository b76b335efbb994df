//! The predicted largest latency, for each panel and sample period.

use std::{
    num::NonZero,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use super::{aggregate, layout::Layout};
use crate::{error::StudyError, predict, sweep::plan::Plan};

/// For each panel and position on the horizontal axis the limit, s; `None` where the loop is not
/// stable even without latency, or where the limit lies well above the map.
pub(crate) type Limits = Vec<Vec<Option<f64>>>;

/// Predicts, on all cores; nothing if the study has no latency over the sample period.
pub(crate) fn predict(
    plan: &Plan,
    layout: &Layout,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Limits, StudyError> {
    if !layout.has_limits(plan) {
        return Ok(Limits::new());
    }
    let panels = layout.combinations(plan);
    let columns = plan.axes[layout.x].positions.len();
    // A little beyond the map: long delays make large matrices.
    let latencies = layout.y.map_or(&[][..], |y| &plan.axes[y].positions);
    let top = latencies.iter().filter_map(|position| position.number).fold(0.0, f64::max);
    let most = (1.25 * top).min(predict::MOST);
    let next = AtomicUsize::new(0);
    let limits = Mutex::new(vec![vec![None; columns]; panels.len()]);
    let work = || -> Result<(), StudyError> {
        while proceed() {
            let task = next.fetch_add(1, Ordering::Relaxed);
            let Some((panel, _)) = panels.get(task / columns) else { break };
            let mut at = vec![0; plan.axes.len()];
            for (axis, position) in layout.panels.iter().zip(panel) {
                at[*axis] = *position;
            }
            at[layout.x] = task % columns;
            let scenario = plan.scenario(aggregate::point(plan, &at))?;
            let limit = predict::predict_up_to(&scenario, most, proceed)?.latency;
            let limit = limit.filter(|limit| *limit < most);
            let mut limits = limits.lock().unwrap_or_else(PoisonError::into_inner);
            limits[task / columns][task % columns] = limit;
        }
        Ok(())
    };
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .try_for_each(|worker| worker.join().unwrap_or(Err(StudyError::Panicked)))
    })?;
    Ok(limits.into_inner().unwrap_or_else(PoisonError::into_inner))
}
