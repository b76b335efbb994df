//! Failures that users of comparable systems reported, and what happens here instead. Each name is
//! the promise; docs/failures.md has the rules.

use std::{
    fs::{self, OpenOptions},
    io::Write,
    os::unix::fs::OpenOptionsExt,
    process::Command,
    thread,
    time::{Duration, Instant},
};

use mtj_protocol::sample::Phase;
use nix::sys::signal::Signal;
use serde_json::Value;

use crate::{
    needs::needs,
    session::{
        MTJ, Running, Session, eventually, free_port, observer::Observer,
        own_controller::OwnController,
    },
};

/// Runs `mtj` to its end: its exit status, and what it said.
fn say(session: &Session, arguments: &str) -> (Option<i32>, String) {
    let mut run = session.start(arguments);
    let status = run.wait();
    (status.code(), run.stdout() + &run.stderr())
}

/// Changes a running loop; returns the sample from which on the change is in effect.
fn set(session: &Session, sets: &str) -> u64 {
    let (status, said) = say(session, &format!("set {sets}"));
    assert_eq!(status, Some(0), "{sets}: {said}");
    said.trim().rsplit(' ').next().unwrap().parse().unwrap_or_else(|_| panic!("{said}"))
}

fn ended(plant: &mut Running) -> Value {
    plant.signal(Signal::SIGINT);
    let status = plant.wait();
    assert!(status.success(), "{status}: {}", plant.stderr());
    serde_json::from_str(&plant.stdout()).unwrap()
}

/// The torques that the trace of a run has at each sample.
fn torques(session: &Session) -> Vec<Vec<f64>> {
    let trace = fs::read_to_string(session.directory.join("trace.csv")).unwrap();
    let mut lines = trace.lines();
    let titles: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns: Vec<usize> =
        (0..titles.len()).filter(|column| titles[*column].starts_with("torque")).collect();
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        columns.iter().map(|column| cells[*column]).collect()
    };
    lines.map(row).collect()
}

const PLANT: &str = "plant --json --scenario sampled/mtj --set duration=60s";

#[test]
fn a_setting_of_safety_acts_whatever_state_the_arm_is_in() {
    let session = Session::on("iceoryx2");
    let mut plant =
        session.start(&format!("{PLANT} --trace trace.csv --set safety.command_timeout=never"));
    let controller = session.start("controller");
    let mut observer = Observer::join(&session);
    observer.hear_torques(20);
    controller.signal(Signal::SIGKILL);
    thread::sleep(Duration::from_millis(300));
    let limited = set(&session, "safety.torque_limit=[1,1]");
    let timed =
        set(&session, "safety.command_timeout=100ms safety.on_timeout=damp safety.damping=0.05");
    thread::sleep(Duration::from_millis(200));
    let zero = set(&session, "safety.on_timeout=zero");
    thread::sleep(Duration::from_millis(100));
    let report = ended(&mut plant);
    assert_eq!(report["timeouts"], 1, "{report}");
    let torques = torques(&session);
    let largest = |from: u64, to: u64| {
        torques[from as usize..to as usize].iter().flatten().fold(0.0, |m, t| f64::max(m, t.abs()))
    };
    assert!(largest(limited - 5, limited) > 1.0, "the law asks for more than the limit");
    assert!(largest(limited, zero) <= 1.0, "within the limit from the answer on");
    let brakes = &torques[timed as usize..zero as usize];
    assert!(brakes[0] != torques[timed as usize - 1], "the timeout is over at once");
    assert!(brakes.windows(2).any(|pair| pair[0] != pair[1]), "braking follows the speed");
    assert_eq!(largest(zero, torques.len() as u64), 0.0, "the new reaction replaces the old one");
    observer.listen();
    let safe = observer.states.iter().find(|state| state.timed_out == 1).unwrap();
    assert!(safe.header.sequence <= timed + 1, "{} {timed}", safe.header.sequence);
}

