//! What cannot be done exactly is refused, and what is taken for granted is said.

use std::fs;

use pointmill_crs::{Placing, Units};
use pointmill_format::{Advice, ErrorKind, OpenOptions, Positions, ReadError, Scan, ScanWarning, Wanted, open_scan};

fn opened(points: &str, placing: Placing) -> Result<Box<dyn Scan>, ReadError> {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("a.xyz");
    fs::write(&file, points).unwrap();
    open_scan(&file, &OpenOptions::default().maps(placing))
}

fn from_to(from: &str, to: &str) -> Placing {
    Placing::default().with_crs(from).unwrap().with_target(to).unwrap()
}

/// The line of a refusal.
#[allow(clippy::needless_pass_by_value)] // built in place by callers
fn refused(points: &str, placing: Placing) -> String {
    let error = match opened(points, placing.clone()) {
        Err(error) => error,
        Ok(scan) => panic!("{placing:?}: {:?}", scan.info().warnings),
    };
    assert!(matches!(error.kind(), ErrorKind::Unsupported), "{error}");
    assert!(error.advice().is_some() && !error.to_string().contains('\n'), "{error}");
    error.to_string()
}

#[test]
fn changes_of_datum_that_need_a_grid_or_have_no_parameters_are_refused() {
    let table = [
        ("400000 300000 10\n", "EPSG:27700", "EPSG:4326", "grid uk_os_OSTN15"),
        ("3500000 5300000 10\n", "EPSG:31467", "EPSG:25832", "grid"),
        ("155000 463000 10\n", "EPSG:28992", "EPSG:25831", "grid nl_nsgi_rdtrans2018.tif"),
        ("500000 4500000 10\n", "EPSG:26710", "EPSG:26910", "grid"),
        ("500000 4500000 10\n", "EPSG:26910", "EPSG:32610", "grid"),
        ("637000 853000 10\n", "EPSG:2994", "EPSG:4326", "EPSG:2994"),
        (
            "600000 2400000 10\n",
            "+proj=lcc +lat_1=46.8 +lat_0=46.8 +lon_0=2.3 +k_0=0.99987742 +x_0=600000 \
          +y_0=2200000 +ellps=clrk80ign +units=m +no_defs",
            "EPSG:2154",
            "no exact way",
        ),
    ];
    let meridian = "prime meridian other than Greenwich";
    let others = [
        ("600000 2200000 10\n", "EPSG:27572", "EPSG:4326", meridian),
        ("600000 2200000 10\n", "EPSG:27572", "EPSG:4807", meridian),
        ("2 46 10\n", "EPSG:4818", "EPSG:5514", meridian),
    ];
    for (points, from, to, words) in table.into_iter().chain(others) {
        let line = refused(points, from_to(from, to));
        assert!(line.contains(words), "{from} {to}: {line}");
    }
}

#[test]
fn heights_keep_what_they_are_above_or_the_scan_is_refused() {
    let line = refused("500000 5400000 100\n", from_to("EPSG:25832+5783", "EPSG:4936"));
    assert!(line.contains("above the vertical datum EPSG:5181") && line.contains("above the ellipsoid"), "{line}");
    refused("500000 5400000 100\n", from_to("EPSG:25832", "EPSG:25832+5783"));
    refused("500000 5400000 100\n", from_to("EPSG:25832+5783", "EPSG:25832+3855"));
    let scan = opened("500000 5400000 100\n", from_to("EPSG:32632", "EPSG:4978")).unwrap();
    let warnings = &scan.info().warnings;
    assert!(matches!(&warnings[..], [ScanWarning::HeightsAboveNothing { .. }]), "{warnings:?}");
    assert!(
        opened("500000 5400000 100\n", from_to("EPSG:25832+5783", "EPSG:25833+5783"))
            .unwrap()
            .info()
            .warnings
            .is_empty()
    );
}

#[test]
fn a_change_of_datum_is_named_with_its_accuracy() {
    let said = |points: &str, placing: Placing| match &opened(points, placing).unwrap().info().warnings[..] {
        [ScanWarning::DatumChange { by }] => by.clone(),
        other => panic!("{other:?}"),
    };
    assert_eq!(
        said("500000 5400000 1\n", from_to("EPSG:25832", "EPSG:32632")),
        "ETRS89 to WGS 84 (1), right within 1 m"
    );
    assert_eq!(
        said("700000 6600000 1\n", from_to("EPSG:2154", "EPSG:25831")),
        "RGF93 v1 to ETRS89 (1), right within 0.1 m"
    );
    let declared = "+proj=tmerc +lat_0=0 +lon_0=9 +k=1 +x_0=3500000 +y_0=0 +ellps=bessel \
                    +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7 +units=m +no_defs";
    assert_eq!(
        said("3500000 5300000 1\n", from_to(declared, "EPSG:32632")),
        "the shift to WGS 84 that the definition declares"
    );
}

#[test]
fn a_scan_without_a_system_is_not_reprojected() {
    let error = opened("1 2 3\n", Placing::default().with_target("EPSG:25832").unwrap()).err().unwrap();
    assert_eq!(error.advice(), Some(&Advice::NameCrs));
}

#[test]
fn points_without_an_image_are_no_positions() {
    let scan = opened("9 48 0\n9 95 0\n", from_to("EPSG:4326", "EPSG:25832")).unwrap();
    let batch = scan.batches(Wanted::positions(scan.info())).next().unwrap().unwrap();
    let Positions::World([x, y, _]) = batch.positions else { panic!() };
    assert!((x[0] - 500_000.0).abs() < 1e-6 && y[0].is_finite() && x[1].is_nan() && y[1].is_nan());
}

fn corner(points: &str, placing: Placing) -> [f64; 3] {
    opened(points, placing).unwrap().bounds_hint().unwrap().max
}

#[test]
fn units_become_metres_or_those_of_the_system() {
    let units = |units| Placing::default().with_units(units);
    assert_eq!(corner("1500 2500 3000\n", units(Units::Millimetre)), [1.5, 2.5, 3.0]);
    assert_eq!(corner("1500 2500 3000\n", units(Units::Metre).with_crs("EPSG:2994").unwrap())[0], 1500.0 / 0.3048);
    assert_eq!(corner("1500 2500 3000\n", units(Units::Foot).with_crs("EPSG:2994").unwrap()), [1500.0, 2500.0, 3000.0]);
    // heights of EPSG:6360 are US survey feet above those of EPSG:5703; x and y are metres
    let compound = units(Units::Metre).with_crs("EPSG:26910+6360").unwrap();
    let [x, y, z] = corner("1500 2500 12\n", compound.clone());
    assert!((x, y) == (1500.0, 2500.0) && (z - 12.0 * 3937.0 / 1200.0).abs() < 1e-12, "{z}");
    let [_, north, up] = corner("1500 12 -2500\n", compound.with_y_up());
    assert!(north == 2500.0 && (up - 12.0 * 3937.0 / 1200.0).abs() < 1e-12, "with y up, the height is y");
    let degrees = refused("9 48 100\n", units(Units::Foot).with_crs("EPSG:4326").unwrap());
    assert!(degrees.contains("degrees"), "{degrees}");
}
