//! Sessions of real processes: starts `mtj`, talks to it as a user does, and leaves nothing behind.

pub mod cable;
pub mod chance;
pub mod holdings;
pub mod observer;
pub mod own_controller;

use std::{
    collections::BTreeSet,
    fs::{self, File},
    net::TcpListener,
    os::unix::{fs::MetadataExt, process::CommandExt},
    path::{Path, PathBuf},
    process::{self, Child, Command, ExitStatus, Stdio},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::BusSettings;
use mtj_protocol::{member::Role, transport::AnyBus};
use nix::{
    sys::signal::{Signal, kill},
    unistd::Pid,
};

use crate::machine::{self, Place};

/// The program.
pub const MTJ: &str = env!("CARGO_BIN_EXE_mtj");

/// Nothing here takes this long unless it never ends.
pub const LONG: Duration = Duration::from_secs(60);

/// A session that no other test has, on one bus, with a directory of its own.
pub struct Session {
    pub name: String,
    pub directory: PathBuf,
    bus: Vec<String>,
    started: AtomicU64,
    _place: Arc<Place>,
}

impl Session {
    pub fn on(bus: &str) -> Self {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("test-{}-{count}", process::id());
        let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join(&name);
        fs::create_dir_all(&directory).unwrap();
        let mut arguments = vec!["--session".to_owned(), name.clone()];
        if bus == "zenoh" {
            arguments.extend(["--listen".to_owned(), format!("tcp/127.0.0.1:{}", free_port())]);
        } else {
            arguments.extend(["--bus".to_owned(), bus.to_owned()]);
        }
        let started = AtomicU64::new(0);
        Self { name, directory, bus: arguments, started, _place: machine::beside_others() }
    }

    /// Starts `mtj` with some arguments, split at blanks, on this session's bus.
    pub fn start(&self, arguments: &str) -> Running {
        self.start_behind_on_bus(&[], arguments)
    }

    /// The same behind a command that makes way for `mtj`, like `env`.
    pub fn start_behind_on_bus(&self, prefix: &[&str], arguments: &str) -> Running {
        let words: Vec<&str> = arguments.split(' ').collect();
        let is_plant = ["plant", "run", "up", "bridge", "study", "tune"].contains(&words[0]);
        let option = |word| if word == "--listen" && !is_plant { "--connect" } else { word };
        let bus: Vec<&str> = self.bus.iter().map(|word| option(word)).collect();
        let arguments = [words, bus].concat();
        self.start_behind(prefix, &arguments)
    }

    /// Starts `mtj` with exactly these arguments, in a process group of its own.
    pub fn start_exactly(&self, arguments: &[&str]) -> Running {
        self.start_program(MTJ, arguments)
    }

    /// The same behind a command that makes way for `mtj`, like `env`.
    pub fn start_behind(&self, prefix: &[&str], arguments: &[&str]) -> Running {
        let words = [prefix, &[MTJ], arguments].concat();
        self.start_program(words[0], &words[1..])
    }

    /// Starts a program that becomes `mtj`.
    pub fn start_program(&self, program: &str, arguments: &[&str]) -> Running {
        let number = self.started.fetch_add(1, Ordering::Relaxed);
        let file = |stream| self.directory.join(format!("{number}.{stream}"));
        let (out, err) = (file("out"), file("err"));
        let child = Command::new(program)
            .args(arguments)
            .current_dir(&self.directory)
            .env_remove("RUST_BACKTRACE")
            // The threads of this test's Zenoh are not those of the product.
            .env_remove("ZENOH_RUNTIME")
            .stdin(Stdio::null())
            .stdout(File::create(&out).unwrap())
            .stderr(File::create(&err).unwrap())
            .process_group(0)
            .spawn()
            .unwrap();
        Running { child, out, err, arguments: arguments.join(" ") }
    }

    /// The port that its plant listens on; `None` on a bus without one.
    pub fn port(&self) -> Option<u16> {
        let place = self.bus.iter().position(|word| word == "--listen")?;
        self.bus[place + 1].rsplit(':').next()?.parse().ok()
    }

    /// Joins the session's bus from within the test.
    pub fn join(&self, role: Role) -> AnyBus {
        let mut table = toml::Table::new();
        for pair in self.bus.chunks(2) {
            let key = pair[0].trim_start_matches("--").replace("bus", "kind");
            table.insert(key, pair[1].as_str().into());
        }
        if !table.contains_key("kind") {
            table.insert("kind".to_owned(), "zenoh".into());
        }
        let settings = BusSettings::from_table("the test", table).unwrap();
        AnyBus::open(&settings, role, &|| true).unwrap().unwrap()
    }

    /// Runs `mtj` to its end and parses what it prints as JSON.
    pub fn report(&self, arguments: &str) -> serde_json::Value {
        let mut run = self.start(arguments);
        let status = run.wait();
        assert!(status.success(), "{arguments}: {status}, {}", run.stderr());
        serde_json::from_str(&run.stdout()).unwrap()
    }

    /// Processes that name this session on their command line.
    pub fn processes(&self) -> Vec<u32> {
        let named = |pid: &u32| {
            fs::read(format!("/proc/{pid}/cmdline"))
                .is_ok_and(|line| line.split(|byte| *byte == 0).any(|a| a == self.name.as_bytes()))
        };
        let entries = fs::read_dir("/proc").unwrap().flatten();
        entries.filter_map(|e| e.file_name().to_str()?.parse().ok()).filter(named).collect()
    }

    /// Waits until `count` processes of the session live.
    pub fn await_processes(&self, count: usize) -> Vec<u32> {
        eventually(&format!("{count} processes"), || {
            let found = self.processes();
            (found.len() == count).then_some(found)
        })
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        if !thread::panicking() {
            let _ = fs::remove_dir_all(&self.directory);
        }
    }
}

/// An `mtj` that was started; ended with the test if it has not ended before.
pub struct Running {
    child: Child,
    out: PathBuf,
    err: PathBuf,
    arguments: String,
}

impl Running {
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn signal(&self, signal: Signal) {
        send(self.id(), signal);
    }

    pub fn stdout(&self) -> String {
        fs::read_to_string(&self.out).unwrap()
    }

    pub fn stderr(&self) -> String {
        fs::read_to_string(&self.err).unwrap()
    }

    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    /// Whether it was the process `pid`, and has ended.
    pub fn has_ended_as(&mut self, pid: u32) -> bool {
        self.id() == pid && {
            self.wait();
            true
        }
    }

    /// Waits for its end, for a bounded time.
    pub fn wait(&mut self) -> ExitStatus {
        let end = Instant::now() + LONG;
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(Instant::now() < end, "mtj {} does not end: {}", self.arguments, self.stderr());
            thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// Sends a signal to a process that was started here.
pub fn send(pid: u32, signal: Signal) {
    kill(Pid::from_raw(pid as i32), signal).unwrap();
}

/// Repeats until `attempt` has something, for a bounded time.
pub fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + LONG;
    loop {
        if let Some(found) = attempt() {
            return found;
        }
        assert!(Instant::now() < end, "{what}: never happened");
        thread::sleep(Duration::from_millis(5));
    }
}

/// A port on loopback that nobody listens on.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Everything in shared memory that was made by one of these processes.
///
/// iceoryx2 names what it makes by numbers that hold the maker's process id in bits 64 to 95.
pub fn shared_memory_of(pids: &[u32]) -> BTreeSet<String> {
    let made_by_them = |name: &str| {
        name.split(|c: char| !c.is_ascii_alphanumeric())
            .filter_map(|part| part.parse::<u128>().ok())
            .any(|number| pids.contains(&((number >> 64) as u32)))
    };
    shared_memory().into_iter().filter(|path| made_by_them(path)).collect()
}

/// Everything that any mtj of this user has in shared memory.
pub fn shared_memory() -> BTreeSet<String> {
    let user = fs::metadata("/proc/self").unwrap().uid();
    let (domain, prefix) = (format!("mtj_{user}"), format!("mtj_{user}_"));
    let paths = |directory: &Path| {
        let entries = fs::read_dir(directory).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut found = paths(Path::new("/dev/shm"));
    found.retain(|path| name(path) == domain || name(path).starts_with(&prefix));
    let mut next = 0;
    while next < found.len() {
        found.extend(paths(&found[next]));
        next += 1;
    }
    found.into_iter().map(|path| path.display().to_string()).collect()
}