#[test]
fn a_timeout_that_no_command_can_meet_is_refused_with_both_numbers() {
    let session = Session::on("iceoryx2");
    let sets = "--set safety.command_timeout=100ms --set link.torque.latency=120ms";
    let (status, said) = say(&session, &format!("{PLANT} {sets}"));
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("\"100ms\"") && said.contains("120 ms"), "{said}");
    let mut plant = session.start(&format!("{PLANT} --set safety.command_timeout=100ms"));
    let _controller = session.start("controller");
    Observer::join(&session).hear_torques(10);
    let (status, said) = say(&session, "set link.state.latency=120ms");
    assert_eq!((status, said.contains("120 ms")), (Some(2), true), "{said}");
    // A measured latency counts, too.
    fs::write(session.directory.join("slow.csv"), "latency_ms\n130\n150\n").unwrap();
    let file = session.directory.join("slow.csv");
    let replay = format!("link.torque.jitter={{kind=\"replay\",file=\"{}\"}}", file.display());
    let (status, said) = say(&session, &format!("set {replay}"));
    assert_eq!((status, said.contains("130 ms")), (Some(2), true), "{said}");
    let report = ended(&mut plant);
    assert_eq!(report["commands"]["too_old"], 0, "{report}");
}

#[test]
fn commands_that_are_too_old_are_counted_apart_and_every_display_shows_the_safe_arm() {
    let session = Session::on("iceoryx2");
    let mut plant = session.start(&format!("{PLANT} --set safety.command_timeout=50ms"));
    let monitor = session.start("monitor");
    let mut controller = OwnController::join(&session);
    while !["the arm brakes", "too old"].iter().all(|words| monitor.stdout().contains(words)) {
        controller.answer(|_| thread::sleep(Duration::from_millis(70)));
    }
    let report = ended(&mut plant);
    let count = |name: &str| report["commands"][name].as_u64().unwrap();
    assert!(count("too_old") > 5, "{report}");
}

#[test]
fn a_setting_that_names_a_file_is_read_elsewhere_and_only_regular_files_are() {
    let session = Session::on("iceoryx2");
    let mut plant = session.start(&format!("{PLANT} --set timing.sample_period=2ms"));
    let _controller = session.start("controller");
    let mut observer = Observer::join(&session);
    observer.hear_torques(100);
    let replay = |file: &str| {
        let file = session.directory.join(file);
        format!("set link.torque.jitter={{kind=\"replay\",file=\"{}\"}}", file.display())
    };
    let fifo = session.directory.join("fifo");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let (status, said) = say(&session, &replay("fifo"));
    assert_eq!((status, said.contains("no regular file")), (Some(2), true), "{said}");
    // Reading this takes some hundred sample periods.
    let lines = "0.5\n".repeat(3_000_000);
    fs::write(session.directory.join("long.csv"), format!("latency_ms\n{lines}")).unwrap();
    let before = observer.status;
    let (status, said) = say(&session, &replay("long.csv"));
    assert_eq!(status, Some(0), "{said}");
    observer.hear_torques(100);
    observer.listen();
    assert_eq!(observer.status.stalls, before.stalls, "the loop did not stand still meanwhile");
    ended(&mut plant);
}

#[test]
fn a_plant_outlives_its_shared_memory_and_no_second_plant_comes_to_its_session() {
    needs!(Machines);
    // A /dev/shm of its own: what is removed there is no other test's.
    let session = Session::on("iceoryx2");
    let holder = session.start_program(
        "unshare",
        &[
            "--mount",
            "sh",
            "-c",
            "mount -t tmpfs tmpfs /dev/shm && touch mounted && exec sleep 100",
        ],
    );
    eventually("the mount", || session.directory.join("mounted").exists().then_some(()));
    let pid = holder.id().to_string();
    let inside = ["nsenter", "--target", &pid, "--mount", "--wdns=."];
    let start = |arguments: &str| session.start_behind_on_bus(&inside, arguments);
    let mut plant = start(&format!("{PLANT} --set safety.command_timeout=100ms"));
    let controller = start("controller");
    let monitor = start("monitor");
    eventually("the loop", || monitor.stdout().contains("mtj").then_some(()));
    let removed = Command::new(inside[0])
        .args(&inside[1..4])
        .args(["sh", "-c", "rm -rf /dev/shm/mtj_*"])
        .status();
    assert!(removed.unwrap().success());
    eventually("a word", || plant.stderr().contains("somebody removed").then_some(()));
    let second = || {
        let mut second = start(&format!("{PLANT} --set duration=1s"));
        let status = second.wait();
        (status.code(), second.stderr())
    };
    let (status, said) = second();
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("has a plant already"), "{said}");
    controller.signal(Signal::SIGSTOP);
    thread::sleep(Duration::from_millis(500));
    controller.signal(Signal::SIGCONT);
    thread::sleep(Duration::from_millis(500));
    assert!(!plant.has_ended(), "{}", plant.stderr());
    let report = ended(&mut plant);
    assert!(report["timeouts"].as_u64().unwrap() >= 1, "{report}");
    assert!(report["commands"]["applied"].as_u64().unwrap() > 50, "{report}");
}

