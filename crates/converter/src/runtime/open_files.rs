//! How many files a process may have open at once.

use std::fs;

/// Where the system does not say (the usual limit of macOS; Windows has none that matters).
const UNKNOWN: usize = 256;

/// The limit of this process, as the system has it now (`ulimit -n`).
pub(crate) fn most_open_files() -> usize {
    fs::read_to_string("/proc/self/limits").ok().and_then(|limits| soft_limit(&limits)).unwrap_or(UNKNOWN)
}

/// The first figure of the line "Max open files".
fn soft_limit(limits: &str) -> Option<usize> {
    let figures = limits.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    match figures.split_whitespace().next()? {
        "unlimited" => Some(usize::MAX),
        figure => figure.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_soft_limit_is_read_from_what_the_system_says() {
        let line =
            |figure: &str| format!("Max processes  9 9 processes\nMax open files            {figure} 4096 files\n");
        assert_eq!(soft_limit(&line("1024")), Some(1024));
        assert_eq!(soft_limit(&line("unlimited")), Some(usize::MAX));
        assert_eq!(soft_limit("Max processes 9 9 processes"), None);
        assert!(most_open_files() > 3);
    }
}
