//! Puts the fixtures where the fuzzer looks for its first inputs: `corpus/<target>/`.

use std::fs;
use std::io;
use std::path::Path;

fn main() -> io::Result<()> {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR"));
    let fixtures = fuzz.join("../fixtures");
    for (target, folder, endings) in [
        ("las", "las", &["las", "laz"][..]),
        ("copc", "copc", &["laz"]),
        ("copc_validate", "copc", &["laz"]),
        ("e57", "e57", &["e57"]),
        ("ply", "rows", &["ply"]),
        ("pcd", "rows", &["pcd"]),
        ("text", "rows", &["xyz", "txt", "asc", "csv", "pts", "ptx", "off"]),
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
    Ok(())
}
