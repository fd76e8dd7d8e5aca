//! What packages take from the source tree is there. `.ci/run` makes one.

use std::path::Path;
use std::process::Command;

/// Root of the source tree.
const ROOT: &str = env!("CARGO_MANIFEST_DIR");

#[test]
fn files_of_the_debian_package_are_there_or_made() {
    let manifest = std::fs::read_to_string(Path::new(ROOT).join("Cargo.toml")).unwrap();
    let script = std::fs::read_to_string(Path::new(ROOT).join("packaging/files.sh")).unwrap();
    let files: Vec<&str> = manifest
        .lines()
        .filter(|line| {
            line.contains("\", \"usr/") || line.starts_with("changelog =") || line.starts_with("license-file")
        })
        .filter_map(|line| line.split('"').nth(1))
        .collect();
    assert!(files.len() > 8, "{files:?}");
    for file in files {
        let Some(made) = file.strip_prefix("target/package/") else {
            assert!(Path::new(ROOT).join(file).is_file(), "{file}");
            continue;
        };
        // completions are made in a loop over the shells, pages by the program
        let named = made.replace("bash", "$shell").replace("zsh", "$shell").replace("fish", "$shell");
        let named = named.replace(".gz", if made.starts_with("man/") { "" } else { ".gz" });
        assert!(script.contains(&format!("target/package/{named}")), "{file} is not made by files.sh");
    }
}

#[test]
fn every_crate_that_is_linked_has_a_licence() {
    let script = Path::new(ROOT).join("packaging/licences.py");
    let Ok(checked) = Command::new("python3").arg(script).arg("--check").current_dir(ROOT).output() else {
        return eprintln!("skipped: there is no python3");
    };
    let said = String::from_utf8_lossy(&checked.stderr);
    assert!(checked.status.success(), "{said}");
    assert!(String::from_utf8_lossy(&checked.stdout).starts_with("complete: "));
}
