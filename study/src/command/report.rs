//! `mtj study report`: a study's results as a page and as figures.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use clap::Args;
use mtj_protocol::shutdown::Shutdown;

use crate::failure::Failure;
use crate::{
    figure::{self, Written},
    report::{cells, figures, layout::Layout, limits, page},
    sweep::{plan::Plan, results},
};

/// Draw a study's results: DIR/report.html, and figures as SVG and PNG beside it
#[derive(Args, Debug)]
pub struct ReportStudy {
    /// Folder that 'mtj study run' or 'mtj study merge' has filled
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

impl ReportStudy {
    /// Writes the page and the figures and says where they are.
    pub fn run(self) -> Result<(), Failure> {
        let shutdown = Shutdown::on_signals();
        let report = write(&self.folder, &move || shutdown.proceed())?;
        println!("{}", report.page.display());
        for Written { svg, png, .. } in report.figures {
            println!("{}  {}", svg.display(), png.display());
        }
        Ok(())
    }
}

/// The files of a report.
#[derive(Debug)]
pub struct Report {
    /// The page.
    pub page: PathBuf,
    /// The figures.
    pub figures: Vec<Written>,
}

/// Reads a study's folder and writes its report there.
pub fn write(folder: &Path, proceed: &(dyn Fn() -> bool + Sync)) -> Result<Report, Failure> {
    let plan = Plan::from_folder(folder)?;
    let rows = results::read(folder, &plan).map_err(|error| {
        Failure::bad_input(format!(
            "no results to report: {error}; 'mtj study run' makes them, 'mtj study merge' joins shards"
        ))
    })?;
    if rows.is_empty() {
        let sentence = format!("{}: the study has no results yet", folder.display());
        return Err(Failure::bad_input(sentence));
    }
    let layout = Layout::of(&plan);
    let cells = cells::gather(&plan, &layout, &rows);
    let limits = limits::predict(&plan, &layout, proceed)?;
    if !proceed() {
        return Err(Failure::from("stopped before the report was written".to_owned()));
    }
    let pictures = folder.join("figures");
    let say = |path: &Path| {
        let path = path.display().to_string();
        move |error: io::Error| Failure::bad_input(format!("{path}: {error}"))
    };
    fs::create_dir_all(&pictures).map_err(say(&pictures))?;
    let figures = figures::all(&plan, &layout, &cells, &limits)
        .iter()
        .map(|(name, svg)| figure::write(svg, &pictures, name))
        .collect::<Result<_, _>>()?;
    let page = folder.join("report.html");
    fs::write(&page, page::html(&plan, &layout, &cells, &limits)).map_err(say(&page))?;
    Ok(Report { page, figures })
}
