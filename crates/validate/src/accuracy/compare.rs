//! The report's figures against those found.

use serde_json::json;

use super::figures::{Accuracy, PositionErrors};
use super::known::{Known, Side};
use super::reported::{Figures, Reported};
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Of figures that other software may have added up in another order.
const RELATIVE: f64 = 1e-6;

/// Units in the last place of the coordinates: of decoded, meant and source positions.
const ULPS: f64 = 16.0;

/// Reports what the report states else than what was found.
pub(super) fn check(report: &Reported, found: &Accuracy, known: &Known<'_>, findings: &Findings) {
    let parts = [
        ("lattice", &report.lattice, &known.lattice, &found.lattice),
        ("format", &report.format, &known.format, &found.format),
    ];
    for (name, stated, side, truth) in parts {
        if let (Some(side), Some(truth)) = (side, truth) {
            match stated {
                Some(stated) => Part { name, stated, truth, noise: noise(side) }.check(findings),
                None => findings.push(Finding::new(Check::Accuracy, name, "figures", "none")),
            }
        }
    }
    check_total(report, findings);
    check_counts(report, found, known, findings);
    check_metres(report, known, findings);
}

/// What rounding of doubles may make of a difference of coordinates of that size.
fn noise(side: &Side) -> [f64; 3] {
    side.deviation.size.map(|size| ULPS * f64::EPSILON * size)
}

/// One of the two kinds of errors.
struct Part<'a> {
    name: &'static str,
    stated: &'a Figures,
    truth: &'a PositionErrors,
    noise: [f64; 3],
}

impl Part<'_> {
    fn check(&self, findings: &Findings) {
        let Figures { errors: stated, is_bound, is_rounding } = self.stated;
        let (truth, noise) = (self.truth, self.noise);
        let noise_3d = length(noise);
        let near = |stated: f64, truth: f64, size: f64, noise: f64| {
            let allowed = RELATIVE * size + noise;
            stated >= truth - allowed && (*is_bound || stated <= truth + allowed)
        };
        let wrong_max = (0..3).any(|a| !near(stated.max[a], truth.max[a], truth.max[a], noise[a]));
        let wrong_rms = (0..3).any(|a| !near(stated.rms[a], truth.rms[a], truth.rms[a], noise[a]));
        let wrong_mean = (0..3).any(|a| {
            let (stated, found) = (stated.mean[a], truth.mean[a]);
            let allowed = RELATIVE * truth.rms[a] + noise[a];
            if *is_bound { stated.abs() < found.abs() - allowed } else { (stated - found).abs() > allowed }
        });
        // of the distance in space a bound will do, if it is that of the axes
        let most = length(stated.max) * (1.0 + RELATIVE) + noise_3d;
        let wrong_max_3d = stated.max_3d < truth.max_3d * (1.0 - RELATIVE) - noise_3d || stated.max_3d > most;
        let wrong_rms_3d = !near(stated.rms_3d, truth.rms_3d, truth.rms_3d, noise_3d);
        findings.checked(Check::Accuracy, 11);
        let report = |is_wrong: bool, what: &str, truth: serde_json::Value, stated: serde_json::Value| {
            if is_wrong {
                let subject = format!("{what} of the {} in the report", self.name);
                findings.push(Finding::new(Check::Accuracy, subject, truth, stated));
            }
        };
        let is_more = *is_rounding && (0..3).any(|a| truth.max[a] > noise[a]);
        report(is_more, "how", "more than the rounding of doubles".into(), "rounding".into());
        report(wrong_max, "max", json!(truth.max), json!(stated.max));
        report(wrong_rms, "rms", json!(truth.rms), json!(stated.rms));
        report(wrong_mean, "mean", json!(truth.mean), json!(stated.mean));
        report(wrong_max_3d, "max_3d", json!(truth.max_3d), json!(stated.max_3d));
        report(wrong_rms_3d, "rms_3d", json!(truth.rms_3d), json!(stated.rms_3d));
    }
}

/// The total is made of the two parts that are stated; what is wrong in these has its finding.
fn check_total(report: &Reported, findings: &Findings) {
    let (Some(lattice), Some(format), Some(total)) = (&report.lattice, &report.format, &report.total) else {
        return;
    };
    findings.checked(Check::Accuracy, 11);
    let (sum, stated) = (lattice.errors.plus(&format.errors), total.errors);
    let near = |stated: f64, sum: f64| (stated - sum).abs() <= 1e-9 * sum.abs();
    let all_near = |stated: [f64; 3], sum: [f64; 3]| (0..3).all(|a| near(stated[a], sum[a]));
    let mut wrong = Vec::new();
    wrong.extend((!all_near(stated.max, sum.max)).then_some("max"));
    wrong.extend((!all_near(stated.rms, sum.rms)).then_some("rms"));
    wrong.extend((!near(stated.rms_3d, sum.rms_3d)).then_some("rms_3d"));
    let most = sum.max_3d.min(length(sum.max));
    wrong.extend((stated.max_3d < most * (1.0 - 1e-9) || stated.max_3d > most * (1.0 + 1e-9)).then_some("max_3d"));
    // of a part that is a bound the sign of the mean is not known
    let is_bound = lattice.is_bound || format.is_bound;
    let (a, b) = (lattice.errors.mean, format.errors.mean);
    let is_mean = |i: usize| match is_bound {
        true => near(stated.mean[i].abs(), a[i].abs() + b[i].abs()),
        false => (stated.mean[i] - sum.mean[i]).abs() <= 1e-9 * sum.rms[i],
    };
    wrong.extend((!(0..3).all(is_mean)).then_some("mean"));
    for what in wrong {
        let subject = format!("{what} of the total in the report");
        findings.push(Finding::new(Check::Accuracy, subject, "lattice and format together", "something else"));
    }
}

