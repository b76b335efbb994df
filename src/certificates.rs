//! An authority of one's own, and the certificates that it signs.

use std::{
    fs::{self, OpenOptions},
    io::{self, Write},
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
};

use mtj_protocol::certificate::Certificate;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

/// The name of the authority.
const AUTHORITY: &str = "mtj authority";
/// How long the authority holds, days.
pub const AUTHORITY_DAYS: u32 = 3650;
/// By how much clocks may disagree.
const SKEW: Duration = Duration::days(1);
/// A router between sites takes part as itself.
pub const ROUTER: &str = "router";
/// Where a plant can always be reached from its own machine.
pub const LOOPBACK: [&str; 3] = ["localhost", "127.0.0.1", "::1"];

/// Why a certificate could not be made.
#[derive(Debug, thiserror::Error)]
pub enum CertificateError {
    /// The directory or a file in it cannot be made or written.
    #[error("--out {}: {} cannot be {what} ({source})", directory.display(), path.display())]
    File {
        /// Where the certificates are to be.
        directory: PathBuf,
        /// What cannot be written.
        path: PathBuf,
        /// "made" or "written".
        what: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// The authority's certificate cannot be read.
    #[error("{} {reason}", path.display())]
    Unreadable {
        /// The certificate.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The authority's key and certificate do not belong together.
    #[error(
        "{} is no key of an authority that 'mtj certs' made in {}; choose another --out",
        key.display(), certificate.display()
    )]
    OtherAuthority {
        /// The key.
        key: PathBuf,
        /// The certificate.
        certificate: PathBuf,
    },
    /// One of the authority's two files is missing.
    #[error(
        "{} has {there} without {missing}; sign where both are, or choose another --out",
        directory.display()
    )]
    Half {
        /// Where the certificates are to be.
        directory: PathBuf,
        /// The file that is there.
        there: &'static str,
        /// The file that is not.
        missing: &'static str,
    },
    /// Signing failed.
    #[error("a certificate could not be made: {0}")]
    Unsigned(#[from] rcgen::Error),
}

impl CertificateError {
    /// Whether the user named a place that does not do.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Unsigned(_))
    }
}

/// An authority, and the directory of what it signs.
pub struct Authority {
    directory: PathBuf,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    /// The authority in a directory; a new one only where there is none.
    pub fn in_directory(directory: &Path) -> Result<Self, CertificateError> {
        fs::create_dir_all(directory)
            .map_err(|source| cannot(directory, "made", directory, source))?;
        let (certificate, key) = (directory.join("ca.pem"), directory.join("ca.key"));
        let mut params = named(AUTHORITY, AUTHORITY_DAYS);
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
        let pair = match (certificate.exists(), key.exists()) {
            (false, false) => {
                let pair = KeyPair::generate()?;
                let signed = params.self_signed(&pair)?;
                write(directory, &key, &pair.serialize_pem(), 0o600)?;
                write(directory, &certificate, &signed.pem(), 0o644)?;
                pair
            }
            (true, true) => {
                let found = Certificate::read(&certificate).map_err(|fault| {
                    let path = certificate.clone();
                    CertificateError::Unreadable { path, reason: fault.to_string() }
                })?;
                let pair =
                    fs::read_to_string(&key).ok().and_then(|text| KeyPair::from_pem(&text).ok());
                let made_here = |pair: &KeyPair| {
                    found.contains(pair.public_key_raw()) && found.contains(AUTHORITY.as_bytes())
                };
                pair.filter(made_here)
                    .ok_or(CertificateError::OtherAuthority { key, certificate })?
            }
            (is_there, _) => {
                let (there, missing) =
                    if is_there { ("ca.pem", "ca.key") } else { ("ca.key", "ca.pem") };
                let directory = directory.to_owned();
                return Err(CertificateError::Half { directory, there, missing });
            }
        };
        Ok(Self { directory: directory.to_owned(), issuer: Issuer::new(params, pair) })
    }

    /// Makes a key and certifies it for some days; for a server at loopback and these hosts if any
    /// are given.
    pub fn certify(
        &self,
        name: &str,
        hosts: Option<&[String]>,
        days: u32,
    ) -> Result<(), CertificateError> {
        let mut params = named(name, days);
        params.is_ca = IsCa::ExplicitNoCa;
        params.use_authority_key_identifier_extension = true;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        if let Some(hosts) = hosts {
            params.extended_key_usages.push(ExtendedKeyUsagePurpose::ServerAuth);
            let names = LOOPBACK.into_iter().map(str::to_owned).chain(hosts.iter().cloned());
            params.subject_alt_names =
                CertificateParams::new(names.collect::<Vec<_>>())?.subject_alt_names;
        }
        let pair = KeyPair::generate()?;
        let signed = params.signed_by(&pair, &self.issuer)?;
        let file = |ending| self.directory.join(format!("{name}.{ending}"));
        write(&self.directory, &file("key"), &pair.serialize_pem(), 0o600)?;
        write(&self.directory, &file("pem"), &signed.pem(), 0o644)
    }
}

/// Writes a file anew, under its name only when it is whole, readable as `mode` says from the
/// start.
fn write(directory: &Path, path: &Path, text: &str, mode: u32) -> Result<(), CertificateError> {
    let draft = path.with_extension("draft");
    let put = || {
        if draft.exists() {
            fs::remove_file(&draft)?;
        }
        let mut file = OpenOptions::new().write(true).create_new(true).mode(mode).open(&draft)?;
        file.write_all(text.as_bytes())?;
        fs::rename(&draft, path)
    };
    put().map_err(|source| cannot(directory, "written", path, source))
}

fn cannot(
    directory: &Path,
    what: &'static str,
    path: &Path,
    source: io::Error,
) -> CertificateError {
    CertificateError::File { directory: directory.to_owned(), path: path.to_owned(), what, source }
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
