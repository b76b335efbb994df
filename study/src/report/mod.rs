//! A study's results as figures and as a page.
//!
//! ```text
//! rows of the results ── Aggregates ─┐
//! Plan ── Layout ────────────────────┼── figures ──▶ SVG, PNG ──▶ report.html
//! predicted limits ──────────────────┘
//! ```
//!
//! The page shows the same SVG documents; its script only says what is under the pointer.

mod aggregate;
mod figures;
mod layout;
mod limits;
mod page;
mod winners;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use mtj_figure::Written;

use self::{aggregate::Groups, layout::Layout};
use crate::{
    error::StudyError,
    sweep::{
        plan::Plan,
        results::{self, Failures},
    },
};

/// The files of a report.
#[derive(Debug)]
pub struct Files {
    /// The page.
    pub page: PathBuf,
    /// The figures.
    pub figures: Vec<Written>,
    /// How many points failed, and why; `None` if none did.
    pub failed: Option<String>,
}

/// Reads a study's folder and writes its report there.
///
/// # Errors
///
/// If the folder has no results, if all points failed, or if a file cannot be written.
pub fn write(folder: &Path, proceed: &(dyn Fn() -> bool + Sync)) -> Result<Files, StudyError> {
    let plan = Plan::from_folder(folder)?;
    let rows = results::read(folder, &plan);
    let rows = rows.map_err(|error| StudyError::NoResults(Box::new(error)))?;
    let layout = Layout::of(&plan);
    let (mut groups, mut failures) = (Groups::new(&plan, &layout), Failures::default());
    for row in rows {
        let row = row.map_err(|error| StudyError::NoResults(Box::new(error)))?;
        failures.count_row(&row);
        groups.add(&row);
    }
    let (count, failed) = (groups.count(), failures.count());
    if count == 0 {
        return Err(StudyError::NoRows { folder: folder.to_owned() });
    }
    if failed == count {
        let reason = failures.reason().unwrap_or_default().to_owned();
        return Err(StudyError::AllFailed { count, reason });
    }
    let failed = failures.reason().map(|why| format!("{failed} of {count} points failed: {why}"));
    let aggregates = groups.aggregates();
    let limits = limits::predict(&plan, &layout, proceed)?;
    if !proceed() {
        return Err(StudyError::Stopped("the report was written"));
    }
    let pictures = folder.join("figures");
    let file = |path: &Path| {
        let path = path.to_owned();
        |source: io::Error| StudyError::File { path, source }
    };
    fs::create_dir_all(&pictures).map_err(file(&pictures))?;
    let drawn = figures::all(&plan, &layout, &aggregates, &limits, failed.as_deref());
    let figures = drawn
        .iter()
        .map(|(name, svg)| mtj_figure::write(svg, &pictures, name))
        .collect::<Result<_, _>>()?;
    let page = folder.join("report.html");
    let documents = drawn.iter().map(|(_, svg)| svg.as_str());
    let html = page::html(&plan, &layout, &aggregates, failed.as_deref(), documents);
    fs::write(&page, html).map_err(file(&page))?;
    Ok(Files { page, figures, failed })
}
