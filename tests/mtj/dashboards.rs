//! Dashboards in numbers, connected to a real monitor of a real session.

use std::{
    fs,
    io::{Read, Write},
    net::TcpStream,
    os::unix::fs::PermissionsExt,
    path::Path,
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use crate::session::{Running, Session, eventually};
use nix::sys::signal::Signal;
use serde_json::Value;
use tungstenite::{Message, WebSocket, client::IntoClientRequest};

/// A monitor that serves dashboards, as it says on standard error where.
struct Server {
    monitor: Running,
    port: u16,
    token: Option<String>,
}

impl Server {
    fn start(session: &Session, options: &str) -> Self {
        let monitor = session.start(&format!("monitor --web 127.0.0.1:0{options}"));
        let url = eventually("an address", || {
            let said = monitor.stderr();
            let (_, url) = said.split_once("dashboard at http://127.0.0.1:")?;
            Some(url.split_once('\n')?.0.to_owned())
        });
        let (port, fragment) = url.split_once('/').unwrap();
        let token = fragment.strip_prefix("#token=").map(str::to_owned);
        Self { port: port.parse().unwrap(), monitor, token }
    }

    /// The status and the body of one request's answer.
    fn ask(&self, request: &str, headers: &[(&str, &str)], body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(crate::session::LONG)).unwrap();
        let mut text = format!("{request} HTTP/1.1\r\nContent-Length: {}\r\n", body.len());
        for (name, value) in headers {
            text += &format!("{name}: {value}\r\n");
        }
        write!(stream, "{text}\r\n{body}").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
    }

    fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    /// Tries to turn a knob, with these headers beside what a page always sends.
    fn turn(&self, knob: &str, headers: &[(&str, &str)]) -> (u16, Value) {
        let host = self.host();
        let always = [("Host", host.as_str()), ("Content-Type", "application/json")];
        let has_host = headers.iter().any(|(name, _)| *name == "Host");
        let headers = [&always[usize::from(has_host)..], headers].concat();
        let (status, body) = self.ask("POST /knob", &headers, knob);
        (status, serde_json::from_str(&body).unwrap_or_else(|_| panic!("no JSON: {body}")))
    }

    fn bearer(&self) -> String {
        format!("Bearer {}", self.token.as_ref().unwrap())
    }

    fn connect(&self) -> WebSocket<TcpStream> {
        self.connect_with("")
    }

    fn connect_with(&self, query: &str) -> WebSocket<TcpStream> {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(crate::session::LONG)).unwrap();
        let address = format!("ws://127.0.0.1:{}/live{query}", self.port);
        tungstenite::client(address, stream).unwrap().0
    }

    /// Resident memory, kB.
    fn memory(&self) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.monitor.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }
}

fn next(socket: &mut WebSocket<TcpStream>) -> String {
    match socket.read().unwrap() {
        Message::Text(text) => text.to_string(),
        other => panic!("not a text: {other:?}"),
    }
}

