//! The runs a second and core of a sweep, in lanes and on the scalar path, and the difference of
//! their results.

use std::{fs, io, thread, time::Instant};

use mtj_model::scenario::Override;
use mtj_study::sweep::{plan::Plan, results::Measured, runner};

use crate::failure::Failure;

/// The size of the measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Runs in lanes on each thread; the scalar path does a twentieth of them.
    pub runs: usize,
    /// The most threads.
    pub threads: usize,
    /// How many runs of each plan are compared with the scalar reference.
    pub checks: usize,
}

/// The runs, by what they differ in.
const PLANS: [(&str, &str); 4] = [
    (
        "gains, masses, thresholds",
        r#"
[[axes]]
name = "kp"
key = "law.kp"
from = 20.0
to = 40.0
count = 16
[[axes]]
name = "mass"
key = "arm.links[0].mass"
from = 3.0
to = 5.0
count = 16
[[axes]]
name = "threshold"
key = "law.factor.error"
from = 0.5
to = 2.0
count = 16
"#,
    ),
    (
        "laws, noise, seeds",
        r#"
[[axes]]
name = "law"
variants = [
    { name = "tj", set = { "law.kind" = "tj", "law.kp" = 60, "law.kd" = 120 } },
    { name = "mtj sent", set = { "law.memory.policy" = "sent" } },
    { name = "mtj delivered", set = { "law.memory.policy" = "delivered" } },
    { name = "mb", set = { "law.kind" = "mb", "law.kp" = 8, "law.kd" = 4 } },
]
[[axes]]
name = "noise"
key = "sensor.noise"
from = 0.001
to = 0.02
count = 16
[[axes]]
name = "seed"
key = "seed"
from = 1
to = 64
count = 64
"#,
    ),
    (
        "latencies",
        r#"
[set]
"law.memory.policy" = "delivered"
"law.prediction.horizon" = "measured"
[[axes]]
name = "latency"
key = "link.torque.latency"
from = "0.1 ms"
to = "5 ms"
count = 64
[[axes]]
name = "kd"
key = "law.kd"
from = 50.0
to = 60.0
count = 64
"#,
    ),
    (
        "jitter, sample periods",
        r#"
[set]
"law.memory.policy" = "delivered"
"law.prediction.horizon" = "measured"
"link.torque.latency" = "2 ms"
"link.torque.jitter.kind" = "gamma"
"link.torque.jitter.deviation" = "0.2 ms"
[[axes]]
name = "sample_period"
key = "timing.sample_period"
values = ["9 ms", "9.5 ms", "10 ms"]
[[axes]]
name = "seed"
key = "seed"
from = 1
to = 1000
count = 1000
"#,
    ),
];

/// The step of the scalar path: the default.
const STEP: &str = "1 ms";
/// A tenth of it, for the reference.
const FINE_STEP: &str = "0.1 ms";
/// How many points a thread takes at a time.
const CHUNK: usize = 256;

/// Processor times below this say little, s.
const COARSE: f64 = 0.1;

/// Some runs and the time that they took.
struct Pace {
    runs: usize,
    /// s.
    wall: f64,
    /// Processor time of all threads, s.
    core: f64,
}