#[test]
fn a_plant_without_descriptors_keeps_its_arm_safe_and_goes_on() {
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let mut plant = session.start(&format!("{PLANT} --set safety.command_timeout=100ms"));
        let controller = session.start("controller");
        let mut observer = Observer::join(&session);
        observer.hear_torques(20);
        let limited = Command::new("prlimit")
            .args(["--nofile=3:3", "--pid", &plant.id().to_string()])
            .status();
        assert!(limited.unwrap().success());
        controller.signal(Signal::SIGKILL);
        observer
            .until("a safe arm", |observer| (observer.states.last()?.timed_out == 1).then_some(()));
        thread::sleep(Duration::from_millis(1500));
        assert!(!plant.has_ended(), "{bus}: {}", plant.stderr());
        let report = ended(&mut plant);
        assert_eq!(report["timeouts"], 1, "{bus}: {report}");
    }
}

#[test]
fn a_session_has_one_plant_wherever_in_a_network_the_second_one_listens() {
    let session = Session::on("zenoh");
    let endpoint = || format!("tcp/127.0.0.1:{}", free_port());
    let (one, other) = (endpoint(), endpoint());
    let words = |places: &[&str]| -> Vec<String> {
        let plant = PLANT.split(' ').chain(["--session", &session.name]);
        plant.chain(places.iter().copied()).map(str::to_owned).collect()
    };
    let start = |places: &[&str]| {
        let words = words(places);
        session.start_exactly(&words.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let mut first = start(&["--listen", &one]);
    eventually("the first", || first.stderr().contains("waiting").then_some(()));
    let mut second = start(&["--listen", &other, "--connect", &one]);
    assert_eq!(second.wait().code(), Some(2), "{}", second.stderr());
    assert!(second.stderr().contains("has a plant already"), "{}", second.stderr());
    assert_eq!(second.stderr().lines().count(), 1, "{}", second.stderr());
    assert!(!first.has_ended());
}

#[test]
fn time_for_which_a_plant_was_stopped_is_no_time_of_its_run() {
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let mut plant = session.start(&format!("{PLANT} --trace trace.csv"));
        let _controller = session.start("controller");
        let mut observer = Observer::join(&session);
        observer.hear_torques(200);
        plant.signal(Signal::SIGSTOP);
        thread::sleep(Duration::from_secs(4));
        plant.signal(Signal::SIGCONT);
        observer.hear_torques(100);
        let report = ended(&mut plant);
        let longest = report["longest_stall_us"].as_f64().unwrap();
        assert!((3.8e6..5.0e6).contains(&longest), "{bus}: {report}");
        assert!(plant.stderr().contains("the plant did not run for"), "{}", plant.stderr());
        assert!(report["duration_s"].as_f64().unwrap() < 30.0, "{report}");
        assert!(report["round_trip_us"]["max"].as_f64().unwrap() < 3e6, "{bus}: {report}");
        let largest = report["peak_torque_nm"].as_array().unwrap();
        assert!(largest.iter().all(|torque| torque.as_f64().unwrap() < 100.0), "{bus}: {report}");
        assert_eq!(report["timeouts"], 0, "{bus}: {report}");
    }
}

#[test]
fn controllers_and_monitors_say_for_how_long_they_did_not_run() {
    let session = Session::on("iceoryx2");
    let _plant = session.start(PLANT);
    let (controller, monitor) = (session.start("controller"), session.start("monitor"));
    Observer::join(&session).hear_torques(20);
    for (role, words) in
        [(&controller, "the controller did not run for 1."), (&monitor, "the monitor did not run")]
    {
        role.signal(Signal::SIGSTOP);
        thread::sleep(Duration::from_millis(1300));
        role.signal(Signal::SIGCONT);
        eventually(words, || role.stderr().contains(words).then_some(()));
    }
}

#[test]
fn a_trace_is_written_while_the_run_goes_on_and_the_old_one_stays_until_it_begins() {
    let session = Session::on("iceoryx2");
    let trace = session.directory.join("trace.csv");
    fs::write(&trace, "old").unwrap();
    let plant = session.start(&format!("{PLANT} --trace trace.csv"));
    eventually("a plant", || plant.stderr().contains("waiting").then_some(()));
    assert_eq!(fs::read_to_string(&trace).unwrap(), "old", "no run has begun");
    let mut second = session.start(&format!("{PLANT} --trace trace.csv"));
    assert_eq!(second.wait().code(), Some(2), "{}", second.stderr());
    assert_eq!(fs::read_to_string(&trace).unwrap(), "old", "the second plant was refused");
    let _controller = session.start("controller");
    Observer::join(&session).hear_torques(100);
    plant.signal(Signal::SIGKILL);
    let rows = fs::read_to_string(&trace).unwrap();
    assert!(rows.starts_with("time_s,") && rows.lines().count() > 90, "{}", rows.lines().count());
}

#[test]
fn a_change_of_law_that_makes_the_torque_jump_is_told_or_made_soft() {
    let session = Session::on("iceoryx2");
    let plant = session.start(PLANT);
    let _controller = session.start("controller");
    let mut observer = Observer::join(&session);
    observer.hear_torques(200);
    // Beside the path by some millimetres, this asks for tens of N m at once.
    set(&session, "law.kind=tj law.kp=20000 law.kd=1");
    let told = "the change of law made the torque at joint";
    eventually(told, || plant.stderr().contains(told).then_some(()));
}

#[test]
fn a_demonstration_that_diverges_waits_for_a_reset_and_goes_on() {
    let session = Session::on("iceoryx2");
    let mut up = session.start(
        "up --no-web --set law.kind=tj --set law.kd=3000 --set link.torque.latency=60ms --set duration=300s",
    );
    let mut observer = Observer::join(&session);
    let diverged = observer.until("a divergence", |observer| {
        (observer.status.phase() == Some(Phase::Diverged)).then_some(observer.status.header)
    });
    thread::sleep(Duration::from_millis(500));
    assert!(!up.has_ended(), "{}", up.stderr());
    eventually("a word", || up.stdout().contains("the arm diverged").then_some(()));
    let (status, said) = say(&session, "set link.torque.latency=0s law.kp=60 law.kd=120");
    assert_eq!(status, Some(0), "{said}");
    let (status, said) = say(&session, "reset");
    assert_eq!(status, Some(0), "{said}");
    observer.until("another run", |observer| {
        let status = &observer.status;
        (status.header.run != diverged.run && status.phase() == Some(Phase::Running)).then_some(())
    });
    up.signal(Signal::SIGINT);
    assert!(up.wait().success(), "{}", up.stderr());
}

#[test]
fn a_foreign_controllers_time_stamps_are_not_believed() {
    for bus in ["iceoryx2", "zenoh"] {
        let session = Session::on(bus);
        let mut plant = session.start(&format!("{PLANT} --set safety.command_timeout=100ms"));
        let mut controller = OwnController::join(&session);
        let (mut honest, mut forged) = (0, 0);
        while honest + forged < 300 {
            controller.answer(|torque| {
                let sequence = torque.header.sequence;
                match sequence % 4 {
                    _ if sequence < 4 => {}
                    0 => torque.header.time_ns = 0,
                    1 => torque.header.time_ns += 1_000_000_000_000,
                    2 => torque.state_sent_ns = 0,
                    _ => {}
                }
                if sequence >= 4 && sequence % 4 < 3 {
                    forged += 1;
                } else {
                    honest += 1;
                }
            });
        }
        let report = ended(&mut plant);
        let count = |name: &str| report["commands"][name].as_u64().unwrap();
        assert!(count("rejected") + 3 >= forged, "{bus}: {forged} forged, {report}");
        assert!(count("applied") <= honest && count("applied") + 5 > honest, "{honest} {report}");
        let told = plant.stderr().matches("does not return the time_ns").count();
        assert_eq!(told, 1, "{bus}: {}", plant.stderr());
    }
}

#[test]
fn a_monitor_says_of_a_silent_law_that_its_error_is_unknown_and_not_that_nobody_controls() {
    let session = Session::on("iceoryx2");
    let _plant = session.start(PLANT);
    let monitor = session.start("monitor");
    let mut controller = OwnController::join(&session);
    while !monitor.stdout().contains("|e| unknown") {
        controller.answer(|_| {});
    }
    assert!(!monitor.stdout().contains("no controller"), "{}", monitor.stdout());
}

#[test]
fn who_cannot_connect_says_within_three_seconds_where_and_why() {
    let session = Session::on("iceoryx2");
    let closed = format!("tcp/127.0.0.1:{}", free_port());
    let stranger = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let stranger = format!("tcp/{}", stranger.local_addr().unwrap());
    for (endpoint, words) in [
        (closed.as_str(), "refused"),
        (&stranger, "is no Zenoh"),
        ("tcp/no-such-host.invalid:7447", "'no-such-host.invalid' is not known"),
    ] {
        let begun = Instant::now();
        let controller = session.start_exactly(&["controller", "--connect", endpoint]);
        let said = eventually("a word", || {
            let said = controller.stderr();
            said.contains(words).then_some(said)
        });
        assert!(begun.elapsed() < Duration::from_secs(4), "{:?}", begun.elapsed());
        assert!(said.contains(endpoint) && said.lines().count() == 1, "{said}");
    }
}

#[test]
fn who_waits_in_vain_is_told_of_another_users_sessions() {
    let session = Session::on("iceoryx2");
    let other = std::path::Path::new("/dev/shm/mtj_4294900000");
    fs::create_dir_all(other).unwrap();
    let controller = session.start("controller");
    let said = eventually("a word", || {
        let said = controller.stderr();
        said.contains("waiting for one").then_some(said)
    });
    fs::remove_dir(other).unwrap();
    assert!(said.contains("private to a user") && said.contains("uid "), "{said}");
}

#[test]
fn roles_that_spin_on_one_processor_wait_in_a_way_that_lets_the_other_run() {
    let session = Session::on("iceoryx2");
    let run = "run --json --set duration=1s --scenario remote/mtj --wait spin";
    let mut pinned = session.start_behind_on_bus(&["taskset", "-c", "0"], run);
    assert!(pinned.wait().success(), "{}", pinned.stderr());
    assert!(pinned.stderr().contains("one processor only"), "{}", pinned.stderr());
    let (status, said) = say(&session, &format!("{run} --cpu 0,0"));
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("--cpu 0,0") && said.contains("--wait hybrid"), "{said}");
}

