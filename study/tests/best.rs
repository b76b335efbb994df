//! The best gains: against a grid, under their limits, and repeated.

#![allow(clippy::unwrap_used)] // A test that cannot go on should say so.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use mtj_model::scenario::{Override, Scenario};
use mtj_plant::report::Report;
use mtj_study::{
    StudyError,
    best::advice::{self, Question},
    experiment, report,
    sweep::{
        lanes,
        plan::Plan,
        results::{self, Results, Shard},
        runner,
    },
};

/// A folder of one test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("mtj-best-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The joints' torque limits, N m, and the limit of the torque step, N m.
const LIMITS: ([f64; 2], f64) = ([40.0, 20.0], 3.0);

/// Two laws over two latencies and two sample periods.
const STUDY: &str = r#"
title = "Two laws"
scenario = "sampled/mtj"

[set]
"duration" = "8 s"
"timing.clock" = "lockstep"
"timing.integration_step" = "auto"
"bus.kind" = "local"

[[axes]]
name = "sample_period"
key = "timing.sample_period"
values = ["5 ms", "10 ms"]

[[axes]]
name = "latency"
key = "link.torque.latency"
values = ["0 ms", "10 ms"]

[best]
torque_limit = [40, 20]
torque_step_limit = 3
short = "4 s"
population = 12
cases = [{ "law.model.mass_scale" = 0.9 }, { "law.model.mass_scale" = 1.1 }]

[[best.laws]]
name = "mb"
set = { "law.kind" = "mb" }
search = { "law.kp" = [1, 10000], "law.kd" = [1, 1000] }

[[best.laws]]
name = "tdc"
set = { "law.kind" = "tdc", "law.factor.kind" = "constant", "law.memory.policy" = "delivered" }
search = { "law.kp" = [1, 1000], "law.kd" = [1, 1000], "law.mass" = [0.1, 4] }
"#;

fn plan() -> Plan {
    Plan::parse("two", STUDY, &[]).unwrap()
}

