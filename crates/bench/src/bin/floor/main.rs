//! The floor: what a conversion costs that does nothing but read, sort and write.
//!
//! Reads a LAS or LAZ file with the decoder that pointmill uses, makes records of the attributes and size that potree2
//! has by default, puts all of them in Morton order, and writes them to one file. No sampling, no tree, no statistics,
//! no checksums, no limit of memory: what a converter costs above this is sampling and overhead.
//!
//! ```sh
//! cargo run --release -p pointmill-bench --bin floor -- scan.las sorted.bin 2
//! ```

mod cells;
mod order;

use std::fs::File;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use pointmill_format::scan::las;
use pointmill_format::{Scan, Scratch, Wanted, bytes};

use cells::{Grid, Result, Store};
use order::Sorter;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, threads] = &args[..] else { return Err("arguments: INPUT OUTPUT THREADS".into()) };
    let points = run(Path::new(input), Path::new(output), threads.parse()?)?;
    println!("{points} points");
    Ok(())
}

/// Points that were written.
fn run(input: &Path, output: &Path, threads: usize) -> Result<u64> {
    let scan = las::open(input)?;
    let grid = Grid::new(scan.info())?;
    let stores = read(&*scan, &grid, threads)?;
    let (points, declared) = (stores.iter().map(|store| store.points).sum(), scan.info().points_declared);
    if points != declared {
        return Err(format!("{points} points were read, the header declares {declared}").into());
    }
    let file = File::create(output)?;
    let bytes = write(&grid, &stores, &file, threads)?;
    if bytes != points * grid.record_len as u64 || file.metadata()?.len() != bytes {
        return Err(format!("{bytes} bytes were written for {points} points").into());
    }
    Ok(points)
}

/// Every point as a record in its cell; a store for each thread.
fn read(scan: &dyn Scan, grid: &Grid, threads: usize) -> Result<Vec<Store>> {
    let (wanted, next) = (Wanted::all(scan.info()), AtomicUsize::new(0));
    on_threads(threads, || {
        let (mut store, mut scratch) = (Store::new(grid), Scratch::default());
        loop {
            // two at once, as the converter reads
            let first = next.fetch_add(2, Ordering::Relaxed);
            if first >= scan.pieces().len() {
                return Ok(store);
            }
            for piece in first..scan.pieces().len().min(first + 2) {
                scratch.next_piece = (piece == first).then_some(piece + 1);
                let mut added = Ok(());
                scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                    added = store.add(grid, batch);
                    if added.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
                })?;
                added?;
            }
        }
    })
}

/// Writes the cells behind one another, each in Morton order; returns the bytes.
fn write(grid: &Grid, stores: &[Store], file: &File, threads: usize) -> Result<u64> {
    let (mut end, mut cells) = (0, Vec::new());
    for cell in 0..grid.cells() {
        let bytes = stores.iter().flat_map(|store| store.blocks(cell)).map(|block| block.len() as u64).sum::<u64>();
        if bytes > 0 {
            cells.push((cell, end));
        }
        end += bytes;
    }
    let next = AtomicUsize::new(0);
    on_threads(threads, || {
        let mut sorter = Sorter::default();
        while let Some((cell, at)) = cells.get(next.fetch_add(1, Ordering::Relaxed)) {
            let blocks: Vec<&[u8]> = stores.iter().flat_map(|store| store.blocks(*cell)).collect();
            let mut at = *at;
            sorter.records_in_order(grid, &blocks, |records| {
                bytes::write_all_at(file, records, at)?;
                at += records.len() as u64;
                Ok(())
            })?;
        }
        Ok(())
    })?;
    Ok(end)
}

/// What `work` returns on each of so many threads.
fn on_threads<T: Send>(threads: usize, work: impl Fn() -> Result<T> + Sync) -> Result<Vec<T>> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(&work)).collect();
        threads.into_iter().map(|thread| thread.join().map_err(|_| "a thread died")?).collect()
    })
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use pointmill_bench::las_file;
    use pointmill_bench::las_layout::{self, LasLayout};
    use pointmill_bench::scene::Scene;

    use super::*;

    const POINTS: u64 = 150_000; // 16 cells and more
    const LEN: usize = 38;

    fn scene(dir: &Path, scene: Scene, ending: &str) -> PathBuf {
        let path = dir.join(format!("{}.{ending}", scene.name()));
        las_file::write(scene, LasLayout::COLOUR, POINTS, 7, &path).unwrap();
        path
    }

    /// Bit by bit, of a record.
    fn code(record: &[u8]) -> u64 {
        let axis = |a: usize| u32::from_le_bytes(record[4 * a..4 * a + 4].try_into().unwrap());
        (0..63).map(|bit| u64::from(axis(bit % 3) >> (bit / 3) & 1) << bit).sum()
    }

    /// The points of a LAS file as they stand there, as records: the position from the least one on, the attributes in
    /// the order of potree2.
    fn expected(las: &Path) -> Vec<Vec<u8>> {
        let bytes = std::fs::read(las).unwrap();
        let points: Vec<&[u8]> = bytes[227..].chunks(las_layout::RECORD_LEN).collect();
        let axis = |point: &[u8], a: usize| i32::from_le_bytes(point[4 * a..4 * a + 4].try_into().unwrap());
        let least = [0, 1, 2].map(|a| points.iter().map(|point| axis(point, a)).min().unwrap());
        let record = |point: &&[u8]| {
            let position = [0, 1, 2].map(|a| (axis(point, a) - least[a]).to_le_bytes());
            let (flags, class) = (point[14], point[15]);
            let mut record = [position.as_flattened(), &point[28..34], &point[12..14]].concat();
            record.extend([flags & 7, flags >> 3 & 7, class >> 5, class & 31]);
            record.extend(&point[16..28]); // angle, user data, source, GPS time
            record.extend([flags >> 6 & 1, flags >> 7]);
            record
        };
        points.iter().map(record).collect()
    }

    #[test]
    fn every_record_is_written_once_in_morton_order_for_any_number_of_threads() {
        let dir = tempfile::tempdir().unwrap();
        for (kind, ending) in [(Scene::Aerial, "las"), (Scene::Terrestrial, "laz")] {
            let mut expected = expected(&scene(dir.path(), kind, "las"));
            let input = scene(dir.path(), kind, ending);
            expected.sort();
            for threads in [1, 3] {
                let output = dir.path().join("sorted.bin");
                assert_eq!(run(&input, &output, threads).unwrap(), POINTS);
                let bytes = std::fs::read(&output).unwrap();
                let mut records: Vec<&[u8]> = bytes.chunks(LEN).collect();
                assert!(records.is_sorted_by_key(|record| code(record)));
                records.sort();
                assert!(records == expected, "{}, {threads} threads", kind.name());
            }
        }
    }

    #[test]
    fn a_header_that_promises_other_points_than_there_are_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let input = scene(dir.path(), Scene::Aerial, "las");
        let whole = std::fs::read(&input).unwrap();
        let output = dir.path().join("sorted.bin");
        let refused = |at: usize, bytes: &[u8], word: &str| {
            let mut file = whole.clone();
            file[at..at + bytes.len()].copy_from_slice(bytes);
            std::fs::write(&input, file).unwrap();
            let error = run(&input, &output, 2).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        };
        refused(107, &(POINTS as u32 + 1).to_le_bytes(), "150001"); // the number of points
        refused(187, &476_010f64.to_le_bytes(), "outside"); // the least x
    }
}
