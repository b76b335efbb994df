//! Scenarios: what is accepted, what is refused, and what the refusal says.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::time::Duration;

use mtj_model::{
    MAX_AXES,
    gains::Gains,
    law::{
        LAWS, Law,
        factor::{FactorKind, Thresholds},
        find,
        mass::Mass,
        mtj::ModifiedTransposeJacobian,
    },
    scenario::{
        BUILT_IN, BusKind, BusSettings, ClockKind, DEFAULT_ENDPOINT, DEFAULT_SPIN, Horizon, Jitter,
        MEMORY, MemoryPolicy, OnTimeout, Override, PREDICTION, Scenario, ScenarioError, Wait,
        built_in,
    },
};

fn overridden(name: &str, sets: &[&str]) -> Result<Scenario, ScenarioError> {
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Scenario::parse(name, built_in(name).unwrap(), &sets)
}

fn refusal(sets: &[&str]) -> String {
    overridden("sampled/mtj", sets).unwrap_err().to_string()
}

/// K_p and K_d of any law.
fn gains(scenario: &Scenario) -> [Gains<f64, MAX_AXES>; 2] {
    match scenario.law.law {
        Law::Tj(law) => [law.gains.kp, law.gains.kd],
        Law::Mtj(law) => [law.tj.kp, law.tj.kd],
        Law::Mb(law) => [law.kp, law.kd],
        Law::Tdc(law) => [law.kp, law.kd],
        law => panic!("{law:?} is none of the scenarios here"),
    }
}

fn mtj(scenario: &Scenario) -> ModifiedTransposeJacobian<f64, MAX_AXES> {
    match scenario.law.law {
        Law::Mtj(law) => law,
        other => panic!("{other:?} is not mtj"),
    }
}

/// A refusal is one sentence that names where the value came from, the key and the value.
fn assert_refused(set: &str, words: &[&str]) {
    let sentence = refusal(&[set]);
    assert!(!sentence.contains('\n'), "one line: {sentence}");
    for word in ["--set"].iter().chain(words) {
        assert!(sentence.contains(word), "'{word}' is not in the refusal of {set}: {sentence}");
    }
}

#[test]
fn every_built_in_scenario_is_acceptable_and_named_after_its_law() {
    assert_eq!(BUILT_IN.len(), 17);
    for (name, text) in BUILT_IN {
        let scenario = Scenario::load(name, &[]).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scenario.name, *name);
        assert_eq!(scenario.duration, Duration::from_secs(20), "{name}");
        let law = scenario.law.law.description().name;
        let (_, end) = name.split_once('/').unwrap();
        assert!(end.split('-').any(|part| part == law), "{name} runs {law}");
        assert!(text.starts_with("# "), "{name} says in its first line what it is");
        assert_eq!(scenario.noise, if name.contains("fig5") { 0.02 } else { 0.0 }, "{name}");
    }
}

#[test]
fn the_papers_scenarios_have_the_papers_settings() {
    for (name, kp, kd, omega) in [
        ("paper/fig2-tj", 60.0, 120.0, 0.05),
        ("paper/fig3-tj", 60.0, 120.0, 2.0),
        ("paper/fig4-tj", 150.0, 300.0, 1.0),
        ("paper/fig4-mtj", 30.0, 60.0, 1.0),
        ("paper/fig4-mb", 8.0, 4.0, 1.0),
        ("paper/fig4-mb-perturbed", 30.0, 60.0, 1.0),
    ] {
        let scenario = Scenario::load(name, &[]).unwrap();
        let diagonal = |gains: Gains<f64, MAX_AXES>| gains.matrix().diagonal()[0];
        if name.contains("fig4") {
            assert_eq!(gains(&scenario).map(diagonal), [kp, kd], "{name}");
        }
        let at = |time| scenario.trajectory.at::<2>(time);
        let rate = (at(1e-6).velocity - at(0.0).velocity).norm() / 1e-6;
        let expected = at(0.0).acceleration.norm();
        assert!((rate - expected).abs() < 1e-3 * (1.0 + expected), "{name}");
        assert!((expected - omega * omega * 2f64.sqrt()).abs() < 1e-9, "ω = {omega} in {name}");
        assert_eq!(scenario.timing.sample_period, Duration::from_micros(500), "{name}");
        assert_eq!(scenario.timing.clock, ClockKind::Lockstep, "{name}");
    }
}

