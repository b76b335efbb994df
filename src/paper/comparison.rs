//! Statements of the paper beside our results, as a table for people.

use std::fmt;

use serde::Serialize;

/// One statement of the paper, tested.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Comparison {
    /// Its place in the paper and its subject.
    pub quantity: String,
    /// The paper's number or words.
    pub printed: String,
    /// Our number.
    pub ours: String,
    /// By how much they differ, or whether what is said holds.
    pub deviation: String,
    /// The number that decides: ours, a ratio, or for Table 1 ours less printed over all N.
    pub value: f64,
}

/// The comparison for people.
pub(crate) struct ComparisonTable<'a>(pub &'a [Comparison]);

impl fmt::Display for ComparisonTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns: [fn(&Comparison) -> &str; 4] =
            [|c| &c.quantity, |c| &c.printed, |c| &c.ours, |c| &c.deviation];
        let heads = ["quantity", "printed", "ours", "deviation"];
        let width = |i: usize| {
            let cells = self.0.iter().map(|row| printed_width(columns[i](row)));
            cells.max().unwrap_or(0).max(heads[i].len())
        };
        let widths: [usize; 4] = std::array::from_fn(width);
        let mut line = |cells: [&str; 4]| {
            let padded = cells
                .iter()
                .zip(widths)
                .map(|(cell, width)| format!("{cell}{}", " ".repeat(width - printed_width(cell))));
            writeln!(f, "  {}", padded.collect::<Vec<_>>().join("  ").trim_end())
        };
        line(heads)?;
        let rules = widths.map(|width| "─".repeat(width));
        line(rules.each_ref().map(String::as_str))?;
        self.0.iter().try_for_each(|row| line(columns.map(|column| column(row))))
    }
}

/// Characters that take a column; a combining dot does not.
pub(crate) fn printed_width(text: &str) -> usize {
    text.chars().filter(|c| !('\u{300}'..='\u{36f}').contains(c)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_combining_dot_takes_no_column() {
        assert_eq!(printed_width("J̇q̇"), 2);
    }

    #[test]
    fn the_table_has_a_head_a_rule_and_a_line_for_each_row() {
        let text = |text: &str| text.to_owned();
        let row = Comparison {
            quantity: text("J̇"),
            printed: text("1"),
            ours: text("2"),
            deviation: text("+1"),
            value: 2.0,
        };
        let table = ComparisonTable(&[row]).to_string();
        assert_eq!(table.lines().count(), 3);
        assert_eq!(table.lines().last(), Some("  J̇         1        2     +1"));
    }
}
