//! How fast batches are encoded and decoded, and what zstd saves and costs on a file of quantised batches.
//!
//!     cargo run --release -p pointmill-format --features zstd --example batches_speed -- points.qbatch
//!
//! One thread; the best of three rounds in memory. Encoding is timed on the decoded positions. Ratios are for each section:
//! compressed bytes of raw bytes.

use std::io::Cursor;
use std::time::Instant;

use pointmill_format::NodePoints;
use pointmill_format::batches::{
    AlignedBytes, BatchScratch, Batches, BlockScratch, DEFAULT_BATCHES_PER_BLOCK, EncodedBatch, Part, Precision,
    compress, encode_batch,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: batches_speed FILE")?;
    let batches = Batches::open(&path)?;
    let header = batches.header();
    let millions = header.points as f64 / 1e6;
    println!("{} points, {} batches, {} bits", header.points, header.batches, header.precision().bits());

    let (mut scratch, mut points) = (BatchScratch::default(), NodePoints::default());
    for precision in Precision::ALL.into_iter().filter(|p| *p <= header.precision()) {
        let mut read = |slot| batches.read_batch(slot, precision, &mut scratch, &mut points);
        let seconds = best_of_3(|| (0..header.batches).try_for_each(&mut read))?;
        println!("decode {} bits: {:.0} M points/s", precision.bits(), millions / seconds);
    }

    let mut axes: Vec<[Vec<f64>; 3]> = Vec::new();
    for slot in 0..header.batches {
        batches.read_batch(slot, header.precision(), &mut scratch, &mut points)?;
        let relative = (0..points.len()).filter_map(|i| Some(header.grid.relative(points.world(i)?)));
        axes.push(std::array::from_fn(|a| relative.clone().map(|p| p[a]).collect()));
    }
    let mut encoded = EncodedBatch::default();
    let seconds = best_of_3(|| axes.iter().try_for_each(|[x, y, z]| encode_batch(0, [x, y, z], &mut encoded)))?;
    println!("encode: {:.1} M points/s", millions / seconds);

    let mut parts = vec![("hi10".to_owned(), Part::Hi10), ("colour".to_owned(), Part::Colour)];
    parts.extend(batches.attributes().enumerate().map(|(i, a)| (a.name.clone(), Part::Attribute(i))));
    parts.extend([("mid10".to_owned(), Part::Mid10), ("lo10".to_owned(), Part::Lo10)]);
    parts.retain(|(_, part)| batches.section_bytes(*part).is_ok());
    for level in [1, 3, 9] {
        let mut file = Cursor::new(Vec::new());
        let start = Instant::now();
        compress(&batches, &mut file, level, DEFAULT_BATCHES_PER_BLOCK)?;
        let packing = millions / start.elapsed().as_secs_f64();
        let packed = Batches::from_bytes(AlignedBytes::from(file.get_ref().as_slice()), &path)?;
        let mut scratch = BlockScratch::default();
        let seconds = best_of_3(|| {
            let mut all = parts.iter().flat_map(|(_, part)| (0..header.batches).map(move |slot| (*part, slot)));
            all.try_for_each(|(part, slot)| packed.batch(part, slot, &mut scratch).map(|_| ()))
        })?;
        let bytes = file.get_ref().len() as f64 / header.points as f64;
        print!(
            "zstd {level}: {bytes:.2} bytes per point, pack {packing:.1}, unpack {:.0} M points/s;",
            millions / seconds
        );
        for (name, part) in &parts {
            let ratio = packed.section_bytes(*part)?.len() as f64 / batches.section_bytes(*part)?.len().max(1) as f64;
            print!(" {name} {ratio:.2}");
        }
        println!();
    }
    Ok(())
}

fn best_of_3<E>(mut run: impl FnMut() -> Result<(), E>) -> Result<f64, E> {
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let start = Instant::now();
        run()?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}
