//! A LAS or LAZ file as quantised batches, in memory: the shortest use of the writer. Intensity and class come along.
//!
//!     cargo run --release -p pointmill-format --features las --example batches_from_las -- scan.laz points.qbatch [CELL]
//!
//! Clouds beyond the memory, filters and reports are the business of `pointmill convert --to batches`.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::ops::ControlFlow;

use pointmill_format::batches::{Cloud, WriteOptions, colour_word, eight_bit, write};
use pointmill_format::scan::las;
use pointmill_format::{Attribute, Column, Positions, Scratch, Wanted};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (input, output, cell) = match args.as_slice() {
        [input, output] => (input, output, 1.0),
        [input, output, cell] => (input, output, cell.parse()?),
        _ => return Err("usage: batches_from_las INPUT OUTPUT [CELL]".into()),
    };
    let scan = las::open(input)?;
    let info = scan.info();
    let lattice = info.lattice.ok_or("the scan has no lattice")?;
    let find = |name: &str| info.attributes.iter().position(|a| a.name == name);
    let (rgb, intensity, class) = (find("rgb"), find("intensity"), find("classification"));

    let mut positions: [Vec<i64>; 3] = Default::default();
    let (mut channels, mut intensities, mut classes) = (Vec::new(), Vec::new(), Vec::new());
    let mut scratch = Scratch::default();
    for piece in 0..scan.pieces().len() {
        scan.decode(piece, &Wanted::all(info), &mut scratch, &mut |batch| {
            if let Positions::Quantized(xyz) = &batch.positions {
                positions.iter_mut().zip(xyz).for_each(|(all, xyz)| all.extend(xyz.iter().map(|v| i64::from(*v))));
            }
            let column = |i: Option<usize>| i.map(|i| &batch.columns[i]);
            if let Some(Column::UInt16(v)) = column(rgb) {
                channels.extend_from_slice(v);
            }
            if let Some(Column::UInt16(v)) = column(intensity) {
                intensities.extend(v.iter().flat_map(|v| v.to_le_bytes()));
            }
            if let Some(Column::UInt8(v)) = column(class) {
                classes.extend_from_slice(v);
            }
            ControlFlow::Continue(())
        })?;
    }
    // many files keep 8 bits in the 16
    let deep = channels.iter().any(|v| *v > 255);
    let eight = |v: u16| if deep { eight_bit(v) } else { v as u8 };
    let (rgb, _) = channels.as_chunks::<3>();
    let mut colours: Vec<u32> = rgb.iter().map(|c| colour_word(c.map(eight), 0)).collect();
    colours.resize(positions[0].len(), colour_word([255; 3], 0));

    let columns = [(intensity, &intensities), (class, &classes)];
    let attributes: Vec<(Attribute, &[u8])> =
        columns.iter().filter_map(|(i, values)| i.map(|i| (info.attributes[i].clone(), values.as_slice()))).collect();
    let mut cloud = Cloud::new(lattice, [&positions[0], &positions[1], &positions[2]], &colours);
    cloud.attributes = &attributes;
    let options = WriteOptions::new(lattice).cell(cell);
    let written = write(&mut BufWriter::new(File::create(output)?), &cloud, &options)?;
    let (header, bits) = (&written.header, written.header.precision().bits());
    println!("{} points in {} batches, {bits} bits, {} bytes", header.points, header.batches, written.bytes);
    println!("points of levels 0 to 3: {:?}", written.lod_points);
    println!("errors: {}", serde_json::to_string(&written.description.errors)?);
    Ok(())
}
