use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};

use mtj_model::scenario::{Override, Scenario};
use mtj_protocol::{
    port::{Message, Offered},
    request::Request,
    sample::{
        ChangeSample, ErrorSample, Header, PresenceSample, RequestSample, StateSample,
        StatusSample, TorqueSample, VERSION, padded, text,
    },
};
use ratatui::{Terminal, backend::TestBackend, buffer::Buffer};

use super::*;

fn scenario(set: &[&str]) -> Scenario {
    let set: Vec<Override> = set.iter().map(|set| set.parse().unwrap()).collect();
    Scenario::load("sampled/mtj", &set).unwrap()
}

fn header(sequence: u64) -> Header {
    let time_ns = sequence * 10_000_000;
    Header { version: VERSION, joints: 2, axes: 2, run: 7, sequence, time_ns, revision: 0 }
}

/// Two seconds of a run with known numbers: the tip is 4 cm below the desired one, except at one
/// instant; k is 0.875; joint 2 is at 8 of 10 N m.
fn two_seconds(set: &[&str]) -> View {
    let mut view = View::default();
    let scenario = scenario(set);
    view.handle(&Message::Scenario(Arc::new(Offered {
        run: 7,
        revision: 0,
        scenario: scenario.clone(),
    })));
    for sequence in 0..=200 {
        let header = header(sequence);
        let depth = if sequence == 100 { 0.4 } else { 0.04 };
        let desired = scenario.trajectory.at::<2>(header.time_ns as f64 * 1e-9).point;
        view.handle(&Message::State(StateSample {
            header,
            sent_ns: 1 + header.time_ns,
            latency_ns: 1_250_000,
            round_trip_ns: if sequence == 150 { 4_000_000 } else { 120_000 },
            residence_ns: 15_000,
            position: padded(&angles(desired.x, desired.y - depth)),
            ..Default::default()
        }));
        view.handle(&Message::Torque(TorqueSample {
            header,
            torque: padded(&[-3.25, 8.0]),
            echo_count: 2,
            echo: padded(&[12.5, -4.5]),
            ..Default::default()
        }));
        view.handle(&Message::Error(ErrorSample {
            header,
            law: text("mtj"),
            error: padded(&[0.0015, 0.04]),
            signals: padded(&[0.875, 0.875, 11.25, -4.25]),
            ..Default::default()
        }));
    }
    view.handle(&Message::Status(StatusSample {
        header: header(200),
        phase: 1,
        sent: 201,
        applied: 198,
        lost: 3,
        deadline_misses: 17,
        torque: padded(&[-3.25, 8.0]),
        ..Default::default()
    }));
    view
}

/// Ten minutes ago by the wall clock, ns.
fn a_while_ago_ns() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    (now.as_nanos() - 600_500_000_000) as u64
}

/// Joint angles that put the tip of two links of 1 m at a point, from the law of cosines.
fn angles(x: f64, y: f64) -> [f64; 2] {
    let elbow = ((x * x + y * y - 2.0) / 2.0).acos();
    let shoulder = y.atan2(x) - elbow.sin().atan2(1.0 + elbow.cos());
    [shoulder, elbow]
}

fn draw_with<'a>(
    view: &'a View,
    width: u16,
    height: u16,
    adapt: impl Fn(&mut Picture<'a>),
) -> Buffer {
    let mut picture = Picture {
        view,
        live: &view.overview,
        is_held: false,
        window: 5.0,
        session: "default over iceoryx2",
        log_line: None,
        shows_help: false,
        palette: Palette::new(true),
    };
    adapt(&mut picture);
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| picture.render(frame.area(), frame.buffer_mut())).unwrap();
    terminal.backend().buffer().clone()
}

fn draw(view: &View, width: u16, height: u16) -> String {
    words(&draw_with(view, width, height, |_| {}))
}

fn words(buffer: &Buffer) -> String {
    let rows = buffer.content.chunks(usize::from(buffer.area.width).max(1));
    rows.map(|row| row.iter().map(ratatui::buffer::Cell::symbol).collect::<String>() + "\n")
        .collect()
}

#[track_caller]
fn assert_shows(screen: &str, all: &[&str]) {
    for words in all {
        assert!(screen.contains(words), "'{words}' is not on the screen:\n{screen}");
    }
}

const SIZES: [(u16, u16); 6] = [(60, 16), (79, 21), (80, 24), (120, 40), (200, 60), (300, 20)];

