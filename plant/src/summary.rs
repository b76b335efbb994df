//! A report for people.

use std::fmt;

use crate::{durations::Percentiles, report::Report};

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |x: Option<f64>, unit: &str| match x {
            Some(x) => format!("{x:.4e} {unit}"),
            None => "-".to_owned(),
        };
        let Self { scenario, law, bus, clock, duration_s, samples, .. } = self;
        writeln!(f, "{scenario}: {law} over {bus}, {clock}, {duration_s} s, {samples} samples")?;
        if self.diverged {
            writeln!(f, "  diverged        after {duration_s:.3} s")?;
        }
        writeln!(f, "  rms error       {}", number(self.rms_error_m, "m"))?;
        writeln!(f, "  peak error      {}", number(self.peak_error_m, "m"))?;
        writeln!(
            f,
            "  energy          {}",
            self.energy_j.map_or("-".into(), |x| format!("{x:.1} J"))
        )?;
        let peaks: Vec<_> = self.peak_torque_nm.iter().map(|x| format!("{x:.1}")).collect();
        writeln!(f, "  peak torque     {} N m", peaks.join(", "))?;
        writeln!(f, "  torque step     {}", number(self.torque_step_rms_nm, "N m rms"))?;
        let c = &self.commands;
        writeln!(
            f,
            "  commands        {} sent, {} applied, {} lost, {} late, {} rejected",
            c.sent, c.applied, c.lost, c.late, c.rejected
        )?;
        if let Some(misses) = self.deadline_misses {
            writeln!(f, "  deadline misses {misses}")?;
        }
        if self.timeouts > 0 || self.takeovers > 0 {
            let gap = self.longest_gap_us.map_or(String::new(), |gap| {
                format!("; at most {:.1} ms without a fresh command", gap * 1e-3)
            });
            writeln!(
                f,
                "  leader          {} takeovers, {} timeouts{gap}",
                self.takeovers, self.timeouts
            )?;
        }
        let times = [("round trip", &self.round_trip_us), ("residence", &self.residence_us)];
        for (name, percentiles) in times {
            if let Some(Percentiles { p50, p90, p99, p999, max }) = percentiles {
                writeln!(
                    f,
                    "  {name:<15} p50 {p50:.1}, p90 {p90:.1}, p99 {p99:.1}, p99.9 {p999:.1}, max {max:.1} µs"
                )?;
            }
        }
        Ok(())
    }
}
