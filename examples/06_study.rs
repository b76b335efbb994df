//! A study: the rms error over sample period and latency for two laws, as a table, a map and a
//! page.
//!
//! `cargo run --release --example 06_study [FOLDER]`

use std::{env, path::PathBuf};

use mtj::{
    Plan,
    study::{
        report,
        sweep::{
            results::{self, Results, Shard},
            runner,
        },
    },
};

const STUDY: &str = r#"
title = "Eq. (16) and eq. (11): latency against sample period"
scenario = "sampled/mtj"

[set]
"timing.clock" = "lockstep"
"timing.integration_step" = "auto"
"bus.kind" = "local"

[[axes]]
name = "law"
variants = [
    { name = "(16) sent", set = { "law.memory.policy" = "sent" } },
    { name = "(11) delivered", set = { "law.acceleration" = true, "law.memory.policy" = "delivered" } },
]

[[axes]]
name = "sample_period"
key = "timing.sample_period"
values = ["2 ms", "5 ms", "10 ms", "20 ms"]

[[axes]]
name = "latency"
key = "link.torque.latency"
values = ["0 ms", "1 ms", "2 ms", "5 ms", "10 ms"]
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder =
        PathBuf::from(env::args().nth(1).unwrap_or_else(|| "examples-out/study".to_owned()));
    let plan = Plan::parse("example", STUDY, &[])?;
    let mut results = Results::open(&folder, &plan, Shard::ALL)?;
    runner::run_in_process(&plan, &mut results, Shard::ALL, 2, &|| true)?;
    results.sort(&plan)?;

    // A line a law and sample period, a column a latency.
    print!("{:<30}", "rms error, mm");
    for latency in &plan.axes[2].positions {
        print!("{:>13}", format!("d = {} s", latency.label));
    }
    for row in results::read(&folder, &plan)? {
        let row = row?;
        let [_, law, period, _, error, ..] = &row.fields[..] else { continue };
        if row.point % plan.axes[2].positions.len() == 0 {
            print!("\n{:<30}", format!("{law}, T_s = {period} s"));
        }
        let error = error.parse().map_or("lost".to_owned(), |e: f64| format!("{:.2}", e * 1e3));
        print!("{error:>13}");
    }
    println!();
    report::write(&folder, &|| true)?;
    Ok(())
}
