//! Datasets that break while they are served: one line in the answer and in the terminal, and the server lives.

use std::fs::{self, OpenOptions};
use std::path::Path;

use pointmill_testkit::files::{dataset, fixture};

use super::batches::three_batches;
use super::client::{Served, serve};

fn copy(from: &str, to: &Path) {
    for (name, bytes) in dataset(&fixture(from)) {
        let path = to.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

fn cut(path: &Path, bytes: u64) {
    OpenOptions::new().write(true).open(path).unwrap().set_len(bytes).unwrap();
}

/// The request fails with a line that names the file, and others are answered.
#[track_caller]
fn fails(served: &Served, target: &str, file: &str) {
    let before = served.lines().len();
    let (status, line) = served.refused(target);
    assert_eq!(status, 500, "{line}");
    assert!(line.contains(file), "{line}");
    assert_eq!(served.lines()[before..], [line]);
    assert_eq!(served.get("/api/0/scene").status, 200);
}

#[test]
fn an_octree_that_is_cut_or_removed_is_an_error_of_the_request() {
    for name in ["potree2/default", "potree2/brotli"] {
        let folder = tempfile::tempdir().unwrap();
        copy(name, folder.path());
        let served = serve(&[folder.path()]);
        served.bytes("/api/0/points?units=r");
        cut(&folder.path().join("octree.bin"), 3);
        fails(&served, "/api/0/points?units=r", "octree.bin");
        cut(&folder.path().join("hierarchy.bin"), 3);
        fails(&served, "/api/0/nodes?of=r00000", "hierarchy.bin");
        // the chunk of the root is known
        served.bytes("/api/0/nodes?of=r");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pages.copc.laz");
    fs::copy(fixture("copc/pages.copc.laz"), &path).unwrap();
    let served = serve(&[&path]);
    served.bytes("/api/0/points?units=r");
    cut(&path, 700);
    fails(&served, "/api/0/points?units=r", "pages.copc.laz");
    let folder = tempfile::tempdir().unwrap();
    copy("potree1/words", folder.path());
    let served = serve(&[folder.path()]);
    fs::remove_dir_all(folder.path()).unwrap();
    fails(&served, "/api/0/points?units=r", "r.bin");
    assert_eq!(served.refused("/data/0/cloud.js").0, 404);
}

#[test]
fn a_leaf_that_is_gone_or_cut_is_an_error_of_the_request() {
    let folder = tempfile::tempdir().unwrap();
    copy("bintree/packed", folder.path());
    let served = serve(&[folder.path()]);
    let leaf = pointmill_format::bintree::Bintree::open(folder.path()).unwrap().leaves().last().unwrap();
    let target = format!("/api/0/points?units={leaf}");
    served.bytes(&target);
    cut(&folder.path().join("leaves.bin"), 20);
    fails(&served, &target, "leaves.bin");
    let folder = tempfile::tempdir().unwrap();
    copy("bintree/files", folder.path());
    let served = serve(&[folder.path()]);
    let tree = pointmill_format::bintree::Bintree::open(folder.path()).unwrap();
    let leaf = tree.leaves().next().unwrap();
    let name = tree.leaf_name(leaf);
    fs::remove_file(folder.path().join(&name)).unwrap();
    fails(&served, &format!("/api/0/points?units={leaf}"), &name);
}

/// A map of the file would end the process, whatever was checked before.
#[test]
fn batches_may_be_cut_while_they_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = three_batches(&folder, true);
    let (bytes, served) = (fs::read(&path).unwrap(), serve(&[&path]));
    let statuses: Vec<u16> = std::thread::scope(|scope| {
        let cutter = scope.spawn(|| {
            for _ in 0..300 {
                cut(&path, 4096);
                fs::write(&path, &bytes).unwrap();
            }
        });
        let mut statuses = Vec::new();
        while !cutter.is_finished() {
            statuses.push(served.get("/api/0/batches?units=0,1,2&planes=3").status);
        }
        statuses
    });
    assert!(statuses.iter().all(|status| [200, 500].contains(status)), "{statuses:?}");
    served.bytes("/api/0/batches?units=0,1,2&planes=3");
}

#[test]
fn batches_that_are_cut_are_an_error_of_the_request() {
    for is_compressed in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let path = three_batches(&folder, is_compressed);
        let served = serve(&[&path]);
        served.bytes("/api/0/batches?units=2&planes=3");
        cut(&path, 4096);
        fails(&served, "/api/0/batches?units=2&planes=3", "three.qbatch");
        fails(&served, "/api/0/point?unit=2&index=0", "three.qbatch");
    }
}
