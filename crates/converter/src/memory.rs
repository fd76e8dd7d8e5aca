//! How much memory this process may use.

use std::fs;
use std::path::Path;

/// 60 % of what the machine or its cgroup allows, bytes; 2 GiB where neither is known.
pub fn default_ceiling_bytes() -> u64 {
    let limit = [cgroup_limit_bytes(), available_bytes()].into_iter().flatten().min();
    limit.map_or(2 << 30, |bytes| bytes / 5 * 3)
}

/// Resident set of this process at its highest, bytes (Linux; `None` elsewhere).
pub fn peak_resident_bytes() -> Option<u64> {
    status_kib("/proc/self/status", "VmHWM:")
}

/// Resident set of this process now, bytes (Linux; `None` elsewhere).
pub fn resident_bytes() -> Option<u64> {
    status_kib("/proc/self/status", "VmRSS:")
}

fn available_bytes() -> Option<u64> {
    status_kib("/proc/meminfo", "MemAvailable:")
}

fn status_kib(path: &str, key: &str) -> Option<u64> {
    let text = fs::read_to_string(path).ok()?;
    let rest = text.lines().find_map(|line| line.strip_prefix(key))?;
    rest.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}

fn cgroup_limit_bytes() -> Option<u64> {
    let membership = fs::read_to_string("/proc/self/cgroup").ok()?;
    limit_of(&membership, |path| fs::read_to_string(path).ok())
}

/// The tightest memory limit on the way from a process's cgroup to the root: version 2 `memory.max`, version 1
/// `memory.limit_in_bytes` (which says "none" as a number near 2^63). `membership`: as in `/proc/self/cgroup`.
fn limit_of(membership: &str, read: impl Fn(&Path) -> Option<String>) -> Option<u64> {
    let mut tightest: Option<u64> = None;
    for line in membership.lines() {
        let mut parts = line.splitn(3, ':');
        let (Some(_), Some(controllers), Some(path)) = (parts.next(), parts.next(), parts.next()) else { continue };
        let (mount, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            c if c.split(',').any(|c| c == "memory") => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
            _ => continue,
        };
        for dir in Path::new(path).ancestors() {
            let dir = Path::new(mount).join(dir.strip_prefix("/").unwrap_or(dir));
            let limit = read(&dir.join(file)).and_then(|s| s.trim().parse::<u64>().ok());
            tightest = [tightest, limit.filter(|bytes| *bytes < 1 << 60)].into_iter().flatten().min();
        }
    }
    tightest
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn limit(membership: &str, files: &[(&str, &str)]) -> Option<u64> {
        let files: HashMap<&str, &str> = files.iter().copied().collect();
        limit_of(membership, |path| files.get(path.to_str()?).map(|text| (*text).to_owned()))
    }

    #[test]
    fn the_tightest_limit_of_either_version_counts() {
        let second = "0::/user.slice/job.scope\n";
        assert_eq!(limit(second, &[("/sys/fs/cgroup/user.slice/job.scope/memory.max", "max\n")]), None);
        let nested = [
            ("/sys/fs/cgroup/user.slice/job.scope/memory.max", "max\n"),
            ("/sys/fs/cgroup/user.slice/memory.max", "536870912\n"),
            ("/sys/fs/cgroup/memory.max", "1073741824\n"),
        ];
        assert_eq!(limit(second, &nested), Some(512 << 20));
        // a container sees its own limit at the root, and the name that the host gave it
        let first = "12:cpu,cpuacct:/docker/1f\n5:memory:/docker/1f\n";
        let own = [("/sys/fs/cgroup/memory/memory.limit_in_bytes", "268435456\n")];
        assert_eq!(limit(first, &own), Some(256 << 20));
        let none = [("/sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n")];
        assert_eq!(limit(first, &none), None);
        assert_eq!(limit("1:cpu:/a\nodd line\n", &own), None);
    }
}
