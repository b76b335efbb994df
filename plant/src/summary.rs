//! A report for people.

use std::fmt;

use crate::{durations::Percentiles, report::Report};

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |x: Option<f64>, unit: &str| match x {
            Some(x) => format!("{x:.4e} {unit}"),
            None => "-".to_owned(),
        };
        let Self { scenario, law, bus, clock, samples, .. } = self;
        // To the nanosecond, so that no rounding shows.
        let duration_s = (self.duration_s * 1e9).round() / 1e9;
        writeln!(f, "{scenario}: {law} over {bus}, {clock}, {duration_s} s, {samples} samples")?;
        if self.diverged {
            writeln!(f, "  diverged        after {duration_s:.3} s")?;
        }
        for (name, error) in [("rms error", self.rms_error_m), ("peak error", self.peak_error_m)] {
            writeln!(f, "  {name:<15} {}, second half of the run", number(error, "m"))?;
        }
        let energy = self.energy_j.map_or("-".to_owned(), |x| format!("{} J", short(x)));
        writeln!(f, "  energy          {energy}")?;
        let peaks: Vec<_> = self.peak_torque_nm.iter().map(|x| short(*x)).collect();
        writeln!(f, "  peak torque     {} N m", peaks.join(", "))?;
        writeln!(f, "  torque step     {}", number(self.torque_step_rms_nm, "N m rms"))?;
        let c = &self.commands;
        writeln!(
            f,
            "  commands        {} sent, {} applied, {} lost, {} late, {} rejected{}",
            c.sent,
            c.applied,
            c.lost,
            c.late,
            c.rejected,
            if c.too_old > 0 { format!(", {} too old", c.too_old) } else { String::new() }
        )?;
        if let Some(misses) = self.deadline_misses {
            writeln!(f, "  deadline misses {misses}")?;
        }
        if let Some(longest) = self.longest_stall_us {
            writeln!(
                f,
                "  stalls          {}, the longest {:.1} ms: the plant did not run, and the run stood still",
                self.stalls,
                longest * 1e-3
            )?;
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
        let times = [
            ("round trip", ", without emulated latency", &self.round_trip_us),
            ("residence", "", &self.residence_us),
        ];
        for (name, remark, percentiles) in times {
            if let Some(Percentiles { p50, p90, p99, p999, max }) = percentiles {
                writeln!(
                    f,
                    "  {name:<15} p50 {p50:.1}, p90 {p90:.1}, p99 {p99:.1}, p99.9 {p999:.1}, max {max:.1} µs{remark}"
                )?;
            }
        }
        Ok(())
    }
}

/// One decimal, and an exponent where a run that diverged makes it long.
fn short(x: f64) -> String {
    if x.abs() < 1e6 { format!("{x:.1}") } else { format!("{x:.1e}") }
}

#[cfg(test)]
mod tests {
    use mtj_model::scenario::Scenario;

    use super::*;
    use crate::{report::Measures, sequencer::Sequencer};

    #[test]
    fn a_summary_is_short_where_a_run_diverged_and_says_what_a_round_trip_leaves_out() {
        let scenario = Scenario::load("sampled/mtj", &[]).unwrap();
        let sequencer = Sequencer::<2, 2>::new(&scenario).unwrap();
        let report = Report {
            duration_s: 60.00000000000001,
            energy_j: Some(3.21e74),
            peak_torque_nm: vec![12.34, 1e30],
            round_trip_us: Some(Percentiles { p50: 1.0, p90: 1.0, p99: 1.0, p999: 1.0, max: 1.0 }),
            ..Measures::<2>::new(&scenario).report(&scenario, &sequencer, 0, 0.0)
        };
        let text = report.to_string();
        assert!(text.contains(" 60 s, "), "{text}");
        assert!(text.contains("energy          3.2e74 J\n"), "{text}");
        assert!(text.contains("peak torque     12.3, 1.0e30 N m\n"), "{text}");
        assert!(text.contains("max 1.0 µs, without emulated latency\n"), "{text}");
    }
}