/// The rows of a study, run on so many threads, as maps from column to field.
fn rows(plan: &Plan, folder: &Path, threads: usize) -> Vec<BTreeMap<String, String>> {
    let mut found = Results::open(folder, plan, Shard::ALL).unwrap();
    assert!(runner::run_in_process(plan, &mut found, Shard::ALL, threads, &|| true).unwrap());
    found.sort(plan).unwrap();
    let columns = results::columns(plan);
    let named = |row: results::ResultRow| columns.iter().cloned().zip(row.fields).collect();
    results::read(folder, plan).unwrap().map(|row| named(row.unwrap())).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

/// The scenario of a command that a row has.
fn scenario(command: &str, more: &[&str]) -> Scenario {
    let words = command.strip_prefix("mtj run --scenario ").unwrap();
    let (name, flags) = words.split_once(' ').unwrap();
    let flags = flags.split("--set ").map(|flag| flag.trim().trim_matches('\''));
    let all = flags.filter(|flag| !flag.is_empty()).chain(more.iter().copied());
    let set: Vec<Override> = all.map(|flag| flag.parse().unwrap()).collect();
    Scenario::load(name, &set).unwrap()
}

fn run(command: &str, more: &[&str]) -> Report {
    experiment::run_direct(&scenario(command, more), false, &|| true).unwrap().report
}

fn keeps_torque(report: &Report) -> bool {
    !report.diverged
        && report.peak_torque_nm.iter().zip(LIMITS.0).all(|(peak, limit)| *peak <= limit)
}

#[test]
fn a_row_s_command_repeats_its_error_to_the_last_digit_and_keeps_all_limits() {
    let folder = Folder::new("repeat");
    let rows = rows(&plan(), &folder.0, 2);
    assert_eq!(rows.len(), 8);
    for row in rows {
        let command = &row["command"];
        let report = run(command, &[]);
        let error = report.rms_error_m.unwrap();
        assert_eq!(error.to_string(), row["rms_error_m"], "{command}");
        assert!(keeps_torque(&report) && report.torque_step_rms_nm.unwrap() <= LIMITS.1);
        let latency = number(&row, "latency_s");
        let longer = format!("link.torque.latency={} s", 1.5 * latency);
        let with_margin = run(command, &[&longer]);
        assert!(keeps_torque(&with_margin), "{command} with {longer}");
        assert!(with_margin.rms_error_m.unwrap() <= 2.0 * error, "{command} with {longer}");
        assert!(number(&row, "margin_rms_error_m") <= 2.0 * error);
    }
}

#[test]
fn the_results_are_the_same_on_any_number_of_threads_and_in_shards() {
    let (one, two, parts) = (Folder::new("one"), Folder::new("both"), Folder::new("parts"));
    let plan = plan();
    let all = rows(&plan, &one.0, 1);
    assert_eq!(all, rows(&plan, &two.0, 2));
    for index in [2, 1] {
        let shard = Shard { index, of: 2 };
        let mut found = Results::open(&parts.0, &plan, shard).unwrap();
        assert!(runner::run_in_process(&plan, &mut found, shard, 1, &|| true).unwrap());
    }
    let merged = results::merge(std::slice::from_ref(&parts.0), &plan).unwrap();
    assert_eq!((merged.count, merged.missing), (8, 0));
    let file = |folder: &Folder| fs::read_to_string(folder.0.join("results.csv")).unwrap();
    assert_eq!(file(&one), file(&parts));
}

/// The least error on a grid of gains of mb with a period and a latency of 10 ms, under the limits.
fn least_on_a_grid(count: usize) -> f64 {
    let place =
        |i: usize, from: f64, to: f64| from * (to / from).powf(i as f64 / (count - 1) as f64);
    let mut scenarios = Vec::new();
    for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
        for (scale, latency) in [(0.9, 10), (1.1, 10), (0.9, 15), (1.1, 15)] {
            let set = [
                "duration=8 s",
                "timing.clock=lockstep",
                "timing.integration_step=auto",
                "bus.kind=local",
                "law.kind=mb",
                &format!("law.kp={}", place(i, 3.0, 3000.0)),
                &format!("law.kd={}", place(j, 3.0, 300.0)),
                &format!("law.model.mass_scale={scale}"),
                &format!("link.torque.latency={latency} ms"),
            ];
            let set: Vec<Override> = set.iter().map(|set| set.parse().unwrap()).collect();
            scenarios.push(Scenario::load("sampled/mtj", &set).unwrap());
        }
    }
    let mut reports = vec![None; scenarios.len()];
    lanes::measure(&scenarios, &|| true, &mut |number, measured| {
        reports[number] = Some(measured.unwrap());
    });
    let reports: Vec<Report> = reports.into_iter().map(Option::unwrap).collect();
    let error = |reports: &[Report]| {
        let all = reports.iter().map(|report| report.rms_error_m.unwrap_or(f64::INFINITY));
        all.fold(0.0, f64::max)
    };
    let least = reports.chunks(4).filter_map(|runs| {
        let (at_latency, with_margin) = runs.split_at(2);
        let is_calm = |run: &Report| run.torque_step_rms_nm.is_some_and(|step| step <= LIMITS.1);
        let keeps = runs.iter().all(keeps_torque)
            && at_latency.iter().all(is_calm)
            && error(with_margin) <= 2.0 * error(at_latency);
        keeps.then(|| error(at_latency))
    });
    least.fold(f64::INFINITY, f64::min)
}

#[test]
fn no_gains_on_a_fine_grid_are_better_by_more_than_five_percent() {
    let folder = Folder::new("grid");
    let rows = rows(&plan(), &folder.0, 2);
    let row = &rows[3];
    assert_eq!([&row["law"], &row["sample_period_s"], &row["latency_s"]], ["mb", "0.01", "0.01"]);
    let (found, least) = (number(row, "rms_error_m"), least_on_a_grid(41));
    assert!(found <= 1.05 * least, "{found} m, on the grid {least} m: {row:?}");
    assert!(found >= 0.8 * least, "{found} m is far below the grid's {least} m: {row:?}");
}

#[test]
fn where_no_gains_keep_the_limits_the_row_says_which_limit_is_in_the_way() {
    let folder = Folder::new("none");
    let text = STUDY.replace("torque_limit = [40, 20]", "torque_limit = [4, 2]");
    let plan = Plan::parse("none", &text, &[]).unwrap();
    for row in rows(&plan, &folder.0, 2) {
        let blank =
            ["rms_error_m", "command", "law.kp", "error"].map(|column| row[column].as_str());
        assert_eq!((blank, row["limit"].as_str()), ([""; 4], "torque"));
    }
}

