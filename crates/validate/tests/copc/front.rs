//! Faults of the header, the records and the info record.

use pointmill_validate::{Check, Severity};

use crate::file::{Copc, INFO, Writer, foreign, good};
use crate::support::{Cloud, Sampler, assert_only, broken};

#[test]
fn a_good_file_has_no_findings() {
    let outcome = good().validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    assert_eq!((outcome.points, outcome.encoding), (6000, Some("laz")));
    assert!(outcome.quality.len() >= 4, "{} levels", outcome.quality.len());
    assert!(outcome.quality.iter().all(|l| l.largest_hole.is_none_or(|h| h <= 2.0)));
    for check in outcome.checks.iter().filter(|c| c.skipped.is_none()) {
        assert!(check.checked > 0, "{} looked at nothing", check.name.name());
    }
    let view = outcome.first_view.unwrap();
    assert_eq!((view.points, view.nodes), (6000, outcome.nodes));
}

#[test]
fn figures_of_quality_are_those_of_the_same_octree_as_potree_2() {
    let cloud = Cloud::new(Sampler::Poisson);
    let other = cloud.encode(pointmill_format::potree2::Encoding::Default).validate();
    assert_eq!(good().validate().quality, other.quality);
    assert_eq!(foreign().validate().quality, other.quality, "measured, whoever wrote it");
}

/// The check that finds `new` at a byte, and how often.
fn with(at: usize, new: &[u8]) -> Copc {
    let mut file = good();
    file.put(at, new);
    file
}

#[test]
fn fields_of_the_header_out_of_range() {
    for (at, new, what) in [
        (6, &[0, 0][..], "global encoding"),
        (107, &5u32.to_le_bytes(), "counts of versions before 1.4"),
        (187, &1e9f64.to_le_bytes(), "bounds"),
    ] {
        let outcome = with(at, new).validate();
        let found = outcome.problems.iter().any(|p| p.check == Check::Header && p.subject == what);
        assert!(found, "{what}: {:#?}", outcome.problems);
    }
}

#[test]
fn true_counts_of_older_versions_are_a_warning() {
    let mut file = with(107, &6000u32.to_le_bytes());
    file.put(111, &6000u32.to_le_bytes());
    let outcome = file.validate();
    assert!(outcome.ok);
    assert_eq!(
        outcome.problems.iter().map(|p| (p.check, p.severity)).collect::<Vec<_>>(),
        [(Check::Header, Severity::Warning)]
    );
}

#[test]
fn what_no_reader_opens_is_said_to_be_so() {
    for (at, new, check) in [
        (0, &b"LASX"[..], Check::Header),
        (25, &[2], Check::Header),
        (94, &227u16.to_le_bytes(), Check::Header),
        (104, &[3 | 0x80], Check::Header),
        (105, &20u16.to_le_bytes(), Check::Header),
        (131, &0f64.to_le_bytes(), Check::Header),
        (155, &f64::NAN.to_le_bytes(), Check::Header),
        (377, b"corp", Check::Records),
        (INFO + 24, &(-1f64).to_le_bytes(), Check::OctreeInfo),
        (INFO + 32, &0f64.to_le_bytes(), Check::OctreeInfo),
        (INFO, &f64::INFINITY.to_le_bytes(), Check::OctreeInfo),
    ] {
        let outcome = with(at, new).validate();
        assert!(outcome.check(check).unwrap().found > 0, "byte {at}: {:#?}", outcome.problems);
        assert!(outcome.checks.iter().skip(3).all(|c| c.skipped.is_some()), "byte {at}");
    }
    let mut short = good();
    short.bytes.truncate(300);
    assert_only(&short.validate(), Check::Header, 1);
}

#[test]
fn records_that_are_not_whole_missing_or_double() {
    let file = good();
    // one more than there are
    let more = file.u32(100) + 1;
    assert_eq!(broken(&with(100, &more.to_le_bytes()).validate()), [Check::Records]);
    let more = file.u32(243) + 1;
    assert_only(&with(243, &more.to_le_bytes()).validate(), Check::Records, 1);
    // a hierarchy that is none
    assert!(with(file.hierarchy + 18, &999u16.to_le_bytes()).validate().check(Check::Records).unwrap().found == 1);
    // the reference system becomes a second info record
    let mut double = with(file.wkt - 52, &[0; 16]);
    double.put(file.wkt - 52, b"copc");
    double.put(file.wkt - 36, &1u16.to_le_bytes());
    assert_eq!(double.validate().check(Check::Records).unwrap().found, 1);
}

#[test]
fn the_record_of_laszip_says_what_the_header_says() {
    let file = good();
    for (at, new) in [(32, 1u16), (34, 12), (36, 31), (40, 12), (42, 8)] {
        let outcome = with(file.laszip + at, &new.to_le_bytes()).validate();
        assert!(outcome.check(Check::Records).unwrap().found > 0, "byte {at}: {:#?}", outcome.problems);
    }
    let outcome = with(file.laszip + 12, &50_000u32.to_le_bytes()).validate();
    assert!(outcome.check(Check::Records).unwrap().found > 0, "{:#?}", outcome.problems);
}

#[test]
fn the_reference_system_is_wkt() {
    let file = good();
    assert_only(&with(file.wkt, b"epsg:2").validate(), Check::Records, 1);
    // not there: a warning
    let outcome = with(file.wkt - 36, &7u16.to_le_bytes()).validate();
    assert!(outcome.ok && outcome.problems.len() == 1, "{:#?}", outcome.problems);
}

#[test]
fn extra_bytes_are_described() {
    let writer = Writer { has_extra: true, ..Writer::default() };
    let file = writer.encode(&Cloud::new(Sampler::Poisson));
    let outcome = file.validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    let mut wide = file.clone();
    wide.put(file.extra + 2, &[3]);
    assert!(wide.validate().check(Check::Records).unwrap().found == 1, "two bytes of one");
    let mut hidden = file.clone();
    hidden.put(file.extra - 36, &7u16.to_le_bytes());
    let outcome = hidden.validate();
    assert!(outcome.ok && outcome.problems.iter().all(|p| p.check == Check::Records), "{:#?}", outcome.problems);
    for (at, stated) in [(64, 4u64), (64, 2), (88, 201), (88, 203)] {
        let mut lying = file.clone();
        lying.put(file.extra + at, &stated.to_le_bytes());
        assert_only(&lying.validate(), Check::AttributeRanges, 1);
    }
}

#[test]
fn reserved_bytes_of_the_info_record_are_zero_and_the_cube_holds_the_bounds() {
    assert_only(&with(INFO + 100, &[1]).validate(), Check::OctreeInfo, 1);
    let center = good().f64(INFO + 8);
    let outcome = with(INFO + 8, &(center + 100.0).to_le_bytes()).validate();
    assert!(outcome.check(Check::OctreeInfo).unwrap().found == 1, "{:#?}", outcome.problems);
    let spacing = good().f64(INFO + 32);
    let outcome = with(INFO + 32, &(spacing * 10.0).to_le_bytes()).validate();
    let is_warned = |p: &pointmill_validate::Finding| p.check == Check::OctreeInfo && p.severity == Severity::Warning;
    assert!(outcome.problems.iter().any(is_warned), "{:#?}", outcome.problems);
}
