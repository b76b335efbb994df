//! The names under which browsers reach the server.

use super::error::WebError;

/// The names that a request may have in its `Host` header.
///
/// They are a closed list, from the machine and the user. A foreign name that points to this server
/// is not among them.
#[derive(Clone, Debug, Default)]
pub(super) struct HostNames(Vec<String>);

impl HostNames {
    /// The names of this machine.
    pub(super) fn of_this_machine() -> Self {
        let name = nix::unistd::gethostname().unwrap_or_default();
        Self::of_machine(&name.to_string_lossy())
    }

    /// `localhost` and, of a machine whose host name is `name`: that name, its first label, and its
    /// first label with `.local`, the name in multicast DNS.
    pub(super) fn of_machine(name: &str) -> Self {
        let names = Self::default().with("localhost");
        let label = name.split('.').next().unwrap_or_default();
        if label.is_empty() {
            return names;
        }
        names.with(name).with(label).with(&format!("{label}.local"))
    }

    /// The same with one more name.
    pub(super) fn with(mut self, name: &str) -> Self {
        self.0.push(name.to_owned());
        self
    }

    /// The same with the names of `--web-host`.
    pub(super) fn with_options(mut self, names: &[String]) -> Result<Self, WebError> {
        for name in names {
            if !is_host_name(name) {
                return Err(WebError::Host { name: name.clone() });
            }
            self = self.with(name);
        }
        Ok(self)
    }

    /// Whether `name` is one of them, in upper or lower case.
    pub(super) fn contains(&self, name: &str) -> bool {
        !name.is_empty() && self.0.iter().any(|known| known.eq_ignore_ascii_case(name))
    }
}

/// Whether a text is a host name: labels of letters, digits, hyphens and underscores.
fn is_host_name(text: &str) -> bool {
    let is_part = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
    text.len() < 254 && text.split('.').all(|label| !label.is_empty() && label.bytes().all(is_part))
}
