//! Puts the fixtures where the fuzzer looks for its first inputs: `corpus/<target>/`.

use std::fs;
use std::io;
use std::path::Path;

#[path = "../../crates/converter/tests/hostile_job/left_job.rs"]
mod left_job;

use left_job::{JOBS, LeftJob};

fn main() -> io::Result<()> {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR"));
    let fixtures = fuzz.join("../fixtures");
    for (target, folder, endings) in [
        ("las", "las", &["las", "laz"][..]),
        ("copc", "copc", &["laz"]),
        ("copc_validate", "copc", &["laz"]),
        ("e57", "e57", &["e57"]),
        ("images", "e57", &["e57"]),
        ("ply", "rows", &["ply"]),
        ("pcd", "rows", &["pcd"]),
        ("text", "rows", &["xyz", "txt", "asc", "csv", "pts", "ptx", "off", "obj"]),
    ] {
        let corpus = fuzz.join("corpus").join(target);
        fs::create_dir_all(&corpus)?;
        for entry in fs::read_dir(fixtures.join(folder))? {
            let path = entry?.path();
            let (Some(name), Some(ending)) = (path.file_name(), path.extension().and_then(|e| e.to_str())) else {
                continue;
            };
            if !endings.contains(&ending) || path.metadata()?.len() > 100_000 {
                continue;
            }
            let bytes = fs::read(&path)?;
            let bytes = if target == "text" { [b"0".as_slice(), &bytes].concat() } else { bytes };
            fs::write(corpus.join(name), bytes)?;
        }
    }
    let corpus = fuzz.join("corpus/depth");
    fs::create_dir_all(&corpus)?;
    for (which, name) in pointmill_fuzz::DEPTH_FILES.into_iter().enumerate() {
        let bytes = fs::read(fixtures.join("depth").join(name))?;
        fs::write(corpus.join(name.replace('/', "_")), [vec![which as u8], bytes].concat())?;
    }
    let corpus = fuzz.join("corpus/potree2");
    fs::create_dir_all(&corpus)?;
    for name in ["default", "brotli"] {
        let file = |file: &str| fs::read(fixtures.join("potree2").join(name).join(file));
        let (metadata, hierarchy, octree) = (file("metadata.json")?, file("hierarchy.bin")?, file("octree.bin")?);
        let lengths = [metadata.len() as u32, hierarchy.len() as u32].map(u32::to_le_bytes).concat();
        fs::write(corpus.join(name), [lengths, metadata, hierarchy, octree].concat())?;
    }
    let corpus = fuzz.join("corpus/potree1");
    fs::create_dir_all(&corpus)?;
    for (name, node) in [("words", "data/r/00/00/r00007.bin"), ("objects", "data/r/r.bin"), ("flat", "data/r.bin")] {
        let file =
            |file: &str| fs::read(fixtures.join("potree1").join(name).join(file)).or(Ok::<_, io::Error>(Vec::new()));
        let (cloud, index, node) = (file("cloud.js")?, file("data/r/r.hrc")?, file(node)?);
        let lengths = [cloud.len() as u32, index.len() as u32].map(u32::to_le_bytes).concat();
        fs::write(corpus.join(name), [lengths, cloud, index, node].concat())?;
    }
    let corpus = fuzz.join("corpus/bintree");
    fs::create_dir_all(&corpus)?;
    for (name, index) in [("packed", "packed"), ("nested", "nested")] {
        let index = fs::read(fixtures.join("bintree").join(index).join("index.json"))?;
        let leaves = fs::read(fixtures.join("bintree/packed/leaves.bin"))?;
        fs::write(corpus.join(name), [(index.len() as u32).to_le_bytes().to_vec(), index, leaves].concat())?;
    }
    let corpus = fuzz.join("corpus/batches");
    fs::create_dir_all(&corpus)?;
    for entry in fs::read_dir(fixtures.join("batches"))? {
        let path = entry?.path();
        if let Some(name) = path.file_name().filter(|_| path.extension().is_some_and(|e| e == "qbatch")) {
            fs::copy(&path, corpus.join(name))?;
        }
    }
    datasets(&fixtures, &fuzz.join("corpus/datasets"))?;
    jobs(&fuzz.join("corpus/job"))
}

/// What the target writes to a folder: the kind, then files with their lengths, the last without.
fn datasets(fixtures: &Path, corpus: &Path) -> io::Result<()> {
    fs::create_dir_all(corpus)?;
    let all: [(u8, &str, &[&str]); 9] = [
        (0, "potree2/default", &["metadata.json", "hierarchy.bin", "", "octree.bin"]),
        (0, "potree2/brotli", &["metadata.json", "hierarchy.bin", "", "octree.bin"]),
        (1, "potree1/objects", &["cloud.js", "data/r/r.hrc", "", "data/r/r.bin"]),
        (1, "potree1/flat", &["cloud.js", "", "", "data/r.bin"]),
        (2, "bintree/files", &["index.json", "n00.bin", "n010.bin", "n011.bin"]),
        (3, "bintree/packed", &["index.json", "", "leaves.bin"]),
        (4, "batches", &["example.qbatch"]),
        (4, "batches", &["blocks.qbatch"]),
        (4, "batches", &["coarse.qbatch"]),
    ];
    for (kind, folder, names) in all {
        let mut input = vec![kind];
        for (i, name) in names.iter().enumerate() {
            let bytes = if name.is_empty() { Vec::new() } else { fs::read(fixtures.join(folder).join(name))? };
            if i + 1 < names.len() {
                input.extend((bytes.len() as u32).to_le_bytes());
            }
            input.extend(bytes);
        }
        fs::write(corpus.join(format!("{}-{}", folder.replace('/', "-"), names[names.len() - 1])), input)?;
    }
    Ok(())
}

/// Each kind of job, and each of its parts as it is, unless it is very long. The journal's head is of no use to another job: it names the scans.
fn jobs(corpus: &Path) -> io::Result<()> {
    fs::create_dir_all(corpus)?;
    for kind in 0..JOBS {
        let folder = tempfile::tempdir()?;
        let job = LeftJob::of(kind, folder.path(), 700);
        for (number, part) in job.parts().iter().enumerate() {
            let bytes = job.part(part);
            let Ok(length) = u16::try_from(bytes.len()) else { continue };
            let head = [&[kind as u8, number as u8][..], &length.to_le_bytes()].concat();
            fs::write(corpus.join(format!("{kind}-{number}")), [&head, bytes].concat())?;
        }
    }
    Ok(())
}
