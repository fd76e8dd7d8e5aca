//! Encodes the points of LAS and LAZ files as records again and prints million points per second of one thread, for columns
//! as batches have them and for records of a store. `--laz`: compressed, too.
//! `cargo run --release --features laz --example las_write_speed -- FILE... [--laz]`

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use pointmill_format::scan::las;
use pointmill_format::scan::las::write::{ChunkEncoder, RecordLayout, StridedColumn, Tally};
use pointmill_format::{Changes, Positions, Scratch, Wanted};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let compresses = std::env::args().any(|a| a == "--laz");
    for path in std::env::args().skip(1).filter(|a| !a.starts_with("--")) {
        let scan = las::open(&path)?;
        let attributes = &scan.info().attributes;
        let layout = RecordLayout::choose(attributes, &[0, 1, 2, 3, 6, 7, 8])?;
        let (len, encoder) = (layout.record_len(), ChunkEncoder::new(&layout)?);
        let (mut scratch, mut tally, mut points) = (Scratch::default(), Tally::default(), 0);
        let (mut records, mut again) = (Vec::new(), Vec::new());
        let mut times = [Duration::ZERO; 4];
        let mut changes = vec![Changes::default(); attributes.len()];
        for piece in 0..scan.pieces().len() {
            scan.decode(piece, &Wanted::all(scan.info()), &mut scratch, &mut |batch| {
                let Positions::Quantized(axes) = &batch.positions else { return ControlFlow::Break(()) };
                let positions = axes.each_ref().map(|axis| StridedColumn::of_axis(axis));
                let columns = batch.columns.iter().zip(attributes.iter());
                let columns: Vec<_> = columns.map(|(c, a)| Some(StridedColumn::of(c, a.elements))).collect();
                records.resize(batch.len() * len, 0);
                let start = Instant::now();
                layout.put(&positions, &columns, &mut records, &mut changes);
                times[0] += start.elapsed();
                let start = Instant::now();
                tally.add(&layout, &records);
                times[1] += start.elapsed();
                // the same from rows: the fields of bits as bytes, as a store has them
                again.resize(records.len(), 0);
                let positions = [0, 4, 8]
                    .map(|at| StridedColumn::new(&records, at, len, pointmill_format::AttributeType::Int32, 1));
                let views: Vec<_> = attributes
                    .iter()
                    .map(|a| Some(StridedColumn::new(&records, len - a.size(), len, a.ty, a.elements)))
                    .collect();
                let start = Instant::now();
                layout.put(&positions, &views, &mut again, &mut vec![Changes::default(); attributes.len()]);
                times[2] += start.elapsed();
                if compresses {
                    let start = Instant::now();
                    if encoder.encode(&records).is_err() {
                        return ControlFlow::Break(());
                    }
                    times[3] += start.elapsed();
                }
                points += batch.len();
                ControlFlow::Continue(())
            })?;
        }
        let [columns, tally, rows, laz] = times.map(|time| points as f64 / time.as_secs_f64() / 1e6);
        println!(
            "{path}: {points} points, format {}, {len} bytes: {columns:.0} M/s from columns, {rows:.0} M/s from rows, \
             {tally:.0} M/s counted, {laz:.2} M/s compressed",
            layout.point_format()
        );
    }
    Ok(())
}