#[test]
fn absent_keys_have_the_documented_defaults() {
    let scenario = overridden("sampled/mtj", &[]).unwrap();
    assert_eq!(scenario.law.memory.step, scenario.timing.sample_period);
    assert_eq!(scenario.law.prediction, None);
    assert_eq!(scenario.law.mass_scale, 1.0);
    assert_eq!(mtj(&scenario).acceleration, None);
    assert_eq!(scenario.task.name, "plane");
    assert_eq!(scenario.link.state.latency, Duration::ZERO);
    assert_eq!(scenario.safety.torque_rate_limit, None);
    assert!(scenario.safety.joint_limits.is_empty());
    assert_eq!(scenario.safety.torque_limit, None);
    assert_eq!((scenario.bus.wait, scenario.bus.session.as_str()), (Wait::Block, "default"));
    assert_eq!(scenario.bus.scouting, None);
    assert_eq!(scenario.bus.listen_endpoints(), [DEFAULT_ENDPOINT]);
    let hybrid = overridden("sampled/mtj", &["bus.wait=hybrid"]).unwrap().bus.wait;
    assert_eq!(hybrid, Wait::Hybrid(DEFAULT_SPIN));
    assert_eq!(scenario.arm.gravity.norm(), 0.0);
}

#[test]
fn any_key_can_be_set() {
    let scenario = overridden(
        "sampled/mtj",
        &[
            "law.memory.policy=delivered",
            "law.memory.step=30ms",
            "law.prediction.horizon=measured",
            "law.factor.kind=diagonal",
            "law.factor.error=[0.5, 0.25]",
            "law.kp=[[30.0, 1.0], [1.0, 40.0]]",
            "link.torque.latency=1ms",
            "arm.links[0].mass=5.5",
            "arm.links[1].center=0.25",
            "arm.position[1]=0.5",
            "safety.on_timeout=damp",
            "safety.damping=3",
            "bus.kind=zenoh",
            "sensor.noise=0.02",
            "seed=42",
        ],
    )
    .unwrap();
    assert_eq!(scenario.law.memory.policy, MemoryPolicy::Delivered);
    assert_eq!(scenario.law.memory.step, Duration::from_millis(30));
    assert_eq!(scenario.law.prediction, Some(Horizon::Measured));
    let law = mtj(&scenario);
    assert_eq!(law.factor.kind, FactorKind::Diagonal);
    let Thresholds::Each(error, _) = law.factor.thresholds else { panic!("{:?}", law.factor) };
    assert_eq!(error.as_slice()[..2], [0.5, 0.25]);
    let kp = law.tj.kp.matrix().fixed_view::<2, 2>(0, 0).transpose();
    assert_eq!(kp.as_slice(), [30.0, 1.0, 1.0, 40.0]);
    assert_eq!(scenario.link.torque.latency, Duration::from_millis(1));
    assert_eq!((scenario.arm.links[0].mass, scenario.arm.links[1].mass), (5.5, 3.0));
    assert_eq!(scenario.arm.links[1].center, 0.25);
    assert_eq!(scenario.arm.position, [0.03, 0.5]);
    assert_eq!(scenario.safety.on_timeout, OnTimeout::Damp(3.0));
    assert_eq!((scenario.bus.kind, scenario.noise, scenario.seed), (BusKind::Zenoh, 0.02, 42));
}

#[test]
fn the_last_of_two_settings_of_a_key_counts() {
    let kp = |sets: &[&str]| gains(&overridden("sampled/mtj", sets).unwrap())[0].matrix()[(0, 0)];
    assert_eq!(kp(&[]), 30.0);
    assert_eq!(kp(&["law.kp=50", "law.kp=70"]), 70.0);
    assert_eq!(kp(&["law.kp=70", "law.kp=50"]), 50.0);
    let bus =
        overridden("sampled/mtj", &["bus={kind = \"zenoh\", wait = \"spin\"}", "bus.wait=block"]);
    assert_eq!(bus.unwrap().bus.wait, Wait::Block);
}

