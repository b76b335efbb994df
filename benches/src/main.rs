//! Counts the instructions of every case and prints them, beside the nanoseconds that criterion has
//! measured if `CRITERION_HOME` says where: `benches/run` does both.
//!
//! `arithmetic --steps` is what callgrind runs; followed by a case's name (`loop, sent: 2 links,
//! tj`) it runs this case alone, for a profile.

use std::{
    env,
    error::Error,
    fs,
    path::{Path, PathBuf},
};

use mtj_benches::{
    callgrind,
    case::{Case, PASSES, Setting},
    law::Law,
    table::{Figures, Table},
};

const STEPS: &str = "--steps";

fn main() -> Result<(), Box<dyn Error>> {
    let cases = Case::all(Setting::loops().chain([Setting::Paper]));
    let mut arguments = env::args().skip(1);
    if arguments.next().as_deref() == Some(STEPS) {
        let wanted = arguments.next();
        let is_wanted = |case: &Case| wanted.as_ref().is_none_or(|name| *name == case.to_string());
        callgrind::run(&cases.into_iter().filter(is_wanted).collect::<Vec<_>>());
        return Ok(());
    }
    let counts = callgrind::count(&env::current_exe()?, &[STEPS], &cases)?;
    let instructions = Figures::new(cases.iter().copied().zip(counts));
    let nanoseconds = env::var_os("CRITERION_HOME").map(|home| measured(Path::new(&home), &cases));
    for (setting, title) in [
        (Setting::LOOP, "Measured state in, torque out"),
        (Setting::Paper, "The law and its torque alone, as many task axes as links, full matrices"),
    ] {
        println!("{title}: instructions (and of tj's)\n");
        println!("{}", Table { figures: &instructions, setting });
        if let Some(figures) = &nanoseconds {
            println!("{title}: nanoseconds (and of tj's)\n");
            println!("{}", Table { figures, setting });
        }
    }
    println!("At most, of tj's instructions, over all memories, with and without prediction:\n");
    for law in Law::MTJ {
        if let Some((case, ratio)) = instructions.worst(law, Setting::loops()) {
            println!("{law}: {ratio:.3} ({case})");
        }
    }
    Ok(())
}

/// The fastest of the samples that criterion took: what else a machine does only adds to a time.
fn measured(home: &Path, cases: &[Case]) -> Figures {
    let fastest = |case: &Case| {
        let times = (0..PASSES).filter_map(|pass| fastest_in(home, case, pass));
        Some((*case, times.min_by(f64::total_cmp)?))
    };
    Figures::new(cases.iter().filter_map(fastest))
}

fn fastest_in(home: &Path, case: &Case, pass: usize) -> Option<f64> {
    let place = [&Case::group(case.setting, pass), &case.law.to_string(), &case.links.to_string()];
    let file = home.join(place.iter().collect::<PathBuf>()).join("new/sample.json");
    let sample: serde_json::Value = serde_json::from_str(&fs::read_to_string(file).ok()?).ok()?;
    let numbers = |key: &str| -> Option<Vec<f64>> {
        sample[key].as_array()?.iter().map(|number| number.as_f64()).collect()
    };
    let (times, steps) = (numbers("times")?, numbers("iters")?);
    times.iter().zip(&steps).map(|(time, steps)| time / steps).min_by(f64::total_cmp)
}
