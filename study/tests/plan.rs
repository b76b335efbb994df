//! Plans: where their scenario is, what `--set` changes, and what a report says of it.

#![allow(clippy::unwrap_used)] // A test that cannot go on should say so.

use std::{
    fs,
    path::{Path, PathBuf},
};

use mtj_model::scenario::{Override, built_in};
use mtj_study::{
    StudyError, experiment, report,
    sweep::{
        plan::Plan,
        results::{self, Results, Shard, ShardError},
        runner,
    },
};

/// A folder of one test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("mtj-plan-{name}-{}", std::process::id()));
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

fn study(scenario: &str, latencies: &str) -> String {
    format!(
        r#"title = "Latencies of 1 s"
scenario = "{scenario}"

[set]
"duration" = "1 s"
"timing.clock" = "lockstep"
"timing.integration_step" = "auto"
"bus.kind" = "local"

[[axes]]
name = "latency"
key = "link.torque.latency"
values = [{latencies}]
"#
    )
}

fn run(plan: &Plan, out: &Path) {
    let mut results = Results::open(out, plan, Shard::ALL).unwrap();
    assert!(runner::run_in_process(plan, &mut results, Shard::ALL, 1, &|| true).unwrap());
    results.sort(plan).unwrap();
}

#[test]
fn a_relative_scenario_starts_at_the_folder_of_the_study_and_is_found_from_its_results() {
    let folder = Folder::new("relative");
    let (own, out) = (folder.0.join("own"), folder.0.join("out"));
    fs::create_dir_all(&own).unwrap();
    fs::write(own.join("arm.toml"), built_in("sampled/mtj").unwrap()).unwrap();
    let path = own.join("study.toml");
    fs::write(&path, study("arm.toml", r#""0 ms", "1 ms""#)).unwrap();
    let plan = Plan::load(path.to_str().unwrap(), &[]).unwrap();
    assert_eq!(Path::new(&plan.scenario), own.join("arm.toml"));
    run(&plan, &out);
    let again = Plan::from_folder(&out).unwrap();
    assert_eq!(again.scenario(1).unwrap().text(), plan.scenario(1).unwrap().text());
    assert!(again.command(0).contains("own/arm.toml --set "), "{}", again.command(0));
    // The same study in another place is still the same study.
    let moved = folder.0.join("moved");
    fs::rename(&own, &moved).unwrap();
    let plan = Plan::load(moved.join("study.toml").to_str().unwrap(), &[]).unwrap();
    assert!(Results::open(&out, &plan, Shard::ALL).is_ok());
    let error = Plan::from_folder(&out).unwrap_err();
    assert!(matches!(error, StudyError::NoScenario { .. }) && error.is_bad_input());
}

#[test]
fn a_scenario_that_is_not_there_is_an_error_with_the_path_that_was_tried() {
    let folder = Folder::new("missing");
    let path = folder.0.join("study.toml");
    fs::write(&path, study("arm.toml", r#""0 ms""#)).unwrap();
    let sentence = Plan::load(path.to_str().unwrap(), &[]).unwrap_err().to_string();
    let tried = folder.0.join("arm.toml");
    assert!(sentence.contains(&format!("there is no {}", tried.display())), "{sentence}");
    assert!(sentence.contains("starts at the folder of the study"), "{sentence}");
}

#[test]
fn a_study_is_shown_as_it_was_written_and_changes_are_comments() {
    let text = study("sampled/mtj", r#""0 ms""#);
    assert_eq!(Plan::parse("own", &text, &[]).unwrap().shown(), text);
    let set = [Override::text("duration", "2 s")];
    let changed = Plan::parse("own", &text, &set).unwrap();
    assert_eq!(changed.shown(), format!("{text}# --set duration=2 s\n"));
    assert_eq!(changed.changes(), set);
}

#[test]
fn a_report_says_below_the_title_what_set_has_changed() {
    let folder = Folder::new("changed");
    let text = study("sampled/mtj", r#""0 ms", "1 ms""#);
    let plan = Plan::parse("own", &text, &[Override::text("duration", "2 s")]).unwrap();
    run(&plan, &folder.0);
    let files = report::write(&folder.0, &|| true).unwrap();
    let svg = fs::read_to_string(&files.figures[0].svg).unwrap();
    assert!(svg.contains("Latencies of 1 s") && svg.contains("; with duration=2 s</text>"));
    let page = fs::read_to_string(&files.page).unwrap();
    assert_eq!(page.matches(r#"<template class="figure"><svg "#).count(), files.figures.len());
    assert_eq!(svg.matches("data-at=").count(), 2, "a mark for each point");
    assert!(
        files.figures.iter().all(|figure| page.contains(&fs::read_to_string(&figure.svg).unwrap()))
    );
}

#[test]
fn a_shard_is_one_of_several() {
    assert_eq!("2/8".parse(), Ok(Shard { index: 2, of: 8 }));
    for text in ["0/8", "9/8", "2", "a/b", ""] {
        assert_eq!(text.parse::<Shard>(), Err(ShardError), "{text}");
    }
}

#[test]
fn a_report_says_which_part_of_a_run_its_measures_are_over() {
    let folder = Folder::new("spans");
    let plan = Plan::parse("own", &study("sampled/mtj", r#""0 ms", "1 ms""#), &[]).unwrap();
    run(&plan, &folder.0);
    let files = report::write(&folder.0, &|| true).unwrap();
    for figure in &files.figures {
        let svg = fs::read_to_string(&figure.svg).unwrap();
        let is_error = figure.svg.file_stem().unwrap().to_str().unwrap().ends_with("error");
        let span = if is_error { "second half" } else { "whole" };
        assert!(svg.contains(&format!(">over the {span} of each run</text>")), "{svg}");
    }
    let page = fs::read_to_string(&files.page).unwrap();
    assert!(page.contains("Errors are over the second half of each run, torques and energy over"));
    // The whole run has a larger peak than its second half.
    let scenario = plan.scenario(0).unwrap();
    let trace = experiment::run_direct(&scenario, true, &|| true).unwrap().trace;
    let peak = |from: f64| {
        let rows = trace.iter().filter(|row| row.time >= from);
        rows.map(|row| row.error[0].hypot(row.error[1])).fold(0.0, f64::max)
    };
    let row = results::read(&folder.0, &plan).unwrap().next().unwrap().unwrap();
    let column = results::columns(&plan).iter().position(|name| name == "peak_error_m").unwrap();
    let shown: f64 = row.fields[column].parse().unwrap();
    assert!((shown / peak(0.5) - 1.0).abs() < 1e-6 && peak(0.0) > 1.1 * shown, "{shown}");
}
