//! The folder of a job. The first byte says what the input is: the journal; what follows the settings in it, as lengths (u16,
//! little-endian) and payloads, which get the right checksums; or the records.

#![no_main]

#[path = "../../crates/converter/tests/hostile_job/left_job.rs"]
mod left_job;

use std::sync::OnceLock;

use left_job::LeftJob;

fn job() -> &'static LeftJob {
    static JOB: OnceLock<LeftJob> = OnceLock::new();
    JOB.get_or_init(|| LeftJob::new(&pointmill_fuzz::folder(), 300))
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, mut rest)) = bytes.split_first() else { return };
    let job = job();
    let _ = match kind % 3 {
        0 => job.resume(rest, job.records()),
        1 => {
            let mut payloads = vec![job.payloads()[0]];
            while let Some((length, behind)) = rest.split_first_chunk::<2>() {
                let (payload, behind) = behind.split_at(usize::from(u16::from_le_bytes(*length)).min(behind.len()));
                payloads.push(payload);
                rest = behind;
            }
            job.resume(&job.journal(&payloads), job.records())
        }
        _ => job.resume(&job.journal(&job.payloads()), rest),
    };
});
