//! Advice names only options that can be passed: those of the command that runs, else of another one that it names.

use std::sync::OnceLock;

use clap::Command;

/// Options of `convert` that a job cannot have.
pub(crate) const NOT_IN_JOBS: [&str; 5] = ["--dry-run", "--resume", "--append", "--page", "--json"];

/// The command that runs, as it is typed behind the name of the program, and all that there are.
static RUNNING: OnceLock<(&'static str, Command)> = OnceLock::new();

/// Advice is for this command from now on. `all`: the definition of the command line.
pub(crate) fn begins(command: &'static str, all: Command) {
    // a process runs one command
    let _ = RUNNING.set((command, all));
}

/// The command that runs.
pub(crate) fn running() -> &'static str {
    RUNNING.get().map_or("convert", |(command, _)| *command)
}

/// The advice, if somebody who typed `command` can follow it; where its options are those of another command, with the name of that
/// one. `None`: no command does with them what this one was to do.
pub(crate) fn fitted(command: &str, advice: &str) -> Option<String> {
    if has_all(command, advice) {
        return Some(advice.to_owned());
    }
    let (other, place) = elsewhere(command)?;
    has_all(other, advice).then(|| format!("{advice} ({place})"))
}

/// A command whose options do for the work of another one, and how to name it.
fn elsewhere(command: &str) -> Option<(&'static str, &'static str)> {
    match command {
        "job units" | "job run" | "job finish" | "job status" => Some(("job plan", "in a new 'pointmill job plan'")),
        "info" => Some(("convert", "with 'pointmill convert'")),
        "export" | "measure" | "preview" | "view" => {
            Some(("convert", "with 'pointmill convert', whose dataset this command takes, too"))
        }
        _ => None,
    }
}

fn has_all(command: &str, advice: &str) -> bool {
    let options = options(command);
    named(advice).all(|option| options.iter().any(|known| known == option))
}

/// The options of a command, without the dashes.
fn options(command: &str) -> Vec<String> {
    let all = RUNNING.get().map(|(_, all)| all);
    let inner = |found: Option<&'static Command>, word| found.and_then(|found| found.find_subcommand(word));
    let Some(found) = command.split(' ').fold(all, inner) else { return Vec::new() };
    let names = found.get_arguments().filter_map(|argument| argument.get_long().map(str::to_owned));
    let is_refused = |name: &str| command == "job plan" && NOT_IN_JOBS.iter().any(|option| option[2..] == *name);
    names.filter(|name| !is_refused(name)).collect()
}

/// The options that a text names, without the dashes.
fn named(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| c.is_whitespace() || ",;:()='\"".contains(c));
    words.filter_map(|word| word.strip_prefix("--")).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory as _, Parser as _};

    use super::*;
    use crate::args::Args;

    #[test]
    fn advice_is_followed_where_its_options_are() {
        begins("convert", Args::command());
        let skip = "pass --unreadable skip";
        for command in ["convert", "export", "extract", "job plan"] {
            assert_eq!(fitted(command, skip).as_deref(), Some(skip), "{command}");
        }
        assert_eq!(fitted("validate", skip), None);
        assert_eq!(fitted("info", skip).unwrap(), "pass --unreadable skip (with 'pointmill convert')");
        assert_eq!(fitted("job run", skip).unwrap(), "pass --unreadable skip (in a new 'pointmill job plan')");
        assert!(
            fitted("view", "--bounds 1,2,3..4,5,6 keeps them, --outliers drop drops them").unwrap().ends_with("too)")
        );
        assert_eq!(fitted("view", "pass --memory 5MiB or more").unwrap(), "pass --memory 5MiB or more");
        assert_eq!(fitted("job run", "leave out --resume"), None, "a job has no such option");
        assert_eq!(fitted("validate", "no option - and none -- here").as_deref(), Some("no option - and none -- here"));
    }

    /// A name that is none of a command has no options, and would hide that of a command that was renamed.
    #[test]
    fn every_name_is_that_of_a_command() {
        begins("convert", Args::command());
        let mut leaves = Vec::new();
        for command in Args::command().get_subcommands() {
            let inner: Vec<_> = command.get_subcommands().map(|inner| inner.get_name()).collect();
            match inner.is_empty() {
                true => leaves.push(command.get_name().to_owned()),
                false => leaves.extend(inner.iter().map(|inner| format!("{} {inner}", command.get_name()))),
            }
        }
        assert_eq!(leaves.len(), 15, "{leaves:?}");
        for leaf in &leaves {
            assert_eq!(options(leaf).is_empty(), leaf == "completions", "{leaf}");
            assert!(elsewhere(leaf).is_none_or(|(other, _)| leaves.iter().any(|leaf| leaf == other)), "{leaf}");
        }
        for typed in
            ["job run d --share 1/1", "job status d", "view a", "info a", "export a -o b.las", "extract a -o d"]
        {
            let args = Args::try_parse_from(["pointmill"].into_iter().chain(typed.split(' '))).unwrap();
            assert!(typed.starts_with(args.command.name()), "{typed}");
        }
    }
}
