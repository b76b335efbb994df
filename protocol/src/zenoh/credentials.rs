//! The files by which a role proves who it is, and the TLS that they make.

use std::path::{Path, PathBuf};

use mtj_model::scenario::BusSettings;

use crate::{
    bus::BusError,
    certificate::{Certificate, Fault},
    member::Role,
};

/// The authority that a role trusts, and what it shows others.
pub struct Credentials {
    authority: PathBuf,
    certificate: PathBuf,
    key: PathBuf,
}

impl Credentials {
    /// Those of a role, if the settings name any. What is wrong with them is said as far as it can be
    /// known without a peer.
    pub fn of(settings: &BusSettings, role: Role) -> Result<Option<Self>, BusError> {
        let Some(directory) = &settings.certs else { return Ok(None) };
        let name = settings.identity.as_deref().unwrap_or(role.name());
        let credentials = Self {
            authority: directory.join("ca.pem"),
            certificate: directory.join(format!("{name}.pem")),
            key: directory.join(format!("{name}.key")),
        };
        credentials.check().map_err(|(path, fault)| {
            BusError::Settings(format!(
                "{} {fault}; 'mtj certs' makes what belongs into {}",
                path.display(),
                directory.display()
            ))
        })?;
        Ok(Some(credentials))
    }

    fn check(&self) -> Result<(), (&Path, String)> {
        fn at(path: &Path, fault: Fault) -> (&Path, String) {
            (path, fault.to_string())
        }
        let Self { authority, certificate, key } = self;
        Certificate::read(authority).map_err(|fault| at(authority, fault))?;
        let own = Certificate::read(certificate).map_err(|fault| at(certificate, fault))?;
        match own.is_foreign_to(key).map_err(|fault| at(key, fault))? {
            true => Err((key, format!("does not belong to {}", certificate.display()))),
            false => Ok(()),
        }
    }

    /// Keys of a Zenoh configuration and their values: each end proves itself to the other, and a link
    /// ends when a certificate does.
    pub fn tls(&self) -> Vec<(String, String)> {
        let path = |path: &Path| format!("{:?}", path.display().to_string());
        let (certificate, key) = (path(&self.certificate), path(&self.key));
        let settings = [
            ("root_ca_certificate", path(&self.authority)),
            ("listen_certificate", certificate.clone()),
            ("listen_private_key", key.clone()),
            ("connect_certificate", certificate),
            ("connect_private_key", key),
            ("enable_mtls", "true".to_owned()),
            ("verify_name_on_connect", "true".to_owned()),
            ("close_link_on_expiration", "true".to_owned()),
        ];
        settings.map(|(name, value)| (format!("transport/link/tls/{name}"), value)).into()
    }
}
