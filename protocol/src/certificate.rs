//! The validity and the key of a certificate (X.509, in PEM).
//!
//! TLS decides whether a certificate is to be trusted. The checks here tell the user, before a role
//! starts with a certificate, what would otherwise only show as a connection that never comes up.

use std::{
    fmt, fs, io,
    path::Path,
    time::{SystemTime, UNIX_EPOCH},
};

use x509_parser::{pem::Pem, time::ASN1Time};

/// A certificate that is valid now.
#[derive(Clone, Debug)]
pub struct Certificate {
    der: Vec<u8>,
    public_key: Vec<u8>,
}

/// Why a certificate or a key is of no use.
#[derive(Debug, thiserror::Error)]
pub enum CertificateError {
    /// The file cannot be read.
    #[error("cannot be read ({0})")]
    Unreadable(#[from] io::Error),
    /// The file holds no certificate, or no key.
    #[error("is not what its name says, in PEM")]
    Absent,
    /// The certificate is valid only from then on.
    #[error("does not hold before {0}; is the clock right?")]
    Early(Date),
    /// The certificate was valid only until then.
    #[error("expired on {0}")]
    Expired(Date),
}

/// A day and a time, UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Date(ASN1Time);

impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let date = self.0.to_datetime();
        write!(
            f,
            "{:04}-{:02}-{:02} {:02}:{:02} UTC",
            date.year(),
            u8::from(date.month()),
            date.day(),
            date.hour(),
            date.minute()
        )
    }
}

impl Certificate {
    /// Reads the first certificate in a file, and checks that it is valid now.
    pub fn read(path: &Path) -> Result<Self, CertificateError> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self::parse(&fs::read(path)?, now.as_secs() as i64)
    }

    /// The first certificate of a PEM text, if it is valid at `now`, s since 1970.
    fn parse(text: &[u8], now: i64) -> Result<Self, CertificateError> {
        let der = decode(text, "CERTIFICATE").ok_or(CertificateError::Absent)?;
        let (_, certificate) =
            x509_parser::parse_x509_certificate(&der).map_err(|_| CertificateError::Absent)?;
        let validity = certificate.validity();
        if now < validity.not_before.timestamp() {
            return Err(CertificateError::Early(Date(validity.not_before)));
        }
        if now > validity.not_after.timestamp() {
            return Err(CertificateError::Expired(Date(validity.not_after)));
        }
        let public_key = certificate.public_key().subject_public_key.data.to_vec();
        Ok(Self { der, public_key })
    }

    /// Whether the certificate contains these bytes, such as a name or a public key.
    pub fn contains(&self, bytes: &[u8]) -> bool {
        contains(&self.der, bytes)
    }

    /// Whether the private key in a file belongs to another certificate. False if that is unknown,
    /// because the key does not carry its public half.
    pub fn is_foreign_to(&self, key: &Path) -> Result<bool, CertificateError> {
        let key = decode(&fs::read(key)?, "PRIVATE KEY").ok_or(CertificateError::Absent)?;
        let point = &self.public_key;
        // RFC 5915: the public half of a key on an elliptic curve is [1] { BIT STRING }, and holds
        // an uncompressed point, which begins with 4.
        let length = point.len() as u8;
        let carries =
            contains(&key, &[0xa1, length.wrapping_add(3), 0x03, length.wrapping_add(1), 0, 4]);
        Ok(carries && !contains(&key, point))
    }
}

/// The bytes of the first block of a PEM text whose label ends like this.
fn decode(text: &[u8], label: &str) -> Option<Vec<u8>> {
    let mut blocks = Pem::iter_from_buffer(text).flatten();
    blocks.find(|block| block.label.ends_with(label)).map(|block| block.contents)
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_date_is_shown_to_the_minute() {
        for (seconds, shown) in [
            (0, "1970-01-01 00:00 UTC"),
            (2_524_607_999, "2049-12-31 23:59 UTC"),
            (951_868_800, "2000-03-01 00:00 UTC"),
            (4_107_499_200, "2100-02-28 12:00 UTC"),
        ] {
            let date = Date(ASN1Time::from_timestamp(seconds).unwrap());
            assert_eq!(date.to_string(), shown);
        }
    }

    #[test]
    fn a_block_of_pem_is_found_by_the_end_of_its_label() {
        let text = "a word before\n-----BEGIN EC PRIVATE KEY-----\nAAEC\nA/8=\n\
                    -----END EC PRIVATE KEY-----\n";
        let decode = |text: &str, label| decode(text.as_bytes(), label);
        assert_eq!(decode(text, "PRIVATE KEY"), Some(vec![0, 1, 2, 3, 255]));
        assert_eq!(decode(text, "CERTIFICATE"), None);
        assert_eq!(decode(&text.replace("A/8=", "A?8="), "PRIVATE KEY"), None);
        assert_eq!(decode(&text[..60], "PRIVATE KEY"), None);
    }

    #[test]
    fn a_block_that_is_cut_short_is_no_certificate() {
        for body in ["", "MAMCAQU=", "MAMC", "MIj//////////wA="] {
            let text = format!("-----BEGIN CERTIFICATE-----\n{body}\n-----END CERTIFICATE-----\n");
            let found = Certificate::parse(text.as_bytes(), 0);
            assert!(matches!(found, Err(CertificateError::Absent)), "{body}: {found:?}");
        }
    }
}
