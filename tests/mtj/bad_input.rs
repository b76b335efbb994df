//! What cannot be, is refused: in one sentence on standard error, with status 2, and nothing left
//! running.

use std::{fs, net::TcpListener, thread, time::Duration};

use crate::session::Session;

/// Runs `mtj` with these arguments and fails unless it refuses them in one line with all the words.
fn assert_refused(session: &Session, arguments: &[&str], words: &[&str]) {
    let arguments = [arguments, &["--session", &session.name]].concat();
    let mut run = session.start_exactly(&arguments);
    let status = run.wait();
    // What `mtj up` is about to do is no part of the refusal.
    let banner = |line: &&str| line.starts_with("mtj up: ") && line.ends_with("Ctrl-C ends it");
    let err = run.stderr();
    let out = run.stdout().lines().filter(|line| !banner(line)).collect::<String>();
    assert_eq!(status.code(), Some(2), "{arguments:?} says: {err}{out}");
    assert_eq!(out, "", "{arguments:?}: nothing on standard output");
    assert_eq!(err.lines().count(), 1, "{arguments:?}: one sentence, not: {err}");
    for word in words {
        assert!(err.contains(word), "{arguments:?}: '{word}' is not in: {err}");
    }
    assert!(!err.contains("panicked"), "{err}");
    assert!(session.processes().is_empty(), "{arguments:?}: nothing left running");
}

#[test]
fn bad_values_are_refused_by_key_and_value() {
    let session = Session::on("local");
    for (set, words) in [
        ("law.gain=3", &["law.gain", "3", "no key 'gain'"][..]),
        ("timing.sample_period=10parsec", &["timing.sample_period", "10parsec", "ms"]),
        ("law.kind=lqr", &["law.kind", "lqr", "mtj"]),
        ("arm.links[0].mass=-4", &["arm.links[0].mass", "-4", "greater than 0"]),
        ("arm.links[1].length=0", &["arm.links[1].length", "0", "greater than 0"]),
        ("arm.position=[0.3, 0.0]", &["arm.position", "[0.3, 0.0]", "singular"]),
        ("timing.sample_period=0s", &["timing.sample_period", "0s", "at least"]),
        ("law.kp=[1, 2, 3]", &["law.kp", "[1, 2, 3]", "list of 2"]),
        ("law.kd=[[1, 2], [2, 1]]", &["law.kd", "[[1, 2], [2, 1]]", "positive definite"]),
        ("law.memory.step=15ms", &["law.memory.step", "15ms", "multiple"]),
        ("law.mass=-1", &["law.mass = -1", "positive definite", "one number", "task-inertia"]),
        ("law.mass=[[1, 2], [2, 1]]", &["law.mass", "[[1, 2], [2, 1]]", "positive definite"]),
        ("law.mass=[1, 2, 3]", &["law.mass", "[1, 2, 3]", "list of 2"]),
        ("law.mass=heavy", &["law.mass", "\"heavy\"", "one number", "\"task-inertia\""]),
        ("law.factor.error=[1, 0]", &["law.factor.error", "[1, 0]", "greater than 0", "list of 2"]),
        ("law.factor.kind=sure", &["law.factor.kind", "\"sure\"", "\"constant\""]),
        ("task.kind=space", &["task.kind", "\"space\"", "\"plane\""]),
        ("bus.kind=smoke", &["bus.kind", "smoke", "zenoh"]),
        ("law.kp", &["law.kp", "KEY=VALUE"]),
    ] {
        for command in [&["run", "--json"][..], &["up"], &["plant"], &["scenario", "check"]] {
            assert_refused(
                &session,
                &[command, &["--set", set]].concat(),
                &[&["--set"], words].concat(),
            );
        }
    }
}

