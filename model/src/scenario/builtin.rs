//! The scenarios that the program carries.

macro_rules! built_in_scenarios {
    ($($name:literal,)*) => {
        /// Names and texts of the built-in scenarios.
        pub const BUILT_IN: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../scenarios/", $name, ".toml"))),)*];
    };
}

built_in_scenarios! {
    "paper/fig2-tj",
    "paper/fig2-mtj",
    "paper/fig3-tj",
    "paper/fig3-mtj",
    "paper/fig4-tj",
    "paper/fig4-mtj",
    "paper/fig4-mb",
    "paper/fig4-mb-perturbed",
    "paper/fig5-tj",
    "paper/fig5-mtj",
    "paper/fig5-mb",
    "paper/fig5-mb-perturbed",
    "sampled/tj",
    "sampled/mtj",
    "sampled/mb",
    "redundant/mtj",
    "remote/mtj",
}

/// The text of a built-in scenario.
pub fn built_in(name: &str) -> Option<&'static str> {
    BUILT_IN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