#[test]
fn terminals_that_take_no_output_hold_up_no_role() {
    let session = Session::on("iceoryx2");
    let made = Command::new("mkfifo").arg(session.directory.join("held")).status();
    assert!(made.unwrap().success());
    // A terminal that the user has stopped: whatever is written to it waits.
    let mut held = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(nix::libc::O_NONBLOCK)
        .open(session.directory.join("held"))
        .unwrap();
    while held.write(&[b'.'; 4096]).is_ok() {}
    while held.write(b".").is_ok() {}
    let start = |command: &str, redirection: &str| {
        let bus = format!("--session {} --bus iceoryx2", session.name);
        session
            .start_program("sh", &["-c", &format!("exec {MTJ} {command} {bus} {redirection}held")])
    };
    let mut monitor = start("monitor --record run.mcap", ">");
    let mut plant = start(&format!("{PLANT} --set safety.command_timeout=100ms"), "2>");
    let mut observer = Observer::join(&session);
    for timeouts in 1..=2 {
        let controller = session.start("controller");
        observer.hear_torques(100);
        drop(controller);
        // This makes the plant say something.
        observer.until("the safe state", |observer| {
            (observer.status.timeouts == timeouts).then_some(())
        });
    }
    plant.signal(Signal::SIGINT);
    assert!(plant.wait().success());
    let report: Value = serde_json::from_str(&plant.stdout()).unwrap();
    assert_eq!(report["stalls"], 0, "{report}");
    assert_eq!(report["timeouts"], 2, "{report}");
    monitor.signal(Signal::SIGINT);
    assert!(monitor.wait().success(), "{}", monitor.stderr());
    let said = monitor.stderr();
    assert!(said.contains("; 0 messages dropped, 0 states missed"), "{said}");
}
