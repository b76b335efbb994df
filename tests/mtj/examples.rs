//! The numbered examples do what docs/library.md shows.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

/// An example that `cargo test` has built beside this test.
fn example(name: &str) -> PathBuf {
    let test = env::current_exe().unwrap();
    test.parent().and_then(Path::parent).unwrap().join("examples").join(name)
}

/// What an example prints when it is run in a folder of its own.
fn output(name: &str) -> String {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let output = Command::new(example(name)).current_dir(&folder).output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What a document shows below a command: up to the end of its block.
fn shown(document: &str, command: &str) -> String {
    let (_, below) = document.split_once(&format!("$ {command}\n")).unwrap();
    below.split_once("```").unwrap().0.to_owned()
}

#[test]
fn examples_print_what_the_document_shows() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/library.md");
    let document = fs::read_to_string(file).unwrap();
    for name in ["01_loop", "02_latency_and_memories", "03_own_law", "04_own_engine", "06_study"] {
        let command = format!("cargo run --release --example {name}");
        assert_eq!(output(name), shown(&document, &command), "{name}");
    }
}

#[test]
fn a_plant_and_a_controller_of_the_example_close_a_loop_over_zenoh() {
    let report = output("05_two_machines");
    assert!(report.contains("mtj over zenoh, realtime, 3 s, 300 samples"), "{report}");
    assert!(report.contains("round trip"), "{report}");
}
