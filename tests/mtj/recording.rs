//! What is said in a session is in its recording, for anybody to read and for a controller to
//! answer once more.

use std::{
    env, fs,
    net::TcpStream,
    path::{Path, PathBuf},
    process::Command,
    thread,
    time::Duration,
};

use crate::{
    needs::{self, needs},
    session::{Running, Session, eventually},
};
use nix::sys::signal::Signal;
use serde_json::Value;

/// What the mcap package of PyPI finds in a recording.
fn read_independently(recording: &Path) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recording.py");
    let output = Command::new(needs::python()).arg(script).arg(recording).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Starts a monitor that records, and waits until nothing can escape it.
fn start_recording(session: &Session, more: &str) -> (Running, PathBuf) {
    let file = session.directory.join("run.mcap");
    let monitor = session.start(&format!("monitor --record {}{more}", file.display()));
    eventually("recording", || monitor.stderr().contains("recording to").then_some(()));
    (monitor, file)
}

fn finish(monitor: &mut Running) -> String {
    monitor.signal(Signal::SIGTERM);
    let status = monitor.wait();
    assert!(status.success(), "{status}: {}", monitor.stderr());
    monitor.stderr()
}

fn report_of(plant: &mut Running) -> Value {
    assert!(plant.wait().success(), "{}", plant.stderr());
    serde_json::from_str(&plant.stdout()).unwrap()
}

/// `mtj` with these arguments and a recording; what it prints.
fn over(session: &Session, command: &str, recording: &Path, more: &[&str]) -> String {
    let recording = recording.to_str().unwrap();
    let mut run = session.start_exactly(&[&[command, recording][..], more].concat());
    assert!(run.wait().success(), "{}", run.stderr());
    run.stdout()
}

fn replay(session: &Session, recording: &Path, more: &[&str]) -> Value {
    let more = [&["--json"][..], more].concat();
    serde_json::from_str(&over(session, "replay", recording, &more)).unwrap()
}

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no count"))
}

/// Whether that is what a monitor says at its end.
fn lost_nothing(said: &str) -> bool {
    said.contains("; 0 messages dropped, 0 states missed")
}

#[test]
fn a_kilohertz_run_of_thirty_seconds_is_recorded_without_loss_and_replayed_without_difference() {
    needs!(Python);
    let session = Session::on("iceoryx2");
    let mut plant = session.start(
        "plant --json --scenario sampled/mtj --set duration=30s --set timing.clock=realtime \
         --set timing.sample_period=1ms",
    );
    let (mut monitor, file) = start_recording(&session, "");
    let mut controller = session.start("controller");
    let report = report_of(&mut plant);
    controller.signal(Signal::SIGTERM);
    controller.wait();
    let said = finish(&mut monitor);
    assert!(lost_nothing(&said), "{said}");

    let found = read_independently(&file);
    assert_eq!(found["finished"], true);
    assert_eq!(found["metadata"]["mtj"]["session"], session.name.as_str());
    let topic = |name: &str| &found["topics"][format!("/mtj/{name}")];
    for name in ["scenario", "state", "torque", "error", "status", "request", "change", "presence"]
    {
        let topic = topic(name);
        assert_eq!(topic["invalid"], Value::Array(vec![]), "{name}");
        assert_eq!(topic["schema"], format!("mtj.{name}"));
        let summary = found["summary"].get(format!("/mtj/{name}"));
        assert_eq!(summary.map_or(0, number), number(&topic["messages"]), "{name}");
        assert!(said.contains(&format!("{} {name}", topic["messages"])), "{said}");
    }

    // Every state the plant counted, in order; the first is repeated until it is answered.
    let states = topic("state");
    assert_eq!(report["samples"], 30_000);
    assert_eq!(number(&states["messages"]) - number(&states["repeated"]), 30_000);
    assert_eq!((&states["gaps"], &states["elsewhen"]), (&0.into(), &0.into()));
    assert_eq!(states["last"]["header"]["sequence"], 29_999);
    assert_eq!(states["last"]["header"]["time_ns"], 29_999_000_000_u64);
    assert_eq!(states["runs"].as_array().unwrap().len(), 1);

    // Every torque that reached the plant; those it counts as lost it never got.
    let torques = topic("torque");
    let answered = number(&torques["messages"]) - number(&torques["repeated"]);
    let commands = &report["commands"];
    assert_eq!(commands["sent"], 30_000);
    assert!(answered >= number(&commands["applied"]), "{answered}, {report}");
    assert!(answered <= 30_000, "{answered}, {report}");
    assert_eq!(number(&topic("error")["messages"]), answered, "an error for each answer");
    assert_eq!(topic("scenario")["messages"], 1);

    let same = replay(&session, &file, &[]);
    assert_eq!((&same["differing"], &same["compared"]), (&0.into(), &answered.into()), "{same}");
    assert_eq!((&same["takeovers"], &same["joined"]), (&0.into(), &0.into()), "{same}");
    let other = replay(&session, &file, &["--set", "law.kind=tj"]);
    assert_eq!(other["compared"], answered, "{other}");
    assert!(number(&other["differing"]) > answered / 2, "{other}");
    assert!(other["largest"][0]["difference_nm"].as_f64().unwrap() > 1.0, "{other}");
    // tj is mtj without its memory, which is empty at the first sample.
    assert_eq!(other["first"]["at"]["sequence"], 1, "{other}");
}

