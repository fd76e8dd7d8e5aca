//! Jobs that lie, with the right checksums: an error of one line, or all points; no panic, no memory for what is only claimed, no
//! work without end. `fuzz/fuzz_targets/job.rs` does the same for longer.

mod left_job;

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use left_job::{JOBS, LARGE, LeftJob, Made, PartName};
use pointmill_testkit::Random;
use pointmill_testkit::damage::{hit, peak_memory_bytes, processor_seconds, rounds};
use pointmill_testkit::las::Las;

/// Processor seconds: more than any of these runs takes, and others beside it.
const LONGEST: f64 = 60.0;

/// Changes a part of a job: lengths and counts, most often, which are numbers of 7 bits a byte.
fn lie(part: &mut Vec<u8>, random: &mut Random) {
    let at = random.index(part.len());
    if random.below(3) == 0 {
        return hit(part, at, random);
    }
    let number = random.pick(&[0, 1, 2, 127, 128, 255, 1 << 20, u64::from(u32::MAX), 1 << 40, u64::MAX / 2, u64::MAX]);
    let was = 1 + part[at..].iter().take_while(|byte| **byte >= 128).count();
    part.splice(at..(at + was).min(part.len()), varint(number));
}

/// A number as files of jobs have it: 7 bits a byte.
fn varint(mut number: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while number >= 128 {
        bytes.push(number as u8 | 128);
        number >>= 7;
    }
    bytes.push(number as u8);
    bytes
}

/// Signed numbers as files of jobs have them.
fn varints(numbers: [i64; 6]) -> Vec<u8> {
    numbers.into_iter().flat_map(|n| varint((n << 1 ^ n >> 63).cast_unsigned())).collect()
}

/// Lets parts of a job lie. Returns how often it was refused, and ended in the bytes of one run, in other bytes of the same points,
/// and in other points.
fn let_lie(kind: usize, seed: u64, times: u64) -> [u64; 4] {
    let dir = tempfile::tempdir().unwrap();
    let job = LeftJob::of(kind, dir.path(), 700);
    let parts: Vec<PartName> = job.parts().into_iter().filter(|part| !job.part(part).is_empty()).collect();
    let (mut random, mut ends) = (Random::new(seed), [0; 4]);
    for round in 0..times {
        let changed: Vec<(PartName, Vec<u8>)> = (0..1 + random.below(2))
            .map(|_| {
                let name = parts[random.index(parts.len())].clone();
                let mut bytes = job.part(&name).to_vec();
                lie(&mut bytes, &mut random);
                (name, bytes)
            })
            .collect();
        let begun = processor_seconds();
        let ended = catch_unwind(AssertUnwindSafe(|| job.go_on(&job.with(&changed))));
        let names: Vec<&PartName> = changed.iter().map(|(name, _)| name).collect();
        let Ok(ended) = ended else { panic!("kind {kind}, round {round}: {names:?}") };
        let took = begun.zip(processor_seconds()).map_or(0.0, |(begun, end)| end - begun);
        assert!(took < LONGEST, "kind {kind}, round {round}: {names:?}: {took} s");
        let end = match ended {
            Err(_) => 0,
            Ok((_, Made::Plain)) => 1,
            Ok((_, Made::SamePoints)) => 2,
            // where nodes and leaves are is what a unit that was built says: nobody reads its points again
            Ok((_, Made::Other)) => {
                assert!(names.iter().any(|(file, _)| file.contains("build-")), "kind {kind}, round {round}: {names:?}");
                3
            }
        };
        ends[end] += 1;
    }
    ends
}

fn all_lie(kinds: Range<usize>) {
    for kind in kinds {
        let times = rounds(12).div_ceil(if LARGE.contains(&kind) { 4 } else { 1 });
        let [refused, plain, same, other] = let_lie(kind, 100 * times + kind as u64, times);
        println!(
            "kind {kind}: {refused} refused, {plain} the bytes of one run, {same} the same points, {other} others"
        );
        assert!(refused + plain > 0, "kind {kind}");
    }
    if let Some(peak) = peak_memory_bytes() {
        assert!(peak < 600 << 20, "{peak} bytes");
    }
}

#[test]
fn jobs_of_potree2_that_lie_are_refused_or_do_no_harm() {
    all_lie(0..4);
}

