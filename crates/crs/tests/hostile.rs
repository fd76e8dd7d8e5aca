//! Texts that are nearly a coordinate reference system: one line says why they are none.

use pointmill_crs::Placing;
use pointmill_testkit::Random;
use pointmill_testkit::damage::{mutated, rounds};

const TEXTS: [&str; 6] = [
    "EPSG:25832+5783",
    "+proj=utm +zone=10 +datum=WGS84 +units=us-ft +no_defs",
    "+proj=lcc +lat_1=43 +lat_2=40 +lat_0=39.8 +lon_0=-100 +x_0=500000 +y_0=0 +ellps=GRS80 +towgs84=1,2,3,4,5,6,7",
    r#"PROJCS["a",GEOGCS["b",DATUM["c",SPHEROID["d",6378137,298.257223563],TOWGS84[0,0,0,0,0,0,0]],PRIMEM["e",0],UNIT["f",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",15],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1]]"#,
    r#"COMPD_CS["c",PROJCS["a",GEOGCS["g",AUTHORITY["EPSG","4269"]],UNIT["metre",1],AUTHORITY["EPSG","26915"]],VERT_CS["h",UNIT["US survey foot",0.3048006096],AUTHORITY["EPSG","6360"]]]"#,
    r#"PROJCRS["x",BASEGEOGCRS["y",DATUM["z",ELLIPSOID["e",6378137,298.257223563]]],CONVERSION["z",METHOD["Lambert Conic Conformal (2SP)"],PARAMETER["Latitude of false origin",40,ANGLEUNIT["degree",0.0174532925199433]]],CS[Cartesian,2],AXIS["easting",east],LENGTHUNIT["metre",1],ID["EPSG",2154]]"#,
];

#[test]
fn damaged_texts_are_systems_or_an_error_of_one_line() {
    let (mut random, mut refused) = (Random::new(51), 0);
    for text in TEXTS {
        for _ in 0..rounds(1000) {
            let damaged = mutated(text.as_bytes(), std::slice::from_ref(&(0..text.len())), &mut random);
            let damaged = String::from_utf8_lossy(&damaged).into_owned();
            let _ = Placing::is_unknown_code(&damaged);
            if let Err(error) = Placing::default().with_crs(&damaged) {
                let line = error.to_string();
                assert!(!line.is_empty() && !line.contains('\n'), "{damaged:?}: {line:?}");
                refused += 1;
            }
        }
    }
    assert!(refused > 500, "{refused}");
}
