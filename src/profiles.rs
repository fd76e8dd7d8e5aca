//! `convert --profile`: options by name, from a measurement of the user's scene or from those of docs/tradeoffs.md.

use std::ffi::OsString;
use std::path::Path;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, FromArgMatches as _, Parser as _};
use serde_json::Value;

use crate::args::{Args, Command, ConvertArgs, ProfileArg, TargetArg, mistake};
use crate::exit::{Failure, print_line};

/// What a profile may set, with the number of values: a file of a measurement can do no more.
const OPTIONS: [(&str, usize); 10] = [
    ("--sampling", 1),
    ("--encoding", 1),
    ("--brotli-quality", 1),
    ("--planes", 1),
    ("--scale", 1),
    ("--precision", 1),
    ("--attributes", 1),
    ("--compress", 1),
    ("--capacity", 1),
    ("--leaf-capacity", 1),
];

/// Options without a value that a profile may set.
const SWITCHES: [&str; 1] = ["--no-originals"];

/// A file of a measurement is smaller: it holds no pictures.
const MAX_FILE_BYTES: u64 = 64 << 20;

/// The options of a profile with the reason.
struct Chosen {
    options: Vec<String>,
    why: String,
}

/// A command line, the name of the program first, with the options of its profile; help and version are printed here, and end the
/// process.
pub(crate) fn command_line(typed: &[OsString]) -> Result<Args, Failure> {
    let args = Args::try_parse_from(typed).map_err(|error| {
        if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
            error.exit();
        }
        Failure::Usage(mistake::line(&error, typed))
    })?;
    apply(args, typed)
}

/// The command line with the options of its profile, which those that were typed override. Nothing changes without a profile.
fn apply(args: Args, typed: &[OsString]) -> Result<Args, Failure> {
    let Command::Convert(convert) = &args.command else { return Ok(args) };
    let Some(profile) = convert.profile else {
        return match convert.measured {
            Some(_) => Err(Failure::Usage("--measured requires --profile".to_owned())),
            None => Ok(args),
        };
    };
    let chosen = choose(convert, profile)?;
    let quiet = convert.talk.quiet;
    if !quiet {
        let options = if chosen.options.is_empty() { "the defaults".to_owned() } else { chosen.options.join(" ") };
        print_line(&format!("profile {}: {options}; {}", profile.name(), chosen.why));
    }
    // behind the name of the command, before what was typed
    let at = typed.iter().skip(1).position(|word| word == "convert").map_or(typed.len(), |at| at + 2);
    let (before, after) = typed.split_at(at);
    let options = without_conflicts(chosen.options, convert);
    let all = before.iter().cloned().chain(options.into_iter().map(Into::into)).chain(after.iter().cloned());
    let mut command = Args::command().mut_subcommand("convert", |convert| convert.args_override_self(true));
    let matches = command.try_get_matches_from_mut(all);
    let again = matches.and_then(|matches| Args::from_arg_matches(&matches));
    again.map_err(|error| Failure::Usage(mistake::line(&error, typed)))
}

/// The options of a profile, less those that cannot stand beside what was typed.
fn without_conflicts(options: Vec<String>, typed: &ConvertArgs) -> Vec<String> {
    let is_out = |option: &str| match option {
        "--precision" => typed.scale.0.is_some(),
        "--scale" => typed.precision.is_some(),
        "--brotli-quality" => typed.encoding.is_some(),
        _ => false,
    };
    let mut kept = Vec::new();
    let mut rest = options.into_iter().peekable();
    while let Some(option) = rest.next() {
        let value = rest.next_if(|word| !word.starts_with("--"));
        if !is_out(&option) {
            kept.push(option);
            kept.extend(value);
        }
    }
    kept
}

fn choose(convert: &ConvertArgs, profile: ProfileArg) -> Result<Chosen, Failure> {
    let Some(path) = &convert.measured else { return Ok(usual(convert, profile)) };
    let path = if path.is_dir() { path.join("measure.json") } else { path.clone() };
    let result = read(&path)?;
    let mut options = Vec::new();
    let mut reasons = Vec::new();
    for to in &convert.to {
        let (found, why) = measured(&result, profile.name(), to.name()).ok_or_else(|| {
            let (path, name, to) = (path.display(), profile.name(), to.name());
            Failure::Usage(format!("{path}: has no profile {name} of {to}; measure with --axes output={to} and others"))
        })?;
        add(&mut options, allowed(&found, &path)?);
        reasons.push(format!("{}: {why}", to.name()));
    }
    Ok(Chosen { options, why: format!("measured in {}: {}", path.display(), reasons.join("; ")) })
}

/// Adds options that are not there yet: two octrees have one way of sampling.
fn add(options: &mut Vec<String>, more: Vec<Vec<String>>) {
    for option in more {
        if !options.contains(&option[0]) {
            options.extend(option);
        }
    }
}

fn read(path: &Path) -> Result<Value, Failure> {
    let fail = |what: &str| Failure::Usage(format!("{}: {what}; name a folder that `measure` made", path.display()));
    let meta = std::fs::metadata(path).map_err(|_| fail("no such file"))?;
    if !meta.is_file() {
        return Err(fail("no file"));
    }
    if meta.len() > MAX_FILE_BYTES {
        return Err(fail("too large for a measurement"));
    }
    let text = std::fs::read(path).map_err(|error| Failure::io(path, "reading", &error))?;
    serde_json::from_slice(&text).map_err(|_| fail("no measurement"))
}