#[test]
fn the_essentials_are_shown_at_every_size() {
    let view = two_seconds(&["law.memory.policy=delivered"]);
    for (width, height) in SIZES {
        let screen = draw(&view, width, height);
        assert_shows(
            &screen,
            &[
                "default over iceoryx2",
                "running  t 2.0 s",
                "law mtj",
                "T_s 10ms",
                "memory delivered",
                // The error is 4 cm now and was 40 cm for one sample.
                "4.00e-2 m  peak 4.0e-1",
                "-3.25",
                "8.00",
                "1.50 0.875",
                "40.0 0.875",
                "12.5  11.2",
                "round trip",
                "120",
                "4.0",
                "lost 3",
                "late 0",
                "misses 17",
                "controller",
            ],
        );
    }
}

#[test]
fn a_large_screen_shows_everything() {
    let mut view = two_seconds(&["safety.torque_limit=[25,10]", "link.torque.latency=1ms"]);
    let set = |number, words: &[&str]| {
        Request::Set(words.iter().map(|&words| words.to_owned()).collect()).to_sample(7, number)
    };
    let change = |request: RequestSample, outcome| {
        Message::Change(ChangeSample::answer(header(120), &request, outcome))
    };
    view.handle(&change(set(1, &["law.kind=pd"]), Err("there is no law pd")));
    view.handle(&change(set(2, &["law.kind=tj"]), Ok(())));
    view.handle(&Message::Presence(PresenceSample {
        header: header(200),
        role: 1,
        process: 4242,
        since_ns: a_while_ago_ns(),
        id: 5,
        precedence: 0,
        host: text("robot-cell"),
    }));
    // First, since it depends on how long the drawing takes.
    assert_shows(&draw(&view, 120, 40), &["10:0", "robot-cell 4242", "heard 0.0"]);
    for (width, height) in [(80, 24), (120, 40), (200, 60)] {
        let screen = draw(&view, width, height);
        assert_shows(
            &screen,
            &[
                "≤25",
                "≤10",
                "Regulating factor k",
                "0.875 0.875  lowest 0.875",
                "latency 1.25 ms",
                "emulated 1ms",
                "jitter",
                "1.2 law.kind=tj",
                "1.2 refused: there is no",
                "201 sent",
            ],
        );
    }
}

#[test]
fn a_change_is_shown_with_its_value_on_a_small_screen() {
    let mut view = two_seconds(&[]);
    let set = Request::Set(vec!["link.torque.latency=12.5ms".to_owned()]).to_sample(7, 1);
    let header = Header { time_ns: 1_275_300_000_000, ..header(120) };
    view.handle(&Message::Change(ChangeSample::answer(header, &set, Ok(()))));
    let screen = draw(&view, 80, 24);
    assert_shows(&screen, &["1275.3 link.torque.", "latency=12.5ms"]);
}

#[test]
fn a_monitor_that_joins_late_does_not_claim_that_there_were_no_changes() {
    let mut view = View::default();
    let late = |revision| Header { revision, ..header(27_500) };
    view.handle(&Message::State(StateSample { header: late(2), ..Default::default() }));
    let screen = draw(&view, 80, 24);
    assert_shows(&screen, &["275.0 monitor joined after", "2 changes"]);
    assert!(!screen.contains("none in this run"), "{screen}");
    assert_shows(&draw(&two_seconds(&[]), 80, 24), &["none in this run"]);
}

#[test]
fn a_law_without_signals_has_no_chart_of_them() {
    let mut view = two_seconds(&[]);
    let law = text("tj");
    view.handle(&Message::Error(ErrorSample { header: header(201), law, ..Default::default() }));
    let screen = draw(&view, 120, 40);
    assert_shows(&screen, &["law tj", "Regulating factor k", "tj has none", "Q̂ N", "12.5"]);
    assert!(!screen.contains("h N") && !screen.contains("memory sent"), "{screen}");
}

#[test]
fn the_tip_is_drawn_in_its_direction() {
    let view = two_seconds(&[]);
    let buffer = draw_with(&view, 120, 40, |_| {});
    let find = |symbol: &str| {
        let place = buffer.content.iter().position(|cell| cell.symbol() == symbol);
        let place = place.unwrap_or_else(|| panic!("no {symbol}:\n{}", words(&buffer)));
        ((place % 120) as f64, (place / 120) as f64 * 2.0)
    };
    // Tip and desired point share one character, so one sign stands for both.
    let (base, tip) = (find("■"), find("◉"));
    let drawn = (tip.0 - base.0, base.1 - tip.1);
    let real = scenario(&[]).trajectory.at::<2>(2.0).point;
    // The same direction from the base, to the accuracy of characters.
    let off = (drawn.1.atan2(drawn.0) - real.y.atan2(real.x)).abs();
    assert!(off < 0.12, "{off} rad:\n{}", words(&buffer));
}

