//! Studies as a user runs them: the same on any number of threads and over any bus, and nothing
//! lost by whatever interrupts them.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use crate::{
    machine::{self, Place},
    session::MTJ,
};

/// A folder of this test's own, removed when it is over.
struct Folder(PathBuf, #[expect(dead_code, reason = "held, not read")] Arc<Place>);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("mtj-study-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Self(path, machine::beside_others())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A study of three laws, one of which does not exist for the arm at some points.
fn write_study(folder: &Folder, latencies: usize, duration: &str) -> PathBuf {
    let path = folder.path("study.toml");
    let text = format!(
        r#"
scenario = "sampled/mtj"

[set]
"timing.clock" = "lockstep"
"timing.integration_step" = "5 ms"
"bus.kind" = "local"
"duration" = "{duration}"

[[axes]]
name = "law"
variants = [
    {{ name = "mtj sent", set = {{ "law.memory.policy" = "sent" }} }},
    {{ name = "mtj delivered", set = {{ "law.memory.policy" = "delivered", "law.prediction.horizon" = "measured" }} }},
    {{ name = "mb", set = {{ "law.kind" = "mb", "law.kp" = 8, "law.kd" = 4 }} }},
]

[[axes]]
name = "latency"
key = "link.torque.latency"
from = "0 ms"
to = "20 ms"
count = {latencies}
"#
    );
    fs::write(&path, text).unwrap();
    path
}

fn mtj_study(arguments: &[&str]) -> Command {
    let mut command = Command::new(MTJ);
    command.arg("study").args(arguments).stdin(Stdio::null()).stderr(Stdio::piped());
    command
}

fn run(study: &Path, out: &Path, more: &[&str]) -> Output {
    let mut arguments = vec!["run", study.to_str().unwrap(), "--out", out.to_str().unwrap()];
    arguments.extend(more);
    mtj_study(&arguments).output().unwrap()
}

fn results(out: &Path) -> String {
    fs::read_to_string(out.join("results.csv")).unwrap()
}

#[test]
fn a_study_is_the_same_on_any_number_of_threads_and_over_every_bus() {
    let folder = Folder::new("same");
    let study = write_study(&folder, 4, "2 s");
    let out = folder.path("one");
    assert!(run(&study, &out, &["--threads", "1"]).status.success());
    let expected = results(&out);
    assert_eq!(expected.lines().count(), 13);
    let ways: [&[&str]; 3] = [&["--threads", "5"], &["--bus", "iceoryx2"], &["--bus", "zenoh"]];
    for way in ways {
        let out = folder.path(&way.join("-"));
        let output = run(&study, &out, way);
        assert!(output.status.success(), "{way:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(results(&out), expected, "{way:?}");
    }
}

#[test]
fn a_study_in_lanes_is_the_same_on_any_number_of_threads_and_agrees_with_every_bus() {
    let folder = Folder::new("lanes");
    let study = write_study(&folder, 12, "2 s");
    let auto = ["--set", "timing.integration_step=auto"];
    let rows = |name: &str, way: &[&str]| {
        let out = folder.path(name);
        let output = run(&study, &out, &[&auto[..], way].concat());
        assert!(output.status.success(), "{way:?}: {}", String::from_utf8_lossy(&output.stderr));
        results(&out)
    };
    let expected = rows("one", &["--threads", "1"]);
    assert_eq!(rows("five", &["--threads", "5"]), expected);
    let over_bus = rows("bus", &["--bus", "iceoryx2"]);
    let (ours, theirs) = (fields(&expected), fields(&over_bus));
    let mut compared = 0;
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert_eq!(ours[..3], theirs[..3]);
        let [ours, theirs] = [ours, theirs].map(|row| row[3].parse::<f64>().unwrap_or(f64::NAN));
        // Beyond that the loop is a limit cycle, which blows up any difference.
        if theirs < 0.05 {
            compared += 1;
            assert!((ours - theirs).abs() < 1e-9, "rms error {ours} m, over a bus {theirs} m");
        }
    }
    assert!(compared > 20, "{compared}");
}

/// The fields of all rows.
fn fields(results: &str) -> Vec<Vec<&str>> {
    results.lines().skip(1).map(|row| row.split(',').collect()).collect()
}

#[test]
fn a_study_killed_at_ten_moments_loses_and_repeats_no_point() {
    let folder = Folder::new("killed");
    let study = write_study(&folder, 200, "20 s");
    let whole = folder.path("whole");
    assert!(run(&study, &whole, &[]).status.success());
    let out = folder.path("killed");
    let mut progress = vec![0];
    for i in 0..10u64 {
        let (study, out) = (study.to_str().unwrap(), out.to_str().unwrap());
        let mut child = mtj_study(&["run", study, "--out", out]).spawn().unwrap();
        // Moments that have nothing to do with the program's own rhythm.
        thread::sleep(Duration::from_millis(20 + (i * 7919) % 131));
        child.kill().unwrap();
        child.wait().unwrap();
        let path = Path::new(out).join("results.csv");
        progress
            .push(fs::read(path).map_or(0, |text| text.iter().filter(|b| **b == b'\n').count()));
    }
    assert!(progress.windows(2).all(|pair| pair[0] <= pair[1]), "{progress:?}");
    assert!(progress[5] > 1, "something was done before it was killed: {progress:?}");
    assert!(progress[5] < 601, "the kills came in the middle of it: {progress:?}");
    assert!(run(&study, &out, &[]).status.success());
    assert_eq!(results(&out), results(&whole));
}

#[test]
fn a_row_cut_short_is_done_again() {
    let folder = Folder::new("cut");
    let study = write_study(&folder, 3, "1 s");
    let out = folder.path("out");
    assert!(run(&study, &out, &[]).status.success());
    let whole = results(&out);
    fs::write(out.join("results.csv"), &whole[..whole.len() - 25]).unwrap();
    assert!(run(&study, &out, &[]).status.success());
    assert_eq!(results(&out), whole);
}

#[test]
fn ctrl_c_stops_a_study_that_can_be_gone_on_with() {
    let folder = Folder::new("stopped");
    let study = write_study(&folder, 2000, "20 s");
    let out = folder.path("out");
    let (study, out) = (study.to_str().unwrap(), out.to_str().unwrap());
    let child = mtj_study(&["run", study, "--out", out]).spawn().unwrap();
    let started = Instant::now();
    let rows = || {
        fs::read_to_string(Path::new(out).join("results.csv"))
            .map_or(0, |text| text.lines().count())
    };
    while rows() < 20 && started.elapsed() < Duration::from_secs(30) {
        thread::sleep(Duration::from_millis(10));
    }
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupted.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("run the same command again"));
    assert!((20..6001).contains(&rows()), "{}", rows());
}

