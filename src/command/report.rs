//! `mtj study report`: a study's results as a page and as figures.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use clap::Args;
use mtj_figure::Written;
use mtj_protocol::shutdown::Shutdown;
use mtj_study::report;

use crate::failure::Failure;

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
        let files = report::write(&self.folder, &move || shutdown.proceed())?;
        let mut out = io::stdout().lock();
        writeln!(out, "{}", files.page.display())?;
        for Written { svg, png, .. } in &files.figures {
            writeln!(out, "{}  {}", svg.display(), png.display())?;
        }
        if let Some(failed) = files.failed {
            writeln!(out, "{failed}")?;
        }
        Ok(())
    }
}