#[test]
fn a_key_that_only_another_law_reads_is_checked() {
    let session = Session::on("local");
    for (kind, set, words) in [
        ("tj", "law.factor.error=-1", &["law.factor.error = -1", "greater than 0"][..]),
        ("tj", "law.mass=heavy", &["law.mass = \"heavy\"", "task-inertia"]),
        ("mb", "law.acceleration=perhaps", &["law.acceleration = \"perhaps\"", "true or false"]),
        ("tdc", "law.acceleration=1", &["law.acceleration = 1", "true or false"]),
    ] {
        let kind = format!("law.kind={kind}");
        let arguments = ["scenario", "check", "--set", &kind, "--set", "law.mass=2", "--set", set];
        assert_refused(&session, &arguments, &[&["--set"], words].concat());
    }
}

/// A scenario with one link, which has no task inertia in the plane.
fn one_link(law: &str) -> String {
    let text = mtj_model::scenario::built_in("sampled/mtj").unwrap();
    let (before, rest) = text.split_once("    { length = 1.0, mass = 3.0").unwrap();
    let (_, after) = rest.split_once("]\n").unwrap();
    format!("{before}]\n{after}")
        .replace("position = [0.03, 1.5707963267948966]", "position = [0.03]")
        .replace("velocity = [1.5, -1.0]", "velocity = [1.5]")
        .replace("radius = 1.4142135623730951", "radius = 0.8")
        .replace("kind = \"mtj\"", law)
}

#[test]
fn a_mass_that_a_law_needs_and_does_not_have_is_refused() {
    let session = Session::on("local");
    let write = |name: &str, text: &str| fs::write(session.directory.join(name), text).unwrap();
    let check = |file: &str, words: &[&str]| {
        let words = [&[file], words].concat();
        for command in [&["run", "--json"][..], &["scenario", "check"]] {
            let arguments = [command, &["--scenario", file]].concat();
            assert_refused(&session, &arguments, &words);
        }
    };
    let rank = ["law.mass = \"task-inertia\"", "a number", "rank", "1 joints for 2 task axes"];
    write("tdc.toml", &one_link("kind = \"tdc\"\nmass = \"task-inertia\""));
    check("tdc.toml", &rank);
    let with_term = "kind = \"mtj\"\nacceleration = true\nmass = \"task-inertia\"";
    write("mtj.toml", &one_link(with_term));
    check("mtj.toml", &rank);
    write("none.toml", &one_link("kind = \"tdc\""));
    check("none.toml", &["law.mass is missing", "one number", "task-inertia"]);
    write("wide.toml", &one_link("kind = \"tdc\"\nmass = [1, 2, 3]"));
    check("wide.toml", &["law.mass = [1, 2, 3]", "list of 2"]);
    write("space.toml", &format!("{}\n[task]\nkind = \"space\"\n", one_link("kind = \"tj\"")));
    check("space.toml", &["task.kind = \"space\"", "\"plane\""]);
    // With a number it is a law like any other, and without the term mtj needs no mass.
    for law in ["kind = \"tdc\"\nmass = 2", "kind = \"mtj\"\nmass = \"task-inertia\""] {
        mtj_model::scenario::Scenario::parse("here", &one_link(law), &[]).unwrap();
    }
}

#[test]
fn unknown_scenarios_are_refused_by_name() {
    let session = Session::on("local");
    for command in ["run", "up", "plant"] {
        let words = ["--scenario", "'sampled/pid'", "mtj scenario list"];
        assert_refused(&session, &[command, "--scenario", "sampled/pid"], &words);
    }
}

#[test]
fn files_are_refused_by_name_and_line() {
    let session = Session::on("local");
    let write = |name: &str, text: &str| fs::write(session.directory.join(name), text).unwrap();
    write("torn.toml", "duration = \"20 s\"\n[arm\n");
    assert_refused(
        &session,
        &["run", "--scenario", "torn.toml"],
        &["torn.toml", "line 2", "not TOML"],
    );
    write("empty.toml", "");
    assert_refused(
        &session,
        &["run", "--scenario", "empty.toml"],
        &["empty.toml", "arm is missing"],
    );
    let text = mtj_model::scenario::built_in("sampled/mb").unwrap();
    write("heavy.toml", &text.replace("mass = 4.0", "mass = \"heavy\""));
    let words = ["heavy.toml", "arm.links[0].mass", "\"heavy\"", "kg"];
    assert_refused(&session, &["run", "--scenario", "heavy.toml"], &words);
    assert_refused(&session, &["run", "--scenario", "."], &["'.'", "could not be read"]);
}