#[test]
fn a_recording_survives_a_kill() {
    needs!(Python);
    let session = Session::on("iceoryx2");
    let mut plant = session.start("plant --json --scenario sampled/mtj --set duration=4s");
    let (mut monitor, file) = start_recording(&session, "");
    let mut controller = session.start("controller");
    let seconds = |second: f64| {
        move |line: &str| {
            let time = line.strip_prefix('t').and_then(|line| line.split_whitespace().next());
            time.is_some_and(|time| time.parse::<f64>().unwrap() >= second)
        }
    };
    eventually("three seconds", || monitor.stdout().lines().any(seconds(2.8)).then_some(()));
    monitor.signal(Signal::SIGKILL);
    assert!(!monitor.wait().success());
    assert!(plant.wait().success());
    controller.signal(Signal::SIGTERM);
    controller.wait();

    let found = read_independently(&file);
    assert_eq!(found["finished"], false);
    let states = &found["topics"]["/mtj/state"];
    // A second at most is lost, and a second more on a machine that is busy.
    let last = number(&states["last"]["header"]["sequence"]);
    assert!((80..400).contains(&last), "{states}");
    assert_eq!(states["gaps"], 0);
    let findings = replay(&session, &file, &[]);
    assert_eq!((&findings["cut_short"], &findings["differing"]), (&true.into(), &0.into()));
    assert_eq!(findings["states"], states["messages"], "we read as far as others do");
    assert!(number(&findings["compared"]) > 80, "{findings}");

    // Cut anywhere, it is read up to there.
    let bytes = fs::read(&file).unwrap();
    for length in (8..bytes.len()).step_by(bytes.len() / 23) {
        let cut = session.directory.join("cut.mcap");
        fs::write(&cut, &bytes[..length]).unwrap();
        let findings = replay(&session, &cut, &[]);
        assert_eq!((&findings["cut_short"], &findings["differing"]), (&true.into(), &0.into()));
    }
}

#[test]
fn a_recording_that_begins_in_mid_run_is_replayed_too_and_so_is_one_with_two_controllers() {
    let session = Session::on("iceoryx2");
    let mut plant = session
        .start("plant --json --scenario sampled/mtj --set duration=4s --set law.memory.step=50ms");
    let mut controller = session.start("controller");
    thread::sleep(Duration::from_millis(1200));
    let (mut monitor, file) = start_recording(&session, "");
    thread::sleep(Duration::from_millis(800));
    controller.signal(Signal::SIGKILL);
    controller.wait();
    let mut standby = session.start("controller");
    assert!(plant.wait().success());
    standby.signal(Signal::SIGTERM);
    standby.wait();
    finish(&mut monitor);
    let findings = replay(&session, &file, &[]);
    assert_eq!((&findings["differing"], &findings["takeovers"]), (&0.into(), &1.into()));
    // Each time until the next memory step begins.
    assert!((2..=10).contains(&number(&findings["joined"])), "{findings}");
    assert!(number(&findings["compared"]) > 100, "{findings}");
}

