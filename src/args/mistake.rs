//! A command line that cannot be parsed, as one line: what is wrong with what, what may have been meant, where to read on.

use std::ffi::OsString;

use clap::CommandFactory as _;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

use super::Args;

/// Longest value that is quoted, characters.
const MAX_QUOTED: usize = 60;

/// The line; `typed`: the arguments, the name of the program first.
pub(crate) fn line(error: &Error, typed: &[OsString]) -> String {
    let commands = commands();
    let command = typed.get(1).filter(|word| commands.iter().any(|name| *word == name.as_str()));
    let help = command.map_or_else(String::new, |name| format!(" {}", name.display()));
    format!("{}; see 'pointmill{help} --help'", what(error, &commands))
}

/// What is wrong, with the nearest of what is known.
fn what(error: &Error, commands: &[String]) -> String {
    let argument = texts(error, ContextKind::InvalidArg);
    let name = argument.first().map_or_else(String::new, |text| short_name(text));
    match error.kind() {
        ErrorKind::UnknownArgument if name.starts_with('-') => {
            format!("there is no option {name}{}", meant(error, ContextKind::SuggestedArg))
        }
        ErrorKind::UnknownArgument => format!("'{name}' is one argument too many"),
        ErrorKind::InvalidSubcommand => {
            let word = text(error, ContextKind::InvalidSubcommand);
            let meant = meant(error, ContextKind::SuggestedSubcommand);
            format!("there is no command '{word}'{meant}; the commands are {}", commands.join(", "))
        }
        ErrorKind::MissingSubcommand | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            format!("no command; the commands are {}", commands.join(", "))
        }
        ErrorKind::MissingRequiredArgument => missing(&argument),
        ErrorKind::ArgumentConflict => match text(error, ContextKind::PriorArg) {
            other if short_name(&other) == name => format!("{name} is given twice"),
            other => format!("{name} and {} exclude each other", short_name(&other)),
        },
        ErrorKind::InvalidValue => unknown_value(error, &name),
        ErrorKind::ValueValidation => {
            let why = std::error::Error::source(error).map_or_else(String::new, ToString::to_string);
            format!("{name} '{}': {why}", text(error, ContextKind::InvalidValue))
        }
        ErrorKind::TooManyValues => format!("{name} takes no value"),
        ErrorKind::NoEquals | ErrorKind::TooFewValues | ErrorKind::WrongNumberOfValues => {
            format!("{name} needs a value")
        }
        ErrorKind::InvalidUtf8 => "an argument that is no path is not UTF-8".to_owned(),
        _ => error.to_string().lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned(),
    }
}

/// A value that is none of the choices, or none at all.
fn unknown_value(error: &Error, name: &str) -> String {
    let value = text(error, ContextKind::InvalidValue);
    let all = texts(error, ContextKind::ValidValue);
    match (value.as_str(), all.join(", ").as_str()) {
        ("", "") => format!("{name} needs a value"),
        ("", choices) => format!("{name} needs a value: {choices}"),
        (value, choices) => {
            // of several that begin so the first is the usual one
            let begun = all.iter().find(|choice| choice.starts_with(value)).map(|near| did_you_mean(near));
            let meant = begun.unwrap_or_else(|| meant(error, ContextKind::SuggestedValue));
            format!("{name} '{value}': expected one of {choices}{meant}")
        }
    }
}

fn missing(arguments: &[String]) -> String {
    let names: Vec<String> = arguments.iter().map(|text| text.replace(['<', '>', '[', ']'], "")).collect();
    let verb = if names.len() == 1 { "is" } else { "are" };
    format!("{} {verb} missing", names.join(" and "))
}

/// "; did you mean --memory?".
fn meant(error: &Error, kind: ContextKind) -> String {
    texts(error, kind).first().map_or_else(String::new, |near| did_you_mean(near))
}

fn did_you_mean(near: &str) -> String {
    format!("; did you mean {near}?")
}

/// `--to` of `--to <FORMAT>`, `INPUT` of `[INPUT]...`; what was typed, shortened.
fn short_name(text: &str) -> String {
    let first = if text.starts_with("--") { text.split([' ', '=', '[']).next().unwrap_or_default() } else { text };
    shortened(first.trim_end_matches("...").trim_matches(['<', '>', '[', ']']))
}

fn text(error: &Error, kind: ContextKind) -> String {
    texts(error, kind).into_iter().next().unwrap_or_default()
}

fn texts(error: &Error, kind: ContextKind) -> Vec<String> {
    match error.get(kind) {
        Some(ContextValue::String(text)) => vec![shortened(text)],
        Some(ContextValue::Strings(texts)) => texts.clone(),
        _ => Vec::new(),
    }
}

fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_QUOTED) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

fn commands() -> Vec<String> {
    Args::command().get_subcommands().map(|command| command.get_name().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;

    fn of(arguments: &[&str]) -> String {
        let typed: Vec<OsString> = ["pointmill"].iter().chain(arguments).map(Into::into).collect();
        line(&Args::try_parse_from(&typed).unwrap_err(), &typed)
    }

    #[test]
    fn every_kind_of_mistake_is_one_line_that_names_it() {
        let table: [(&[&str], &str); 14] = [
            (
                &[],
                "no command; the commands are convert, job, export, measure, validate, extract, info, preview, view, completions, man; see 'pointmill --help'",
            ),
            (&["convrt"], "there is no command 'convrt'; did you mean convert?; the commands are convert, "),
            (&["convert"], "--output OUT is missing; see 'pointmill convert --help'"),
            (&["extract"], "--output DIR and SCAN are missing"),
            (&["info"], "PATH... is missing"),
            (&["convert", "a", "-o"], "--output needs a value"),
            (&["convert", "a", "-o", "b", "--memry", "2"], "there is no option --memry; did you mean --memory?"),
            (&["validate", "a", "b"], "'b' is one argument too many; see 'pointmill validate --help'"),
            (
                &["convert", "a", "-o", "b", "--to", "potree"],
                "one of potree2, potree1, copc, bintree, batches; did you mean potree2?",
            ),
            (&["convert", "a", "-o", "b", "--threads", "x"], "--threads 'x': expected a whole number from 1 to 1024"),
            (&["convert", "a", "-o", "b", "--memory", "-5"], "--memory '-5': expected a size such as"),
            (&["convert", "a", "-o", "b", "-v", "-q"], "--verbose and --quiet exclude each other"),
            (&["convert", "a", "-o", "b", "--dry-run", "--dry-run"], "--dry-run is given twice"),
            (&["convert", "a", "-o", "b", "--json=1"], "--json takes no value"),
        ];
        for (arguments, expected) in table {
            let line = of(arguments);
            assert!(line.contains(expected) && !line.contains('\n'), "{arguments:?}: {line}");
        }
        let long = "x".repeat(1000);
        assert!(of(&["convert", "a", "-o", "b", "--memory", &long]).len() < 250);
    }
}