fn check_counts(report: &Reported, found: &Accuracy, known: &Known<'_>, findings: &Findings) {
    let compare = |subject: &'static str, truth: Option<u64>, stated: Option<u64>| {
        if let (Some(truth), Some(stated)) = (truth, stated) {
            findings.checked(Check::Accuracy, 1);
            if truth != stated {
                findings.push(Finding::new(Check::Accuracy, subject, truth, stated));
            }
        }
    };
    compare("points in the report", Some(known.points), report.points);
    compare("points whose integers come back, in the report", found.integers.map(|i| i.same), report.same);
    compare("points merged by the lattice, in the report", found.merged.lattice, report.merged.lattice);
    compare("points merged by the format, in the report", found.merged.format, report.merged.format);
}

/// Metres are stated of degrees, and are those of the page. Other angles, and units of heights, a dataset does not tell.
fn check_metres(report: &Reported, known: &Known<'_>, findings: &Findings) {
    let (Some(total), Some(bounds)) = (&report.total, known.bounds) else { return };
    if !is_in_degrees(known.projection) {
        return;
    }
    let Some(metres) = &report.metres else {
        findings.push(Finding::new(Check::Accuracy, "metres in the report", "figures", "none"));
        return;
    };
    findings.checked(Check::Accuracy, 2);
    let per_degree = metres_per_degree(bounds[1]);
    let expected = [0, 1].map(|a| total.errors.max[a] * per_degree[a]);
    let found = [0, 1].map(|a| metres.errors.max[a]);
    // the box may be that of decoded positions
    if (0..2).any(|a| (found[a] - expected[a]).abs() > 1e-6 * expected[a]) {
        findings.push(Finding::new(Check::Accuracy, "max in metres in the report", json!(expected), json!(found)));
    }
}

/// Metres in a degree of longitude at the latitude nearest to the equator, and of latitude at the farthest (WGS 84).
fn metres_per_degree([south, north]: [f64; 2]) -> [f64; 2] {
    const A: f64 = 6_378_137.0;
    const F: f64 = 1.0 / 298.257_223_563;
    let e2 = F * (2.0 - F);
    let near = if south * north <= 0.0 { 0.0 } else { south.abs().min(north.abs()).to_radians() };
    let far = south.abs().max(north.abs()).to_radians();
    let w = |latitude: f64| (1.0 - e2 * latitude.sin() * latitude.sin()).sqrt();
    [A * near.cos() / w(near), A * (1.0 - e2) / (w(far) * w(far) * w(far))].map(|radian| radian * 1f64.to_radians())
}

/// True for longitudes and latitudes in degrees.
fn is_in_degrees(projection: &str) -> bool {
    let mut words = projection.split_whitespace();
    projection == "EPSG:4326"
        || words.any(|w| matches!(w, "+proj=longlat" | "+proj=latlong" | "+proj=lonlat" | "+proj=latlon"))
}

fn length(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use pointmill_format::DatasetKind;

    use super::super::Deviation;
    use super::*;

    fn found(change: impl Fn(&mut Figures)) -> Vec<String> {
        let mut deviation = Deviation::default();
        deviation.add([0.25, -0.5, 0.0], [1e6; 3]);
        deviation.add([0.25, 0.0, 0.0], [1e6; 3]);
        let truth = PositionErrors::of(&deviation);
        let mut stated = Figures { errors: truth, ..Figures::default() };
        change(&mut stated);
        let findings = Findings::new(DatasetKind::Bintree, 20);
        let noise = noise(&Side { deviation, ..Side::default() });
        Part { name: "format", stated: &stated, truth: &truth, noise }.check(&findings);
        findings.finish().1.iter().map(|f| f.subject.to_string()).collect()
    }

    #[test]
    fn a_figure_that_is_lower_than_the_truth_or_differs_from_it_is_found() {
        assert!(found(|_| ()).is_empty());
        assert!(found(|f| f.errors.max[0] += 1e-10).is_empty(), "the rounding of doubles at a million");
        assert_eq!(found(|f| f.errors.max[1] = 0.49)[0], "max of the format in the report");
        assert_eq!(found(|f| f.errors.max[1] = 0.51)[0], "max of the format in the report");
        assert_eq!(found(|f| f.errors.rms[0] *= 1.00001), ["rms of the format in the report"]);
        assert_eq!(found(|f| f.errors.mean[1] = 0.25), ["mean of the format in the report"], "the sign counts");
        assert_eq!(found(|f| f.errors.max_3d = 0.5), ["max_3d of the format in the report"]);
        let rounding = |f: &mut Figures| (f.is_bound, f.is_rounding) = (true, true);
        assert_eq!(found(rounding), ["how of the format in the report"]);
        assert_eq!(found(|f| *f = Figures::default()).len(), 5, "nothing is said to be unchanged that is not");
    }

    #[test]
    fn a_bound_may_be_above_the_truth_and_not_below() {
        let bound = |by: f64| {
            found(move |f| {
                let max = f.errors.max.map(|v| v * by);
                f.errors = PositionErrors { max, rms: max, mean: max, ..f.errors };
                f.is_bound = true;
                (f.errors.max_3d, f.errors.rms_3d) = (length(max), length(max));
            })
        };
        assert!(bound(1.0).is_empty() && bound(1.5).is_empty());
        assert_eq!(bound(0.9)[0], "max of the format in the report");
    }
}