#[test]
fn a_scenario_survives_being_shown_and_read_again() {
    for (name, _) in BUILT_IN {
        let scenario = overridden(name, &[]).unwrap();
        assert_eq!(Scenario::parse(name, scenario.text(), &[]).unwrap(), scenario, "as it is");
        let sets = ["arm.links[1].mass=2.5", "link.state.latency=\"3 ms\"", "bus.session=abc"];
        let changed = overridden(name, &sets).unwrap();
        let read = Scenario::parse(name, changed.text(), &[]).unwrap();
        assert_eq!(read, changed, "{name} with settings");
        assert_eq!(read.arm.links[1].mass, 2.5);
    }
}

#[test]
fn a_refusal_names_origin_key_and_value() {
    for (set, words) in [
        ("law.kind=lqr", &["law.kind = \"lqr\"", "\"tj\", \"mtj\", \"mb\", \"tdc\""][..]),
        ("law.gain=3", &["law.gain = 3", "no key 'gain'", "kp"]),
        ("speed=3", &["speed = 3", "no key 'speed'", "duration"]),
        ("arm.links[1].mass=-3", &["arm.links[1].mass = -3", "a number in kg greater than 0"]),
        ("arm.links[0].length=0.0", &["arm.links[0].length = 0.0", "a number in m"]),
        ("arm.links[0].inertia=nan", &["arm.links[0].inertia = nan", "inertia"]),
        ("arm.links=[]", &["arm.links", "1 to 7 links"]),
        ("arm.position=[0.0, 0.0]", &["arm.position", "singular"]),
        ("arm.position=[0.3, 3.141592653589793]", &["arm.position", "singular"]),
        ("arm.position=[1.0, 2.0, 3.0]", &["arm.position", "2 numbers"]),
        ("timing.sample_period=0s", &["timing.sample_period = \"0s\"", "at least"]),
        ("timing.sample_period=0 s", &["timing.sample_period = \"0 s\"", "at least"]),
        ("timing.sample_period=10", &["timing.sample_period = 10", "unit"]),
        ("timing.sample_period=10 lightyears", &["10 lightyears", "ns, us, ms, s"]),
        ("timing.sample_period=21s", &["timing.sample_period", "no more than the duration"]),
        ("timing.clock=sundial", &["timing.clock = \"sundial\"", "lockstep", "realtime"]),
        ("law.kp=[1.0, 2.0, 3.0]", &["law.kp", "list of 2"]),
        ("law.kp=[[1.0, 0.0], [0.0]]", &["law.kp", "2 rows of 2"]),
        ("law.kp=-30", &["law.kp = -30", "positive definite"]),
        ("law.kd=[[1.0, 2.0], [2.0, 1.0]]", &["law.kd", "positive definite"]),
        ("law.memory.step=25ms", &["law.memory.step = \"25ms\"", "multiple", "10 ms"]),
        ("law.memory.step=5ms", &["law.memory.step = \"5ms\"", "at least 10 ms"]),
        (
            "law.memory.policy=forgotten",
            &["law.memory.policy", "\"sent\", \"applied\", \"delivered\""],
        ),
        ("law.factor.error=0", &["law.factor.error = 0", "greater than 0"]),
        ("law.factor.error=[1.0, 0.0]", &["law.factor.error", "greater than 0"]),
        ("law.factor.error=[1.0, 2.0, 3.0]", &["law.factor.error", "list of 2"]),
        ("law.factor.error_rate=-1", &["law.factor.error_rate = -1", "m/s greater than 0"]),
        ("law.factor.kind=sure", &["law.factor.kind", "\"constant\", \"switch\""]),
        ("law.mass=-2", &["law.mass = -2", "positive definite", "task-inertia"]),
        ("law.mass=heavy", &["law.mass = \"heavy\"", "one number", "\"task-inertia\""]),
        ("law.mass=[1, 2, 3]", &["law.mass", "list of 2"]),
        ("law.mass=[[1, 2], [2, 1]]", &["law.mass", "positive definite"]),
        ("task.kind=space", &["task.kind = \"space\"", "\"plane\""]),
        ("law.prediction.horizon=soon", &["law.prediction.horizon = \"soon\"", "measured"]),
        ("law.model.mass_scale=0", &["law.model.mass_scale = 0", "greater than 0"]),
        ("link.torque.latency=-1ms", &["link.torque.latency = \"-1ms\"", "at least 0 s"]),
        ("link.torqe.latency=1ms", &["link.torqe", "no key 'torqe'"]),
        ("sensor.noise=-0.1", &["sensor.noise = -0.1", "0 or more"]),
        ("bus.kind=carrier-pigeon", &["bus.kind", "iceoryx2"]),
        ("bus.session=a b", &["bus.session = \"a b\"", "letters, digits"]),
        ("bus.listen=127.0.0.1:7447", &["bus.listen", "tcp/127.0.0.1:7447"]),
        ("bus.connect=tcp/127.0.0.1:99999", &["bus.connect", "endpoint"]),
        ("safety.torque_limit=[1.0, 0.0]", &["safety.torque_limit", "greater than 0"]),
        ("safety.command_timeout=0s", &["safety.command_timeout", "\"never\"", "a unit"]),
        ("safety.command_timeout=5ms", &["command_timeout = \"5ms\"", "sample_period, 10 ms"]),
        ("safety.torque_rate_limit=0", &["safety.torque_rate_limit = 0", "N m/s greater than 0"]),
        ("safety.position_max=[-1.0, 3.0]", &["position_max", "joint 1 is at 0.03 rad"]),
        ("safety.speed_limit=1.2", &["speed_limit = 1.2", "joint 1", "1.5 rad/s"]),
        ("trajectory.radius=2.5", &["trajectory.radius = 2.5", "0.000 m to 2.000 m", "2.5"]),
        ("law.gravity=moon", &["law.gravity = \"moon\"", "\"none\", \"model\""]),
        ("safety.on_timeout=panic", &["safety.on_timeout", "\"hold\", \"zero\", \"damp\""]),
        ("seed=-1", &["seed = -1", "0 or more"]),
        ("duration=0s", &["duration = \"0s\"", "at least 1 ms"]),
        ("trajectory.radius=-1", &["trajectory.radius = -1", "greater than 0"]),
        ("trajectory.kind=spiral", &["trajectory.kind = \"spiral\"", "perturbed-circle"]),
    ] {
        assert_refused(set, words);
    }
}

