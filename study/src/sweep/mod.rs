//! Studies: a scenario, and axes over any of its keys.
//!
//! | module | contents |
//! |---|---|
//! | [`plan`] | the points |
//! | [`runner`] | computes them |
//! | [`lanes`] | many at once |
//! | [`results`] | what they measured, in a folder |
//! | [`rows`] | the rows of its files |
//!
//! A study may have ten million points, so none of these holds all of them: points are made when
//! they are computed, rows are written as they come and sorted on disk. What remains in memory is a
//! bit for each point.
//!
//! A study of six points, computed in this process:
//!
//! ```
//! use mtj_study::sweep::{
//!     plan::Plan,
//!     results::{self, Results, Shard},
//!     runner,
//! };
//!
//! let study = r#"
//!     scenario = "sampled/mtj"
//!
//!     [set]
//!     "duration" = "2 s"
//!     "timing.clock" = "lockstep"
//!     "timing.integration_step" = "auto"
//!     "bus.kind" = "local"
//!
//!     [[axes]]
//!     name = "kd"
//!     key = "law.kd"
//!     values = [40.0, 60.0]
//!
//!     [[axes]]
//!     name = "latency"
//!     key = "link.torque.latency"
//!     values = ["0 ms", "1 ms", "2 ms"]
//! "#;
//! let plan = Plan::parse("example", study, &[])?;
//! assert_eq!(plan.len(), 6);
//!
//! let folder = std::env::temp_dir().join(format!("mtj-example-{}", std::process::id()));
//! let mut results = Results::open(&folder, &plan, Shard::ALL)?;
//! let is_complete = runner::run_in_process(&plan, &mut results, Shard::ALL, 2, &|| true)?;
//! assert!(is_complete);
//! results.sort(&plan)?;
//!
//! let rows = results::read(&folder, &plan)?.collect::<Result<Vec<_>, _>>()?;
//! let columns = results::columns(&plan);
//! let rms = columns.iter().position(|name| name == "rms_error_m").expect("a measure");
//! assert_eq!(rows[5].fields[..3], ["5", "60", "0.002"]);
//! let error: f64 = rows[5].fields[rms].parse()?;
//! assert!(error > 0.0 && error < 1.0, "{error} m");
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod axis;
pub mod builtin;
pub mod lanes;
pub mod plan;
mod points;
pub mod results;
mod row;
pub mod rows;
pub mod runner;
