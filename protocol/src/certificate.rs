//! What a certificate says of itself (X.509, in PEM): from when until when it holds, for which key.
//!
//! Whether it is to be believed is for TLS to find out. This is enough to tell a user, before a role
//! is started with it, what they would otherwise have to read out of a connection that never comes up.

use std::{
    fmt, fs, io,
    path::Path,
    time::{SystemTime, UNIX_EPOCH},
};

/// A certificate.
#[derive(Clone, Debug)]
pub struct Certificate {
    der: Vec<u8>,
    from: Date,
    until: Date,
    public_key: Vec<u8>,
}

/// Why a certificate or a key is of no use.
#[derive(Debug)]
pub enum Fault {
    /// The file cannot be read.
    Unreadable(io::Error),
    /// There is none in it.
    Absent,
    /// It holds only from then on.
    Early(Date),
    /// It held only until then.
    Expired(Date),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable(error) => write!(f, "cannot be read ({error})"),
            Self::Absent => f.write_str("is not what its name says, in PEM"),
            Self::Early(date) => write!(f, "does not hold before {date}; is the clock right?"),
            Self::Expired(date) => write!(f, "expired on {date}"),
        }
    }
}

impl Certificate {
    /// The first certificate in a file, if it holds now.
    pub fn read(path: &Path) -> Result<Self, Fault> {
        let text = fs::read_to_string(path).map_err(Fault::Unreadable)?;
        let certificate =
            decode(&text, "CERTIFICATE").and_then(Self::parse).ok_or(Fault::Absent)?;
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let now = since_1970.as_secs() as i64;
        match (certificate.from.seconds(), certificate.until.seconds()) {
            (from, _) if now < from => Err(Fault::Early(certificate.from)),
            (_, until) if now > until => Err(Fault::Expired(certificate.until)),
            _ => Ok(certificate),
        }
    }

    fn parse(der: Vec<u8>) -> Option<Self> {
        let (_, certificate, _) = element(&der)?;
        let (_, mut fields, _) = element(certificate)?;
        let mut next = || {
            let (tag, content, rest) = element(fields)?;
            fields = rest;
            Some((tag, content))
        };
        // The version may be left out; then comes the serial number, which is a plain integer.
        if next()?.0 != INTEGER {
            next()?;
        }
        let (_algorithm, _issuer) = (next()?, next()?);
        let (_, validity) = next()?;
        let _subject = next()?;
        let (_, key) = next()?;
        let (tag, from, rest) = element(validity)?;
        let from = Date::parse(tag, from)?;
        let (tag, until, _) = element(rest)?;
        let until = Date::parse(tag, until)?;
        let (_, _algorithm, key) = element(key)?;
        let public_key = element(key)?.1.to_vec();
        Some(Self { der, from, until, public_key })
    }

    /// Whether these bytes are in it, as they are in what it was made from.
    pub fn holds(&self, bytes: &[u8]) -> bool {
        contains(&self.der, bytes)
    }

    /// Whether the private key in a file is another one's. Unknown, and so not said, of a key that does
    /// not carry its public half.
    pub fn is_foreign_to(&self, key: &Path) -> Result<bool, Fault> {
        let text = fs::read_to_string(key).map_err(Fault::Unreadable)?;
        let key = decode(&text, "PRIVATE KEY").ok_or(Fault::Absent)?;
        // RFC 5915: the public half of a key on an elliptic curve, an uncompressed point.
        let length = self.public_key.len() as u8;
        let carries = contains(&key, &[0xa1, length.wrapping_add(2), 0x03, length, 0, 4]);
        Ok(carries && !contains(&key, &self.public_key))
    }
}

/// A day and a time, UTC.
#[derive(Clone, Copy, Debug)]
pub struct Date {
    year: i64,
    /// Month, day, hour, minute, second.
    rest: [i64; 5],
}

impl Date {
    fn parse(tag: u8, text: &[u8]) -> Option<Self> {
        let mut digits = std::str::from_utf8(text).ok()?;
        let mut take = |count: usize| {
            let (number, rest) = digits.split_at_checked(count)?;
            digits = rest;
            number.parse::<i64>().ok()
        };
        let year = match tag {
            // RFC 5280: of two digits, 50 and more are of the twentieth century.
            UTC_TIME => take(2).map(|year| if year < 50 { 2000 + year } else { 1900 + year })?,
            GENERALIZED_TIME => take(4)?,
            _ => return None,
        };
        let mut rest = [0; 5];
        for part in &mut rest {
            *part = take(2)?;
        }
        Some(Self { year, rest })
    }

