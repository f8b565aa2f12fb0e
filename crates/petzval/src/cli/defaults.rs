//! Defaults of requests as words of the command line: every default stands in a request of `petzval-jobs`, and nowhere else.

use serde::Serialize;
use serde_json::Value;

/// A choice, a name or a path of a request, as the command line takes it.
pub fn word(of: impl Serialize) -> String {
    match serde_json::to_value(of) {
        Ok(Value::String(word)) => word,
        // Whatever is no word has none: the test of all arguments finds it.
        _ => String::new(),
    }
}

/// Numbers of a request with commas between them.
pub fn numbers<T: ToString>(of: &[T]) -> String {
    of.iter().map(T::to_string).collect::<Vec<_>>().join(",")
}

/// Choices of a request with commas between them.
pub fn words<T: Serialize>(of: &[T]) -> String {
    of.iter().map(word).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory};

    use crate::cli::Cli;

    /// Every argument of every verb, with the words of its verb.
    fn all(command: &Command, path: &str, found: &mut Vec<(String, clap::Arg)>) {
        found.extend(command.get_arguments().map(|arg| (format!("{path} {}", arg.get_id()), arg.clone())));
        for verb in command.get_subcommands() {
            all(verb, &format!("{path} {}", verb.get_name()), found);
        }
    }

    #[test]
    fn every_default_is_a_value_that_its_argument_takes() {
        let mut arguments = Vec::new();
        all(&Cli::command(), "petzval", &mut arguments);
        let mut defaults = 0;
        for (name, arg) in arguments {
            let choices = arg.get_possible_values();
            for default in arg.get_default_values() {
                let default = default.to_string_lossy();
                assert!(!default.is_empty(), "{name}");
                // Lists are split at commas by clap.
                for part in default.split(',').filter(|_| !choices.is_empty()) {
                    assert!(choices.iter().any(|choice| choice.matches(part, false)), "{name}: {part}");
                }
                defaults += 1;
            }
        }
        assert!(defaults > 100, "{defaults}");
    }
}
