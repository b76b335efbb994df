//! A bad network: datagrams are lost, come twice, in another order, or damaged.

use std::{
    collections::HashMap,
    net::{SocketAddr, UdpSocket},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use crate::{
    machine,
    session::{Session, eventually, free_port},
};
use serde_json::Value;

/// The share of datagrams to which something happens.
#[derive(Clone, Copy, Debug, Default)]
struct Weather {
    lost: f64,
    twice: f64,
    swapped: f64,
    damaged: f64,
}

const FINE: Weather = Weather { lost: 0.0, twice: 0.0, swapped: 0.0, damaged: 0.0 };

/// Between a plant and the processes that connect to it.
struct Relay {
    weather: Mutex<Weather>,
    chance: Mutex<u64>,
    is_over: AtomicBool,
}

impl Relay {
    /// Relays between `front` and `back`, two ports on loopback, until told that it is over.
    fn start(front: u16, back: u16) -> Arc<Self> {
        let relay = Arc::new(Self {
            weather: Mutex::new(FINE),
            chance: Mutex::new(1),
            is_over: AtomicBool::new(false),
        });
        let socket = Arc::new(socket(front));
        let on_thread = Arc::clone(&relay);
        thread::spawn(move || {
            let mut ways: HashMap<SocketAddr, Way> = HashMap::new();
            let mut buffer = [0; 65536];
            while !on_thread.is_over.load(Ordering::Relaxed) {
                let Ok((length, client)) = socket.recv_from(&mut buffer) else { continue };
                let way = ways
                    .entry(client)
                    .or_insert_with(|| Way::open(&on_thread, &socket, client, back));
                on_thread.pass(&mut buffer[..length], &mut way.held, &|datagram| {
                    let _ = way.socket.send(datagram);
                });
            }
        });
        relay
    }

    fn set(&self, weather: Weather) {
        *self.weather.lock().unwrap() = weather;
    }

    /// Lets the weather have its way with a datagram.
    fn pass(&self, datagram: &mut [u8], held: &mut Option<Vec<u8>>, send: &dyn Fn(&[u8])) {
        let Weather { lost, twice, swapped, damaged } = *self.weather.lock().unwrap();
        if self.happens(lost) {
            return;
        }
        if self.happens(damaged) {
            let bit = self.draw() as usize % (8 * datagram.len());
            datagram[bit / 8] ^= 1 << (bit % 8);
        }
        if held.is_none() && self.happens(swapped) {
            *held = Some(datagram.to_vec());
            return;
        }
        send(datagram);
        if self.happens(twice) {
            send(datagram);
        }
        if let Some(held) = held.take() {
            send(&held);
        }
    }

    fn happens(&self, share: f64) -> bool {
        share > 0.0 && (self.draw() as f64) < share * u64::MAX as f64
    }

    /// The next number of a SplitMix64 generator.
    fn draw(&self) -> u64 {
        let mut state = self.chance.lock().unwrap();
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

/// One client's way to the plant.
struct Way {
    socket: Arc<UdpSocket>,
    held: Option<Vec<u8>>,
}

impl Way {
    fn open(relay: &Arc<Relay>, front: &Arc<UdpSocket>, client: SocketAddr, back: u16) -> Self {
        let socket = Arc::new(socket(0));
        socket.connect(("127.0.0.1", back)).unwrap();
        let (relay, front, answers) = (Arc::clone(relay), Arc::clone(front), Arc::clone(&socket));
        thread::spawn(move || {
            let mut buffer = [0; 65536];
            let mut held = None;
            while !relay.is_over.load(Ordering::Relaxed) {
                let Ok(length) = answers.recv(&mut buffer) else { continue };
                relay.pass(&mut buffer[..length], &mut held, &|datagram| {
                    let _ = front.send_to(datagram, client);
                });
            }
        });
        Self { socket, held: None }
    }
}

fn socket(port: u16) -> UdpSocket {
    let socket = UdpSocket::bind(("127.0.0.1", port)).unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
    socket
}

/// A run of eight seconds with bad weather from its first to its fourth; its counts.
fn run_through(bad: Weather) -> Value {
    let session = Session::on("zenoh");
    let (front, back) = (free_port(), free_port());
    let relay = Relay::start(front, back);
    let name = &session.name;
    let start = |arguments: &str| session.start_exactly(&arguments.split(' ').collect::<Vec<_>>());
    let mut plant = start(&format!(
        "plant --json --scenario remote/mtj --set duration=8s --trace trace.csv \
         --session {name} --listen udp/127.0.0.1:{back}"
    ));
    let mut controller =
        start(&format!("controller --session {name} --connect udp/127.0.0.1:{front}"));
    let mut monitor = start(&format!("monitor --session {name} --connect udp/127.0.0.1:{back}"));
    eventually("a line of the monitor", || monitor.stdout().contains("|e|").then_some(()));
    relay.set(bad);
    thread::sleep(Duration::from_secs(3));
    relay.set(FINE);
    assert!(plant.wait().success(), "{bad:?}: {}", plant.stderr());
    relay.is_over.store(true, Ordering::Relaxed);
    for role in [&mut controller, &mut monitor] {
        assert!(!role.has_ended(), "{bad:?}: {}", role.stderr());
    }
    let said = plant.stderr() + &controller.stderr() + &monitor.stderr();
    assert!(!said.contains("panicked"), "{bad:?}: {said}");

    let mut reader = csv::Reader::from_path(session.directory.join("trace.csv")).unwrap();
    let names = reader.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let column = |row: &csv::StringRecord, name: &str| -> f64 {
        row[names.iter().position(|known| known == name).unwrap()].parse().unwrap()
    };
    for row in &rows {
        for (name, limit) in [("torque_nm_1", 40.0), ("torque_nm_2", 15.0)] {
            assert!(column(row, name).abs() <= limit, "{bad:?}: {row:?}");
        }
    }
    // In the last two seconds a command comes for each sample.
    let last = &rows[rows.len() - 200..];
    let fresh = last.windows(2).filter(|rows| {
        let force = |row| column(row, "force_n_1");
        force(&rows[1]) != force(&rows[0])
    });
    let fresh = fresh.count();
    assert!(fresh > 190, "{bad:?}: {fresh} of 199 commands when the network is good again");
    let report: Value = serde_json::from_str(&plant.stdout()).unwrap();
    println!("{bad:?}: {}", report["commands"]);
    report["commands"].clone()
}

fn count(counts: &Value, name: &str) -> u64 {
    counts[name].as_u64().unwrap()
}

#[test]
fn a_lossy_network_loses_commands_and_no_more() {
    let _machine = machine::alone();
    let counts = run_through(Weather { lost: 0.1, ..FINE });
    // Either of two datagrams may be lost, of three seconds' samples.
    assert!((20..150).contains(&count(&counts, "lost")), "{counts}");
}

#[test]
fn a_repeated_command_acts_once() {
    let _machine = machine::alone();
    let counts = run_through(Weather { twice: 0.3, ..FINE });
    assert!(count(&counts, "lost") < 20, "{counts}");
}

#[test]
fn an_overtaken_command_does_not_act() {
    let _machine = machine::alone();
    let counts = run_through(Weather { swapped: 0.1, ..FINE });
    assert!(count(&counts, "lost") + count(&counts, "rejected") > 20, "{counts}");
}

#[test]
fn a_network_that_damages_datagrams_is_survived() {
    let _machine = machine::alone();
    let counts = run_through(Weather { damaged: 0.02, ..FINE });
    assert!(count(&counts, "lost") > 0, "{counts}");
}

#[test]
fn a_network_that_does_it_all_at_once_is_survived() {
    let _machine = machine::alone();
    run_through(Weather { lost: 0.05, twice: 0.05, swapped: 0.05, damaged: 0.01 });
}
