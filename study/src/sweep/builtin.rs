//! The studies that the program carries.

macro_rules! built_in_studies {
    ($($name:literal,)*) => {
        /// Names and texts of the built-in studies.
        pub const BUILT_IN: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../studies/", $name, ".toml"))),)*];
    };
}

built_in_studies! {
    "latency",
    "sample-period",
    "jitter",
    "dropout",
    "memory-step",
    "thresholds",
    "noise",
    "horizon",
    "gains",
    "best",
}

/// The text of a built-in study.
pub fn built_in(name: &str) -> Option<&'static str> {
    BUILT_IN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