    /// Since 1970.
    fn seconds(&self) -> i64 {
        let Self { year, rest: [month, day, hour, minute, second] } = *self;
        // Years that begin in March have the leap day at their end.
        let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
        let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
        let day_of_year = (153 * month + 2) / 5 + day - 1;
        let days = 365 * year + leap_days + day_of_year - 719_468;
        ((days * 24 + hour) * 60 + minute) * 60 + second
    }
}

impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { year, rest: [month, day, hour, minute, _] } = self;
        write!(f, "{year:04}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
    }
}

const INTEGER: u8 = 0x02;
const UTC_TIME: u8 = 0x17;
const GENERALIZED_TIME: u8 = 0x18;

/// The first element of DER: its tag, what is in it, and what comes after it.
fn element(der: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (tag, rest) = der.split_first()?;
    let (length, rest) = rest.split_first()?;
    let (length, rest) = match usize::from(*length) {
        short @ 0..0x80 => (short, rest),
        long => {
            let (bytes, rest) = rest.split_at_checked(long - 0x80)?;
            let append =
                |length: usize, byte: &u8| length.checked_mul(256)?.checked_add(usize::from(*byte));
            (bytes.iter().try_fold(0, append)?, rest)
        }
    };
    let (content, rest) = rest.split_at_checked(length)?;
    Some((*tag, content, rest))
}

/// The bytes of the first block of a PEM text whose label ends like this.
fn decode(text: &str, label: &str) -> Option<Vec<u8>> {
    let mut lines = text.lines().map(str::trim);
    lines.find(|line| {
        line.starts_with("-----BEGIN ") && line.trim_end_matches('-').ends_with(label)
    })?;
    let mut bytes = Vec::new();
    let (mut bits, mut count) = (0_u32, 0);
    for line in lines {
        if line.starts_with("-----END ") {
            return Some(bytes);
        }
        for character in line.bytes().filter(|character| *character != b'=') {
            let digit = match character {
                b'A'..=b'Z' => character - b'A',
                b'a'..=b'z' => character - b'a' + 26,
                b'0'..=b'9' => character - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(digit);
            count += 6;
            if count >= 8 {
                count -= 8;
                bytes.push((bits >> count) as u8);
            }
        }
    }
    None
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_read_as_rfc_5280_writes_them() {
        for (tag, text, seconds, words) in [
            (UTC_TIME, "700101000000Z", 0, "1970-01-01 00:00 UTC"),
            (UTC_TIME, "491231235959Z", 2_524_607_999, "2049-12-31 23:59 UTC"),
            (GENERALIZED_TIME, "20000301000000Z", 951_868_800, "2000-03-01 00:00 UTC"),
            (GENERALIZED_TIME, "21000228120000Z", 4_107_499_200, "2100-02-28 12:00 UTC"),
        ] {
            let date = Date::parse(tag, text.as_bytes()).unwrap();
            assert_eq!((date.seconds(), date.to_string().as_str()), (seconds, words), "{text}");
        }
        assert!(Date::parse(UTC_TIME, b"7001").is_none());
        assert!(Date::parse(INTEGER, b"700101000000Z").is_none());
    }

    #[test]
    fn what_is_cut_short_is_no_certificate() {
        let whole = [0x30, 0x03, 0x02, 0x01, 0x05];
        assert_eq!(element(&whole), Some((0x30, &whole[2..], &[][..])));
        for end in 0..whole.len() {
            assert_eq!(element(&whole[..end]), None, "{end} bytes");
        }
        let endless = [0x30, 0x88, 255, 255, 255, 255, 255, 255, 255, 255, 0];
        assert_eq!(element(&endless), None);
        assert!(Certificate::parse(whole.to_vec()).is_none());
    }

    #[test]
    fn pem_is_base64_between_two_lines() {
        let text = "a word before\n-----BEGIN EC PRIVATE KEY-----\nAAEC\nA/8=\n-----END EC PRIVATE KEY-----\n";
        assert_eq!(decode(text, "PRIVATE KEY"), Some(vec![0, 1, 2, 3, 255]));
        assert_eq!(decode(text, "CERTIFICATE"), None);
        assert_eq!(decode(&text.replace("A/8=", "A?8="), "PRIVATE KEY"), None);
        assert_eq!(decode(&text[..60], "PRIVATE KEY"), None);
    }
}
