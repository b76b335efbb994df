//! Which law is measured.

use std::fmt;

/// A law, with mtj's regulating factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// Eq. (7).
    Tj,
    /// Eq. (16) with the factor of eq. (14).
    MtjSwitch,
    /// Eq. (16) with the factor of eq. (15a).
    MtjExponential,
    /// Eq. (16) with the factor of eq. (15b).
    MtjDiagonal,
    /// Eq. (4).
    Mb,
    /// Time-delay control with a mass that is a number.
    Tdc,
}

impl Law {
    /// All of them, tj first.
    pub const ALL: [Self; 6] =
        [Self::Tj, Self::MtjSwitch, Self::MtjExponential, Self::MtjDiagonal, Self::Mb, Self::Tdc];

    /// mtj's three.
    pub const MTJ: [Self; 3] = [Self::MtjSwitch, Self::MtjExponential, Self::MtjDiagonal];
}

impl fmt::Display for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tj => "tj",
            Self::MtjSwitch => "mtj (14)",
            Self::MtjExponential => "mtj (15a)",
            Self::MtjDiagonal => "mtj (15b)",
            Self::Mb => "mb",
            Self::Tdc => "tdc",
        })
    }
}