#[test]
fn shards_join_to_the_whole_and_what_is_missing_is_named() {
    let folder = Folder::new("shards");
    let study = write_study(&folder, 5, "1 s");
    let whole = folder.path("whole");
    assert!(run(&study, &whole, &[]).status.success());
    let (one, other) = (folder.path("a"), folder.path("b"));
    assert!(run(&study, &one, &["--shard", "1/3"]).status.success());
    assert!(run(&study, &other, &["--shard", "3/3"]).status.success());
    let merge = || {
        let [study, one, other] = [&study, &one, &other].map(|path| path.to_str().unwrap());
        mtj_study(&["merge", study, one, other]).output().unwrap()
    };
    let output = merge();
    assert_eq!(output.status.code(), Some(1));
    let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(sentence.contains("5 of 15 points are missing: 1, 4, 7, 10, 13"), "{sentence}");
    assert!(run(&study, &other, &["--shard", "2/3"]).status.success());
    assert!(merge().status.success());
    assert_eq!(results(&one), results(&whole));
}

#[test]
fn a_bad_point_is_recorded_and_stops_nothing() {
    let folder = Folder::new("bad");
    let study = write_study(&folder, 2, "1 s");
    let text = fs::read_to_string(&study).unwrap();
    // A memory step that is a multiple of the sample period only at some points.
    let axis = "\n[[axes]]\nname = \"step\"\nkey = \"law.memory.step\"\nvalues = [\"10 ms\", \"15 ms\", \"20 ms\"]\n";
    fs::write(&study, text + axis).unwrap();
    let out = folder.path("out");
    let output = run(&study, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    let sentence = last_line(&output.stderr);
    assert!(sentence.contains("12 points in ") && sentence.contains(", 6 failed: "), "{sentence}");
    let text = results(&out);
    let (bad, good): (Vec<_>, Vec<_>) =
        text.lines().skip(1).partition(|row| row.contains("law.memory.step"));
    assert_eq!((bad.len(), good.len()), (6, 12));
    assert!(bad.iter().all(|row| row.contains("whole multiple")), "{bad:?}");
}

/// A study of two links, one of which replays a file; of three latencies, in lanes.
fn write_replays(folder: &Folder, replayed: &str) -> PathBuf {
    let path = folder.path("replays.toml");
    let text = format!(
        r#"
scenario = "sampled/mtj"

[set]
"timing.clock" = "lockstep"
"timing.integration_step" = "auto"
"bus.kind" = "local"
"duration" = "1 s"

[[axes]]
name = "network"
variants = [
    {{ name = "constant", set = {{ "link.state.latency" = "1 ms" }} }},
    {{ name = "measured", set = {{ "link.state.jitter" = {{ kind = "replay", file = "{replayed}" }} }} }},
]

[[axes]]
name = "latency"
key = "link.torque.latency"
values = ["0 ms", "1 ms", "2 ms"]
"#
    );
    fs::write(&path, text).unwrap();
    path
}

fn report(out: &Path) -> Output {
    let mut command = mtj_study(&["report", out.to_str().unwrap()]);
    command.output().unwrap()
}

fn last_line(text: &[u8]) -> String {
    String::from_utf8_lossy(text).lines().next_back().unwrap_or_default().to_owned()
}

#[test]
fn points_that_failed_are_counted_reported_and_tried_again_and_no_others() {
    let folder = Folder::new("failed");
    let replayed = folder.path("net.csv");
    let study = write_replays(&folder, replayed.to_str().unwrap());
    let out = folder.path("out");
    let failed = run(&study, &out, &[]);
    assert_eq!(failed.status.code(), Some(1));
    let sentence = last_line(&failed.stderr);
    let expected = format!("3 points in {}, 3 failed: the replayed latencies", out.display());
    assert!(sentence.contains(&expected) && sentence.contains("tries them again"), "{sentence}");
    let reported = report(&out);
    assert!(reported.status.success());
    let line = last_line(&reported.stdout);
    assert!(line.starts_with("3 of 6 points failed: the replayed latencies"), "{line}");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.matches("3 of 6 points failed").count() > 5, "the page and its figures say so");

    // A row that was computed again would lose this mark.
    let before = results(&out);
    let row = before.lines().nth(2).unwrap();
    let marked = row.rsplit_once(",100,").map(|(left, right)| format!("{left},123,{right}"));
    let marked = marked.unwrap_or_else(|| panic!("no column of 100 samples: {row}"));
    fs::write(out.join("results.csv"), before.replace(row, &marked)).unwrap();
    fs::write(&replayed, "latency_ms\n1\n").unwrap();
    let output = run(&study, &out, &[]);
    assert!(output.status.success(), "{}", last_line(&output.stderr));
    assert_eq!(last_line(&output.stdout), format!("6 points in {}", out.display()));
    let after = results(&out);
    assert_eq!(after.lines().nth(2), Some(&*marked));
    // The file says a millisecond for each message, which is what the other link has.
    let rms = |row: usize| fields(&after)[row][3].to_owned();
    assert_eq!([rms(3), rms(4), rms(5)], [rms(0), rms(1), rms(2)]);
    assert!(!last_line(&report(&out).stdout).contains("points failed"));
}

