//! Files of laspy, LASzip and PDAL against what laspy reads from them (`fixtures/las/expected.tsv`).

use pointmill_format::AttributeType;
use pointmill_format::scan::las;
use pointmill_testkit::reader::{Cloud, columns_are_independent, integers};
use pointmill_testkit::{files, golden, scans};

use crate::common::{self, LAS, read};

/// Points, sum, minimum, maximum, first, last.
fn summary(values: &[i128]) -> [i128; 6] {
    let (min, max) = (values.iter().min().unwrap(), values.iter().max().unwrap());
    [values.len() as i128, values.iter().sum(), *min, *max, values[0], values[values.len() - 1]]
}

fn table(cloud: &Cloud) -> golden::Columns<i128, 6> {
    let columns = golden::columns(cloud, |v| v as i128, integers);
    columns.iter().map(|(name, values)| (name.clone(), summary(values))).collect()
}

#[test]
fn every_fixture_gives_the_columns_that_laspy_reads() {
    let expected = golden::expected("las");
    assert_eq!(expected.len(), scans::scan_fixtures("las").len());
    for (file, expected) in &expected {
        let cloud = read(file);
        assert!(cloud.errors.is_empty(), "{file}: {:?}", cloud.errors);
        assert_eq!(&table(&cloud), expected, "{file}");
    }
}

#[test]
fn a_laz_file_gives_the_same_values_as_its_las_twin() {
    for path in common::small_fixtures().iter().map(|f| &f.path).filter(|p| p.with_extension("laz").exists()) {
        let (las, laz) = (LAS.read(path).unwrap(), LAS.read(&path.with_extension("laz")).unwrap());
        assert_eq!(las.xyz, laz.xyz);
        let values = |c: &Cloud| c.columns.iter().map(integers).collect::<Vec<_>>();
        assert_eq!(values(&las), values(&laz), "{}", path.display());
        assert_eq!(las.info.attributes, laz.info.attributes);
    }
}

#[test]
fn sound_files_give_no_warning_but_that_waveforms_are_left_out() {
    for fixture in common::small_fixtures() {
        let name = fixture.path.file_stem().unwrap().to_str().unwrap();
        let waveforms = ["format4", "format5", "format9", "format10"].contains(&name);
        let cloud = LAS.read(&fixture.path).unwrap();
        assert_eq!(cloud.warned("waveform"), waveforms, "{name}");
        assert_eq!(cloud.info.warnings.len(), usize::from(waveforms), "{name}: {:?}", cloud.info.warnings);
    }
}

#[test]
fn a_selection_of_columns_leaves_the_others_empty_and_changes_no_value() {
    for fixture in common::small_fixtures() {
        columns_are_independent(las::open(&fixture.path).unwrap().as_ref());
    }
}

#[test]
fn colour_comes_first_then_the_standard_attributes_then_extra_bytes() {
    let names = |file: &str| -> Vec<String> {
        let cloud = read(file);
        cloud.info.attributes.iter().map(|a| a.name.clone()).collect()
    };
    assert_eq!(
        names("format3.las").join(", "),
        "rgb, intensity, return number, number of returns, classification flags, classification, scan angle rank, \
         user data, point source id, gps-time, scan direction flag, edge of flight line"
    );
    assert_eq!(
        names("format8.las").join(", "),
        "rgb, nir, intensity, return number, number of returns, classification flags, classification, user data, \
         scan angle, point source id, gps-time, scanner channel, scan direction flag, edge of flight line"
    );
    let extra = names("extra_bytes_format7.las");
    assert_eq!(extra[13..16], ["extra u1", "extra i1", "extra u2"]);
    assert!(extra.contains(&"gps-time 2".to_owned()) && extra.contains(&"Höhe".to_owned()));
}

#[test]
fn extra_bytes_keep_type_scale_offset_and_no_data() {
    let cloud = read("extra_bytes_format3.las");
    let get = |name: &str| cloud.info.attributes.iter().find(|a| a.name == name).unwrap();
    assert_eq!((get("extra u2").scale[0], get("extra u2").offset[0]), (0.5, -100.0));
    assert_eq!(get("extra u2").description, "of type u2");
    assert_eq!(get("extra u1").no_data, Some(vec![255.0]));
    assert_eq!(get("extra i2").no_data, Some(vec![-1.0]));
    assert_eq!(get("extra i8").ty, AttributeType::Int64);
    assert_eq!((get("extra f8").scale[0], get("extra f8").no_data.clone()), (1.0, None));
    let arrays = read("extra_byte_arrays.las");
    let shape: Vec<_> = arrays.info.attributes.iter().rev().take(2).map(|a| (a.ty, a.elements)).collect();
    assert_eq!(shape, [(AttributeType::Float32, 3), (AttributeType::UInt16, 2)]);
}

#[test]
fn the_coordinate_system_is_found_wherever_it_stands() {
    let crs = |file: &str| las::open(files::fixture("las").join(file)).unwrap().info().crs.clone();
    let wkt = "PROJCS[\"Höhe \\\"quoted\\\"\",GEOGCS[\"WGS 84\"],UNIT[\"metre\",1]]";
    for file in ["wkt_vlr.las", "evlrs.las", "evlrs.laz"] {
        assert_eq!(crs(file).wkt.as_deref(), Some(wkt), "{file}");
    }
    let geotiff = crs("geotiff.las");
    assert_eq!((geotiff.wkt, geotiff.epsg, geotiff.vertical_epsg), (None, Some(32633), Some(5773)));
    let autzen = crs("autzen_trim.laz");
    assert!(autzen.wkt.unwrap().contains("NAD_1983_HARN_Lambert_Conformal_Conic"));
}

#[test]
fn the_header_is_told_as_it_is() {
    let scan = las::open(files::fixture("las").join("autzen_trim.laz")).unwrap();
    let info = scan.info();
    assert_eq!((info.format.as_str(), info.points_declared), ("LAZ 1.2, point format 3", 110_000));
    let bounds = info.bounds_declared.unwrap();
    assert_eq!(
        (bounds.min, bounds.max),
        ([636001.76, 848935.2000000001, 406.26], [637179.2200000001, 849497.9, 520.51])
    );
    assert_eq!(info.lattice.unwrap().scale, [0.01; 3]);
    assert_eq!(scan.pieces().iter().map(|p| p.points).collect::<Vec<_>>(), [50_000, 50_000, 10_000]);
    let scan = las::open(files::fixture("las").join("las_1_5.las")).unwrap();
    assert_eq!(scan.info().format, "LAS 1.5, point format 6");
}
