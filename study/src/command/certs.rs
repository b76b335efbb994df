//! `mtj certs`: a small authority of one's own, and a certificate for each role.

use std::{
    fs::{self, OpenOptions},
    io::{self, Write},
    net::IpAddr,
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
};

use clap::Args;
use mtj_protocol::{certificate::Certificate, member::Role};
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

use crate::failure::Failure;

/// Who signs.
const AUTHORITY: &str = "mtj authority";
/// How long the authority holds.
const AUTHORITY_DAYS: u32 = 3650;
/// By how much clocks may disagree.
const SKEW: Duration = Duration::days(1);
/// A router between sites takes part as itself.
const ROUTER: &str = "router";
/// Where a plant can always be reached by those beside it.
const LOOPBACK: [&str; 3] = ["localhost", "127.0.0.1", "::1"];

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
        fs::create_dir_all(&self.out).map_err(|error| self.cannot("made", &self.out, &error))?;
        let authority = self.authority()?;
        for role in Role::ALL {
            self.certify(&authority, role.name(), role == Role::Plant)?;
        }
        self.certify(&authority, ROUTER, true)?;
        self.explain()?;
        Ok(())
    }

    /// The authority in the directory; a new one only where there is none.
    fn authority(&self) -> Result<Issuer<'static, KeyPair>, Failure> {
        let (certificate, key) = (self.out.join("ca.pem"), self.out.join("ca.key"));
        let mut params = named(AUTHORITY, AUTHORITY_DAYS);
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
        match (certificate.exists(), key.exists()) {
            (false, false) => {
                let pair = KeyPair::generate().map_err(unsigned)?;
                let signed = params.self_signed(&pair).map_err(unsigned)?;
                self.write(&key, &pair.serialize_pem(), 0o600)?;
                self.write(&certificate, &signed.pem(), 0o644)?;
                Ok(Issuer::new(params, pair))
            }
            (true, true) => {
                let found = Certificate::read(&certificate).map_err(|fault| {
                    Failure::bad_input(format!("{} {fault}", certificate.display()))
                })?;
                let pair =
                    fs::read_to_string(&key).ok().and_then(|text| KeyPair::from_pem(&text).ok());
                let made_here = |pair: &KeyPair| {
                    found.contains(pair.public_key_raw()) && found.contains(AUTHORITY.as_bytes())
                };
                let pair = pair.filter(made_here).ok_or_else(|| {
                    Failure::bad_input(format!(
                        "{} is no key of an authority that 'mtj certs' made in {}; choose another --out",
                        key.display(),
                        certificate.display()
                    ))
                })?;
                Ok(Issuer::new(params, pair))
            }
            (is_there, _) => Err(Failure::bad_input(format!(
                "{} has {} without {}; sign where both are, or choose another --out",
                self.out.display(),
                if is_there { "ca.pem" } else { "ca.key" },
                if is_there { "ca.key" } else { "ca.pem" },
            ))),
        }
    }

    /// Makes a key and has it certified. Only those who listen may pose as a server.
    fn certify(
        &self,
        authority: &Issuer<'_, KeyPair>,
        name: &str,
        listens: bool,
    ) -> Result<(), Failure> {
        let mut params = named(name, self.days);
        params.is_ca = IsCa::ExplicitNoCa;
        params.use_authority_key_identifier_extension = true;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        if listens {
            params.extended_key_usages.push(ExtendedKeyUsagePurpose::ServerAuth);
            let hosts = LOOPBACK.into_iter().map(str::to_owned).chain(self.hosts.iter().cloned());
            params.subject_alt_names = CertificateParams::new(hosts.collect::<Vec<_>>())
                .map_err(unsigned)?
                .subject_alt_names;
        }
        let pair = KeyPair::generate().map_err(unsigned)?;
        let signed = params.signed_by(&pair, authority).map_err(unsigned)?;
        self.write(&self.out.join(format!("{name}.key")), &pair.serialize_pem(), 0o600)?;
        self.write(&self.out.join(format!("{name}.pem")), &signed.pem(), 0o644)
    }

    /// Writes a file anew, under its name only when it is whole, readable as `mode` says from the start.
    fn write(&self, path: &Path, text: &str, mode: u32) -> Result<(), Failure> {
        let draft = path.with_extension("draft");
        let put = || {
            if draft.exists() {
                fs::remove_file(&draft)?;
            }
            let mut file =
                OpenOptions::new().write(true).create_new(true).mode(mode).open(&draft)?;
            file.write_all(text.as_bytes())?;
            fs::rename(&draft, path)
        };
        put().map_err(|error| self.cannot("written", path, &error))
    }

    fn cannot(&self, what: &str, path: &Path, error: &io::Error) -> Failure {
        Failure::bad_input(format!(
            "--out {}: {} cannot be {what} ({error})",
            self.out.display(),
            path.display()
        ))
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
        writeln!(out, "  {:<15} ca.key: its holder can make certificates", "nobody's")?;
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

fn named(name: &str, days: u32) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    let now = OffsetDateTime::now_utc();
    params.not_before = now - SKEW;
    params.not_after = now + Duration::days(days.into());
    params
}

/// An address, or a name of dotted words.
fn is_host(text: &str) -> bool {
    let is_word = |word: &str| {
        !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
    };
    text.parse::<IpAddr>().is_ok() || text.split('.').all(is_word)
}

fn unsigned(error: rcgen::Error) -> Failure {
    format!("a certificate could not be made: {error}").into()
}