/// The options of a profile and their reason in a measurement.
fn measured(result: &Value, profile: &str, output: &str) -> Option<(Vec<String>, String)> {
    let text = |value: &Value, name: &str| value.get(name)?.as_str().map(str::to_owned);
    let of_it =
        |p: &&Value| text(p, "name").is_some_and(|n| n == profile) && text(p, "output").is_some_and(|o| o == output);
    let found = result.get("profiles")?.as_array()?.iter().find(of_it)?;
    let arguments = found.get("arguments")?.as_array()?;
    let arguments = arguments.iter().map(|a| a.as_str().map(str::to_owned)).collect::<Option<_>>()?;
    Some((arguments, text(found, "why")?))
}

/// The options one by one, without `--to`; anything that a profile may not set is refused.
fn allowed(arguments: &[String], path: &Path) -> Result<Vec<Vec<String>>, Failure> {
    let mut options = Vec::new();
    let mut rest = arguments.iter();
    while let Some(option) = rest.next() {
        let values = OPTIONS.iter().chain(&[("--to", 1)]).find(|(name, _)| name == option).map(|(_, values)| *values);
        let values = values.or_else(|| SWITCHES.contains(&option.as_str()).then_some(0));
        let values =
            values.ok_or_else(|| Failure::Usage(format!("{}: a profile may not set {option}", path.display())))?;
        let whole: Vec<String> = [option].into_iter().chain(rest.by_ref().take(values)).cloned().collect();
        if whole.len() != 1 + values {
            return Err(Failure::Usage(format!("{}: {option} of a profile has no value", path.display())));
        }
        if option != "--to" {
            options.push(whole);
        }
    }
    Ok(options)
}

/// Without a measurement: what the scenes of docs/tradeoffs.md have in common.
fn usual(convert: &ConvertArgs, profile: ProfileArg) -> Chosen {
    let of = |to: TargetArg| -> &[&[&str]] {
        match (profile, to) {
            (ProfileArg::Fast, TargetArg::Potree2 | TargetArg::Potree1 | TargetArg::Copc) => {
                &[&["--sampling", "random"]]
            }
            (ProfileArg::Balanced, TargetArg::Potree2) => &[&["--encoding", "brotli"]],
            (ProfileArg::Fast | ProfileArg::Balanced, TargetArg::Batches) => &[&["--no-originals"]],
            _ => &[],
        }
    };
    let mut options = Vec::new();
    for to in &convert.to {
        let words = of(*to).iter().map(|option| option.iter().map(|word| (*word).to_owned()).collect());
        add(&mut options, words.collect());
    }
    let why = "figures in docs/tradeoffs.md; `measure` finds those of your scene".to_owned();
    Chosen { options, why }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn words(line: &str) -> Vec<OsString> {
        line.split(' ').map(Into::into).collect()
    }

    fn applied(line: &str) -> Result<Box<ConvertArgs>, Failure> {
        use clap::Parser as _;
        let typed = words(line);
        match apply(Args::try_parse_from(&typed).unwrap(), &typed)?.command {
            Command::Convert(convert) => Ok(convert),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_typed_overrides_the_profile() {
        use crate::args::{EncodingArg, SamplingArg};
        let line = "pointmill convert a.las -o out -q --profile";
        assert_eq!(applied(&format!("{line} fast")).unwrap().sampling, Some(SamplingArg::Random));
        let typed = applied(&format!("{line} fast --sampling grid")).unwrap();
        assert_eq!(typed.sampling, Some(SamplingArg::Grid));
        assert_eq!(applied(&format!("{line} balanced")).unwrap().encoding, Some(EncodingArg::Brotli));
        assert_eq!(applied(&format!("{line} exact")).unwrap().encoding, None);
        assert!(applied(&format!("{line} fast --to batches")).unwrap().batches.no_originals);
    }

    #[test]
    fn profiles_of_a_measurement_set_what_they_may_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("measure.json");
        let write = |arguments: &[&str]| {
            let profile = json!({"name": "fast", "output": "potree2", "arguments": arguments, "why": "it is"});
            std::fs::write(&file, json!({"profiles": [profile]}).to_string()).unwrap();
        };
        let line = format!("pointmill convert a.las -o out -q --measured {} --profile", dir.path().display());
        write(&["--to", "potree2", "--scale", "0.5"]);
        assert_eq!(applied(&format!("{line} fast")).unwrap().scale.0, Some(0.5));
        write(&["--to", "potree2", "--precision", "1cm", "--encoding", "brotli", "--brotli-quality", "9"]);
        let both = applied(&format!("{line} fast --scale 0.5 --encoding default")).unwrap();
        assert!(both.scale.0 == Some(0.5) && both.precision.is_none() && both.brotli_quality.is_none());
        write(&["--to", "potree2", "--scale"]);
        assert!(applied(&format!("{line} fast")).unwrap_err().line().contains("has no value"));
        let missing = applied(&format!("{line} exact")).unwrap_err();
        assert!(missing.line().contains("no profile exact of potree2"), "{missing:?}");
        for evil in ["--overwrite", "--output", "-o", "--report"] {
            write(&["--to", "potree2", evil, "x"]);
            let refused = applied(&format!("{line} fast")).unwrap_err();
            assert!(refused.line().contains(&format!("may not set {evil}")), "{refused:?}");
        }
        std::fs::write(&file, "{").unwrap();
        assert_eq!(applied(&format!("{line} fast")).unwrap_err().code(), 2);
    }
}
