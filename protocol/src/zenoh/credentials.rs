//! The certificates and the key of a role, and the TLS settings made of them.

use std::path::{Path, PathBuf};

use mtj_model::scenario::BusSettings;

use super::ZenohError;
use crate::{certificate::Certificate, member::Role};

/// The authority that a role trusts, and the certificate and key that it presents.
pub(super) struct Credentials {
    directory: PathBuf,
    authority: PathBuf,
    certificate: PathBuf,
    key: PathBuf,
}

impl Credentials {
    /// The credentials of a role, if the settings name any; checked as far as that is possible
    /// without a peer.
    pub(super) fn of(settings: &BusSettings, role: Role) -> Result<Option<Self>, ZenohError> {
        let Some(directory) = &settings.certs else { return Ok(None) };
        let name = settings.identity.as_deref().unwrap_or(role.name());
        let credentials = Self {
            directory: directory.clone(),
            authority: directory.join("ca.pem"),
            certificate: directory.join(format!("{name}.pem")),
            key: directory.join(format!("{name}.key")),
        };
        credentials.check()?;
        Ok(Some(credentials))
    }

    fn check(&self) -> Result<(), ZenohError> {
        let at = |file: &Path| {
            let (file, directory) = (file.to_owned(), self.directory.clone());
            |source| ZenohError::Credentials { file, directory, source }
        };
        let Self { directory, authority, certificate, key } = self;
        Certificate::read(authority).map_err(at(authority))?;
        let own = Certificate::read(certificate).map_err(at(certificate))?;
        if own.is_foreign_to(key).map_err(at(key))? {
            return Err(ZenohError::ForeignKey {
                key: key.clone(),
                certificate: certificate.clone(),
                directory: directory.clone(),
            });
        }
        Ok(())
    }

    /// The keys of a Zenoh configuration and their values: mutual TLS, on links that end when a
    /// certificate expires.
    pub(super) fn tls(&self) -> Vec<(String, String)> {
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
