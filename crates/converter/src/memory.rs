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

fn available_bytes() -> Option<u64> {
    status_kib("/proc/meminfo", "MemAvailable:")
}

fn status_kib(path: &str, key: &str) -> Option<u64> {
    let text = fs::read_to_string(path).ok()?;
    let rest = text.lines().find_map(|line| line.strip_prefix(key))?;
    rest.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}

/// The tightest memory limit on the way from this process's cgroup to the root: version 2 `memory.max`, version 1
/// `memory.limit_in_bytes` (which says "none" as a number near 2^63).
fn cgroup_limit_bytes() -> Option<u64> {
    let membership = fs::read_to_string("/proc/self/cgroup").ok()?;
    let mut tightest: Option<u64> = None;
    for line in membership.lines() {
        let mut parts = line.splitn(3, ':');
        let (_, controllers, path) = (parts.next()?, parts.next()?, parts.next()?);
        let (mount, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            c if c.split(',').any(|c| c == "memory") => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
            _ => continue,
        };
        for dir in Path::new(path).ancestors() {
            let dir = Path::new(mount).join(dir.strip_prefix("/").unwrap_or(dir));
            let limit = fs::read_to_string(dir.join(file)).ok().and_then(|s| s.trim().parse::<u64>().ok());
            tightest = [tightest, limit.filter(|bytes| *bytes < 1 << 60)].into_iter().flatten().min();
        }
    }
    tightest
}
