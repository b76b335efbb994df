//! `mtj scenario`: the built-in experiments, and checking one's own.

use std::io::{self, Write};

use clap::{Args, Subcommand};
use mtj_model::scenario::{BUILT_IN, KeyDefault, KeyTable, reference, reference_page};

use crate::{failure::Failure, options::scenario::ScenarioOptions};

/// List, show or check scenarios
#[derive(Args, Debug)]
pub struct ScenarioCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Print the names of the built-in scenarios
    List,
    /// Print a scenario as TOML, with everything set that was asked for
    Show(Named),
    /// Say whether a scenario is acceptable
    Check(Named),
    /// Print all keys that a scenario may have, with units and defaults
    Keys {
        /// As docs/scenario.md is written
        #[arg(long)]
        markdown: bool,
    },
}

#[derive(Args, Debug)]
struct Named {
    /// Built-in name or TOML file
    name: Option<String>,
    #[command(flatten)]
    options: ScenarioOptions,
}

impl Named {
    fn load(mut self) -> Result<mtj_model::scenario::Scenario, Failure> {
        if let Some(name) = self.name {
            self.options.scenario = name;
        }
        Ok(self.options.load()?)
    }
}

impl ScenarioCommand {
    /// Prints to standard output.
    pub fn run(self) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        match self.action {
            Action::List => {
                for (name, text) in BUILT_IN {
                    writeln!(out, "{name:<25} {}", summary(text))?;
                }
            }
            Action::Show(named) => write!(out, "{}", named.load()?.text())?,
            Action::Keys { markdown: true } => write!(out, "{}", reference_page())?,
            Action::Keys { markdown: false } => print_keys(&mut out)?,
            Action::Check(named) => writeln!(out, "{}: acceptable", named.load()?.name)?,
        }
        Ok(())
    }
}

/// A line a key: its path, what it takes, unit and default; what it means stands below.
fn print_keys(out: &mut impl Write) -> io::Result<()> {
    for KeyTable { title, note, keys } in reference() {
        writeln!(out, "[{title}]  {note}")?;
        for key in keys {
            let default = match key.default {
                KeyDefault::Required => "required".to_owned(),
                KeyDefault::Value(value) => format!("default {value}"),
                KeyDefault::SameAs(other) => format!("default: as {other}"),
                KeyDefault::Words(words) => format!("default: {words}"),
            };
            let unit = if key.unit.is_empty() { String::new() } else { format!(", {}", key.unit) };
            writeln!(out, "  {}  {}{unit}; {default}", key.key, key.syntax())?;
            writeln!(out, "      {}", key.help)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// The first paragraph of the comment that a scenario's file begins with.
fn summary(text: &str) -> String {
    text.lines().map_while(|line| line.strip_prefix("# ")).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_has_whole_sentences() {
        for (name, text) in BUILT_IN {
            let summary = summary(text);
            assert!(summary.ends_with('.') && !summary.contains('\n'), "{name}: {summary}");
        }
    }
}
