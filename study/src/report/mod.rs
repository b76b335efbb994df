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

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use mtj_figure::Written;

use self::layout::Layout;
use crate::{
    error::StudyError,
    sweep::{plan::Plan, results},
};

/// The files of a report.
#[derive(Debug)]
pub struct Files {
    /// The page.
    pub page: PathBuf,
    /// The figures.
    pub figures: Vec<Written>,
}

/// Reads a study's folder and writes its report there.
///
/// # Errors
///
/// If the folder has no results, or a file cannot be written.
pub fn write(folder: &Path, proceed: &(dyn Fn() -> bool + Sync)) -> Result<Files, StudyError> {
    let plan = Plan::from_folder(folder)?;
    let rows = results::read(folder, &plan);
    let rows = rows.map_err(|error| StudyError::NoResults(Box::new(error)))?;
    if rows.is_empty() {
        return Err(StudyError::NoRows { folder: folder.to_owned() });
    }
    let layout = Layout::of(&plan);
    let aggregates = aggregate::aggregate(&plan, &layout, &rows);
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
    let drawn = figures::all(&plan, &layout, &aggregates, &limits);
    let figures = drawn
        .iter()
        .map(|(name, svg)| mtj_figure::write(svg, &pictures, name))
        .collect::<Result<_, _>>()?;
    let page = folder.join("report.html");
    let documents = drawn.iter().map(|(_, svg)| svg.as_str());
    fs::write(&page, page::html(&plan, &layout, &aggregates, documents)).map_err(file(&page))?;
    Ok(Files { page, figures })
}
