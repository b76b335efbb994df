//! Plant and controller in two processes, over Zenoh; on two machines if each is given the plant's
//! address.
//!
//! ```text
//! cargo run --release --example 05_two_machines                                   # both, on loopback
//! cargo run --release --example 05_two_machines -- plant tcp/127.0.0.1:7447       # one terminal
//! cargo run --release --example 05_two_machines -- controller tcp/127.0.0.1:7447  # another
//! ```
//!
//! Beyond loopback a plant needs certificates: `bus.certs`, as `mtj certs` makes them.

use std::{
    env,
    error::Error,
    net::TcpListener,
    process::{Command, Stdio},
};

use mtj::{
    Scenario,
    controller::serve::serve,
    model::scenario::BusSettings,
    plant::{
        plant::{self, Watch},
        run_id,
    },
    protocol::{
        member::{Member, Role},
        port::PlantPort,
        shutdown::Shutdown,
        transport::AnyBus,
    },
};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        [] => both(),
        ["plant", endpoint] => plant(endpoint),
        ["controller", endpoint] => controller(endpoint),
        _ => Err("say 'plant ENDPOINT' or 'controller ENDPOINT', or nothing for both".into()),
    }
}

/// The plant listens, offers its scenario, and waits for a controller. Its clock starts with the
/// first answer.
fn plant(endpoint: &str) -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::load(
        "sampled/mtj",
        &[
            "duration=3s".parse()?,
            "bus.kind=zenoh".parse()?,
            format!("bus.listen={endpoint}").parse()?,
            "law.memory.policy=delivered".parse()?,
        ],
    )?;
    let shutdown = Shutdown::on_signals();
    let proceed = move || shutdown.proceed();
    let Some(bus) = AnyBus::open(&scenario.bus, Role::Plant, &proceed)? else { return Ok(()) };
    let run = run_id::fresh();
    let mut port = PlantPort::open(&bus, &scenario, run)?;
    let watch = Watch { round_trips: true, ..Watch::default() };
    let outcome = plant::run(&scenario, run, &mut port, watch, &proceed)?;
    print!("{}", outcome.report);
    Ok(())
}

/// The controller needs to know only where the plant is: it fetches the scenario, and with it its
/// law.
fn controller(endpoint: &str) -> Result<(), Box<dyn Error>> {
    let mut table = toml::Table::new();
    table.insert("kind".to_owned(), "zenoh".into());
    table.insert("connect".to_owned(), endpoint.into());
    let settings = BusSettings::from_table("this example", table)?;
    let shutdown = Shutdown::on_signals().when_stdin_closes();
    let proceed = move || shutdown.proceed();
    if let Some(bus) = AnyBus::open(&settings, Role::Controller, &proceed)? {
        serve(&bus, &Member::new(Role::Controller, 0), None, &proceed)?;
    }
    Ok(())
}

/// Both ends on this machine, in two processes.
fn both() -> Result<(), Box<dyn Error>> {
    let address = TcpListener::bind("127.0.0.1:0")?.local_addr()?;
    let endpoint = format!("tcp/{address}");
    let mut controller = Command::new(env::current_exe()?)
        .args(["controller", &endpoint])
        .stdin(Stdio::piped())
        .spawn()?;
    let outcome = plant(&endpoint);
    drop(controller.stdin.take()); // It ends when this closes.
    controller.wait()?;
    outcome
}