#[test]
fn a_value_of_the_file_is_refused_in_the_files_name() {
    let text = built_in("sampled/mtj").unwrap().replace("kp = 30", "kp = 0");
    let sentence = Scenario::parse("my/own.toml", &text, &[]).unwrap_err().to_string();
    assert!(sentence.starts_with("my/own.toml: law.kp = 0 is not accepted"), "{sentence}");
    let text = built_in("sampled/mtj").unwrap().replace("kp = 30", "");
    let sentence = Scenario::parse("my/own.toml", &text, &[]).unwrap_err().to_string();
    assert!(sentence.starts_with("my/own.toml: law.kp is missing"), "{sentence}");
    // What was set elsewhere does not change who is to blame.
    let sets = ["law.kd=50".parse().unwrap()];
    let sentence = Scenario::parse("my/own.toml", &text, &sets).unwrap_err().to_string();
    assert!(sentence.starts_with("my/own.toml: law.kp is missing"), "{sentence}");
}

#[test]
fn text_that_is_not_toml_is_refused_with_its_line() {
    let text = "duration = \"20 s\"\nseed = 1\n[arm\nkind = \"planar\"\n";
    let sentence = Scenario::parse("torn.toml", text, &[]).unwrap_err().to_string();
    assert!(sentence.starts_with("torn.toml: line 3 is not TOML"), "{sentence}");
    assert!(!sentence.contains('\n'), "one line: {sentence}");
}

#[test]
fn a_scenario_that_is_neither_built_in_nor_a_file_is_refused_by_name() {
    let sentence = Scenario::load("sampled/pid", &[]).unwrap_err().to_string();
    for word in ["--scenario", "'sampled/pid'", "mtj scenario list"] {
        assert!(sentence.contains(word), "'{word}' in: {sentence}");
    }
}

