//! Coordinate reference systems in the unit that the scan declares.

use std::fs;

use pointmill_testkit::las::Las;
use pointmill_testkit::las_records::{Vlr, shorts, with_vlrs};
use serde_json::Value;

use crate::support::Dir;

/// EPSG:32104, defined in metres: its false easting of 500 km is in metres whatever the unit of the coordinates.
const NEBRASKA: &str = "+proj=lcc +lat_1=43 +lat_2=40 +lat_0=39.83333333333334 +lon_0=-100 +x_0=500000 +y_0=0 \
                        +datum=NAD83 +units=us-ft +no_defs";

/// A LAS file with these GeoTIFF keys: id and value each.
fn with_keys(keys: &[[u16; 2]], more: &[Vlr<'_>]) -> Vec<u8> {
    let mut directory = vec![1, 1, 0, keys.len() as u16];
    keys.iter().for_each(|[id, value]| directory.extend([*id, 0, 1, *value]));
    let records = [&[("LASF_Projection", 34735, shorts(&directory))], more].concat();
    let mut las = Las::terrain(300, 1);
    las.offset = [2_445_180.0, 604_300.0, 900.0];
    with_vlrs(&las.bytes(), &records)
}

fn projection(dir: &Dir, dataset: &str) -> String {
    let metadata: Value = serde_json::from_slice(&fs::read(dir.path(dataset).join("metadata.json")).unwrap()).unwrap();
    metadata["projection"].as_str().unwrap().to_owned()
}

#[test]
fn coordinates_in_feet_get_a_definition_in_feet() {
    let dir = Dir::new();
    dir.write("feet.las", &with_keys(&[[1024, 1], [3072, 32104], [3076, 9003]], &[]));
    let ended = dir.succeed(["convert", "feet.las", "-o", "out"]);
    assert_eq!(projection(&dir, "out"), NEBRASKA);
    let line = "EPSG:32104 has coordinates in units of metre, but units of US survey foot are declared";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    let info = dir.succeed(["info", "feet.las"]).stdout();
    assert!(info.contains("EPSG:32104 NAD83 / Nebraska in units of US survey foot"), "{info}");
    assert!(info.contains("US survey foot; that of heights is not known"), "{info}");
    // the code alone says nothing of the unit that the file declares; a definition does
    dir.succeed(["convert", "feet.las", "-o", "code", "--crs", "EPSG:32104", "-q"]);
    assert_eq!(projection(&dir, "code"), NEBRASKA);
    let ended = dir.succeed(["convert", "feet.las", "-o", "text", "--crs", "+proj=utm +zone=14 +datum=NAD83"]);
    assert!(projection(&dir, "text").starts_with("+proj=utm +zone=14"));
    assert!(ended.stderr().contains("the inputs declare coordinates in units of US survey foot"), "{}", ended.stderr());
}

#[test]
fn an_unknown_unit_leaves_the_definition_empty() {
    let dir = Dir::new();
    dir.write("odd.las", &with_keys(&[[3072, 32104], [3076, 32767]], &[]));
    let ended = dir.succeed(["convert", "odd.las", "-o", "out"]);
    assert_eq!(projection(&dir, "out"), "");
    let stderr = ended.stderr();
    assert!(stderr.contains("the unit 32767, which has no known size"), "{stderr}");
    assert!(stderr.contains("the unit of the coordinates is not known"), "{stderr}");
}

#[test]
fn records_at_odds_are_both_named() {
    let dir = Dir::new();
    let wkt = br#"PROJCS["NAD83 / Nebraska",UNIT["metre",1],AUTHORITY["EPSG","32104"]]"#.to_vec();
    let keys = [[3072, 32104], [3076, 9003], [4096, 6360]];
    let mut las = with_keys(&keys, &[("LASF_Projection", 2112, wkt)]);
    for (bit, taken, unit) in [(0, "the keys were taken", "+units=us-ft"), (16, "the WKT was taken", "+units=m ")] {
        las[6] = bit;
        dir.write("both.las", &las);
        let ended = dir.succeed(["convert", "both.las", "-o", "out", "--overwrite"]);
        let stderr = ended.stderr();
        for words in ["the WKT says EPSG:32104 in units of metre", "EPSG:32104 in units of US survey foot", taken] {
            assert!(stderr.contains(words), "{words}: {stderr}");
        }
        assert!(projection(&dir, "out").contains(unit), "{}", projection(&dir, "out"));
    }
}

#[test]
fn heights_have_units_of_their_own() {
    let dir = Dir::new();
    dir.write("heights.las", &with_keys(&[[3072, 26914], [4096, 5703], [4099, 9003]], &[]));
<<<<<<< HEAD
    let info: Value = serde_json::from_str(&dir.succeed(["info", "heights.las", "--json"]).stdout()).unwrap();
    assert_eq!(info[0]["crs"]["unit"]["name"], "metre");
    assert_eq!(info[0]["crs"]["vertical_unit"]["metres"], 1200.0 / 3937.0);
    assert_eq!(info[0]["crs"]["is_geographic"], false);
=======
    let all: Value = serde_json::from_str(&dir.succeed(["info", "heights.las", "--json"]).stdout()).unwrap();
    let info = &all[0];
    assert_eq!(info["crs"]["unit"]["name"], "metre");
    assert_eq!(info["crs"]["vertical_unit"]["metres"], 1200.0 / 3937.0);
    assert_eq!(info["crs"]["is_geographic"], false);
>>>>>>> attrs
}

#[test]
fn definitions_that_end_early_or_have_no_name_are_refused() {
    let dir = Dir::new();
    dir.write("scan.las", &Las::terrain(300, 1).bytes());
    let crs = |text: &str| dir.run(["convert", "scan.las", "-o", "out", "--crs", text]);
    crs("PROJCS[\"x\"").failed_with(2, &["--crs", "ends before its brackets are closed"]);
    crs("GEOGCS[\"WGS 84\",AUTHORITY[\"EPSG\",\"4326").failed_with(2, &["ends before"]);
    crs("PROJCS[\"\"]").failed_with(2, &["has no name"]);
    crs("WKT \"\"").failed_with(2, &["is not EPSG:n"]);
    // any kind of scan: what is given has its unit
    dir.write("scan.xyz", b"1 2 3\n4 5 6\n7 8 9\n");
    dir.succeed(["convert", "scan.xyz", "-o", "feet", "--crs", "EPSG:2994+5703", "-q"]);
    assert!(projection(&dir, "feet").contains("+x_0=399999.9999984 +y_0=0 +ellps=GRS80"));
    assert!(projection(&dir, "feet").contains("+units=ft "));
}

#[test]
fn an_empty_wkt_is_named() {
    let dir = Dir::new();
    for text in [&b"\0\0"[..], b"\"\""] {
        dir.write("empty.las", &with_vlrs(&Las::terrain(300, 1).bytes(), &[("LASF_Projection", 2112, text.to_vec())]));
        let info = dir.succeed(["info", "empty.las"]).stdout();
        assert!(info.contains("no CRS"), "{info}");
        assert!(info.contains("the WKT of the coordinate reference system is empty"), "{info}");
    }
}
