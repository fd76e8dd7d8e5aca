//! The reader under test, its fixtures, and pictures made for a test.

use std::fs;
use std::path::Path;

use pointmill_format::scan::depth;
use pointmill_format::{DepthOptions, Intrinsics, ReadError, Scan, Wanted};
use pointmill_testkit::files;
use pointmill_testkit::reader::{Cloud, Reader, read};

/// The camera of the fixtures.
pub(crate) const CAMERA: Intrinsics = Intrinsics { focal: [26.25, 26.0], centre: [15.75, 11.5], size: Some([32, 24]) };

/// Options for `tum`, which does not describe its camera.
pub(crate) fn tum_options() -> DepthOptions {
    let mut options = DepthOptions::default();
    (options.intrinsics, options.units_per_metre) = (Some(CAMERA), Some(5000.0));
    options
}

#[allow(clippy::needless_pass_by_value)] // built in place by tests
pub(crate) fn open(path: &Path, depth: DepthOptions) -> Result<Box<dyn Scan>, ReadError> {
    depth::open(path, &depth, None)
}

/// All points of what can be opened.
pub(crate) fn cloud(path: &Path, depth: DepthOptions) -> Cloud {
    let scan = open(path, depth).unwrap();
    read(scan.as_ref(), &Wanted::all(scan.info()))
}

/// The line of an error.
pub(crate) fn refused(path: &Path, depth: DepthOptions) -> String {
    open(path, depth).err().unwrap().to_string()
}

/// Without options, as a single depth map is opened.
pub(crate) const SINGLE: Reader = Reader {
    open: |path| open(path, DepthOptions::default()),
    // a row of equal pixels takes a bit or two
    max_points: |bytes| 1000 * bytes + 768,
    max_decoded: |bytes| 2000 * bytes + 4096,
};

/// Folders: pieces of frames that cannot be read promise as many points as their camera has pixels.
pub(crate) const SEQUENCE: Reader = Reader { max_points: |_| 1 << 27, max_decoded: |_| 1 << 27, ..SINGLE };

/// A copy of a fixture's folder.
pub(crate) fn copy_of(name: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    copy(&files::fixture("depth").join(name), dir.path());
    dir
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in files::entries(from) {
        let target = to.join(entry.file_name().unwrap());
        if entry.is_dir() {
            copy(&entry, &target);
        } else {
            fs::copy(&entry, target).unwrap();
        }
    }
}

/// Writes a PNG picture; samples of 16 bits have the high byte first.
pub(crate) fn write_png(
    path: &Path,
    [width, height]: [u32; 2],
    colour: png::ColorType,
    bits: png::BitDepth,
    bytes: &[u8],
) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), width, height);
    encoder.set_color(colour);
    encoder.set_depth(bits);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
}

/// Writes a depth map, and a file that describes its camera: a pixel is as wide as it is deep, 1000 units in a metre.
pub(crate) fn write_depth(folder: &Path, name: &str, size: [u32; 2], depths: &[u16], more: &str) -> std::path::PathBuf {
    let path = folder.join(format!("{name}.png"));
    let bytes: Vec<u8> = depths.iter().flat_map(|depth| depth.to_be_bytes()).collect();
    write_png(&path, size, png::ColorType::Grayscale, png::BitDepth::Sixteen, &bytes);
    let [width, height] = size;
    let camera = format!(
        r#"{{"fx": 1, "fy": 1, "cx": 1, "cy": 0, "width": {width}, "height": {height}, "depth_scale": 1000{more}}}"#
    );
    fs::write(folder.join(format!("{name}.json")), camera).unwrap();
    path
}