#[test]
fn a_report_of_points_that_all_failed_is_an_error_and_draws_nothing() {
    let folder = Folder::new("all-failed");
    let study = write_replays(&folder, "nowhere.csv");
    let set = r#"link.state.jitter={ kind = "replay", file = "nowhere.csv" }"#;
    let text = fs::read_to_string(&study).unwrap();
    let text = text.replace(r#""link.state.latency" = "1 ms""#, r#""seed" = 2"#);
    fs::write(&study, text).unwrap();
    let out = folder.path("out");
    let output = run(&study, &out, &["--set", set]);
    assert_eq!(output.status.code(), Some(1));
    assert!(last_line(&output.stderr).contains("0 points in "), "{}", last_line(&output.stderr));
    let reported = report(&out);
    assert_eq!(reported.status.code(), Some(2));
    let sentence = last_line(&reported.stderr);
    assert!(sentence.contains("all 6 points failed: the replayed latencies"), "{sentence}");
    assert!(!out.join("report.html").exists() && !out.join("figures").exists());
}

#[test]
fn shards_with_failed_points_join_to_what_could_be_run() {
    let folder = Folder::new("failed-shards");
    let replayed = folder.path("net.csv");
    let study = write_replays(&folder, replayed.to_str().unwrap());
    let out = folder.path("out");
    for shard in ["1/2", "2/2"] {
        let output = run(&study, &out, &["--shard", shard]);
        assert_eq!(output.status.code(), Some(1), "{}", last_line(&output.stderr));
    }
    let merge =
        || mtj_study(&["merge", study.to_str().unwrap(), out.to_str().unwrap()]).output().unwrap();
    let output = merge();
    assert_eq!(output.status.code(), Some(1));
    let sentence = last_line(&output.stderr);
    assert!(sentence.contains(", 3 failed: the replayed latencies"), "{sentence}");
    fs::write(&replayed, "latency_ms\n1\n").unwrap();
    assert!(run(&study, &out, &["--shard", "1/2"]).status.success());
    assert!(last_line(&merge().stderr).contains("4 points in "), "one shard is run again");
    assert!(run(&study, &out, &["--shard", "2/2"]).status.success());
    assert!(merge().status.success());
    assert!(fields(&results(&out)).iter().all(|row| row.last() == Some(&"")));
}

#[test]
fn a_folder_with_another_study_is_left_alone() {
    let folder = Folder::new("other");
    let study = write_study(&folder, 2, "1 s");
    let out = folder.path("out");
    assert!(run(&study, &out, &[]).status.success());
    let before = results(&out);
    let output = run(&study, &out, &["--set", "seed=2"]);
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("another study"));
    assert_eq!(results(&out), before);
}

