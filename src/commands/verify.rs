//! `convert --verify`: the validator looks at what was made before it gets its name.

use std::path::Path;

use pointmill_converter::{ConvertError, Plan};
use pointmill_format::ReadError;
use pointmill_validate::{Finding, Options, Outcome, locate, several, validate};

use crate::args::VerifyArg;
use crate::human::progress::Progress;
use crate::human::quantities::plural;

/// Validates all datasets in a folder that is about to become the output.
///
/// # Errors
/// A dataset breaks a promise of its format, differs from the scans, or cannot be looked at.
pub(crate) fn verify(folder: &Path, how: VerifyArg, plan: &Plan, progress: &Progress) -> Result<(), ConvertError> {
    let options = Options {
        against: if how == VerifyArg::Scans { plan.inputs.clone() } else { Vec::new() },
        open: plan.open.clone(),
        threads: plan.threads,
        memory_bytes: plan.memory_bytes,
        ..Options::default()
    };
    let refused = |why: String| ConvertError::Refused { output: plan.output.clone(), why };
    let broken = |error: ReadError| match error.path().starts_with(folder) {
        true => refused(error.what_and_where().replace(&*folder.to_string_lossy(), &plan.output.to_string_lossy())),
        false => error.into(),
    };
    let mut datasets = vec![folder.to_path_buf()];
    if locate(folder).is_err()
        && let Some(several) = several(folder).map_err(broken)?
    {
        if let Some(first) = several.problems.first() {
            return Err(refused(first.to_string()));
        }
        datasets = several.datasets.iter().map(|located| folder.join(located.kind.name())).collect();
    }
    for dataset in datasets {
        let outcome = validate(&dataset, &options, &|p| progress.at(p.phase, p.done, p.total)).map_err(broken)?;
        if let Some(why) = why(&outcome) {
            return Err(refused(why));
        }
    }
    Ok(())
}

/// What is wrong with a dataset, in a line.
fn why(outcome: &Outcome) -> Option<String> {
    if outcome.ok {
        return None;
    }
    let broken: Vec<&str> = outcome.checks.iter().filter(|check| !check.ok).map(|check| check.name.name()).collect();
    let faults = plural(outcome.checks.iter().map(|check| check.found).sum(), "error");
    let found = format!("{} {faults} found by {}", outcome.format, broken.join(", "));
    let first = |finding: &&Finding| broken.contains(&finding.check.name());
    Some(match outcome.problems.iter().find(first) {
        Some(problem) => format!("{found}, such as: {problem}"),
        None => found,
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser as _;
    use pointmill_converter::{Potree2Settings, Silent, convert, convert_verified};
    use pointmill_testkit::las::Las;

    use super::*;
    use crate::args::TalkArgs;

    #[derive(clap::Parser)]
    struct Talk {
        #[command(flatten)]
        talk: TalkArgs,
    }

    fn quiet() -> Progress {
        Progress::new(&Talk::parse_from(["pointmill", "-q"]).talk, None)
    }

    #[test]
    fn a_dataset_that_is_broken_before_it_has_its_name_never_gets_it() {
        let dir = tempfile::tempdir().unwrap();
        let (scan, out) = (dir.path().join("a.las"), dir.path().join("out"));
        fs::write(&scan, Las::terrain(3000, 1).bytes()).unwrap();
        let mut plan = Plan::new(vec![scan], out.clone());
        let targets = [Potree2Settings::default().into()];
        for how in [VerifyArg::Dataset, VerifyArg::Scans] {
            plan.overwrite = true;
            let whole = |folder: &Path| verify(folder, how, &plan, &quiet());
            convert_verified(&plan, &targets, &Silent, &whole).unwrap();
        }
        let before = fs::read(out.join("octree.bin")).unwrap();
        let broken = |folder: &Path| {
            let path = folder.join("octree.bin");
            let mut bytes = fs::read(&path).unwrap();
            bytes[7] ^= 0x40; // a coordinate of the first node
            fs::write(&path, bytes).unwrap();
            verify(folder, VerifyArg::Dataset, &plan, &quiet())
        };
        let error = convert_verified(&plan, &targets, &Silent, &broken).unwrap_err().to_string();
        assert!(error.contains("was not kept: potree2 ") && error.contains("such as: "), "{error}");
        assert_eq!(fs::read(out.join("octree.bin")).unwrap(), before);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2, "nothing is left");
    }

    #[test]
    fn a_point_that_is_not_that_of_the_scan_is_found_against_the_scans_alone() {
        let dir = tempfile::tempdir().unwrap();
        let scan = dir.path().join("a.las");
        fs::write(&scan, Las::terrain(3000, 1).bytes()).unwrap();
        let plan = Plan::new(vec![scan.clone()], dir.path().join("out"));
        convert(&plan, &[Potree2Settings::default().into()], &Silent).unwrap();
        let other = Las::terrain(3000, 2).bytes(); // of as many points
        fs::write(&scan, other).unwrap();
        verify(&plan.output, VerifyArg::Dataset, &plan, &quiet()).unwrap();
        let error = verify(&plan.output, VerifyArg::Scans, &plan, &quiet()).unwrap_err().to_string();
        assert!(error.contains("was not kept"), "{error}");
    }

    #[test]
    fn a_file_that_is_missing_is_named_as_it_would_have_been_called() {
        let dir = tempfile::tempdir().unwrap();
        let scan = dir.path().join("a.las");
        fs::write(&scan, Las::terrain(3000, 1).bytes()).unwrap();
        let plan = Plan::new(vec![scan], dir.path().join("out"));
        let targets = [Potree2Settings::default().into(), pointmill_converter::BintreeSettings::default().into()];
        let missing = |folder: &Path| {
            fs::remove_file(folder.join("potree2/hierarchy.bin")).unwrap();
            verify(folder, VerifyArg::Dataset, &plan, &quiet())
        };
        let error = convert_verified(&plan, &targets, &Silent, &missing).unwrap_err().to_string();
        assert!(error.contains("hierarchy.bin") && !error.contains("new/"), "{error}");
    }
}
