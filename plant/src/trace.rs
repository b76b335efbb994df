//! Every sampling instant of a run, for plots and for comparing runs bit by bit.

use std::io::{self, Write};

use mtj_model::MAX_JOINTS;
use mtj_protocol::sample::{Echo, Joints};

/// What was true at one sampling instant. Nothing in it depends on wall time, unless the run does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// s.
    pub time: f64,
    /// True joint angles, rad.
    pub position: Joints,
    /// True joint velocities, rad/s.
    pub velocity: Joints,
    /// True tip, m.
    pub tip: [f64; 2],
    /// Where it should be, m.
    pub desired: [f64; 2],
    /// Torque in effect when the sample was taken, N m.
    pub torque: Joints,
    /// The law's echo in effect when the sample was taken.
    pub echo: Echo,
}

impl Row {
    /// desired − true, m.
    pub fn error(&self) -> [f64; 2] {
        std::array::from_fn(|i| self.desired[i] - self.tip[i])
    }
}

/// Writes rows as CSV with a header line; numbers are printed so that they read back exactly.
pub fn write_csv(out: &mut impl Write, joints: usize, rows: &[Row]) -> io::Result<()> {
    let joints = joints.min(MAX_JOINTS);
    let axes = 2;
    let numbered =
        |name: &str, count| (1..=count).map(|i| format!(",{name}{i}")).collect::<String>();
    writeln!(
        out,
        "time_s{}{},x_m,y_m,x_desired_m,y_desired_m,error_x_m,error_y_m{}{}",
        numbered("q_rad_", joints),
        numbered("q_dot_rad_s_", joints),
        numbered("torque_nm_", joints),
        numbered("force_n_", axes),
    )?;
    for row in rows {
        write!(out, "{}", row.time)?;
        let lists: [&[f64]; 7] = [
            &row.position[..joints],
            &row.velocity[..joints],
            &row.tip,
            &row.desired,
            &row.error(),
            &row.torque[..joints],
            &row.echo[..axes],
        ];
        for number in lists.into_iter().flatten() {
            write!(out, ",{number}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