#[test]
fn the_built_in_studies_are_all_acceptable_and_the_map_is_large_enough() {
    let output = mtj_study(&["list"]).output().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), 10, "{text}");
    let points: usize = text
        .lines()
        .find(|line| line.starts_with("latency "))
        .and_then(|line| line.split_whitespace().nth(1))
        .and_then(|count| count.parse().ok())
        .unwrap();
    assert!(points >= 7 * 40 * 25, "{points}");
}

#[test]
fn predictions_are_close_to_measurements_where_the_loop_is_linear_enough() {
    let folder = Folder::new("predict");
    let study = write_study(&folder, 2, "20 s");
    let text = fs::read_to_string(&study).unwrap();
    let axis = "\n[[axes]]\nname = \"period\"\nkey = \"timing.sample_period\"\nvalues = [\"2 ms\", \"5 ms\"]\n";
    fs::write(&study, text + axis).unwrap();
    let output = mtj_study(&["predict", study.to_str().unwrap(), "--csv"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut compared = 0;
    for row in text.lines().skip(1).filter(|row| row.starts_with("mtj")) {
        let fields: Vec<_> = row.split(',').collect();
        let (predicted, measured): (f64, f64) =
            (fields[5].parse().unwrap(), fields[6].parse().unwrap());
        assert!((predicted / measured - 1.0).abs() < 0.15, "{row}");
        compared += 1;
    }
    assert_eq!(compared, 4, "{text}");
}

#[test]
fn every_built_in_study_runs() {
    let folder = Folder::new("built-in");
    let list = String::from_utf8(mtj_study(&["list"]).output().unwrap().stdout).unwrap();
    for name in list.lines().filter_map(|line| line.split_whitespace().next()) {
        let out = folder.path(name);
        // A search of gains at thousands of points takes half an hour; some of them will do.
        let is_search = name == "best";
        let some: &[&str] = if is_search { &["--shard", "1/2000"] } else { &[] };
        let output = run(Path::new(name), &out, &[&["--set", "duration=100ms"], some].concat());
        let stderr = String::from_utf8_lossy(&output.stderr);
        if is_search {
            assert!(output.status.success(), "{name}: {stderr}");
            continue;
        }
        let text = results(&out);
        let bad = text.lines().skip(1).filter(|row| !row.ends_with(',')).count();
        assert_eq!(bad, 0, "{name}: {bad} points could not be run");
        assert!(output.status.success(), "{name}: {stderr}");
    }
}

#[test]
fn the_benchmark_prints_how_far_the_lanes_are_from_the_reference_and_that_is_not_far() {
    let arguments = ["bench", "sweep", "--runs", "16", "--checks", "4", "--threads", "2"];
    let output = Command::new(MTJ).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let differences: Vec<f64> = text
        .lines()
        .filter_map(|line| line.strip_suffix(" m")?.split_whitespace().last()?.parse().ok())
        .collect();
    assert_eq!(differences.len(), 8, "{text}");
    assert!(differences.iter().all(|difference| *difference < 1e-9), "{text}");
}
