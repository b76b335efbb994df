//! The trace of a run: every sampling instant, for plots and for comparing runs bit by bit.

use std::io::{self, Write};

use mtj_model::{scenario::Scenario, task::Axis};
use mtj_protocol::sample::{Axes, Echo, Joints};

/// The true state at one sampling instant. Nothing in it depends on wall time, unless the run does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRow {
    /// s.
    pub time: f64,
    /// True joint angles, rad.
    pub position: Joints,
    /// True joint velocities, rad/s.
    pub velocity: Joints,
    /// True tip, m.
    pub tip: Axes,
    /// Where it should be, m.
    pub desired: Axes,
    /// desired ⊖ true, m.
    pub error: Axes,
    /// Torque in effect when the sample was taken, N m.
    pub torque: Joints,
    /// The law's echo in effect when the sample was taken.
    pub echo: Echo,
}

/// Writes rows as CSV with a header line; numbers are printed so that they read back exactly.
pub fn write_csv(out: &mut impl Write, scenario: &Scenario, rows: &[TraceRow]) -> io::Result<()> {
    let (joints, axes) = (scenario.arm.links.len(), scenario.task.axes);
    let echo = &scenario.law.law.description().echo;
    let echoed = echo.per.count(joints, axes.len());
    write!(out, "time_s")?;
    numbered(out, "q", "rad", joints)?;
    numbered(out, "q_dot", "rad/s", joints)?;
    for (before, after) in [("", ""), ("", "_desired"), ("error_", "")] {
        for Axis { name, unit } in axes {
            write!(out, ",{before}{name}{after}_{}", in_a_name(unit))?;
        }
    }
    numbered(out, "torque", "N m", joints)?;
    numbered(out, echo.key, echo.unit, echoed)?;
    writeln!(out)?;
    for row in rows {
        write!(out, "{}", row.time)?;
        let lists: [&[f64]; 7] = [
            &row.position[..joints],
            &row.velocity[..joints],
            &row.tip[..axes.len()],
            &row.desired[..axes.len()],
            &row.error[..axes.len()],
            &row.torque[..joints],
            &row.echo[..echoed],
        ];
        for number in lists.into_iter().flatten() {
            write!(out, ",{number}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// The titles of so many columns.
fn numbered(out: &mut impl Write, name: &str, unit: &str, count: usize) -> io::Result<()> {
    (1..=count).try_for_each(|i| write!(out, ",{name}_{}_{i}", in_a_name(unit)))
}

/// A unit as names of columns have it: `nm` for N m, `rad_s` for rad/s.
fn in_a_name(unit: &str) -> String {
    unit.to_lowercase().replace(' ', "").replace('/', "_")
}
