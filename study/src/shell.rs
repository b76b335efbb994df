//! Commands that a user can paste into a shell.

use mtj_model::scenario::Override;

/// The command that runs a scenario.
pub fn run_command(scenario: &str, set: &[Override]) -> String {
    format!("mtj run --scenario {}{}", quoted(scenario), flags(set))
}

/// The options that set keys, with a space before each.
pub(crate) fn flags(set: &[Override]) -> String {
    set.iter().map(|set| format!(" --set {}", quoted(&set.to_string()))).collect()
}

/// A text as one word.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=./:,+".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_with_quotes_is_quoted() {
        let set = [Override::text("a", "1ms"), Override::text("b", "it's 1")];
        assert_eq!(
            run_command("sampled/mtj", &set),
            r#"mtj run --scenario sampled/mtj --set a=1ms --set 'b=it'\''s 1'"#
        );
    }
}
