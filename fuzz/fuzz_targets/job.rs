//! What a job holds for others to go on with, with the right checksums: one that a run has left, or one that processes share. The
//! first byte says which ([`JOBS`]). Then come parts that replace those of the job: number (u8), length (u16, little-endian), bytes.

#![no_main]

#[path = "../../crates/converter/tests/hostile_job/left_job.rs"]
mod left_job;

use std::sync::OnceLock;

use left_job::{JOBS, LeftJob, PartName};

/// Of a scan: enough for a tree of several units.
const POINTS: usize = 700;

fn job(kind: usize) -> &'static LeftJob {
    static ALL: [OnceLock<LeftJob>; JOBS] = [const { OnceLock::new() }; JOBS];
    ALL[kind].get_or_init(|| LeftJob::of(kind, &pointmill_fuzz::folder().join(kind.to_string()), POINTS))
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, mut rest)) = bytes.split_first() else { return };
    let job = job(usize::from(*kind) % JOBS);
    let (parts, mut changed): (Vec<PartName>, Vec<_>) = (job.parts(), Vec::new());
    while let Some(([number, length @ ..], behind)) = rest.split_first_chunk::<3>() {
        let (part, behind) = behind.split_at(usize::from(u16::from_le_bytes(*length)).min(behind.len()));
        changed.push((parts[usize::from(*number) % parts.len()].clone(), part.to_vec()));
        rest = behind;
    }
    let _ = job.go_on(&job.with(&changed));
});