#[test]
fn a_limit_that_is_in_the_way_gives_a_lower_error_when_it_is_raised() {
    let (low, high) = (Folder::new("low"), Folder::new("high"));
    let tight = STUDY.replace("torque_limit = [40, 20]", "torque_limit = [22, 11]");
    let tight = rows(&Plan::parse("tight", &tight, &[]).unwrap(), &low.0, 2);
    let wide = rows(&plan(), &high.0, 2);
    let bound: Vec<_> =
        tight.iter().zip(&wide).filter(|(row, _)| row["limit"] == "torque").collect();
    assert!(!bound.is_empty(), "{tight:?}");
    for (tight, wide) in bound {
        let (tight_error, wide_error) = (number(tight, "rms_error_m"), number(wide, "rms_error_m"));
        assert!(wide_error < tight_error, "{tight:?} {wide:?}");
    }
}

#[test]
fn the_report_shows_the_best_law_and_each_cell_s_command() {
    let folder = Folder::new("report");
    let rows = rows(&plan(), &folder.0, 2);
    let files = report::write(&folder.0, &|| true).unwrap();
    assert_eq!(files.figures[0].name, "best-law");
    let page = fs::read_to_string(&files.page).unwrap();
    let svg = fs::read_to_string(&files.figures[0].svg).unwrap();
    for cell in 0..4 {
        let error = |law: usize| number(&rows[4 * law + cell], "rms_error_m");
        let best = usize::from(error(1) < error(0));
        let mark = format!(r#"data-at="{best},{},{}""#, cell / 2, cell % 2);
        assert!(svg.contains(&mark), "{mark}");
        let command = serde_json::to_string(&rows[4 * best + cell]["command"]).unwrap();
        assert!(page.contains(&command), "{command}");
    }
}

#[test]
fn a_range_that_is_none_is_refused_with_its_key() {
    let text = STUDY.replace(r#""law.kp" = [1, 10000]"#, r#""law.kp" = [10, 1]"#);
    let error = Plan::parse("bad", &text, &[]).unwrap_err().to_string();
    assert!(error.contains("search") && error.contains("0 < from < to"), "{error}");
    let text = STUDY.replace("torque_step_limit = 3", "torque_step_limit = 0");
    let error = Plan::parse("bad", &text, &[]).unwrap_err().to_string();
    assert!(error.contains("torque_step_limit = 0"), "{error}");
    let predicted = mtj_study::predict::scenarios(&plan());
    assert!(matches!(predicted, Err(StudyError::Searched { .. })));
}

#[test]
fn advice_ranks_the_laws_that_keep_the_limits_and_tells_of_the_others() {
    let set = ["duration=8 s", "link.torque.latency=5 ms", "sensor.noise=0.005"];
    let question = Question {
        scenario: "sampled/mtj".to_owned(),
        set: set.iter().map(|set| set.parse().unwrap()).collect(),
        torque_limit_nm: LIMITS.0.to_vec(),
        torque_step_limit_nm: Some(LIMITS.1),
        cases: vec![Vec::new()],
    };
    let advice = advice::advise(&question, &|| true).unwrap();
    let errors: Vec<f64> = advice.laws.iter().map(|law| law.rms_error_m().unwrap()).collect();
    assert!(errors.len() > 5 && errors.is_sorted(), "{advice:?}");
    let found = advice.laws[0].found.as_ref().unwrap();
    let report = run(&found.command, &[]);
    assert_eq!(report.rms_error_m, Some(errors[0]));
    assert!(keeps_torque(&report) && report.torque_step_rms_nm.unwrap() <= LIMITS.1);

    // A redundant arm: the laws that need a square Jacobian are told apart.
    let redundant = Question {
        scenario: "redundant/mtj".to_owned(),
        set: vec!["duration=4 s".parse().unwrap()],
        torque_limit_nm: vec![200.0],
        torque_step_limit_nm: Some(50.0),
        ..question
    };
    let advice = advice::advise(&redundant, &|| true).unwrap();
    let mb = advice.others.iter().find(|other| other.law == "mb").unwrap();
    assert!(mb.found.as_ref().unwrap_err().to_string().contains("not square"));
}
