//! A loop in ten lines: the paper's arm under MTJ, and what it measured.
//!
//! `cargo run --release --example 01_loop`

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scenario = mtj::Scenario::load("sampled/mtj", &["timing.clock=lockstep".parse()?])?;
    let outcome = mtj::run(&scenario)?;
    print!("{}", outcome.report);
    for row in outcome.trace.iter().step_by(400) {
        println!("t = {:4.1} s  error {:+.2e} m, {:+.2e} m", row.time, row.error[0], row.error[1]);
    }
    Ok(())
}