/// The columns of a CSV file whose names begin with one of `names`, row by row.
fn columns(file: &Path, names: &[&str]) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(file).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let is_wanted = |i: &usize| names.iter().any(|name| header[*i].starts_with(name));
    let wanted: Vec<usize> = (0..header.len()).filter(is_wanted).collect();
    // Before the first command there is no echo.
    let number = |cell: &str| if cell.is_empty() { 0.0 } else { cell.parse().unwrap() };
    lines.map(|row| wanted.iter().map(|i| number(row[*i])).collect()).collect()
}

#[test]
fn a_recording_becomes_tables_with_the_same_numbers() {
    let session = Session::on("iceoryx2");
    let (mut monitor, file) = start_recording(&session, "");
    let mut plant = session.start(
        "plant --json --scenario sampled/mtj --set duration=500ms --set timing.clock=lockstep \
         --trace trace.csv",
    );
    let mut controller = session.start("controller");
    assert_eq!(report_of(&mut plant)["samples"], 50);
    controller.signal(Signal::SIGTERM);
    controller.wait();
    finish(&mut monitor);
    let tables = session.directory.join("tables");
    let to_tables = ["--csv", tables.to_str().unwrap()];
    let printed = over(&session, "export", &file, &to_tables);
    assert!(printed.contains("state.csv: ") && printed.contains("torque.csv: "), "{printed}");

    // Without noise, what is measured is what is true, and the plant writes that down on its own.
    let mut measured = columns(&tables.join("state.csv"), &["position_", "velocity_"]);
    measured.dedup(); // The first state is repeated until a controller answers it.
    let truth = columns(&session.directory.join("trace.csv"), &["q_rad_", "q_dot_rad_s_"]);
    assert_eq!(measured, truth);
    let mut applied = columns(&tables.join("state.csv"), &["applied_"]);
    applied.drain(..applied.len() - 50);
    assert_eq!(applied, columns(&session.directory.join("trace.csv"), &["force_n_"]));

    let units = fs::read_to_string(tables.join("units.csv")).unwrap();
    for unit in [
        "state,position_0,rad",
        "torque,echo_1,N",
        "error,factor_0,",
        "error,memory_0,N",
        "state,time_ns,ns",
    ] {
        assert!(units.lines().any(|line| line == unit), "{unit} is not in {units}");
    }
    let mut again =
        session.start_exactly(&["export", file.to_str().unwrap(), to_tables[0], to_tables[1]]);
    assert_eq!(again.wait().code(), Some(2), "tables that are there are not replaced");
    assert!(again.stderr().contains("--overwrite"), "{}", again.stderr());
    over(&session, "export", &file, &[&to_tables[..], &["--overwrite"]].concat());
}

/// The recordings in a session's folder, in order.
fn recordings(session: &Session) -> Vec<PathBuf> {
    let entries = fs::read_dir(&session.directory).unwrap().flatten();
    let is_recording = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "mcap");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_recording).collect();
    paths.sort();
    paths
}

#[test]
fn each_part_of_a_recording_is_replayed_on_its_own() {
    let session = Session::on("iceoryx2");
    let (mut monitor, _) = start_recording(&session, " --record-split 1s");
    let mut plant = session.start("plant --json --scenario sampled/mtj --set duration=4s");
    let mut controller = session.start("controller");
    report_of(&mut plant);
    controller.signal(Signal::SIGTERM);
    controller.wait();
    let said = finish(&mut monitor);
    assert!(lost_nothing(&said), "{said}");
    let parts = recordings(&session);
    assert!((4..=8).contains(&parts.len()), "{parts:?}");
    assert!(parts[0].ends_with("run-0001.mcap"), "{parts:?}");
    let last = parts.last().unwrap();
    let summary = format!("run-0001.mcap to {}", last.display());
    assert!(said.contains(&summary), "'{summary}' is not in: {said}");
    let (mut states, mut compared) = (0, 0);
    for part in &parts {
        let findings = replay(&session, part, &[]);
        assert_eq!((&findings["differing"], &findings["cut_short"]), (&0.into(), &false.into()));
        assert_eq!(findings["without_scenario"], 0, "{findings}");
        states += number(&findings["states"]);
        compared += number(&findings["compared"]);
    }
    assert!(states >= 400 && compared > 350, "{states} states, {compared} compared");
    assert!(said.contains(&format!("{states} state, ")), "{states}: {said}");
}