#[test]
fn a_silent_controller_is_a_red_banner_even_if_the_view_is_held() {
    let mut view = two_seconds(&[]);
    let still = view.clone();
    std::thread::sleep(std::time::Duration::from_millis(700));
    // The plant goes on sending states.
    view.handle(&Message::State(StateSample { header: header(201), ..Default::default() }));
    for (width, height) in SIZES {
        let buffer = draw_with(&still, width, height, |picture| {
            picture.live = &view.overview;
            picture.is_held = true;
        });
        let screen = words(&buffer);
        assert_shows(&screen, &["the controller has been silent for", "view held", "t 2.0 s"]);
        let row = screen.lines().position(|line| line.contains("silent for")).unwrap();
        let ground = buffer[(0, row as u16)].bg;
        assert_eq!(ground, Palette::new(true).style(Tone::Alarm).bg.unwrap());
    }
}

#[test]
fn before_there_is_a_plant_the_screen_says_so() {
    for (width, height) in SIZES {
        assert_shows(&draw(&View::default(), width, height), &["waiting for a plant", "no plant"]);
    }
}

#[test]
fn a_screen_that_is_too_small_says_what_it_needs() {
    let view = two_seconds(&[]);
    for (width, height) in [(59, 24), (80, 15), (40, 10)] {
        let screen = draw(&view, width, height);
        let screen = screen.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_shows(&screen, &[&format!("{width} × {height}"), "60 × 16", "press q"]);
    }
    // No size may panic.
    for (width, height) in [(1, 1), (3, 40), (200, 2), (0, 0)] {
        draw(&view, width, height);
    }
}

#[test]
fn an_arm_of_seven_joints_fits() {
    let links = "[{length=0.3,mass=1,inertia=0.01},{length=0.3,mass=1,inertia=0.01},\
                 {length=0.3,mass=1,inertia=0.01},{length=0.3,mass=1,inertia=0.01},\
                 {length=0.3,mass=1,inertia=0.01},{length=0.3,mass=1,inertia=0.01},\
                 {length=0.3,mass=1,inertia=0.01}]";
    let angles = "[0.1,0.4,0.4,0.4,0.4,0.4,0.4]";
    let set = [
        format!("arm.links={links}"),
        format!("arm.position={angles}"),
        "arm.velocity=[0,0,0,0,0,0,0]".to_owned(),
    ];
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let mut view = View::default();
    let scenario = scenario(&set);
    view.handle(&Message::Scenario(Arc::new(Offered { run: 7, revision: 0, scenario })));
    let header = Header { joints: 7, ..header(5) };
    view.handle(&Message::State(StateSample { header, ..Default::default() }));
    let torque = padded(&[1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5]);
    view.handle(&Message::Torque(TorqueSample { header, torque, ..Default::default() }));
    for (width, height) in [(80, 24), (120, 40)] {
        assert_shows(&draw(&view, width, height), &["1   1.50", "7   7.50"]);
    }
    for (width, height) in SIZES {
        draw(&view, width, height);
    }
}

#[test]
fn a_new_run_starts_empty() {
    let mut view = two_seconds(&[]);
    let header = Header { run: 8, ..header(1) };
    view.handle(&Message::State(StateSample { header, ..Default::default() }));
    assert_eq!(view.error.range(0.0, 10.0), None);
    assert!(!draw(&view, 80, 24).contains("peak 4.0e-1"));
}

#[test]
fn a_log_line_is_shown_in_the_last_line() {
    let view = two_seconds(&[]);
    let buffer = draw_with(&view, 80, 24, |picture| {
        let text = "ignoring a torque sample".to_owned();
        picture.log_line = Some(LogLine { level: tracing::Level::WARN, text });
    });
    assert_shows(words(&buffer).lines().last().unwrap(), &["ignoring a torque sample"]);
    let help = words(&draw_with(&view, 60, 16, |picture| picture.shows_help = true));
    assert_shows(&help, &["space", "hold the view", "quit"]);
}
