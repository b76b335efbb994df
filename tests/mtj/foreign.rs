//! A controller in another language, written from docs/wire.md alone.

use std::{
    fs::{self, File},
    path::Path,
    process::{Child, Command, Stdio},
};

use crate::{
    needs::{self, needs},
    session::{Session, free_port},
};

/// Where the trajectory may differ: rounding in another order, over the whole run.
const TOLERANCE: f64 = 1e-9;

struct Foreign(Child);

impl Drop for Foreign {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts examples/controller.py; what it complains about goes to `errors`.
fn foreign_controller(session: &Session, endpoint: &str, errors: &Path) -> Foreign {
    let program = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/controller.py");
    let python = needs::python();
    let child = Command::new(&python)
        .arg(program)
        .args(["--connect", endpoint, "--session", &session.name])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(errors).unwrap())
        .spawn()
        .unwrap_or_else(|error| panic!("{}: {error}", python.display()));
    Foreign(child)
}

/// Header and rows of a trace.
fn read(csv: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = fs::read_to_string(csv).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let row = |line: &str| line.split(',').map(|number| number.parse().unwrap()).collect();
    (header, lines.map(row).collect())
}

#[test]
fn a_controller_in_another_language_closes_the_loop_with_the_same_trajectory() {
    needs!(Python);
    for settings in [
        "--scenario sampled/mtj --set law.memory.policy=sent",
        "--scenario sampled/mtj --set law.memory.policy=delivered --set link.torque.latency=1ms",
        "--scenario sampled/mtj --set law.memory.policy=applied --set law.factor.ceiling=0.98",
        "--scenario sampled/mtj --set law.memory.step=20ms --set law.factor.kind=switch --set duration=5s",
        "--scenario sampled/mtj --set law.acceleration=true --set link.torque.latency=1ms",
        "--scenario sampled/tj --set duration=5s",
        "--scenario redundant/mtj --set duration=5s",
    ] {
        let settings = format!("{settings} --set timing.clock=lockstep");
        let ours = Session::on("local");
        ours.report(&format!("run --json {settings} --trace trace.csv"));

        let session = Session::on("local");
        let endpoint = format!("tcp/127.0.0.1:{}", free_port());
        let (trace, errors) =
            (session.directory.join("trace.csv"), session.directory.join("py.err"));
        let plant = format!(
            "plant --json {settings} --trace trace.csv --session {} --listen {endpoint}",
            session.name
        );
        let mut plant = session.start_exactly(&plant.split(' ').collect::<Vec<_>>());
        let _controller = foreign_controller(&session, &endpoint, &errors);
        let status = plant.wait();
        let said = fs::read_to_string(&errors).unwrap();
        assert!(status.success(), "{settings}: {}{said}", plant.stderr());

        let (columns, expected) = read(&ours.directory.join("trace.csv"));
        let (same_columns, found) = read(&trace);
        assert_eq!((&columns, expected.len()), (&same_columns, found.len()), "{settings}");
        let mut largest = 0.0_f64;
        for (expected, found) in expected.iter().zip(&found) {
            for ((column, x), y) in columns.iter().zip(expected).zip(found) {
                if column == "time_s" || column.starts_with("q_") || column.ends_with("_m") {
                    largest = largest.max((x - y).abs());
                }
            }
        }
        eprintln!("{settings}: {} samples, at most {largest:e} apart", found.len());
        assert!(largest <= TOLERANCE, "{settings}: {largest:e} apart");
    }
}