#[test]
fn jobs_of_other_octrees_that_lie_are_refused_or_do_no_harm() {
    all_lie(4..8);
}

#[test]
fn jobs_of_binary_trees_that_lie_are_refused_or_do_no_harm() {
    all_lie(8..12);
}

#[test]
fn jobs_of_batches_that_lie_are_refused_or_do_no_harm() {
    all_lie(12..JOBS);
}

/// A unit that keeps back where some of its bytes are: they would be missing, or stay as a run before has left them.
#[test]
fn a_unit_that_leaves_out_a_place_is_built_again() {
    for kind in [0, 6, 8, 10, 12].into_iter().filter(|_| cfg!(unix)) {
        let dir = tempfile::tempdir().unwrap();
        let job = LeftJob::of(kind, dir.path(), 700);
        let recalled = |changed: &[(PartName, Vec<u8>)]| {
            let (report, made) = job.go_on(&job.with(changed)).unwrap();
            assert_eq!(made, Made::Plain, "kind {kind}: {changed:?}");
            report.recalled_units
        };
        let (all, mut again) = (recalled(&[]), 0);
        for unit in job.parts().into_iter().filter(|(file, part)| file.starts_with("build-") && *part == 3) {
            let mut places = job.part(&unit).to_vec();
            let count = usize::from(kind > 6); // behind the mark of what may be missing
            assert!((1..128).contains(&places[count]), "kind {kind}: {} places", places[count]);
            places[count] -= 1;
            again += all - recalled(&[(unit, places)]);
        }
        // of batches, some may have been changed at the end of the run before
        assert!(again == all && all > 0, "kind {kind}: {again} of {all}");
    }
}

/// Found by the fuzzer: cells lay outside of the bounds of all points.
#[test]
fn bounds_that_do_not_hold_the_points_are_refused() {
    let bounds = |seed: u64| {
        let las = Las::terrain(700, seed);
        let steps = |corner: [f64; 3]| [0, 1, 2].map(|a| ((corner[a] - las.offset[a]) / las.scale[a]).round() as i64);
        let [[a, b, c], [d, e, f]] = las.bounds().map(steps);
        [a, b, c, d, e, f]
    };
    for kind in [0, 1, 4, 5, 6, 7, 8, 9, 14, 15] {
        let dir = tempfile::tempdir().unwrap();
        let job = LeftJob::of(kind, dir.path(), 700);
        let lying = |seed: u64, change: fn([i64; 6]) -> [i64; 6]| {
            let (was, says) = (varints(bounds(seed)), varints(change(bounds(seed))));
            let at = |part: &PartName| job.part(part).windows(was.len()).position(|bytes| bytes == was);
            let (part, at) = job.parts().into_iter().find_map(|part| Some((part.clone(), at(&part)?))).unwrap();
            let mut bytes = job.part(&part).to_vec();
            bytes.splice(at..at + was.len(), says);
            (part, bytes)
        };
        let changes: [fn([i64; 6]) -> [i64; 6]; 3] = [
            |[a, b, c, ..]| [a, b, c, a, b, c],
            |[.., d, e, f]| [d, e, f, d, e, f],
            |[a, b, c, d, e, f]| [a - 9_000_000, b - 9_000_000, c, d - 9_000_000, e - 9_000_000, f],
        ];
        for (i, change) in changes.into_iter().enumerate() {
            let ended = job.go_on(&job.with(&[lying(1, change), lying(2, change)])).map(|(_, made)| made);
            assert!(ended.is_err(), "kind {kind}, change {i}: {ended:?}");
        }
    }
}

/// Found by the fuzzer: what a journal says of the run before was quoted with its line ends.
#[test]
fn an_error_is_one_line_whatever_the_journal_says() {
    let dir = tempfile::tempdir().unwrap();
    let job = LeftJob::of(0, dir.path(), 700);
    let name = ("journal".to_owned(), 0);
    let whole = job.part(&name).to_vec();
    let path = whole.windows(5).position(|bytes| bytes == b"1.las").unwrap();
    for at in [2, 8, path] {
        let mut bytes = whole.clone();
        bytes[at] = b'\n';
        assert!(job.go_on(&job.with(&[(name.clone(), bytes)])).is_err(), "byte {at}");
    }
}
