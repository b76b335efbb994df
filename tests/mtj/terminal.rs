//! The terminal dashboard in a real pseudo-terminal, with a terminal emulator to read the screen.

use std::{
    fs::File,
    io::{Read, Write},
    num::NonZero,
    os::unix::process::CommandExt,
    process::{Child, ChildStdin, Command, ExitStatus, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use crate::session::{LONG, MTJ, Running, Session, eventually, send};
use mtj_model::scenario::BusSettings;
use mtj_protocol::{
    bus::Bus,
    member::Role,
    sample::{Header, TorqueSample},
    transport::AnyBus,
};
use nix::sys::signal::Signal;
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{Winsize, tcgetattr, tcsetwinsize},
};

const PROMPT: &str = "user@robot:~$ mtj monitor --tui";

/// A terminal of a given size, and what is on its screen.
struct Terminal {
    /// The side of the user.
    user: File,
    /// The side of programs.
    line: File,
    emulator: Arc<Mutex<vt100::Parser>>,
    settings: String,
    closed: Arc<AtomicBool>,
    watching: Option<JoinHandle<()>>,
}

impl Drop for Terminal {
    /// Closes the window.
    fn drop(&mut self) {
        self.closed.store(true, Ordering::Relaxed);
        let _ = self.watching.take().map(JoinHandle::join);
    }
}

fn cells(count: u16) -> NonZero<u16> {
    NonZero::new(count).unwrap()
}

impl Terminal {
    fn new(columns: u16, rows: u16) -> Self {
        let user = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&user).unwrap();
        unlockpt(&user).unwrap();
        let name = ptsname(&user, Vec::new()).unwrap().into_string().unwrap();
        let line = File::options().read(true).write(true).open(name).unwrap();
        let user = File::from(user);
        let emulator = vt100::Parser::new(cells(rows), cells(columns), 0);
        let emulator = Arc::new(Mutex::new(emulator));
        let (mut reader, screen) = (user.try_clone().unwrap(), Arc::clone(&emulator));
        let closed = Arc::new(AtomicBool::new(false));
        let is_closed = Arc::clone(&closed);
        let watching = thread::spawn(move || {
            let mut bytes = [0; 4096];
            while !is_closed.load(Ordering::Relaxed) {
                let patience = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
                if poll(&mut [PollFd::new(&reader, PollFlags::IN)], Some(&patience)) != Ok(0) {
                    let Ok(count @ 1..) = reader.read(&mut bytes) else { return };
                    screen.lock().unwrap().process(&bytes[..count]);
                }
            }
        });
        let settings = String::new();
        let mut terminal =
            Self { user, line, emulator, settings, closed, watching: Some(watching) };
        terminal.resize(columns, rows);
        terminal.settings = terminal.settings_now();
        terminal.line.write_all(PROMPT.as_bytes()).unwrap();
        terminal.line.write_all(b"\r\n").unwrap();
        terminal
    }

    /// As a user does who drags a corner of the window.
    fn resize(&self, columns: u16, rows: u16) {
        let size = Winsize { ws_col: columns, ws_row: rows, ws_xpixel: 0, ws_ypixel: 0 };
        let mut emulator = self.emulator.lock().unwrap();
        tcsetwinsize(&self.user, size).unwrap();
        emulator.set_size(cells(rows), cells(columns));
    }

    /// Starts a monitor here, in a process group of its own, with nothing but this terminal to
    /// stand on: it is not the process's controlling terminal.
    fn start(&self, session: &Session, stdin: Stdio, more: &[&str]) -> Monitor {
        let end = || Stdio::from(self.line.try_clone().unwrap());
        let mut command = Command::new(MTJ);
        command
            .args(["monitor", "--tui", "--bus", "iceoryx2", "--session", &session.name])
            .args(more)
            .env("TERM", "xterm-256color")
            .env_remove("NO_COLOR")
            .stdin(stdin)
            .stdout(end())
            .stderr(end())
            .process_group(0);
        Monitor(command.spawn().unwrap())
    }

    fn keyboard(&self) -> Stdio {
        Stdio::from(self.line.try_clone().unwrap())
    }

    fn press(&mut self, keys: &str) {
        self.user.write_all(keys.as_bytes()).unwrap();
    }

    fn rows(&self) -> Vec<String> {
        let emulator = self.emulator.lock().unwrap();
        let (_, columns) = emulator.screen().size();
        emulator.screen().rows(0, columns.get()).collect()
    }

    /// The screen, as soon as it holds all of these words.
    fn shows(&self, words: &[&str]) -> Vec<String> {
        let end = Instant::now() + LONG;
        loop {
            let rows = self.rows();
            let all = rows.join("\n");
            if words.iter().all(|words| all.contains(words)) {
                return rows;
            }
            assert!(Instant::now() < end, "never on the screen: {words:?}; it is\n{all}");
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// The run's time as it is shown.
    fn time(&self) -> Option<f64> {
        let title = self.rows().first()?.clone();
        let (_, time) = title.rsplit_once("  t ")?;
        time.trim_end().strip_suffix(" s")?.parse().ok()
    }

    fn settings_now(&self) -> String {
        let settings = tcgetattr(&self.line).unwrap();
        format!(
            "{:?} {:?} {:?} {:?} {:?}",
            settings.input_modes,
            settings.output_modes,
            settings.control_modes,
            settings.local_modes,
            settings.special_codes
        )
    }

    fn assert_is_taken(&self) {
        assert_ne!(self.settings_now(), self.settings, "keys come one by one");
        let emulator = self.emulator.lock().unwrap();
        assert!(emulator.screen().alternate_screen() && emulator.screen().hide_cursor());
    }

    /// Settings, screen and cursor are as they were, with what the user had there before.
    fn assert_is_as_it_was(&self) {
        assert_eq!(self.settings_now(), self.settings);
        eventually("the screen is left", || {
            let emulator = self.emulator.lock().unwrap();
            (!emulator.screen().alternate_screen()).then_some(())
        });
        assert_eq!(self.rows()[0], PROMPT);
        let emulator = self.emulator.lock().unwrap();
        assert!(!emulator.screen().hide_cursor(), "the cursor is seen again");
        assert_eq!(emulator.screen().fgcolor(), vt100::Color::Default);
    }
}

/// A monitor in a terminal, ended with the test.
struct Monitor(Child);

impl Monitor {
    fn wait(&mut self) -> ExitStatus {
        eventually("the monitor ends", || self.0.try_wait().unwrap())
    }
}

impl Drop for Monitor {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn loop_of(session: &Session) -> (Running, Running) {
    let plant = session.start("plant --json --scenario sampled/mtj --set duration=1h");
    (plant, session.start("controller"))
}

#[test]
fn the_dashboard_shows_a_live_session_and_leaves_the_terminal_as_it_was() {
    let session = Session::on("iceoryx2");
    let mut terminal = Terminal::new(80, 24);
    let mut monitor = terminal.start(&session, terminal.keyboard(), &[]);
    terminal.shows(&["waiting for a plant", "q quit"]);
    terminal.assert_is_taken();
    let (_plant, mut controller) = loop_of(&session);

    terminal.shows(&["running", "law mtj", "T_s 10ms", "Tracking error", "round trip", "lost"]);
    let first = eventually("the run's time", || terminal.time());
    eventually("the time goes on", || terminal.time().filter(|time| *time > first + 0.5));
    // Circles and error have been drawn.
    let braille =
        |rows: &[String]| rows.join("").chars().filter(|c| ('⠁'..='⣿').contains(c)).count();
    assert!(braille(&terminal.rows()) > 50, "{}", terminal.rows().join("\n"));

    for (columns, rows) in [(120, 40), (60, 16), (200, 50), (80, 24)] {
        terminal.resize(columns, rows);
        // All of the new size is used, and nothing is left of the old one.
        eventually("the new size is used", || {
            let screen = terminal.rows();
            let keys: Vec<_> =
                (0..screen.len()).filter(|i| screen[*i].contains("q quit")).collect();
            let titles = screen.iter().filter(|row| row.contains("running  t")).count();
            let is_wide = screen[0].chars().count() == usize::from(columns);
            (keys == [usize::from(rows) - 1] && titles == 1 && is_wide).then_some(())
        });
    }
    terminal.resize(50, 10);
    terminal.shows(&["terminal is 50 × 10", "press q"]);
    terminal.resize(80, 24);
    terminal.shows(&["running"]);

    controller.signal(Signal::SIGKILL);
    controller.wait();
    terminal.shows(&["the controller has been silent for"]);
    let _standby = session.start("controller");
    eventually("the banner goes", || {
        (!terminal.rows().join("\n").contains("has been silent")).then_some(())
    });

    terminal.press(" ");
    terminal.shows(&["view held"]);
    let held = terminal.time();
    terminal.press("++\x1b[A");
    terminal.shows(&["120 s"]);
    assert_eq!(terminal.time(), held, "a held view stands still");
    terminal.press("?");
    terminal.shows(&["hold the view"]);
    terminal.press("? ");
    eventually("it goes on", || terminal.time().filter(|time| Some(*time) > held));

    terminal.press("q");
    assert_eq!(monitor.wait().code(), Some(0));
    terminal.assert_is_as_it_was();
}

#[test]
fn every_way_to_end_it_leaves_the_terminal_as_it_was() {
    let session = Session::on("iceoryx2");
    let _roles = loop_of(&session);
    type End = fn(&mut Terminal, &Monitor);
    let ends: [(&str, End); 5] = [
        ("SIGTERM", |_, monitor| send(monitor.0.id(), Signal::SIGTERM)),
        ("SIGHUP", |_, monitor| send(monitor.0.id(), Signal::SIGHUP)),
        ("SIGINT", |_, monitor| send(monitor.0.id(), Signal::SIGINT)),
        ("Ctrl-C", |terminal, _| terminal.press("\x03")),
        ("Esc", |terminal, _| terminal.press("\x1b")),
    ];
    for (name, end) in ends {
        let mut terminal = Terminal::new(80, 24);
        let mut monitor = terminal.start(&session, terminal.keyboard(), &[]);
        terminal.shows(&["running"]);
        terminal.assert_is_taken();
        end(&mut terminal, &monitor);
        assert_eq!(monitor.wait().code(), Some(0), "{name}");
        terminal.assert_is_as_it_was();
    }
}

#[test]
fn on_a_leash_it_hears_the_keys_and_ends_with_the_leash() {
    let session = Session::on("iceoryx2");
    let _roles = loop_of(&session);
    let mut terminal = Terminal::new(80, 24);
    let mut monitor = terminal.start(&session, Stdio::piped(), &["--until-stdin-closes"]);
    let leash: ChildStdin = monitor.0.stdin.take().unwrap();
    terminal.shows(&["running"]);
    terminal.press(" ");
    terminal.shows(&["view held"]);
    drop(leash);
    assert_eq!(monitor.wait().code(), Some(0));
    terminal.assert_is_as_it_was();
}

#[test]
fn a_terminal_that_is_closed_ends_it() {
    let session = Session::on("iceoryx2");
    let _roles = loop_of(&session);
    let terminal = Terminal::new(80, 24);
    let mut monitor = terminal.start(&session, terminal.keyboard(), &[]);
    terminal.shows(&["running"]);
    drop(terminal);
    assert_eq!(monitor.wait().code(), Some(0));
}

#[test]
fn complaints_do_not_disturb_the_screen_and_are_said_when_it_is_left() {
    let session = Session::on("iceoryx2");
    let _roles = loop_of(&session);
    let mut terminal = Terminal::new(120, 40);
    let mut monitor = terminal.start(&session, terminal.keyboard(), &[]);
    terminal.shows(&["running"]);
    // Somebody speaks another version of the protocol.
    let settings: toml::Table =
        format!("kind = 'iceoryx2'\nsession = '{}'", session.name).parse().unwrap();
    let settings = BusSettings::from_table("test", settings).unwrap();
    let bus = AnyBus::open(&settings, Role::Controller, &|| true).unwrap().unwrap();
    let mut writer = bus.writer::<TorqueSample>().unwrap();
    let header = Header { version: 99, ..Header::default() };
    writer.write(&TorqueSample { header, ..TorqueSample::default() }).unwrap();
    let rows = terminal.shows(&["ignoring a torque sample"]);
    assert!(rows[39].contains("q quit") && rows[39].contains("ignoring"), "{}", rows.join("\n"));
    assert_eq!(rows.iter().filter(|row| row.contains("ignoring")).count(), 1);
    terminal.press("q");
    assert_eq!(monitor.wait().code(), Some(0));
    terminal.assert_is_as_it_was();
    terminal.shows(&["mtj monitor: ignoring a torque sample: it has protocol version 99"]);
}

#[test]
fn where_there_is_no_terminal_one_sentence_says_so() {
    let session = Session::on("iceoryx2");
    let mut monitor = session.start("monitor --tui");
    assert_eq!(monitor.wait().code(), Some(2));
    assert_eq!(monitor.stdout(), "");
    let said = monitor.stderr();
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("--tui") && said.contains("standard output"), "{said}");
}

/// What the next test runs in a terminal: a dashboard whose process panics, on another thread even.
#[test]
#[ignore = "run by a_panic_leaves_the_terminal_as_it_was"]
fn panic_with_a_dashboard() {
    let _dashboard = mtj_monitor::terminal::Dashboard::open("nowhere".to_owned()).unwrap();
    thread::sleep(Duration::from_millis(300));
    let _ = thread::spawn(|| panic!("on purpose")).join();
    std::process::exit(3);
}

#[test]
fn a_panic_leaves_the_terminal_as_it_was() {
    let terminal = Terminal::new(80, 24);
    let end = || Stdio::from(terminal.line.try_clone().unwrap());
    let mut command = Command::new(std::env::current_exe().unwrap());
    command
        .args(["--ignored", "--exact", "--nocapture", "terminal::panic_with_a_dashboard"])
        .env("TERM", "xterm-256color")
        .stdin(end())
        .stdout(end())
        .stderr(end())
        .process_group(0);
    let mut child = Monitor(command.spawn().unwrap());
    eventually("the screen is taken", || {
        terminal.emulator.lock().unwrap().screen().alternate_screen().then_some(())
    });
    assert_eq!(child.wait().code(), Some(3));
    terminal.assert_is_as_it_was();
    terminal.shows(&["on purpose"]);
}