#[test]
fn a_setting_that_reaches_nowhere_is_refused() {
    for (set, words) in [
        ("arm.links[5].mass=1", &["arm.links[5].mass", "not a list that long"][..]),
        ("arm.links[x].mass=1", &["arm.links[x].mass"]),
        ("arm.links.mass=1", &["arm.links.mass"]),
        ("duration.seconds=1", &["duration.seconds", "not a table"]),
        ("arm.position[2]=1.0", &["arm.position[2]", "not a list that long"]),
    ] {
        assert_refused(set, words);
    }
    for text in ["law.kp", "=3", ""] {
        let sentence = text.parse::<Override>().unwrap_err().to_string();
        assert!(sentence.contains("--set") && sentence.contains("KEY=VALUE"), "{sentence}");
    }
}

#[test]
fn a_bus_alone_is_read_with_the_same_care() {
    let table = |text: &str| text.parse::<toml::Table>().unwrap();
    let text =
        "kind = 'zenoh'\nlisten = ['tcp/127.0.0.1:1', 'udp/[::1]:2#iface=lo']\nwait = 'spin'";
    let bus = BusSettings::from_table("here", table(text)).unwrap();
    assert_eq!((bus.kind, bus.wait), (BusKind::Zenoh, Wait::Spin));
    assert_eq!(bus.listen_endpoints(), ["tcp/127.0.0.1:1", "udp/[::1]:2#iface=lo"]);
    assert_eq!(bus.connect_endpoints(), bus.listen_endpoints(), "where the plant listens");
    let refused = BusSettings::from_table("here", table("listen = 'tcp/nowhere'")).unwrap_err();
    assert!(refused.to_string().starts_with("here: bus.listen = \"tcp/nowhere\""), "{refused}");
}

#[test]
fn only_mb_is_refused_on_a_redundant_arm() {
    let needs = ["law.mass=2", "law.filter=20ms", "law.inertia=2", "law.adaptation=20"];
    let accepts = |name: &str, kind: &str, needs: &[&str]| {
        overridden(name, &[&[&*format!("law.kind={kind}")], needs].concat()).is_ok()
    };
    for law in LAWS {
        // With a desired inertia the law is computed torque.
        let needs = if law.name == "impedance" { &[][..] } else { &needs[..] };
        assert_eq!(accepts("redundant/mtj", law.name, needs), law.name != "mb", "{}", law.name);
        assert!(accepts("sampled/mtj", law.name, needs), "{}", law.name);
    }
}

#[test]
fn a_running_loop_can_change_keys_that_do_not_define_the_run() {
    let before = overridden("sampled/mtj", &[]).unwrap();
    let change = |sets: &[&str]| {
        let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
        before.changed(&sets)
    };
    let changed = change(&["law.kp=31", "link.torque.latency=1ms"]).unwrap();
    assert_eq!(gains(&changed)[0], Gains::Diagonal([31.0; MAX_AXES].into()));
    assert_eq!(changed.link.torque.latency, Duration::from_millis(1));
    assert_eq!((&changed.arm, changed.timing), (&before.arm, before.timing));
    let again = changed.text();
    assert!(again.contains("31") && again.contains("1ms"), "changes add up: {again}");
    for set in ["arm.links[0].mass=3.0", "timing.clock=lockstep", "duration=1s", "lawless=1"] {
        let sentence = change(&["law.kp=31", set]).unwrap_err().to_string();
        let key = set.split('=').next().unwrap();
        assert!(sentence.contains(key) && sentence.contains("a running loop"), "{sentence}");
    }
    let sentence = change(&["law.kp=-1"]).unwrap_err().to_string();
    assert!(sentence.contains("law.kp = -1"), "validated like any scenario: {sentence}");
}

#[test]
fn prediction_can_be_switched_off_by_its_name() {
    let horizon = |set: &str| overridden("sampled/mtj", &[set]).unwrap().law.prediction;
    assert_eq!(horizon("law.prediction.horizon=measured"), Some(Horizon::Measured));
    assert_eq!(horizon("law.prediction.horizon=none"), None);
}

