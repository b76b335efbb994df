//! A fleet: many sessions on one bus, and a monitor that shows them all.

use crate::session::{Running, Session, eventually, free_port};
use nix::sys::signal::Signal;
use zenoh::Wait as _;

/// Several sessions, whose names begin alike, on one bus.
struct Fleet {
    session: Session,
    bus: [String; 2],
}

impl Fleet {
    fn on(bus: [&str; 2]) -> Self {
        Self { session: Session::on("local"), bus: bus.map(str::to_owned) }
    }

    fn name(&self, cell: &str) -> String {
        format!("{}-{cell}", self.session.name)
    }

    /// Starts `mtj` in one of the sessions.
    fn start(&self, cell: &str, arguments: &str) -> Running {
        let name = self.name(cell);
        let bus = ["--session", &name, &self.bus[0], &self.bus[1]];
        self.session.start_exactly(&[&arguments.split(' ').collect::<Vec<_>>()[..], &bus].concat())
    }
}

/// What the newest table says of a session, word by word.
fn row(monitor: &Running, session: &str) -> Option<Vec<String>> {
    let shown = monitor.stdout();
    // A table that is being written has no last line yet.
    let whole = &shown[..shown.rfind('\n')? + 1];
    let table = &whole[whole.rfind("session  ")?..];
    let line = table.lines().find(|line| line.split(' ').next() == Some(session))?;
    Some(line.split_whitespace().map(str::to_owned).collect())
}

const PHASE: usize = 1;
const ERROR: usize = 4;
const ROUND_TRIP: usize = 6;
const IN_CHARGE: usize = 8;
const STANDBY: usize = 9;
const ALARM: usize = 17;

const PLANT: &str = "plant --json --scenario sampled/mtj --set duration=1h";

fn a_table_tells_how_each_session_is(bus: [&str; 2]) {
    let fleet = Fleet::on(bus);
    let monitor = fleet.start("*", "monitor");
    eventually("an empty table", || {
        monitor.stdout().contains("no session is called").then_some(())
    });
    let comes_to = |cell: &str, what: &str, is_so: &dyn Fn(&[String]) -> bool| {
        let name = fleet.name(cell);
        eventually(&format!("{name}: {what}"), || row(&monitor, &name).filter(|row| is_so(row)))
    };
    let is = |phase: &'static str| move |row: &[String]| row[PHASE] == phase;
    let alarm = |row: &[String]| row[ALARM..].join(" ");

    let _steady = (fleet.start("steady", PLANT), fleet.start("steady", "controller"));
    comes_to("steady", "runs", &is("running"));
    let _standby = fleet.start("steady", "controller");
    let _paused = (fleet.start("paused", PLANT), fleet.start("paused", "controller"));
    let _lonely = fleet.start("lonely", PLANT);
    let dying = (fleet.start("dying", PLANT), fleet.start("dying", "controller"));

    let row_of_it = comes_to("steady", "with one that stands by", &|row| {
        row[STANDBY] == "1" && row[IN_CHARGE].contains('@') && row.len() == ALARM
    });
    let leader = row_of_it[IN_CHARGE].split('@').next().unwrap().to_owned();
    assert_eq!(leader, _steady.1.id().to_string(), "who came first is in charge: {row_of_it:?}");
    assert!(row_of_it[ERROR].parse::<f64>().unwrap() < 1.0, "{row_of_it:?}");
    assert!(row_of_it[ROUND_TRIP].parse::<f64>().unwrap() > 0.0, "{row_of_it:?}");

    comes_to("paused", "runs", &is("running"));
    assert!(fleet.start("paused", "pause").wait().success());
    comes_to("paused", "stands still", &|row| row[PHASE] == "paused" && row.len() == ALARM);

    let waiting = comes_to("lonely", "waits", &is("waiting"));
    assert_eq!(alarm(&waiting), "the plant is waiting for a controller");

    comes_to("dying", "runs", &is("running"));
    dying.0.signal(Signal::SIGKILL);
    comes_to("dying", "has no plant", &|row| {
        alarm(row).starts_with("the plant has been silent for")
    });
    dying.1.signal(Signal::SIGKILL);
    let gone = comes_to("dying", "is gone", &is("gone"));
    assert_eq!(alarm(&gone), "nobody takes part any more");
    let name = fleet.name("dying");
    eventually("it disappears", || row(&monitor, &name).is_none().then_some(()));
    let _again = (fleet.start("dying", PLANT), fleet.start("dying", "controller"));
    comes_to("dying", "is there again", &is("running"));
    comes_to("steady", "still runs", &is("running"));
}

#[test]
fn a_table_tells_how_each_session_behind_a_router_is() {
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"router\""),
        ("listen/endpoints", &format!("[\"{endpoint}\"]")),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
    ] {
        config.insert_json5(key, value).unwrap();
    }
    let router = zenoh::open(config).wait().unwrap();
    a_table_tells_how_each_session_is(["--connect", &endpoint]);
    router.close().wait().unwrap();
}

#[test]
fn a_table_tells_how_each_session_in_shared_memory_is() {
    a_table_tells_how_each_session_is(["--bus", "iceoryx2"]);
}

#[test]
fn many_sessions_where_one_is_meant_are_refused_in_a_sentence() {
    let session = Session::on("local");
    for (arguments, words) in [
        (&["monitor", "--session", "cell-*", "--record", "run.mcap"][..], "leave out --record"),
        (&["monitor", "--session", "*", "--web"], "leave out --web"),
        (&["monitor", "--session", "*", "--tui"], "leave out --tui"),
        (&["monitor", "--session", "a/*"], "like 'cell-*'"),
        (&["plant", "--session", "*"], "only a monitor takes '*'"),
        (&["controller", "--session", "cell-*"], "only a monitor takes '*'"),
        (&["set", "law.kind=tj", "--session", "*"], "only a monitor takes '*'"),
        (&["bridge", "--session", "*"], "only a monitor takes '*'"),
    ] {
        let mut refused = session.start_exactly(arguments);
        assert_eq!(refused.wait().code(), Some(2), "{arguments:?}: {}", refused.stderr());
        assert!(refused.stderr().contains(words), "{arguments:?}: {}", refused.stderr());
        assert_eq!(refused.stderr().lines().count(), 1, "{}", refused.stderr());
    }
    assert!(!session.directory.join("run.mcap").exists());
}
