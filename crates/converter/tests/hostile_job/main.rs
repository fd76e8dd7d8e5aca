//! Journals and units that lie, with the right checksums: an error of one line, or a dataset; no panic, and no memory for what is
//! only claimed. `fuzz/fuzz_targets/job.rs` does the same for longer.

mod left_job;

use left_job::LeftJob;
use pointmill_converter::{ConvertError, JobFault};
use pointmill_testkit::Random;
use pointmill_testkit::damage::{hit, peak_memory_bytes, rounds};

#[test]
fn units_that_lie_are_refused_or_do_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let job = LeftJob::new(dir.path(), 1500);
    let payloads = job.payloads();
    let whole = job.resume(&job.journal(&payloads), job.records()).unwrap();
    assert_eq!((whole.recalled_points, payloads.len()), (3000, 3));
    let (mut random, mut refused) = (Random::new(31), 0);
    for _ in 0..rounds(300) {
        let mut lying: Vec<Vec<u8>> = payloads.iter().map(|payload| payload.to_vec()).collect();
        for _ in 0..=random.below(2) {
            // seldom the settings, which end it all
            let payload = &mut lying[if random.below(10) == 0 { 0 } else { 1 + random.index(2) }];
            let at = random.index(payload.len().min(if random.below(2) == 0 { 60 } else { usize::MAX }));
            hit(payload, at, &mut random);
        }
        let lying: Vec<&[u8]> = lying.iter().map(Vec::as_slice).collect();
        refused += u32::from(job.resume(&job.journal(&lying), job.records()).is_err());
    }
    assert!(refused > 50, "{refused}");
    if let Some(peak) = peak_memory_bytes() {
        assert!(peak < 400 << 20, "{peak} bytes");
    }
}

#[test]
fn journals_and_records_of_any_bytes_are_refused_or_do_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let job = LeftJob::new(dir.path(), 1500);
    let journal = job.journal(&job.payloads());
    let (mut random, mut damaged) = (Random::new(32), 0);
    for round in 0..rounds(200) {
        let (mut journal, mut records) = (journal.clone(), job.records().to_vec());
        let bytes = if round % 2 == 0 { &mut journal } else { &mut records };
        let at = random.index(bytes.len());
        hit(bytes, at, &mut random);
        let is_damaged = |e: &ConvertError| matches!(e, ConvertError::Job(JobFault::Damaged { .. }));
        damaged += u32::from(job.resume(&journal, &records).as_ref().is_err_and(is_damaged));
    }
    assert!(damaged > 100, "{damaged}");
}