#[test]
fn a_parameter_has_the_value_in_effect() {
    let scenario = |set: &[&str]| {
        let set: Vec<Override> = set.iter().map(|set| set.parse().unwrap()).collect();
        Scenario::load("sampled/mtj", &set).unwrap()
    };
    let value = |scenario: &Scenario, key: &str| {
        let own = find("mtj").unwrap().parameters;
        let mut all = own.iter().chain(MEMORY).chain(PREDICTION);
        let parameter = all.find(|parameter| parameter.key == key).unwrap();
        scenario.settings().get(parameter).unwrap().to_string()
    };
    let plain = scenario(&["timing.sample_period=20ms"]);
    for (key, expected) in [
        ("law.kp", "30"),
        ("law.factor.kind", "\"exponential\""),
        ("law.acceleration", "false"),
        ("law.memory.policy", "\"sent\""),
        ("law.memory.step", "\"20ms\""),
        ("law.prediction.horizon", "\"none\""),
    ] {
        assert_eq!(value(&plain, key), expected, "{key}");
    }
    let set = scenario(&["law.kp=[30,40]", "law.memory.step=50ms", "law.factor.error=2"]);
    assert_eq!(value(&set, "law.kp"), "[30, 40]");
    assert_eq!(value(&set, "law.memory.step"), "\"50ms\"");
    assert_eq!(value(&set, "law.factor.error"), "2");
}

#[test]
fn a_relative_path_starts_at_the_folder_of_the_scenarios_file() {
    let set = ["link.state.jitter={kind='replay', file='net/wan.csv'}".parse().unwrap()];
    let text = built_in("sampled/mtj").unwrap();
    for (name, expected) in [
        ("lab/robots/one.toml", "lab/robots/net/wan.csv"),
        ("/lab/one.toml", "/lab/net/wan.csv"),
        ("one.toml", "net/wan.csv"),
        ("sampled/mtj", "net/wan.csv"),
    ] {
        let scenario = Scenario::parse(name, text, &set).unwrap();
        let again = scenario.changed(&["law.kp=31".parse().unwrap()]).unwrap();
        for scenario in [scenario, again] {
            let Jitter::Replay { file } = &scenario.link.state.jitter else { panic!("{name}") };
            assert_eq!(file.to_str(), Some(expected), "{name}");
        }
    }
}

#[test]
fn a_mass_that_is_given_is_a_number_like_any_other() {
    // So that runs with masses of 1.0 and 2.0 share lanes.
    let mass = |sets: &[&str]| {
        let sets = [&["law.acceleration=true"], sets].concat();
        mtj(&overridden("sampled/mtj", &sets).unwrap()).acceleration
    };
    assert_eq!(mass(&[]), Some(Mass::Unit));
    let one = Mass::Constant(Gains::Diagonal([1.0; MAX_AXES].into()));
    assert_eq!((mass(&["law.mass=1"]), mass(&["law.mass=1.0"])), (Some(one), Some(one)));
}

#[test]
fn a_timeout_that_no_command_can_meet_is_refused_with_what_the_links_do() {
    let refused = |sets: &[&str]| {
        let sets: Vec<_> = sets.iter().map(|set| set.parse().unwrap()).collect();
        Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets)
            .err()
            .map(|e| e.to_string())
    };
    let timeout = "safety.command_timeout=100ms";
    let sentence = refused(&[timeout, "link.state.latency=50ms", "link.torque.latency=70ms"]);
    for words in ["command_timeout = \"100ms\"", "at least 120 ms", "50 ms", "70 ms"] {
        assert!(sentence.as_ref().is_some_and(|all| all.contains(words)), "{words}: {sentence:?}");
    }
    let jitter = "link.torque.jitter={kind=\"uniform\",spread=\"30ms\"}";
    assert_eq!(refused(&[timeout, "link.torque.latency=120ms", jitter]), None, "some are in time");
    let narrow = "link.torque.jitter={kind=\"normal\",deviation=\"1ms\"}";
    assert!(refused(&[timeout, "link.torque.latency=120ms", narrow]).is_some());
    let lockstep = "timing.clock=lockstep";
    assert_eq!(refused(&[lockstep, "link.torque.latency=9s"]), None, "lockstep has no timeout");
    assert_eq!(refused(&["link.torque.latency=2s", "timing.clock=realtime"]), None);
}

