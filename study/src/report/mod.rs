//! A study's results as figures and as a page.
//!
//! ```text
//! Plan ── Layout ─┐
//! rows ── Cells ──┼── figures ──▶ SVG, PNG
//! limits ─────────┴── page ─────▶ report.html
//! ```

pub mod cells;
pub mod figures;
pub mod layout;
pub mod limits;
pub mod page;
