//! Figures of `mtj`: described as data, drawn as SVG, rasterised as PNG.
//!
//! | module | draws |
//! |---|---|
//! | [`lines`] | curves over time, each panel with axes of its own |
//! | [`trend`] | curves over the positions of a study |
//! | [`heatmap`] | maps over two axes of a study, with one colour scale |
//! | [`winners`] | maps of which of several is best in each cell |
//!
//! All place title, panels and legend by `layout`, their ticks by `axis`, and write to one
//! `sheet`. A PNG is made of exactly the SVG beside it, with a font that the program carries, so
//! neither depends on what the machine has installed.
//!
//! A line plot:
//!
//! ```
//! use mtj_figure::lines::{Curve, LineFigure, LinePanel, ValueAxis};
//!
//! let times = || (0..=200).map(|i| 0.01 * f64::from(i));
//! let decay = |rate: f64| times().map(move |t| (t, (-rate * t).exp()));
//! let figure = LineFigure {
//!     title: "Decay of an error".to_owned(),
//!     columns: 1,
//!     panel_size: (440.0, 300.0),
//!     panels: vec![LinePanel {
//!         title: "first order".to_owned(),
//!         x: ValueAxis::new("time (s)", 0.0..2.0),
//!         y: ValueAxis::new("error (m)", 0.0..1.0),
//!         curves: vec![Curve::new("1/s", decay(1.0)), Curve::new("5/s", decay(5.0))],
//!     }],
//! };
//! let svg = figure.svg();
//! assert!(svg.starts_with("<svg ") && svg.contains(">time (s)</text>"));
//! let png = mtj_figure::raster::png(&svg)?;
//! assert_eq!(&png[1..4], b"PNG");
//! # Ok::<(), mtj_figure::FigureError>(())
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod axis;
pub mod cells;
mod colormap;
pub mod heatmap;
mod layout;
pub mod lines;
pub mod raster;
mod sheet;
mod style;
mod thin;
pub mod trend;
pub mod winners;

use std::{error::Error, fs, io, path::Path, path::PathBuf};

pub use axis::short;

/// Why a figure could not be made.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The document is not SVG.
    #[error("a figure could not be drawn: {0}")]
    Svg(#[from] resvg::usvg::Error),
    /// The document has no area.
    #[error("a figure could not be drawn: it has no area")]
    NoArea,
    /// The picture could not be compressed.
    #[error("a figure could not be drawn: {0}")]
    Png(#[source] Box<dyn Error + Send + Sync>),
    /// A file could not be written.
    #[error("{} could not be written: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl FigureError {
    /// Whether the user named a place that cannot be written.
    pub fn is_bad_input(&self) -> bool {
        matches!(self, Self::File { .. })
    }
}

/// Where a figure was written.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Written {
    /// The name of the files, without folder and ending.
    pub name: String,
    /// The SVG file.
    pub svg: PathBuf,
    /// The PNG file.
    pub png: PathBuf,
}

/// Writes a document as `folder/name.svg`, and its picture as `folder/name.png`.
///
/// # Errors
///
/// [`FigureError::File`] if a file cannot be written; the others if `svg` is not a document.
pub fn write(svg: &str, folder: &Path, name: &str) -> Result<Written, FigureError> {
    let png = raster::png(svg)?;
    let written = Written {
        name: name.to_owned(),
        svg: folder.join(format!("{name}.svg")),
        png: folder.join(format!("{name}.png")),
    };
    let write = |path: &PathBuf, bytes: &[u8]| {
        fs::write(path, bytes).map_err(|source| FigureError::File { path: path.clone(), source })
    };
    write(&written.svg, svg.as_bytes())?;
    write(&written.png, &png)?;
    Ok(written)
}