#[test]
fn an_arm_in_real_time_is_protected_unless_the_scenario_says_never() {
    let safety = |sets: &[&str]| {
        let sets: Vec<_> = sets.iter().map(|set| set.parse().unwrap()).collect();
        Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap().safety
    };
    let real = "timing.clock=realtime";
    let found = safety(&[real, "link.state.latency=30ms"]);
    assert_eq!(found.command_timeout, Some(Duration::from_millis(530)));
    assert_eq!(found.on_timeout, OnTimeout::Damp(10.0));
    let slow = safety(&[real, "timing.sample_period=50ms"]);
    assert_eq!(slow.command_timeout, Some(Duration::from_secs(1)), "20 sample periods");
    assert_eq!(safety(&[real, "safety.command_timeout=never"]).command_timeout, None);
    assert_eq!(safety(&[real, "safety.on_timeout=hold"]).on_timeout, OnTimeout::Hold);
    let lockstep = safety(&["timing.clock=lockstep"]);
    assert_eq!((lockstep.command_timeout, lockstep.on_timeout), (None, OnTimeout::Hold));
}

#[test]
fn a_load_that_the_law_does_not_carry_is_told_with_its_number() {
    let advice = |sets: &[&str]| -> Vec<String> {
        let sets: Vec<_> = sets.iter().map(|set| set.parse().unwrap()).collect();
        let scenario = Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap();
        scenario.advice().iter().map(ToString::to_string).collect()
    };
    let gravity = "arm.gravity=[0.0, -9.81]";
    assert_eq!(advice(&[]), [""; 0]);
    // The upper arm points along x, the forearm up: g (m₁ l/2 + m₂ l + m₂ cos(q₁ + q₂) l/2).
    let by_hand = 9.81
        * (0.03_f64.cos() * (4.0 * 0.5 + 3.0)
            + 3.0 * 0.5 * (0.03_f64 + std::f64::consts::FRAC_PI_2).cos());
    let found = advice(&[gravity]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains(&format!("{by_hand:.1} N m at joint 1")), "{by_hand}: {found:?}");
    assert!(found[0].contains("law.gravity = \"model\""), "{found:?}");
    assert_eq!(advice(&[gravity, "law.gravity=model"]), [""; 0]);
    assert_eq!(advice(&[gravity, "law.kind=mb", "law.kp=8", "law.kd=4"]), [""; 0]);
    let found = advice(&[gravity, "law.gravity=model", "safety.torque_limit=[20.0, 20.0]"]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("more than safety.torque_limit") && found[0].contains("20 N m"));
}

#[test]
fn a_motion_from_a_file_travels_as_its_points() {
    let folder = std::env::temp_dir().join(format!("mtj-points-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let text = built_in("sampled/mtj").unwrap();
    let mut table: toml::Table = text.parse().unwrap();
    table["trajectory"] =
        "kind = \"file\"\nfile = \"path.csv\"".parse::<toml::Table>().unwrap().into();
    let file = folder.join("own.toml");
    std::fs::write(&file, table.to_string()).unwrap();
    let load = || Scenario::load(file.to_str().unwrap(), &[]);
    let csv = |text: &str| std::fs::write(folder.join("path.csv"), text).unwrap();
    csv("\u{feff}time_s,note,x_m,y_m\n0,a,1.0,1.0\n2,,0.5,1.2\n4,,1.0,1.0\n");
    let scenario = load().unwrap();
    assert_eq!(scenario.trajectory.at::<2>(2.0).point.as_slice(), [0.5, 1.2]);
    // Another machine has no file.
    std::fs::remove_file(folder.join("path.csv")).unwrap();
    let travelled = Scenario::parse(&scenario.name, scenario.text(), &[]).unwrap();
    assert_eq!(travelled.trajectory, scenario.trajectory);
    for (text, words) in [
        ("time,x_m,y_m\n0,1,1\n", "columns time_s, x_m and y_m"),
        ("time_s,x_m,y_m\n0,1,1\n1,one,1\n", "line 3: 'one'"),
        ("time_s,x_m,y_m\n0,1,1\n", "at least two"),
        ("time_s,x_m,y_m\n0,1,1\n0,1,1.1\n", "times that rise"),
        ("time_s,x_m,y_m\n0,1,1\n5,3,1\n", "the arm can reach"),
    ] {
        csv(text);
        let sentence = load().unwrap_err().to_string();
        assert!(sentence.contains(words) && sentence.contains("own.toml"), "{sentence}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