#[test]
fn a_folder_that_cannot_be_made_is_refused() {
    let session = Session::on("local");
    let arguments = ["study", "run", "latency", "--out", "/proc/here"];
    assert_refused(&session, &arguments, &["--out /proc/here", "can be written"]);
}

#[test]
fn mb_on_a_redundant_arm_is_refused() {
    let session = Session::on("local");
    let arguments = ["run", "--scenario", "redundant/mtj", "--set", "law.kind=mb"];
    assert_refused(&session, &arguments, &["law.kind", "mb", "tj or mtj", "3 joints"]);
}

#[test]
fn addresses_that_do_not_parse_are_refused() {
    let session = Session::on("local");
    for address in ["nowhere", "tcp/127.0.0.1", "tcp/127.0.0.1:http", "pigeon/127.0.0.1:7447"] {
        for command in ["run", "up", "plant"] {
            assert_refused(&session, &[command, "--listen", address], &["bus.listen", address]);
        }
        for command in ["controller", "monitor"] {
            assert_refused(&session, &[command, "--connect", address], &["bus.connect", address]);
        }
    }
}

#[test]
fn an_unknown_bus_is_refused() {
    let session = Session::on("local");
    for command in ["run", "up", "plant", "controller", "monitor"] {
        let words = ["bus.kind", "\"smoke\"", "\"iceoryx2\""];
        assert_refused(&session, &[command, "--bus", "smoke"], &words);
    }
}

#[test]
fn the_local_bus_is_not_for_roles_of_their_own() {
    let session = Session::on("local");
    for command in ["plant", "controller", "monitor"] {
        assert_refused(&session, &[command, "--bus", "local"], &["bus.kind", "local", "iceoryx2"]);
    }
}

#[test]
fn a_busy_port_is_refused_and_nothing_is_left_running() {
    let busy = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/127.0.0.1:{}", busy.local_addr().unwrap().port());
    let session = Session::on("local");
    for command in ["plant", "run", "up"] {
        let words = ["bus.listen", &endpoint, "in use", "--listen"];
        assert_refused(&session, &[command, "--listen", &endpoint], &words);
    }
}

#[test]
fn a_trace_that_cannot_be_written_is_refused_before_the_run() {
    let session = Session::on("local");
    for bus in ["local", "iceoryx2", "zenoh"] {
        let arguments =
            ["run", "--bus", bus, "--set", "duration=1h", "--trace", "no/such/place.csv"];
        assert_refused(&session, &arguments, &["--trace", "no/such/place.csv"]);
    }
}

#[test]
fn a_zenoh_configuration_that_is_none_is_refused() {
    let session = Session::on("local");
    fs::write(session.directory.join("odd.json5"), "{ mode: ").unwrap();
    for file in ["odd.json5", "absent.json5"] {
        for command in ["run", "plant", "controller", "monitor"] {
            let words = [file, "not a Zenoh configuration"];
            assert_refused(&session, &[command, "--zenoh-config", file], &words);
        }
    }
}

#[test]
fn a_second_plant_in_a_session_is_refused() {
    let session = Session::on("iceoryx2");
    let arguments = ["plant", "--bus", "iceoryx2", "--session", &session.name];
    let mut first = session.start_exactly(&arguments);
    let mut second = session.start_exactly(&arguments);
    // Whichever came second.
    let refused = crate::session::eventually("a refusal", || {
        thread::sleep(Duration::from_millis(5));
        [&mut first, &mut second]
            .into_iter()
            .find_map(|plant| plant.has_ended().then(|| (plant.wait(), plant.stderr())))
    });
    assert_eq!(refused.0.code(), Some(2), "{}", refused.1);
    for word in ["session", &session.name, "--session"] {
        assert!(refused.1.contains(word), "'{word}' in: {}", refused.1);
    }
    assert_eq!(refused.1.lines().count(), 1, "{}", refused.1);
}
