//! Examples at the end of each command's help. Each is parsed by a test.

pub(super) const CONVERT: &str = "\
Examples:
  pointmill convert scans/ -o city                        a folder, searched recursively
  pointmill convert 'tiles/*.laz' -o city --memory 2GiB --threads 8
  pointmill convert hall.e57 street.ply -o city --precision 1mm
  pointmill convert scans/ -o city --to potree2 --to copc   city/potree2 and city/copc from one read
  pointmill convert scans/ -o city --dry-run              every choice and why; memory, disk and size";

pub(super) const EXPORT: &str = "\
Examples:
  pointmill export city -o city.laz
  pointmill export city -o thin.laz --spacing 0.5         an octree as a thinned cloud
  pointmill export a.las b.e57 -o both.ply --class 2";

pub(super) const MEASURE: &str = "\
Examples:
  pointmill measure scans/ -o trade                       open trade/report.html
  pointmill measure scans/ -o trade --sample 5M --axes output=potree2,sampling
  pointmill convert scans/ -o city --profile balanced --measured trade";

pub(super) const VALIDATE: &str = "\
Examples:
  pointmill validate city                                 does it conform to its format?
  pointmill validate city --against scans/                does it hold every point of the scans once?";

pub(super) const EXTRACT: &str = "\
Examples:
  pointmill extract site.e57 -o site-images
  pointmill extract site.e57 -o hall-images --scan Hall";

pub(super) const INFO: &str = "\
Examples:
  pointmill info scans/ city
  pointmill info scan.laz --deep --json";

pub(super) const PREVIEW: &str = "\
Examples:
  pointmill preview city -o city.png
  pointmill preview scan.laz -o top.png --view top --size 1920x1080 --colour height";

pub(super) const VIEW: &str = "\
Examples:
  pointmill view city                                     opens the browser
  pointmill view scan.laz hall.e57                        converted first, into a temporary dataset
  pointmill view city line12 --no-open --port 8080";

pub(super) const COMPLETIONS: &str = "\
Examples:
  pointmill completions bash > ~/.local/share/bash-completion/completions/pointmill
  pointmill completions zsh > ~/.zfunc/_pointmill
  pointmill completions fish > ~/.config/fish/completions/pointmill.fish";

pub(super) const JOB: &str = "\
Examples:
  pointmill job plan scans/ -o city --job /shared/city.job
  pointmill job units /shared/city.job --json
  pointmill job run /shared/city.job read-1-0 read-1-1
  pointmill job run /shared/city.job --share 3/16   one of 16 processes
  pointmill job finish /shared/city.job";

pub(super) const MAN: &str = "\
Examples:
  pointmill man | man -l -
  pointmill man -o ~/.local/share/man/man1";

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::args::Args;

    #[test]
    fn every_example_is_a_command_line() {
        let all = [CONVERT, EXPORT, MEASURE, VALIDATE, EXTRACT, INFO, PREVIEW, VIEW, JOB, COMPLETIONS, MAN];
        let lines: Vec<&str> = all.iter().flat_map(|text| text.lines().skip(1)).collect();
        assert!(lines.len() > 20);
        for line in lines {
            // what is meant by it stands behind three blanks or more, what a shell does with it behind > or |
            let line = line.trim().split("   ").next().unwrap_or_default();
            let command = line.split(['>', '|']).next().unwrap_or_default().replace('\'', "");
            let words: Vec<&str> = command.split_whitespace().collect();
            assert_eq!(words.first(), Some(&"pointmill"), "{line}");
            if let Err(error) = Args::try_parse_from(&words) {
                panic!("{line}: {error}");
            }
        }
    }
}
