//! A proposal in words, as JSON, and as something to paste.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{
    Latency, LatencySource, MARGIN, Proposal, STARTS, VERIFIED_S, Wanted, verify::Verification,
};

/// The `[law]` tables to paste into a scenario.
pub fn snippet(proposal: &Proposal) -> String {
    let v = &proposal.values;
    let mut text = format!("[law]\nkind = \"mtj\"\nkp = {}\nkd = {}\n", v.kp, v.kd);
    if let Some(mass) = v.remedy.mass {
        let _ = write!(text, "acceleration = true\nmass = {mass}\n");
    }
    let _ = write!(
        text,
        "\n[law.factor]\nkind = \"exponential\"\nerror = {}\nerror_rate = {}\nceiling = 1.0\n\n\
         [law.memory]\npolicy = \"{}\"\n",
        v.error,
        v.error_rate,
        v.remedy.policy_name()
    );
    if v.remedy.predicts {
        text.push_str("\n[law.prediction]\nhorizon = \"measured\"\n");
    }
    text
}

/// The table for people.
pub fn table(proposal: &Proposal, wanted: &Wanted, limit_source: &str) -> String {
    let v = &proposal.values;
    let lines = [
        ("wanted", format!("K_d/K_p = {} s", wanted.time_constant_s), String::new()),
        ("torque limit", torques(&wanted.torque_limit_nm), limit_source.to_owned()),
        ("latency", format!("{:.3} ms", wanted.latency.mean_s * 1e3), latency(wanted)),
        ("K_d", format!("{} N s/m", v.kd), proposal.gain_limit.to_string()),
        ("K_p", format!("{} N/m", v.kp), "K_d over the time constant".to_owned()),
        (
            "M̄ of (11)",
            v.remedy.mass.map_or("none".to_owned(), |mass| format!("{mass} kg")),
            String::new(),
        ),
        ("memory", v.remedy.name(), proposal.memory_reason.clone()),
        (
            "thresholds",
            format!("{} m, {} m/s", v.error, v.error_rate),
            proposal.threshold_reason.clone(),
        ),
    ];
    let mut text = String::new();
    for (name, value, reason) in lines {
        let _ = writeln!(text, "{}", format!("{name:<13} {value:<26} {reason}").trim_end());
    }
    for line in &proposal.rejected {
        let _ = writeln!(text, "given up      {line}");
    }
    text.push('\n');
    let _ = writeln!(
        text,
        "{:<28} {:>10}  {:>10}  {:>10}  {:>13}  peak torque",
        format!("verified from {STARTS} starts"),
        "rms error",
        "median",
        "worst",
        "time constant"
    );
    let rows = [
        ("with the latency".to_owned(), &proposal.verified),
        (format!("with {MARGIN} x the latency"), &proposal.with_margin),
        ("as it stands, no limit".to_owned(), &proposal.as_it_stands),
    ];
    for (name, row) in rows {
        let _ = writeln!(text, "{name:<28} {}", verification(row));
    }
    let _ = writeln!(
        text,
        "Errors are over the second half of {VERIFIED_S} s, or of the scenario's duration if it is longer."
    );
    for shortfall in &proposal.shortfalls {
        let _ = writeln!(text, "falls short   {shortfall}");
    }
    text
}

/// What the latency is, and where it is from.
fn latency(wanted: &Wanted) -> String {
    let Latency { p99_s, .. } = wanted.latency;
    let source = match wanted.latency_source {
        LatencySource::Links => "drawn from the links, jitter and replays included",
        LatencySource::Given => "given, in place of the links' own latency, jitter and losses",
        LatencySource::Measured => {
            "the links' mean and the 99th percentile measured on the bus, without the links' jitter"
        }
    };
    let spread = match wanted.latency_source {
        LatencySource::Links => format!("; 99 % within {:.3} ms", p99_s * 1e3),
        LatencySource::Given | LatencySource::Measured => String::new(),
    };
    format!("sample to application, on average{spread}; {source}")
}

fn verification(row: &Verification) -> String {
    let millimetres =
        |rms: Option<f64>| rms.map_or("runs away".to_owned(), |rms| format!("{:.2} mm", rms * 1e3));
    let [own, median, worst] =
        [row.rms_error_m, row.median_rms_error_m, row.worst_rms_error_m].map(millimetres);
    let tau = row.time_constant_s.map_or("-".to_owned(), |tau| format!("{tau:.2} s"));
    format!("{own:>10}  {median:>10}  {worst:>10}  {tau:>13}  {}", torques(&row.peak_torque_nm))
}

fn torques(list: &[f64]) -> String {
    let short = |torque: &f64| {
        if *torque < 1e5 { format!("{torque:.2}") } else { format!("{torque:.2e}") }
    };
    let list: Vec<_> = list.iter().map(short).collect();
    format!("{} N m", list.join(", "))
}

/// One object for machines.
pub fn object(proposal: &Proposal, wanted: &Wanted, source: &str, command: &str) -> Value {
    let v = &proposal.values;
    json!({
        "wanted": wanted,
        "torque_limit_source": source,
        "kp": v.kp,
        "kd": v.kd,
        "error": v.error,
        "error_rate": v.error_rate,
        "memory": v.remedy.policy_name(),
        "predicts": v.remedy.predicts,
        "mass": v.remedy.mass,
        "limits": {
            "gain": proposal.gain_limit.to_string(),
            "memory": proposal.memory_reason,
            "thresholds": proposal.threshold_reason,
        },
        "given_up": proposal.rejected.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "verified": proposal.verified,
        "with_margin": proposal.with_margin,
        "as_it_stands": proposal.as_it_stands,
        "shortfalls": proposal.shortfalls.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "command": command,
        "toml": snippet(proposal),
    })
}