#[test]
fn the_last_seconds_are_saved_at_a_signal_and_when_the_controller_falls_silent() {
    let session = Session::on("iceoryx2");
    let file = session.directory.join("run.mcap");
    let mut monitor =
        session.start(&format!("monitor --record {} --record-last 2s", file.display()));
    eventually("keeping", || monitor.stderr().contains("keeping the last 2s").then_some(()));
    let plant = session.start("plant --scenario sampled/mtj --set duration=60s");
    let mut controller = session.start("controller");
    let after = |second: f64| {
        move |line: &str| {
            let time = line.strip_prefix('t').and_then(|line| line.split_whitespace().next());
            time.is_some_and(|time| time.parse::<f64>().unwrap() >= second)
        }
    };
    let saved = |monitor: &Running, count: usize| {
        let is_saved = || {
            (monitor.stderr().matches(": saving the last").count() == count
                && monitor.stderr().matches("mtj monitor: saved ").count() == count)
                .then_some(())
        };
        eventually("a saved file", is_saved);
        let files = recordings(&session);
        assert_eq!(files.len(), count, "{files:?}");
        replay(&session, files.last().unwrap(), &[])
    };
    eventually("four seconds", || monitor.stdout().lines().any(after(3.9)).then_some(()));
    monitor.signal(Signal::SIGUSR1);
    let findings = saved(&monitor, 1);
    assert_eq!((&findings["differing"], &findings["cut_short"]), (&0.into(), &false.into()));
    // Two seconds at 100 Hz, and an eighth of a second more at most; more on a machine that is busy.
    assert!((190..300).contains(&number(&findings["states"])), "{findings}");
    assert!(number(&findings["compared"]) > 150, "{findings}");

    controller.signal(Signal::SIGKILL);
    controller.wait();
    let findings = saved(&monitor, 2);
    assert_eq!(findings["differing"], 0);
    let unanswered = number(&findings["states"]) - number(&findings["torques"]);
    assert!(unanswered > 30, "half a second of states without an answer: {findings}");
    let said = monitor.stderr();
    assert!(said.contains("SIGUSR1: saving") && said.contains("the controller has been silent"));
    drop(plant);
    finish(&mut monitor);
}

#[test]
fn a_stop_of_the_arm_saves_the_last_seconds() {
    let session = Session::on("iceoryx2");
    let mut monitor = session.start("monitor --record run.mcap --record-last 2s");
    let _plant = session.start("plant --scenario sampled/mtj --set duration=60s");
    let _controller = session.start("controller");
    eventually("the loop", || monitor.stdout().contains("mtj").then_some(()));
    let mut set = session.start("set safety.position_max=[0.1,3.0]");
    assert!(set.wait().success(), "{}", set.stderr());
    eventually("a saved file", || monitor.stderr().contains("monitor: saved ").then_some(()));
    let said = finish(&mut monitor);
    assert!(said.contains("a joint left its limits") && said.contains("saving the last"), "{said}");
    let [file] = &recordings(&session)[..] else { panic!("{said}") };
    assert_eq!(replay(&session, file, &[])["differing"], 0);
}

#[test]
fn a_monitor_that_takes_every_tenth_sample_and_some_topics_says_that_it_missed_none() {
    let session = Session::on("iceoryx2");
    let (mut monitor, file) = start_recording(&session, " --every 10 --topics state,error");
    let mut plant = session
        .start("plant --json --scenario sampled/mtj --set duration=4s --set timing.clock=realtime");
    let mut controller = session.start("controller");
    report_of(&mut plant);
    controller.signal(Signal::SIGTERM);
    controller.wait();
    let said = finish(&mut monitor);
    assert!(lost_nothing(&said), "{said}");
    assert!(said.contains(" 0 torque, "), "{said}");
    let printed = monitor.stdout();
    assert!(printed.contains("|e| "), "{printed}");
    assert!(!printed.contains("missed") && !printed.contains("controller has been silent"));

    let tables = session.directory.join("tables");
    over(&session, "export", &file, &["--csv", tables.to_str().unwrap()]);
    let sequences = |table: &str| {
        let mut numbers = columns(&tables.join(table), &["sequence"]).concat();
        numbers.dedup(); // The first state is repeated until a controller answers it.
        numbers
    };
    let tens: Vec<f64> = (0..40).map(|i| 10.0 * f64::from(i)).collect();
    assert_eq!(sequences("state.csv"), tens);
    let errors = sequences("error.csv");
    assert!(errors.iter().all(|number| tens.contains(number)) && errors.len() > 20, "{errors:?}");
    assert!(sequences("status.csv").len() > 100, "status always passes");
}

