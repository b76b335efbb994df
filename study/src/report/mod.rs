//! A study's results as figures and as a page.
//!
//! ```text
//! Plan ── Layout ─┐
//! rows ── Cells ──┼── figures ──▶ SVG, PNG
//! limits ─────────┴── page ─────▶ report.html
//! ```

mod cells;
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
pub fn write(folder: &Path, proceed: &(dyn Fn() -> bool + Sync)) -> Result<Files, StudyError> {
    let plan = Plan::from_folder(folder)?;
    let rows =
        results::read(folder, &plan).map_err(|error| StudyError::NoResults(Box::new(error)))?;
    if rows.is_empty() {
        return Err(StudyError::NoRows { folder: folder.to_owned() });
    }
    let layout = Layout::of(&plan);
    let cells = cells::gather(&plan, &layout, &rows);
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
    let figures = figures::all(&plan, &layout, &cells, &limits)
        .iter()
        .map(|(name, svg)| mtj_figure::write(svg, &pictures, name))
        .collect::<Result<_, _>>()?;
    let page = folder.join("report.html");
    fs::write(&page, page::html(&plan, &layout, &cells, &limits)).map_err(file(&page))?;
    Ok(Files { page, figures })
}
