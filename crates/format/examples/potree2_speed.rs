//! How fast a Potree 2.0 dataset is read, and what BROTLI costs and saves at several qualities.
//!
//!     cargo run --release -p pointmill-format --example potree2_speed -- FOLDER
//!
//! One thread; the best of five rounds, so the files are in the page cache. Seconds on the processor where the system
//! reports them (Linux), else on the clock. Encoding is timed on the DEFAULT records of all nodes of the dataset,
//! whatever its encoding.

use std::time::Instant;

use pointmill_format::potree2::{BrotliScratch, Dataset, encode_brotli};
use pointmill_format::{Attribute, Column, NodePoints, ReadError, with_column};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: potree2_speed FOLDER")?;
    let dataset = Dataset::open(folder)?;
    let nodes = dataset.read_hierarchy()?;
    let mut points = NodePoints::default();
    let mut count = 0;
    let seconds = best_of_5(|| {
        count = 0;
        for node in &nodes {
            dataset.read_points(node, &mut points)?;
            count += points.len();
        }
        Ok::<_, ReadError>(())
    })?;
    println!("{} nodes, {count} points, {} bytes", nodes.len(), dataset.octree_bytes());
    println!("read: {:.1} M points/s", count as f64 / seconds / 1e6);

    let stats = &dataset.metadata().attributes;
    let position = stats.iter().filter(|a| a.attribute.name == "position");
    let others = stats.iter().filter(|a| a.attribute.name != "position");
    let attributes: Vec<Attribute> = position.chain(others).map(|a| a.attribute.clone()).collect();
    let mut records = Vec::new();
    for node in &nodes {
        dataset.read_points(node, &mut points)?;
        records.push(to_records(&points, &attributes));
    }
    let (mut scratch, mut out) = (BrotliScratch::default(), Vec::new());
    for quality in [2, 4, 5, 6] {
        let seconds = best_of_5(|| {
            out.clear();
            records.iter().try_for_each(|r| encode_brotli(&attributes, r, quality, &mut scratch, &mut out))
        })?;
        let (rate, each) = (count as f64 / seconds / 1e6, out.len() as f64 / count as f64);
        println!("encode, quality {quality}: {rate:.2} M points/s, {each:.2} bytes per point");
    }
    Ok(())
}

fn best_of_5<E>(mut run: impl FnMut() -> Result<(), E>) -> Result<f64, E> {
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let (start, start_cpu) = (Instant::now(), cpu_seconds());
        run()?;
        let cpu = cpu_seconds().zip(start_cpu).map(|(end, start)| end - start);
        best = best.min(cpu.unwrap_or(start.elapsed().as_secs_f64()));
    }
    Ok(best)
}

/// Time that this thread spent on a processor.
fn cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    stat.split(' ').next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds / 1e9)
}

/// The points as DEFAULT records, `position` first.
fn to_records(points: &NodePoints, attributes: &[Attribute]) -> Vec<u8> {
    let mut records = Vec::new();
    for i in 0..points.len() {
        records.extend(points.quantized().unwrap_or_default().into_iter().flat_map(|axis| axis[i].to_le_bytes()));
        for (column, attribute) in points.columns().iter().zip(&attributes[1..]) {
            append_value(column, i * attribute.elements..(i + 1) * attribute.elements, &mut records);
        }
    }
    records
}

fn append_value(column: &Column, range: std::ops::Range<usize>, records: &mut Vec<u8>) {
    with_column!(column, values => records.extend(values[range].iter().flat_map(|v| v.to_le_bytes())));
}
