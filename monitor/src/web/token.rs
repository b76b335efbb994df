//! The secret that a request to the plant needs.

use std::{
    fmt,
    fs::{self, File},
    io::{self, Read},
    ops::RangeInclusive,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
};

use subtle::ConstantTimeEq;

/// How long a token in a file may be: from 128 bits as hexadecimal digits to a line of text.
const LENGTHS: RangeInclusive<usize> = 32..=256;
/// The permissions that a file with a secret gives nobody.
const OTHERS: u32 = 0o077;

/// The secret that a request to the plant needs: 128 random bits, or what a file of the user holds.
#[derive(Clone)]
pub(super) struct Token(String);

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(…)")
    }
}

/// Why a file has no token for the dashboard.
#[derive(Debug, thiserror::Error)]
pub enum TokenFileError {
    /// The file cannot be read.
    #[error("--web-token-file {}: {source}; name a file that holds the token", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is a folder, a pipe or a device.
    #[error("--web-token-file {}: this is no regular file; name one that holds the token", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
    },
    /// Other users may read or change it.
    #[error(
        "--web-token-file {path}: other users can read or change it (mode {mode:03o}); run \
         'chmod 600 {path}', and renew the token if it is no secret any more",
        path = path.display()
    )]
    Mode {
        /// The file.
        path: PathBuf,
        /// Its permissions.
        mode: u32,
    },
    /// What it holds is no token.
    #[error(
        "--web-token-file {}: it must hold one line of {} to {} letters, digits, '-', '.', '_' or \
         '~', like 'openssl rand -hex 32' prints",
        path.display(), LENGTHS.start(), LENGTHS.end()
    )]
    Content {
        /// The file.
        path: PathBuf,
    },
}

impl Token {
    /// A new token of random bits from the operating system.
    pub(super) fn new() -> Result<Self, getrandom::Error> {
        let mut bits = [0; 16];
        getrandom::fill(&mut bits)?;
        Ok(Self(bits.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The token in a regular file that only its owner can read and change.
    pub(super) fn read(path: &Path) -> Result<Self, TokenFileError> {
        let failed = |source| TokenFileError::Read { path: path.to_owned(), source };
        // Before it is opened, which would wait for the other end of a pipe.
        if !fs::metadata(path).map_err(failed)?.is_file() {
            return Err(TokenFileError::Kind { path: path.to_owned() });
        }
        let file = File::open(path).map_err(failed)?;
        let mode = file.metadata().map_err(failed)?.permissions().mode() & 0o777;
        if mode & OTHERS != 0 {
            return Err(TokenFileError::Mode { path: path.to_owned(), mode });
        }
        let mut text = Vec::new();
        // A token, the end of its line, and one byte more: what is too long shows.
        file.take(*LENGTHS.end() as u64 + 3).read_to_end(&mut text).map_err(failed)?;
        Self::parse(&text).ok_or_else(|| TokenFileError::Content { path: path.to_owned() })
    }

    /// A token of characters that stand for themselves in a URL, with or without an end of line.
    fn parse(text: &[u8]) -> Option<Self> {
        let text = text.strip_suffix(b"\n").unwrap_or(text);
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        let is_unreserved = |byte: &u8| byte.is_ascii_alphanumeric() || b"-._~".contains(byte);
        let is_token = LENGTHS.contains(&text.len()) && text.iter().all(is_unreserved);
        is_token.then(|| Self(String::from_utf8_lossy(text).into_owned()))
    }

    /// The token as text.
    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether `shown` is the token; how long the comparison takes tells nothing about where they
    /// differ.
    pub(super) fn is(&self, shown: &str) -> bool {
        shown.as_bytes().ct_eq(self.0.as_bytes()).into()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

    use super::*;

    #[test]
    fn no_two_tokens_are_the_same_and_each_has_128_bits() {
        let (one, other) = (Token::new().unwrap(), Token::new().unwrap());
        assert_ne!(one.as_str(), other.as_str());
        assert_eq!(one.as_str().len(), 32);
        assert!(one.as_str().bytes().all(|digit| digit.is_ascii_hexdigit()));
    }

    #[test]
    fn a_token_of_a_file_has_32_to_256_characters_that_stand_for_themselves_in_a_url() {
        let token = |text: &str| Token::parse(text.as_bytes()).map(|token| token.0);
        let (shortest, longest) = ("a".repeat(32), "Z".repeat(256));
        for good in [&shortest, &longest, "0123456789-._~abcdefghijklmnopqrstuv"] {
            for end in ["", "\n", "\r\n"] {
                assert_eq!(token(&format!("{good}{end}")).as_deref(), Some(good), "{good}");
            }
        }
        let spoilt = |with: char| format!("{with}{shortest}");
        for bad in [
            "",
            "\n",
            &shortest[1..],
            &format!("{longest}a"),
            &format!("{shortest}\n\n"),
            &format!("{shortest}\n{shortest}\n"),
            &spoilt(' '),
            &spoilt('+'),
            &spoilt('/'),
            &spoilt('ä'),
        ] {
            assert_eq!(token(bad), None, "{bad:?}");
        }
    }
}
