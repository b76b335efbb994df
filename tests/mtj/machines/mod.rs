//! Machines in tests: network namespaces, each with an address of its own, at one switch.
//!
//! A cable can be pulled so that a machine sees it (*carrier*), or so that nobody does: the switch
//! then forwards nothing more of it (*silence*). Nothing is ever sent beyond the namespaces.

use std::{
    process::{self, Command},
    sync::atomic::{AtomicU32, Ordering},
};

use crate::session::{Running, Session};

/// Some machines at one switch; gone when dropped.
pub struct Network {
    name: String,
    number: u32,
    machines: u32,
}

/// What is wrong with a machine's cable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// The machine's own interface is down.
    Carrier,
    /// The machine sees nothing wrong, but nothing comes and nothing arrives.
    Silence,
}

impl Network {
    /// A network of `machines` machines, which are numbered from 0.
    pub fn of(machines: u32) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("mtj-{}-{number}", process::id());
        // What was made is removed even if the rest cannot be made.
        let network = Self { name, number, machines };
        let switch = network.switch();
        ip(&format!("netns add {switch}"));
        ip(&format!("-n {switch} link add bridge type bridge"));
        ip(&format!("-n {switch} link set bridge up"));
        for machine in 0..machines {
            let (name, port, address) =
                (network.machine(machine), port(machine), network.address(machine));
            ip(&format!("netns add {name}"));
            ip(&format!("-n {name} link set lo up"));
            ip(&format!("-n {switch} link add {port} type veth peer name eth0 netns {name}"));
            ip(&format!("-n {switch} link set {port} master bridge up"));
            ip(&format!("-n {name} address add {address}/24 dev eth0"));
            ip(&format!("-n {name} link set eth0 up"));
        }
        network
    }

    /// A machine's address.
    pub fn address(&self, machine: u32) -> String {
        format!("10.77.{}.{}", self.number % 256, machine + 1)
    }

    /// Starts `mtj` on a machine with some arguments, split at blanks.
    pub fn start(&self, machine: u32, session: &Session, arguments: &str) -> Running {
        self.start_with(machine, &[], session, arguments)
    }

    /// The same with variables in its environment, like `NAME=VALUE`.
    pub fn start_with(
        &self,
        machine: u32,
        variables: &[&str],
        session: &Session,
        arguments: &str,
    ) -> Running {
        let machine = self.machine(machine);
        let prefix = [&["ip", "netns", "exec", &machine, "env"], variables].concat();
        session.start_behind(&prefix, &arguments.split(' ').collect::<Vec<_>>())
    }

    /// A command that will run on a machine.
    pub fn command(&self, machine: u32, program: &str) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.machine(machine), program]);
        command
    }

    /// Pulls a machine's cable.
    pub fn cut(&self, machine: u32, cut: Cut) {
        match cut {
            Cut::Carrier => ip(&format!("-n {} link set eth0 down", self.machine(machine))),
            Cut::Silence => {
                ip(&format!("-n {} link set {} nomaster", self.switch(), port(machine)));
            }
        }
    }

    /// Plugs it in again.
    pub fn mend(&self, machine: u32, cut: Cut) {
        match cut {
            Cut::Carrier => ip(&format!("-n {} link set eth0 up", self.machine(machine))),
            Cut::Silence => {
                ip(&format!("-n {} link set {} master bridge", self.switch(), port(machine)));
            }
        }
    }

    fn switch(&self) -> String {
        format!("{}-switch", self.name)
    }

    fn machine(&self, machine: u32) -> String {
        format!("{}-{machine}", self.name)
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        // With a namespace go its interfaces, and their other ends.
        for name in (0..self.machines).map(|machine| self.machine(machine)).chain([self.switch()]) {
            let _ = Command::new("ip").args(["netns", "delete", &name]).output();
        }
    }
}

/// A machine's port at the switch.
fn port(machine: u32) -> String {
    format!("port{machine}")
}

/// Runs iproute2's `ip`.
fn ip(arguments: &str) {
    let output = Command::new("ip").args(arguments.split(' ')).output();
    let output = output.unwrap_or_else(|error| panic!("ip {arguments}: {error}; install iproute2"));
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "ip {arguments}: {words}this test makes machines of network namespaces, which needs root"
    );
}
