//! `mtj certs`: a small authority of one's own, and a certificate for each role.

use std::{
    io::{self, Write},
    net::IpAddr,
    path::PathBuf,
};

use clap::Args;
use mtj_protocol::member::Role;

use crate::{
    certificates::{AUTHORITY_DAYS, Authority, LOOPBACK, ROUTER},
    failure::Failure,
};

/// Make an authority and a certificate for each role, for links over TLS and QUIC
#[derive(Args, Debug)]
pub struct Certs {
    /// Directory; an authority that is there already signs again
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Name or address of the plant's or the router's machine, beside loopback; may be repeated
    #[arg(long = "host", value_name = "NAME|ADDRESS")]
    hosts: Vec<String>,
    /// For how long the roles' certificates hold
    #[arg(long, value_name = "N", default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=AUTHORITY_DAYS as i64))]
    days: u32,
}

impl Certs {
    /// Writes the files and says where they belong.
    pub fn run(self) -> Result<(), Failure> {
        if let Some(host) = self.hosts.iter().find(|host| !is_host(host)) {
            return Err(Failure::bad_input(format!(
                "--host {host}: expected a name like robot.example.org or an address like 192.168.1.2"
            )));
        }
        let authority = Authority::in_directory(&self.out)?;
        for role in Role::ALL {
            // Only the plant listens.
            let hosts = (role == Role::Plant).then_some(&*self.hosts);
            authority.certify(role.name(), hosts, self.days)?;
        }
        authority.certify(ROUTER, Some(&self.hosts), self.days)?;
        Ok(self.explain()?)
    }

    fn explain(&self) -> io::Result<()> {
        let mut out = io::stdout().lock();
        writeln!(
            out,
            "In {}, for {} days; copy to each machine only what its role needs:",
            self.out.display(),
            self.days
        )?;
        for (machine, name) in [
            ("the plant's", "plant"),
            ("a controller's", "controller"),
            ("a monitor's", "monitor"),
            ("an operator's", "operator"),
            ("a router's", ROUTER),
        ] {
            writeln!(out, "  {machine:<15} ca.pem {name}.pem {name}.key")?;
        }
        writeln!(out, "  {:<15} ca.key: its holder can make certificates", "none")?;
        writeln!(
            out,
            "The plant and the router can be reached as {}.",
            LOOPBACK
                .into_iter()
                .chain(self.hosts.iter().map(String::as_str))
                .collect::<Vec<_>>()
                .join(", ")
        )
    }
}

/// An address, or a name of dotted words.
fn is_host(text: &str) -> bool {
    let is_word = |word: &str| {
        !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
    };
    text.parse::<IpAddr>().is_ok() || text.split('.').all(is_word)
}