/// Measures and prints one line for each plan and number of threads.
pub(crate) fn sweep(
    settings: &Settings,
    out: &mut dyn io::Write,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<(), Failure> {
    writeln!(
        out,
        "20 s runs at T_s = 10 ms (9 to 10 ms where it differs); a core's rate is by its processor time\n"
    )?;
    writeln!(
        out,
        "{:<26} {:>7} {:>11} {:>14} {:>11} {:>8} {:>16}",
        "runs differ in",
        "threads",
        "runs/s",
        "runs/s a core",
        "real time",
        "scalar",
        "rms differs by"
    )?;
    for (name, axes) in PLANS {
        let plan = |step: &str| Plan::parse(name, &text(axes), &set(step));
        let (lanes, scalar, fine) = (plan("auto")?, plan(STEP)?, plan(FINE_STEP)?);
        let few = pace(&scalar, (settings.runs / 20).max(1), 1, proceed);
        let largest = largest_difference(&lanes, &fine, settings.checks, proceed);
        for threads in counts(settings.threads) {
            let pace = pace(&lanes, settings.runs, threads, proceed);
            if !proceed() {
                return Ok(());
            }
            let (rate, scalar_rate) = (pace.rate(), few.rate());
            writeln!(
                out,
                "{name:<26} {threads:>7} {:>11.0} {rate:>14.0} {:>10.0}x {:>7.1}x {:>14.1e} m",
                pace.runs as f64 / pace.wall,
                20.0 * rate,
                rate / scalar_rate,
                largest
            )?;
            out.flush()?;
        }
    }
    writeln!(
        out,
        "\nscalar: against one thread of the scalar path with steps of {STEP}, in this same run\n\
         rms differs by: the most in {} runs of each kind, against the scalar path with steps of {FINE_STEP}",
        settings.checks
    )?;
    Ok(())
}

/// One thread, and as many as there may be.
fn counts(most: usize) -> impl Iterator<Item = usize> {
    std::iter::once(1).chain((most > 1).then_some(most))
}

fn text(axes: &str) -> String {
    format!("scenario = \"sampled/mtj\"\n{axes}")
}

fn set(step: &str) -> [Override; 3] {
    [("timing.clock", "lockstep"), ("bus.kind", "local"), ("timing.integration_step", step)]
        .map(|(key, value)| Override::text(key, value))
}

/// Computes `runs` runs on each of `threads` threads, from the plan to the measures.
fn pace(plan: &Plan, runs: usize, threads: usize, proceed: &(dyn Fn() -> bool + Sync)) -> Pace {
    let started = Instant::now();
    let work = |thread: usize| {
        let started = processor_time();
        let points: Vec<usize> = (0..runs).map(|i| (i * threads + thread) % plan.len()).collect();
        let mut done = 0;
        for chunk in points.chunks(CHUNK) {
            runner::measure(plan, chunk, proceed, &mut |_, _| done += 1);
        }
        (done, processor_time() - started)
    };
    let all: Vec<(usize, f64)> = thread::scope(|scope| {
        let threads: Vec<_> =
            (0..threads).map(|thread| scope.spawn(move || work(thread))).collect();
        threads.into_iter().filter_map(|thread| thread.join().ok()).collect()
    });
    Pace {
        runs: all.iter().map(|(done, _)| done).sum(),
        wall: started.elapsed().as_secs_f64(),
        core: all.iter().map(|(_, core)| core).sum(),
    }
}

impl Pace {
    /// Runs in a second of one core's time.
    fn rate(&self) -> f64 {
        // The system counts in ticks of some milliseconds.
        let core = if self.core > COARSE { self.core } else { self.wall };
        self.runs as f64 / core
    }
}

/// The largest difference of the rms error between two plans, m, in some points that are spread
/// evenly.
fn largest_difference(plan: &Plan, other: &Plan, checks: usize, proceed: &dyn Fn() -> bool) -> f64 {
    let points: Vec<usize> = (0..checks).map(|i| i * plan.len() / checks.max(1)).collect();
    let errors = |plan: &Plan| {
        let mut errors = vec![f64::NAN; plan.len()];
        runner::measure(plan, &points, proceed, &mut |point, measured: Measured| {
            errors[point] = measured.ok().and_then(|report| report.rms_error_m).unwrap_or(f64::NAN);
        });
        errors
    };
    let (ours, theirs) = (errors(plan), errors(other));
    points.iter().map(|point| (ours[*point] - theirs[*point]).abs()).fold(
        0.0,
        |most, difference| {
            if difference > most || difference.is_nan() { difference } else { most }
        },
    )
}

/// The processor time of this thread, s; wall time where the system does not count it.
fn processor_time() -> f64 {
    let told = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let wall = || START.get_or_init(Instant::now).elapsed().as_secs_f64();
    nanoseconds.map_or_else(wall, |nanoseconds| nanoseconds * 1e-9)
}
