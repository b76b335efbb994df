//! What a memory makes of latency: the rms error of each remedy, as a table and as a figure.
//!
//! `cargo run --release --example 02_latency_and_memories [FOLDER]`

use std::{env, fs, path::PathBuf};

use mtj::{
    Scenario,
    figure::{
        cells::{CellAxis, CellValue, Spread},
        trend::{TrendPanel, Trends},
    },
    run,
};

/// From sample to application, ms.
const LATENCIES: [f64; 6] = [0.0, 1.0, 2.0, 5.0, 10.0, 20.0];

const REMEDIES: [(&str, &[&str]); 5] = [
    ("(16), sent", &["law.memory.policy=sent"]),
    ("(16), delivered", &["law.memory.policy=delivered"]),
    (
        "(16), delivered, prediction",
        &["law.memory.policy=delivered", "law.prediction.horizon=measured"],
    ),
    ("(11), sent", &["law.acceleration=true"]),
    ("(11), delivered", &["law.acceleration=true", "law.memory.policy=delivered"]),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(env::args().nth(1).unwrap_or_else(|| "examples-out".to_owned()));
    fs::create_dir_all(&folder)?;
    let scenario = Scenario::load("sampled/mtj", &["timing.clock=lockstep".parse()?])?;

    print!("{:<28}", "rms error, mm");
    LATENCIES.iter().for_each(|latency| print!("{latency:>7} ms"));
    println!();
    let mut curves = Vec::new();
    for (name, sets) in REMEDIES {
        print!("{name:<28}");
        let mut curve = Vec::new();
        for latency in LATENCIES {
            let mut set = vec![format!("link.torque.latency={latency} ms").parse()?];
            for text in sets {
                set.push(text.parse()?);
            }
            let report = run(&scenario.changed(&set)?)?.report;
            let error = report.rms_error_m.filter(|_| !report.diverged).map(|error| error * 1e3);
            match error {
                Some(error) => print!("{error:>10.2}"),
                None => print!("{:>10}", "diverges"),
            }
            curve.push(
                error.map_or(CellValue::Diverged, |error| CellValue::Known(Spread::of(error))),
            );
        }
        println!();
        curves.push(curve);
    }

    let figure = Trends {
        title: "Latency and memories".to_owned(),
        note: "mtj on the paper's arm, T_s = 10 ms".to_owned(),
        names: REMEDIES.map(|(name, _)| name.to_owned()).to_vec(),
        quantity: "rms error (mm)".to_owned(),
        x: CellAxis::of_numbers("latency (ms)", &LATENCIES, true),
        panels: vec![TrendPanel { title: String::new(), curves }],
    };
    mtj::figure::write(&figure.svg(), &folder, "02-latency-and-memories")?;
    Ok(())
}
