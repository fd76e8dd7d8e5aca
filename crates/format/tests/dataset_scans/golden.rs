//! Every value of the golden datasets, in the order of a scan.

use pointmill_format::{Lattice, OpenOptions, Resolution, Wanted};
use pointmill_testkit::files::{corpus, fixture};
use pointmill_testkit::reader::{columns_are_independent, read};

use crate::util::{READER, changed, open, records};

/// X Y Z from the lower corner of the cube, classification, gps-time, Amplitude, intensity of all points, sorted.
const POINTS: [([f64; 3], [f64; 4]); 13] = [
    ([0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0]),
    ([0.0, 0.0, 7.0], [1.0, 7.0, 7.0, 3.0]),
    ([0.0, 6.0, 0.0], [1.0, 6.0, 6.0, 2.0]),
    ([1.0, 2.0, 3.0], [6.0, 1e-300, 1.0, 100.0]),
    ([5.0, 0.0, 0.0], [1.0, 5.0, 5.0, 1.0]),
    ([512.0, 512.0, 512.0], [1.0, 8.0, 8.0, 4.0]),
    ([513.0, 512.0, 512.0], [1.0, 11.0, 11.0, 7.0]),
    ([700.0, 1000.0, 512.0], [1.0, 10.0, 10.0, 6.0]),
    ([1023.0, 600.0, 700.0], [1.0, 9.0, 9.0, 5.0]),
    ([8000.0, 0.0, 1.0], [2.0, -1.25, 1000.0, 65_535.0]),
    ([8192.0; 3], [17.0, 2.0, 2.0, 8.0]),
    ([8192.0; 3], [17.0, 2.0, 2.0, 9.0]),
    ([16_383.0; 3], [255.0, 123_456_789.125, 65_535.0, 7.0]),
];

/// The values of all points, sorted; positions from `corner`.
fn values(name: &str, corner: [f64; 3], columns: &[&str]) -> Vec<Vec<f64>> {
    let cloud = READER.check(&fixture(name), name).unwrap();
    assert!(cloud.errors.is_empty(), "{name}: {:?}", cloud.errors);
    columns_are_independent(&*open(name, &OpenOptions::default()));
    let columns: Vec<Vec<f64>> = columns.iter().map(|column| cloud.values(column)).collect();
    let point = |i: usize| -> Vec<f64> {
        let place = (0..3).map(|axis| cloud.xyz[axis][i] - corner[axis]);
        place.chain(columns.iter().map(|values| values[i])).collect()
    };
    let mut all: Vec<Vec<f64>> = (0..cloud.len()).map(point).collect();
    all.sort_by(|a, b| a.partial_cmp(b).unwrap());
    all
}

fn expected(columns: usize) -> Vec<Vec<f64>> {
    POINTS.iter().map(|(place, values)| [&place[..], &values[..columns]].concat()).collect()
}

#[test]
fn potree_2_gives_the_integers_of_the_job_that_made_it() {
    let columns = ["classification", "gps-time", "Amplitude", "intensity"];
    for encoding in ["potree2/default", "potree2/brotli"] {
        assert_eq!(values(encoding, [1_000_000.0, 2_000_000.0, -5000.0], &columns), expected(4), "{encoding}");
        let scan = open(encoding, &OpenOptions::default());
        let info = scan.info();
        assert_eq!(info.lattice, Some(Lattice { scale: [0.001; 3], offset: [0.0; 3] }));
        assert_eq!((info.points_declared, info.bounds_declared.unwrap().max), (13, [1016.383, 2016.383, 11.383]));
        assert_eq!(info.crs.wkt.as_deref(), Some("LOCAL_CS[\"a \\ b\"]"));
        assert!(info.rgb_is_16_bit && info.warnings.is_empty(), "{:?}", info.warnings);
        let (_, amplitude) = info.attribute("Amplitude").unwrap();
        assert_eq!((&amplitude.scale, &amplitude.offset), (&vec![0.01], &vec![-10.0]));
        assert_eq!(amplitude.description, "echo \"amplitude\", dB");
    }
    let cloud = READER.check(&fixture("potree2/default"), "").unwrap();
    assert_eq!(
        cloud.attributes(),
        "rgb uint16x3, intensity uint16x1, classification uint8x1, scan angle int16x1, gps-time doublex1, Amplitude uint16x1"
    );
    assert_eq!(cloud.values("scan angle").iter().sum::<f64>(), 57.0);
}

