//! The figures as a table: a row for each number of links, and what each law is of tj's.

use std::fmt;

use crate::{
    case::{Case, LINKS, Setting},
    law::Law,
};

/// What was measured of each case, in some unit; of some cases perhaps nothing.
pub struct Figures(Vec<(Case, f64)>);

impl Figures {
    /// From cases and what was measured of them.
    pub fn new(figures: impl IntoIterator<Item = (Case, f64)>) -> Self {
        Self(figures.into_iter().collect())
    }

    /// Of one case.
    pub fn of(&self, case: Case) -> Option<f64> {
        self.0.iter().find(|(measured, _)| *measured == case).map(|(_, figure)| *figure)
    }

    /// What a law is of tj in the same setting.
    pub fn ratio(&self, case: Case) -> Option<f64> {
        Some(self.of(case)? / self.of(Case { law: Law::Tj, ..case })?)
    }

    /// The largest ratio of a law to tj over some settings, and where it is.
    pub fn worst(&self, law: Law, settings: impl Iterator<Item = Setting>) -> Option<(Case, f64)> {
        settings
            .flat_map(|setting| LINKS.map(move |links| Case { setting, links, law }))
            .filter_map(|case| Some((case, self.ratio(case)?)))
            .max_by(|(_, one), (_, other)| one.total_cmp(other))
    }
}

/// A table of one setting's figures, in Markdown.
pub struct Table<'a> {
    /// What was measured.
    pub figures: &'a Figures,
    /// In which setting.
    pub setting: Setting,
}

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| links | {} |", Law::ALL.map(|law| law.to_string()).join(" | "))?;
        writeln!(f, "|---{}|", "|---".repeat(Law::ALL.len()))?;
        for links in LINKS {
            let cell = |law| {
                let case = Case { setting: self.setting, links, law };
                match (self.figures.of(case), self.figures.ratio(case)) {
                    (Some(figure), _) if law == Law::Tj => format!("{figure:.0}"),
                    (Some(figure), Some(ratio)) => format!("{figure:.0} ({ratio:.2})"),
                    _ => String::new(),
                }
            };
            writeln!(f, "| {links} | {} |", Law::ALL.map(cell).join(" | "))?;
        }
        Ok(())
    }
}
