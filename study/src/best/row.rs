//! A row of results with the best gains of a point.

use super::{Best, Found};
use crate::{
    error::StudyError,
    sweep::{
        plan::Plan,
        results::{self, ResultRow},
    },
};

/// A point's row.
pub(crate) fn row(
    plan: &Plan,
    best: &Best,
    point: usize,
    found: Result<Found, StudyError>,
) -> ResultRow {
    match found {
        Err(error) => {
            let blank = vec![String::new(); best.columns().len()];
            results::row_with(plan, point, Some(&Err(error)), blank)
        }
        Ok(found) => {
            let fields = fields(best, &found);
            results::row_with(plan, point, found.report.map(Ok).as_ref(), fields)
        }
    }
}

fn fields(best: &Best, found: &Found) -> Vec<String> {
    let mut fields = vec![
        found.limit.to_string(),
        found.margin_rms_error_m.map(|error| error.to_string()).unwrap_or_default(),
    ];
    fields.extend(best.keys().into_iter().map(|key| {
        let gain = found.gains.iter().find(|gain| gain.path() == key);
        let text = gain.map(ToString::to_string).unwrap_or_default();
        text.split_once('=').map_or(String::new(), |(_, value)| value.to_owned())
    }));
    fields.push(found.command.clone());
    fields
}
