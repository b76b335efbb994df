//! What it does to a loop that it is watched: by a dashboard in a browser, one in a terminal, and a
//! recorder.
//!
//! Prints the loop's round trips without and with them, in turns. `MTJ_ROUNDS` is how often each
//! has its turn, once unless set; `MTJ_SECONDS` how long a turn is, 2 unless set; `MTJ_LOOP` the
//! options of the loop.

use std::{
    collections::BTreeSet,
    env,
    fs::{self, File},
    io::Read,
    net::TcpStream,
    process::{Child, Command, Stdio},
    thread::{self, JoinHandle},
    time::Duration,
};

use crate::{
    machine,
    session::{MTJ, Running, Session, eventually},
};
use nix::sys::signal::Signal;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::Value;

fn setting(name: &str, default: &str) -> String {
    env::var(name).unwrap_or_else(|_| default.to_owned())
}

/// All who watch a session.
struct Watchers {
    web: Running,
    recorder: Running,
    terminal: Child,
    /// Each reads what a watcher shows, and returns how many bytes that were.
    readers: Vec<JoinHandle<usize>>,
}

/// Takes what comes as long as it comes.
fn swallow(mut source: impl Read + Send + 'static) -> JoinHandle<usize> {
    thread::spawn(move || {
        let (mut bytes, mut all) = ([0; 4096], 0);
        while let Ok(count @ 1..) = source.read(&mut bytes) {
            all += count;
        }
        all
    })
}

impl Watchers {
    fn of(session: &Session) -> Self {
        let web = session.start("monitor --web 127.0.0.1:0");
        let recorder = session.start("monitor --record watched.mcap");
        let user = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&user).unwrap();
        unlockpt(&user).unwrap();
        let name = ptsname(&user, Vec::new()).unwrap().into_string().unwrap();
        let line = File::options().read(true).write(true).open(name).unwrap();
        let end = || Stdio::from(line.try_clone().unwrap());
        let terminal = Command::new(MTJ)
            .args(["monitor", "--tui", "--bus", "iceoryx2", "--session", &session.name])
            .env("TERM", "xterm-256color")
            .stdin(end())
            .stdout(end())
            .stderr(end())
            .spawn()
            .unwrap();
        let port = eventually("an address", || {
            let said = web.stderr();
            let (_, url) = said.split_once("dashboard at http://127.0.0.1:")?;
            url.split(['/', '\n']).next()?.parse::<u16>().ok()
        });
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        let address = format!("ws://127.0.0.1:{port}/live");
        let (socket, _) = tungstenite::client(address, stream).unwrap();
        let page = socket.get_ref().try_clone().unwrap();
        let readers = vec![swallow(page), swallow(File::from(user))];
        std::mem::forget(socket); // Closed by the monitor's end.
        Self { web, recorder, terminal, readers }
    }

    /// Ends them; each has shown something.
    fn end(mut self) {
        crate::session::send(self.terminal.id(), Signal::SIGTERM);
        self.terminal.wait().unwrap();
        for watcher in [&mut self.web, &mut self.recorder] {
            watcher.signal(Signal::SIGTERM);
            assert!(watcher.wait().success(), "{}", watcher.stderr());
        }
        let seen: Vec<usize> = self.readers.into_iter().map(|it| it.join().unwrap()).collect();
        assert!(seen.iter().all(|bytes| *bytes > 10_000), "{seen:?}");
    }
}

/// One turn: the plant's report.
fn run(seconds: &str, is_watched: bool) -> Value {
    let session = Session::on("iceoryx2");
    let watchers = is_watched.then(|| Watchers::of(&session));
    let options = setting("MTJ_LOOP", "--set bus.wait=spin");
    let mut plant = session.start(&format!(
        "plant --json --scenario sampled/mtj --set timing.sample_period=1ms --set duration={seconds}s {options}"
    ));
    let controller_options = match options.split_once("--priority ") {
        Some((_, rest)) => format!(" --priority {}", rest.split(' ').next().unwrap()),
        None => String::new(),
    };
    // The loop begins with it, when all who watch are there.
    thread::sleep(Duration::from_millis(if is_watched { 500 } else { 100 }));
    let _controller = session.start(&format!("controller{controller_options}"));
    assert!(plant.wait().success(), "{}", plant.stderr());
    let report: Value = serde_json::from_str(&plant.stdout()).unwrap();
    if let Some(watchers) = watchers {
        thread::sleep(Duration::from_millis(300));
        watchers.end();
        let arguments = ["export", "--csv", "tables", "watched.mcap"];
        assert!(session.start_exactly(&arguments).wait().success());
        let states = fs::read_to_string(session.directory.join("tables/state.csv")).unwrap();
        let column = states.lines().next().unwrap().split(',').position(|it| it == "sequence");
        let sequence = |line: &str| line.split(',').nth(column.unwrap()).unwrap().to_owned();
        let recorded: BTreeSet<String> = states.lines().skip(1).map(sequence).collect();
        assert_eq!(recorded.len() as u64, report["samples"].as_u64().unwrap(), "every state");
    }
    report
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn a_loop_that_is_watched_goes_on_as_if_it_were_not() {
    let _machine = machine::alone();
    let rounds: usize = setting("MTJ_ROUNDS", "1").parse().unwrap();
    let seconds = setting("MTJ_SECONDS", "2");
    let mut trips: [Vec<(f64, f64)>; 2] = Default::default();
    for _ in 0..rounds {
        for (is_watched, trips) in [false, true].into_iter().zip(&mut trips) {
            let report = run(&seconds, is_watched);
            assert_eq!(report["diverged"], false, "{report}");
            let at = |quantile: &str| report["round_trip_us"][quantile].as_f64().unwrap();
            trips.push((at("p50"), at("p99")));
            println!(
                "{}: p50 {:.2} µs, p99 {:.2} µs, {}",
                if is_watched { "watched  " } else { "unwatched" },
                at("p50"),
                at("p99"),
                report["commands"]
            );
        }
    }
    for (name, quantile) in [("p50", 0), ("p99", 1)] {
        let pick = |trip: &(f64, f64)| if quantile == 0 { trip.0 } else { trip.1 };
        let [alone, watched] =
            [&trips[0], &trips[1]].map(|trips| median(trips.iter().map(pick).collect()));
        println!(
            "{name}: {alone:.2} µs alone, {watched:.2} µs watched, {:+.1} %",
            100.0 * (watched / alone - 1.0)
        );
    }
}
