//! Figures of line panels, heat maps and trends: described as data, drawn as SVG, rasterised as PNG.
//!
//! ```text
//! Figure { panels } ── svg() ──▶ text ── raster::png() ──▶ bytes
//! ```
//!
//! A PNG is made of exactly the SVG beside it, with a font that the program carries, so neither
//! depends on what the machine has installed.

pub mod colormap;
mod draw;
pub mod heatmap;
pub mod raster;
pub mod scale;
mod sheet;
mod thin;
pub mod trend;

use std::{fs, io, ops::Range, path::Path, path::PathBuf};

/// Line colours that stay apart for colour-blind readers and in grey print (after Okabe and Ito).
pub mod colors {
    /// Blue, for the first of two curves.
    pub const BLUE: (u8, u8, u8) = (0, 114, 178);
    /// Vermilion, for the second.
    pub const VERMILION: (u8, u8, u8) = (213, 94, 0);
    /// Bluish green, for the third.
    pub const GREEN: (u8, u8, u8) = (0, 158, 115);
    /// Reddish purple, for the fourth.
    pub const PURPLE: (u8, u8, u8) = (204, 121, 167);
}

/// Panels of one size, filled row by row.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What stands above all panels; empty for nothing.
    pub title: String,
    /// Panels in a row.
    pub columns: usize,
    /// Width and height of one panel with its axes, pixels.
    pub panel_size: (u32, u32),
    /// The panels.
    pub panels: Vec<Panel>,
}

/// Curves over one pair of axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What stands above the panel, on the left.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Drawn in this order; labels stand above the panel, on the right, where they hide nothing.
    pub curves: Vec<Curve>,
}

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// What is shown.
    pub range: Range<f64>,
}

/// One line.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend; empty for none.
    pub label: String,
    /// Red, green, blue.
    pub color: (u8, u8, u8),
    /// Its points; where x never decreases they are thinned to what the picture can show.
    pub points: Vec<(f64, f64)>,
}

/// Why a figure could not be made.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The drawing failed.
    #[error("a figure could not be drawn: {0}")]
    Drawing(String),
    /// A file could not be written.
    #[error("{} could not be written: {source}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What the system said.
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
    /// What the files are called, without folder and ending.
    pub name: String,
    /// The SVG file.
    pub svg: PathBuf,
    /// The PNG file.
    pub png: PathBuf,
}

impl Axis {
    /// An axis over `range`.
    pub fn new(label: &str, range: Range<f64>) -> Self {
        Self { label: label.to_owned(), range }
    }
}

impl Curve {
    /// A line through `points`.
    pub fn new(
        label: &str,
        color: (u8, u8, u8),
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self { label: label.to_owned(), color, points: points.into_iter().collect() }
    }
}

impl Figure {
    /// The figure as an SVG document.
    pub fn svg(&self) -> Result<String, FigureError> {
        draw::svg(self)
    }

    /// Writes `folder/name.svg` and `folder/name.png`.
    pub fn write(&self, folder: &Path, name: &str) -> Result<Written, FigureError> {
        write(&self.svg()?, folder, name)
    }
}

/// Writes a document as `folder/name.svg`, and its picture as `folder/name.png`.
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