/// A file system that is soon full, if this user may mount one.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(path: PathBuf) -> Option<Self> {
        fs::create_dir_all(&path).unwrap();
        let options = ["-t", "tmpfs", "-o", "size=64k", "tmpfs"];
        let status = Command::new("mount").args(options).arg(&path).status();
        status.is_ok_and(|status| status.success()).then_some(Self(path))
    }
}

impl SmallDisk {
    fn grow(&self) {
        let options = ["-o", "remount,size=64m"];
        assert!(Command::new("mount").args(options).arg(&self.0).status().unwrap().success());
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

#[test]
fn a_full_disk_is_told_once_and_monitoring_goes_on() {
    needs!(Python);
    let session = Session::on("iceoryx2");
    let Some(disk) = SmallDisk::mount(session.directory.join("disk")) else {
        eprintln!("not tested: only root may mount a small disk");
        return;
    };
    let file = disk.0.join("run.mcap");
    let mut monitor = session.start(&format!("monitor --record {}", file.display()));
    let plant = session.start("plant --scenario sampled/mtj --set duration=60s");
    let controller = session.start("controller");
    let is_full = || monitor.stderr().contains("the disk is full").then_some(());
    eventually("a full disk", is_full);
    let lines = |monitor: &Running| monitor.stdout().lines().count();
    let before = lines(&monitor);
    eventually("two more lines", || (lines(&monitor) >= before + 2).then_some(()));
    let said = finish(&mut monitor);
    drop((plant, controller));
    assert_eq!(said.matches("the disk is full").count(), 1, "{said}");
    assert!(!lost_nothing(&said), "{said}");
    let found = read_independently(&file);
    let states = &found["topics"]["/mtj/state"]["messages"];
    assert_eq!(found["finished"], false);
    assert!(said.contains(&format!("{states} state, ")), "{states}: {said}");
    let findings = replay(&session, &file, &[]);
    assert_eq!((&findings["states"], &findings["differing"]), (states, &0.into()), "{findings}");
    assert!(number(&findings["compared"]) > 10, "{findings}");
}

#[test]
fn the_last_seconds_that_do_not_fit_on_a_disk_are_told_and_kept_for_the_next_request() {
    let session = Session::on("iceoryx2");
    let Some(disk) = SmallDisk::mount(session.directory.join("disk")) else {
        eprintln!("not tested: only root may mount a small disk");
        return;
    };
    let file = disk.0.join("run.mcap");
    let mut monitor =
        session.start(&format!("monitor --record {} --record-last 60s", file.display()));
    let plant = session
        .start("plant --scenario sampled/mtj --set duration=60s --set timing.sample_period=1ms");
    let controller = session.start("controller");
    let after = |line: &str| line.starts_with("t ") && !line.starts_with("t     0.");
    eventually("some seconds", || {
        (monitor.stdout().lines().filter(|l| after(l)).count() > 3).then_some(())
    });
    monitor.signal(Signal::SIGUSR1);
    let is_told =
        || monitor.stderr().contains("the disk is full; this file ends here").then_some(());
    eventually("a full disk", is_told);
    let lines = |monitor: &Running| monitor.stdout().lines().count();
    let before = lines(&monitor);
    eventually("two more lines", || (lines(&monitor) >= before + 2).then_some(()));
    disk.grow();
    monitor.signal(Signal::SIGUSR1);
    eventually("a saved file", || monitor.stderr().contains("monitor: saved ").then_some(()));
    drop((plant, controller));
    let said = finish(&mut monitor);
    assert!(said.contains("files saved: 1;"), "{said}");

    let [first, second] =
        ["run-0001.mcap", "run-0002.mcap"].map(|name| replay(&session, &disk.0.join(name), &[]));
    assert_eq!((&first["cut_short"], &first["differing"]), (&true.into(), &0.into()), "{first}");
    assert_eq!(
        (&second["cut_short"], &second["differing"]),
        (&false.into(), &0.into()),
        "{second}"
    );
    assert!(number(&second["states"]) > number(&first["states"]) + 1000, "{first} {second}");
}

#[test]
fn a_recording_is_played_to_a_dashboard() {
    let session = Session::on("iceoryx2");
    let (mut monitor, file) = start_recording(&session, "");
    let mut plant = session.start("plant --json --scenario sampled/mtj --set duration=3s");
    let controller = session.start("controller");
    report_of(&mut plant);
    drop(controller);
    finish(&mut monitor);

    let serve = ["replay", file.to_str().unwrap(), "--serve", "127.0.0.1:0", "--speed", "3"];
    let mut player = session.start_exactly(&serve);
    let address = eventually("an address", || {
        let said = player.stderr();
        let (_, url) = said.split_once("dashboard at http://")?;
        Some(url.split_once('/')?.0.to_owned())
    });
    let stream = TcpStream::connect(&address).unwrap();
    stream.set_read_timeout(Some(crate::session::LONG)).unwrap();
    let (mut socket, _) = tungstenite::client(format!("ws://{address}/live"), stream).unwrap();
    let mut next =
        || -> Value { serde_json::from_str(socket.read().unwrap().to_text().unwrap()).unwrap() };
    let hello = next();
    assert_eq!((&hello["kind"], &hello["read_only"]), (&"hello".into(), &true.into()), "{hello}");
    // The curves come to the end of the run, and begin at its beginning.
    let mut begin = f64::INFINITY;
    loop {
        let message = next();
        if message["kind"] == "bins" {
            let times: Vec<f64> = serde_json::from_value(message["t"].clone()).unwrap();
            begin = times.iter().copied().fold(begin, f64::min);
            if times.iter().any(|time| *time > 2.9) {
                break;
            }
        }
    }
    assert!(begin < 0.1, "{begin}");
    eventually("the end", || player.stderr().contains("played to its end").then_some(()));
    assert!(!player.has_ended(), "the dashboard stays");
    finish(&mut player);
}

#[test]
fn a_file_that_is_there_is_not_lost() {
    needs!(Python);
    let session = Session::on("iceoryx2");
    let file = session.directory.join("run.mcap");
    fs::write(&file, "precious").unwrap();
    let record = format!("monitor --record {}", file.display());
    let mut monitor = session.start(&record);
    assert_eq!(monitor.wait().code(), Some(2));
    let said = monitor.stderr();
    assert!(said.contains("exists") && said.contains("--overwrite"), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");

    let (mut monitor, file) = start_recording(&session, " --overwrite");
    finish(&mut monitor);
    assert_eq!(
        read_independently(&file)["finished"],
        true,
        "a recording in which nothing was said"
    );
}

#[test]
fn an_impossible_recording_is_refused_in_one_sentence() {
    let session = Session::on("iceoryx2");
    let text = session.directory.join("text.mcap");
    fs::write(&text, "no recording").unwrap();
    let text = text.to_str().unwrap();
    for (arguments, words) in [
        (&["monitor", "--record", "/nowhere/run.mcap"][..], "/nowhere/run.mcap"),
        (&["monitor", "--record", "/", "--overwrite"], "directory"),
        (&["monitor", "--record", "a.mcap", "--record-split", "10"], "--record-split '10'"),
        (&["monitor", "--record", "a.mcap", "--record-last", "1ms"], "--record-last '1ms'"),
        (&["monitor", "--record", "/nowhere/a.mcap", "--record-last", "9s"], "/nowhere/a.mcap"),
        (&["replay", "/nowhere/run.mcap"], "No such file"),
        (&["replay", text], "not an MCAP file"),
        (&["replay", text, "--set", "law.kind"], "KEY=VALUE"),
        (&["export", text, "--csv", "out"], "not an MCAP file"),
    ] {
        let mut run = session.start_exactly(arguments);
        assert_eq!(run.wait().code(), Some(2), "{arguments:?}: {}", run.stderr());
        let said = run.stderr();
        assert!(said.contains(words) && said.lines().count() == 1, "{arguments:?}: {said}");
    }
}