#[test]
fn a_dataset_of_others_has_its_own_lattice() {
    let (_kept, folder) = changed("potree2/default", |name, bytes| {
        if name == "metadata.json" {
            let text = String::from_utf8(bytes.clone()).unwrap().replace("\"pointmill\": {", "\"other\": {");
            *bytes = text.replace("\"projection\": \"\"", "\"projection\": \"+proj=utm +zone=33\"").into_bytes();
        }
    });
    let cloud = READER.check(&folder, "of others").unwrap();
    let info = &cloud.info;
    assert_eq!(info.lattice, Some(Lattice { scale: [0.001; 3], offset: [1000.0, 2000.0, -5.0] }));
    assert_eq!((info.crs.proj4.as_deref(), info.crs.wkt.as_deref()), (Some("+proj=utm +zone=33"), None));
    assert!(!info.rgb_is_16_bit);
    assert_eq!(cloud.xyz[0].iter().copied().fold(0.0, f64::max), 16_383.0);
}

#[test]
fn potree_1_gives_integers_from_the_corner_and_colours_of_8_bits() {
    for (name, columns) in [("words", 0), ("objects", 4), ("flat", 0)] {
        let name = format!("potree1/{name}");
        let names = &["classification", "gps-time", "Amplitude", "intensity"][..columns];
        assert_eq!(values(&name, [0.0; 3], names), expected(columns), "{name}");
        let scan = open(&name, &OpenOptions::default());
        let offset = [1000.0, 2000.0, -5.0];
        assert_eq!(scan.info().lattice, Some(Lattice { scale: [0.001; 3], offset }), "{name}");
        let cloud = read(&*scan, &Wanted::all(scan.info()));
        let mut rgb: Vec<f64> = cloud.values("rgb");
        rgb.sort_by(f64::total_cmp);
        assert_eq!((rgb[38], rgb.len()), (255.0, 39), "{name}: as the readers of other scans give 8 bits");
    }
}

#[test]
fn stored_scales_of_potree_1_are_those_of_its_attributes() {
    let (_kept, folder) = changed("potree1/objects", |name, bytes| {
        if name == "cloud.js" {
            let own = "{\n\t\"pointmill\": {\"attributeScales\": {\"Amplitude\": {\"scale\": [0.01], \"offset\": [-10]}}, \
                       \"attributesRenamed\": {\"Amplitude\": \"height\"}, \"colours\": \"white\"},";
            *bytes = String::from_utf8(bytes.clone()).unwrap().replacen('{', own, 1).into_bytes();
        }
    });
    let cloud = READER.check(&folder, "scaled").unwrap();
    let (_, height) = cloud.info.attribute("height").unwrap();
    assert_eq!((&height.scale, &height.offset), (&vec![0.01], &vec![-10.0]));
    assert_eq!(cloud.attributes(), "classification uint8x1, gps-time doublex1, intensity uint16x1, height uint16x1");
}

#[test]
fn a_fourth_byte_of_colours_that_says_something_is_told() {
    let (_kept, folder) = changed("potree1/words", |name, bytes| {
        if name.ends_with("/r.bin") {
            assert_eq!(bytes[15], 255);
            bytes[15] = 7;
        }
    });
    let cloud = READER.check(&folder, "alpha").unwrap();
    assert!(cloud.warned("a fourth byte that is not 255"), "{:?}", cloud.info.warnings);
    assert!(READER.check(&fixture("potree1/words"), "no alpha").unwrap().info.warnings.is_empty());
}

#[test]
fn copc_is_the_same_cloud_as_laz_and_as_an_octree() {
    for name in ["format6", "format8", "pages"] {
        let name = format!("copc/{name}.copc.laz");
        let [plain, octree] = [OpenOptions::default(), OpenOptions::default().max_level(31)].map(|options| {
            let scan = open(&name, &options);
            pointmill_testkit::reader::keeps_promises(&*scan, &Wanted::all(scan.info()), u64::MAX);
            read(&*scan, &Wanted::all(scan.info()))
        });
        assert_eq!((plain.info.lattice, &plain.info.crs), (octree.info.lattice, &octree.info.crs));
        assert_eq!(plain.attributes(), octree.attributes());
        assert!(records(&plain) == records(&octree), "{name}");
    }
}

/// The corners of its nodes are no whole steps: world coordinates.
#[test]
fn the_lion_is_a_scan_in_world_coordinates() {
    let Some(folder) = corpus("potree1/lion_takanawa") else { return };
    let cloud = READER.check(&folder, "the lion").unwrap();
    assert_eq!((cloud.len(), cloud.info.lattice), (272_768, None));
    assert!(matches!(cloud.info.resolution[0], Resolution::Step(_)));
    assert_eq!(cloud.attributes(), "rgb uint16x3, NormalX floatx1, NormalY floatx1, NormalZ floatx1");
}