/// Listens until the bins have come to a run time; the messages, not looked at any further.
fn listen_until(socket: &mut WebSocket<TcpStream>, time: f64) -> Vec<String> {
    let mut heard = Vec::new();
    loop {
        heard.push(next(socket));
        let bins = Bin::all(&heard[heard.len() - 1..]);
        if bins.last().is_some_and(|bin| bin.start >= time) {
            return heard;
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Bin {
    start: f64,
    width: f64,
}

impl Bin {
    /// All bins in some messages, which all have an error in them.
    fn all(messages: &[String]) -> Vec<Self> {
        let mut all = Vec::new();
        for message in messages.iter().filter(|text| text.contains("\"kind\":\"bins\"")) {
            let bins: Value = serde_json::from_str(message).unwrap();
            let width = bins["width"].as_f64().unwrap();
            let starts = bins["t"].as_array().unwrap();
            let (low, high) = (&bins["series"]["error.norm"][0], &bins["series"]["error.norm"][1]);
            for (i, start) in starts.iter().enumerate() {
                let (low, high) = (low[i].as_f64().unwrap(), high[i].as_f64().unwrap());
                assert!(0.0 <= low && low <= high, "{message}");
                all.push(Self { start: start.as_f64().unwrap(), width });
            }
        }
        all
    }

    fn assert_without_gap(bins: &[Self], whose: &str) {
        for pair in bins.windows(2) {
            let distance = pair[1].start - pair[0].start - pair[0].width;
            assert!(distance.abs() < 1e-6, "{whose}: {pair:?}");
        }
    }
}

fn plant(seconds: u32, sets: &str) -> String {
    format!("plant --json --scenario sampled/mtj --set duration={seconds}s{sets}")
}

const REAL_TIME_1_KHZ: &str = " --set timing.clock=realtime --set timing.sample_period=1ms";

/// How many of a thousand samples something happened to that should not.
fn trouble(report: &Value) -> f64 {
    let commands = &report["commands"];
    let all = [&commands["lost"], &commands["late"], &report["deadline_misses"]];
    let sum: f64 = all.iter().map(|count| count.as_f64().unwrap()).sum();
    1e3 * sum / report["samples"].as_f64().unwrap()
}

/// The report of a run at 1 kHz that `with` is called during.
fn run(seconds: u32, with: impl FnOnce(&Server)) -> Value {
    let session = Session::on("iceoryx2");
    let server = Server::start(&session, "");
    let _controller = session.start("controller");
    let mut plant = session.start(&plant(seconds, REAL_TIME_1_KHZ));
    with(&server);
    assert!(plant.wait().success(), "{}", plant.stderr());
    serde_json::from_str(&plant.stdout()).unwrap()
}

/// Reads a socket in a thread of its own until told to stop, or until it is closed.
fn read_along(mut socket: WebSocket<TcpStream>, stop: &Arc<AtomicBool>) -> JoinHandle<Vec<String>> {
    let stop = Arc::clone(stop);
    thread::spawn(move || {
        let mut heard = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            heard.push(next(&mut socket));
        }
        heard
    })
}

fn dashboards_now(messages: &[String]) -> u64 {
    let now = messages.iter().rev().find(|text| text.contains("\"kind\":\"now\"")).unwrap();
    serde_json::from_str::<Value>(now).unwrap()["dashboards"].as_u64().unwrap()
}

#[test]
fn the_loop_does_not_notice_fifty_dashboards_one_of_which_never_reads() {
    const ATTEMPTS: usize = 3;
    for attempt in 1..=ATTEMPTS {
        let alone = trouble(&run(6, |_| {}));
        let watched = trouble(&run(20, |server| {
            let never_read = server.connect();
            let stop = Arc::new(AtomicBool::new(false));
            let readers: Vec<_> = (0..49).map(|_| read_along(server.connect(), &stop)).collect();
            thread::sleep(Duration::from_secs(4));
            let before = server.memory();
            // Longer than buffers and patience with the one that does not read last.
            thread::sleep(Duration::from_secs(14));
            let after = server.memory();
            stop.store(true, Ordering::Relaxed);
            for (number, reader) in readers.into_iter().enumerate() {
                let heard = reader.join().unwrap();
                let bins = Bin::all(&heard);
                Bin::assert_without_gap(&bins, &format!("dashboard {number}"));
                assert!(bins[0].start == 0.0 && bins.len() > 1500, "{number}: {}", bins.len());
                assert_eq!(dashboards_now(&heard), 49, "the one that never reads is sent away");
            }
            drop(never_read);
            assert!(after < before + 8 * 1024, "memory went from {before} kB to {after} kB");
        }));
        // How well the machine keeps a period of 1 ms differs from run to run, by itself.
        if watched <= 2.0 * alone + 10.0 {
            return;
        }
        assert!(attempt < ATTEMPTS, "of 1000 samples: {alone} alone, {watched} watched");
    }
}

#[test]
fn a_dashboard_that_comes_back_has_missed_nothing() {
    run(8, |server| {
        let first = listen_until(&mut server.connect(), 1.0);
        thread::sleep(Duration::from_secs(2));
        let mut socket = server.connect();
        let second = listen_until(&mut socket, 4.0);
        let hello: Value = serde_json::from_str(&second[0]).unwrap();
        assert_eq!((&hello["kind"], &hello["bus"]), (&"hello".into(), &"iceoryx2".into()));
        let scenario: Value = serde_json::from_str(&second[1]).unwrap();
        assert_eq!(scenario["kind"], "scenario");
        assert_eq!(scenario["knobs"]["timing.sample_period"], "1ms");
        for (heard, which) in [(&first, "first"), (&second, "second")] {
            let bins = Bin::all(heard);
            assert_eq!(bins[0].start, 0.0, "the {which} has the run from its beginning");
            Bin::assert_without_gap(&bins, which);
        }
        let (run, newest) = (scenario["run"].as_str().unwrap(), Bin::all(&first).pop().unwrap());
        let query = format!("?run={run}&since={}", newest.start);
        let third = listen_until(&mut server.connect_with(&query), 5.0);
        let bins = [Bin::all(&first), Bin::all(&third)].concat();
        Bin::assert_without_gap(&bins, "who says what it has gets the rest");
    });
}

#[test]
fn a_dashboard_that_did_not_read_for_seconds_has_missed_nothing() {
    run(12, |server| {
        let mut socket = server.connect();
        let mut heard = listen_until(&mut socket, 0.5);
        thread::sleep(Duration::from_secs(7));
        heard.extend(listen_until(&mut socket, 9.0));
        let bins = Bin::all(&heard);
        assert_eq!(bins[0].start, 0.0);
        Bin::assert_without_gap(&bins, "after a rest");
    });
}

#[test]
fn a_run_faster_than_time_is_shown_in_wider_bins_without_a_gap() {
    let session = Session::on("iceoryx2");
    let server = Server::start(&session, "");
    let mut socket = server.connect();
    let _controller = session.start("controller");
    let mut plant = session.start(&plant(1200, " --set timing.clock=lockstep"));
    let heard = listen_until(&mut socket, 590.0);
    let bins = Bin::all(&heard);
    Bin::assert_without_gap(&bins, "lockstep");
    let most = heard.iter().map(|message| Bin::all(std::slice::from_ref(message)).len()).max();
    assert!(most.unwrap() <= 1000, "{most:?} bins in one message");
    assert!(plant.wait().success(), "{}", plant.stderr());
}

#[test]
fn knobs_take_the_token_and_a_page_of_ones_own() {
    let session = Session::on("iceoryx2");
    let server = Server::start(&session, "");
    let (host, bearer) = (server.host(), server.bearer());
    let authorized = ("Authorization", bearer.as_str());
    let set = r#"{"set":["law.kind=tj"]}"#;
    let refused = |headers: &[(&str, &str)], knob: &str| {
        let (status, answer) = server.turn(knob, headers);
        assert_eq!(answer["accepted"], false, "{answer}");
        assert!(answer["reason"].as_str().unwrap().len() > 20, "{answer}");
        status
    };
    assert_eq!(refused(&[], set), 401);
    assert_eq!(refused(&[("Authorization", "Bearer 0123")], set), 401);
    let foreign = [authorized, ("Origin", "http://evil.example")];
    assert_eq!(refused(&foreign, set), 403);
    let rebound = [authorized, ("Host", "evil.example"), ("Origin", "http://evil.example")];
    assert_eq!(refused(&rebound, set), 403);
    let own_origin = format!("http://{host}");
    let own = [authorized, ("Origin", own_origin.as_str())];
    for nonsense in ["\"explode\"", "{", r#"{"set":[]}"#, r#"{"kick":{"torque":[5]}}"#] {
        assert_eq!(refused(&own, nonsense), 400, "{nonsense}");
    }
    assert_eq!(refused(&own, &format!("\"{}\"", "x".repeat(100_000))), 400);
    assert_eq!(refused(&own, set), 504, "there is no plant");

    let read_only = Server::start(&session, " --read-only");
    assert_eq!(read_only.token, None);
    assert_eq!(read_only.turn(set, &[authorized]).0, 403);
}

/// The next message of a kind, and how it is.
fn next_of(socket: &mut WebSocket<TcpStream>, kind: &str) -> Value {
    loop {
        let message: Value = serde_json::from_str(&next(socket)).unwrap();
        if message["kind"] == kind {
            return message;
        }
    }
}

#[test]
fn a_knob_that_is_turned_is_seen_by_every_dashboard() {
    let session = Session::on("iceoryx2");
    let server = Server::start(&session, "");
    let _controller = session.start("controller");
    let _plant = session.start(&plant(60, " --set timing.clock=realtime"));
    let mut dashboards = [server.connect(), server.connect()];
    let run = next_of(&mut dashboards[0], "scenario")["run"].clone();
    next_of(&mut dashboards[1], "scenario");
    listen_until(&mut dashboards[0], 0.2);
    let bearer = server.bearer();
    let authorized = [("Authorization", bearer.as_str())];

    let (status, answer) = server.turn(r#"{"set":["law.kind=tj"]}"#, &authorized);
    assert_eq!(
        (status, &answer["accepted"], &answer["words"]),
        (200, &true.into(), &"law.kind=tj".into())
    );
    for dashboard in &mut dashboards {
        let scenario = next_of(dashboard, "scenario");
        assert_eq!((&scenario["run"], &scenario["knobs"]["law.kind"]), (&run, &"tj".into()));
        let mark = next_of(dashboard, "mark");
        assert_eq!((&mark["time"], &mark["accepted"]), (&answer["time"], &true.into()));
    }
    let (status, answer) = server.turn(r#"{"set":["law.kp=-1"]}"#, &authorized);
    assert_eq!((status, &answer["accepted"]), (422, &false.into()));
    let mark = next_of(&mut dashboards[0], "mark");
    assert_eq!((&mark["accepted"], &mark["reason"]), (&false.into(), &answer["reason"]));

    assert_eq!(server.turn("\"reset\"", &authorized).0, 200);
    for dashboard in &mut dashboards {
        let scenario = loop {
            let scenario = next_of(dashboard, "scenario");
            if scenario["run"] != run {
                break scenario;
            }
        };
        assert_eq!(scenario["knobs"]["law.kind"], "tj", "a reset keeps what was set");
        assert_eq!(next_of(dashboard, "bins")["t"][0], 0.0);
    }
}

#[test]
fn pages_of_other_origins_see_nothing() {
    let session = Session::on("iceoryx2");
    let server = Server::start(&session, "");
    let host = server.host();
    let (status, page) = server.ask("GET /", &[("Host", &host)], "");
    assert!(status == 200 && page.starts_with("<!doctype html>"), "{status} {page}");
    assert_eq!(server.ask("GET /", &[("Host", "evil.example")], "").0, 403);
    assert_eq!(server.ask("GET /../Cargo.toml", &[("Host", &host)], "").0, 404);

    let stream = TcpStream::connect(("127.0.0.1", server.port)).unwrap();
    let mut request = format!("ws://{host}/live").into_client_request().unwrap();
    request.headers_mut().insert("Origin", "http://evil.example".parse().unwrap());
    match tungstenite::client(request, stream) {
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
            assert_eq!(response.status(), 403);
        }
        other => panic!("a page of another origin got in: {other:?}"),
    }
}

#[test]
fn a_dashboard_is_reached_by_the_names_of_its_machine_and_by_those_that_were_added() {
    let session = Session::on("iceoryx2");
    let server = Server::start(&session, " --web-host robot.lab --web-host cell-7");
    let machine = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let label = machine.trim().split('.').next().unwrap().to_uppercase();
    let status = |name: &str| {
        let host = format!("{name}:{}", server.port);
        let origin = format!("http://{host}");
        let (page, _) = server.ask("GET /", &[("Host", &host)], "");
        // A page of that name is one of this server's own, so that it may turn knobs.
        let bearer = server.bearer();
        let own = [("Host", &*host), ("Origin", &*origin), ("Authorization", &*bearer)];
        let (knob, _) = server.turn("\"explode\"", &own);
        (page, knob)
    };
    let local = format!("{label}.local");
    for name in [machine.trim(), &label, &local, "localhost", "127.0.0.1", "robot.lab", "cell-7"] {
        assert_eq!(status(name), (200, 400), "{name}");
    }
    let foreign = [
        format!("{label}.evil.example"),
        format!("{label}.local.evil.example"),
        "evil.local".to_owned(),
        "robot.lab.evil.example".to_owned(),
        "lab".to_owned(),
    ];
    for name in &foreign {
        assert_eq!(status(name), (403, 403), "{name}");
    }
}

#[test]
fn a_dashboard_saves_the_last_seconds_with_the_token() {
    let session = Session::on("iceoryx2");
    let file = session.directory.join("run.mcap");
    let record = format!(" --record {} --record-last 10s", file.display());
    let mut server = Server::start(&session, &record);
    let (host, bearer) = (server.host(), server.bearer());
    let save = |server: &Server, headers: &[(&str, &str)]| {
        let headers = [&[("Host", &*host)], headers].concat();
        let (status, body) = server.ask("POST /save", &headers, "");
        (status, serde_json::from_str::<Value>(&body).unwrap())
    };
    let authorized = [("Authorization", &*bearer)];
    assert_eq!(save(&server, &[]).0, 401);
    let foreign = [authorized[0], ("Origin", "http://evil.example")];
    assert_eq!(save(&server, &foreign).0, 403);
    assert_eq!(save(&server, &authorized).0, 409, "nothing was heard yet");
    let _controller = session.start("controller");
    let _plant = session.start(&plant(60, " --set timing.clock=realtime"));
    listen_until(&mut server.connect(), 0.5);
    for name in ["run-0001.mcap", "run-0002.mcap"] {
        let (status, answer) = save(&server, &authorized);
        let saved = session.directory.join(name);
        assert_eq!((status, answer["file"].as_str()), (200, saved.to_str()), "{answer}");
        assert!(fs::metadata(&saved).unwrap().len() > 5000);
    }
    server.monitor.signal(Signal::SIGTERM);
    assert!(server.monitor.wait().success());

    let without = Server::start(&session, "");
    let bearer = without.bearer();
    let headers = [("Host", &*without.host()), ("Authorization", &*bearer)];
    let (status, answer) = without.ask("POST /save", &headers, "");
    assert!(status == 404 && answer.contains("--record-last"), "{status} {answer}");
}

/// Writes a file that these users can read and change.
fn write_with_mode(path: &Path, text: &str, mode: u32) {
    fs::write(path, text).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
}

#[test]
fn a_token_from_a_file_survives_a_restart_and_is_not_printed() {
    let session = Session::on("iceoryx2");
    let (token, file) = ("0123456789abcdef".repeat(4), session.directory.join("token"));
    write_with_mode(&file, &format!("{token}\n"), 0o600);
    for _ in 0..2 {
        let mut server = Server::start(&session, &format!(" --web-token-file {}", file.display()));
        assert_eq!(server.token, None, "the URL has no token");
        let set = r#"{"set":["law.kind=tj"]}"#;
        let bearer = format!("Bearer {token}");
        assert_eq!(server.turn(set, &[("Authorization", &bearer)]).0, 504, "there is no plant");
        let other = format!("Bearer {}0", &token[1..]);
        assert_eq!(server.turn(set, &[("Authorization", &other)]).0, 401);
        server.monitor.signal(Signal::SIGTERM);
        assert!(server.monitor.wait().success());
        let said = server.monitor.stderr() + &server.monitor.stdout();
        assert!(!said.contains(&token[..16]), "{said}");
        assert!(said.contains(file.to_str().unwrap()), "{said}");
    }
}

#[test]
fn a_file_that_is_no_secret_of_its_user_or_has_no_token_is_refused() {
    let session = Session::on("iceoryx2");
    let path = |name: &str| session.directory.join(name);
    let token = "0123456789abcdef".repeat(2);
    for (name, text, mode) in [
        ("shared", &*token, 0o640),
        ("public", &token, 0o604),
        ("changed", &token, 0o622),
        ("short", &token[1..], 0o600),
        ("empty", "", 0o600),
        ("words", "correct horse battery staple, correct horse", 0o600),
        ("long", &"x".repeat(100_000), 0o600),
    ] {
        write_with_mode(&path(name), text, mode);
    }
    assert!(Command::new("mkfifo").arg(path("pipe")).status().unwrap().success());
    fs::create_dir(path("folder")).unwrap();
    for (name, words) in [
        ("shared", ["mode 640", "chmod 600"]),
        ("public", ["mode 604", "chmod 600"]),
        ("changed", ["mode 622", "chmod 600"]),
        ("short", ["32 to 256", "openssl rand -hex 32"]),
        ("empty", ["32 to 256", "openssl rand -hex 32"]),
        ("words", ["32 to 256", "openssl rand -hex 32"]),
        ("long", ["32 to 256", "openssl rand -hex 32"]),
        ("pipe", ["no regular file", "name one"]),
        ("folder", ["no regular file", "name one"]),
        ("absent", ["No such file", "name a file"]),
    ] {
        let options = format!("--web 127.0.0.1:0 --web-token-file {}", path(name).display());
        let mut monitor = session.start(&format!("monitor {options}"));
        assert_eq!(monitor.wait().code(), Some(2), "{name}: {}", monitor.stderr());
        let said = monitor.stderr();
        assert_eq!(said.lines().count(), 1, "{said}");
        for word in [&words[..], &["--web-token-file", path(name).to_str().unwrap()]].concat() {
            assert!(said.contains(word), "{name}: '{word}' is not in: {said}");
        }
        assert!(!said.contains("horse") && !said.contains(&token[1..]), "{said}");
    }
}

#[test]
fn a_name_for_the_dashboard_that_is_none_is_bad_input() {
    let session = Session::on("iceoryx2");
    for (options, words) in [
        ("--web 127.0.0.1:0 --web-host robot.lab:8080", ["'robot.lab:8080'", "without scheme"]),
        ("--web 127.0.0.1:0 --web-host http://robot", ["'http://robot'", "like robot.lab"]),
        ("--web 127.0.0.1:0 --web-host robot..lab", ["'robot..lab'", "like robot.lab"]),
        ("--web-host robot.lab", ["--web-host is for the dashboard", "add --web"]),
    ] {
        let mut monitor = session.start(&format!("monitor {options}"));
        assert_eq!(monitor.wait().code(), Some(2), "{options}: {}", monitor.stderr());
        let said = monitor.stderr();
        assert_eq!(said.lines().count(), 1, "{said}");
        for word in words {
            assert!(said.contains(word), "{options}: '{word}' is not in: {said}");
        }
    }
}

#[test]
fn a_bus_has_room_for_256_and_refuses_the_next_in_a_sentence() {
    let session = Session::on("iceoryx2");
    let server = Server::start(&session, "");
    let mut guests: Vec<_> = (0..256).map(|_| server.connect()).collect();
    let host = server.host();
    let (status, sentence) = server.ask("GET /", &[("Host", &host)], "");
    assert!(status == 503 && sentence.contains("too many"), "{status} {sentence}");
    guests.pop();
    eventually("room again", || {
        (server.ask("GET /", &[("Host", &host)], "").0 == 200).then_some(())
    });
}

#[test]
fn an_address_that_is_none_is_bad_input() {
    let session = Session::on("iceoryx2");
    let began = Instant::now();
    for address in ["nonsense::8080x", "http://127.0.0.1:8080", "192.0.2.1:8080"] {
        let mut monitor = session.start(&format!("monitor --web {address}"));
        assert_eq!(monitor.wait().code(), Some(2), "{address}: {}", monitor.stderr());
        assert!(monitor.stderr().starts_with("mtj: --web: "), "{}", monitor.stderr());
    }
    assert!(began.elapsed() < crate::session::LONG);
}
