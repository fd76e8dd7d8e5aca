//! Writes a cloud that fits memory, plainly: the reference that other writers are compared with.

use std::collections::HashMap;
use std::io::{Seek, SeekFrom, Write};

use crate::{Aabb, Attribute, Lattice, WriteError};

use super::describe::{ColourSource, Description};
use super::{
    Averaging, BATCH_POINTS, ColourSum, EncodedBatch, ErrorSums, Grid, HEADER_BYTES, Header, LOD_LEVELS, Layout, Part,
    PointSection, Precision, Section, align, colour_word, encode_batch, le_bytes, lod_of, rgb_of,
};

/// Points in memory, in any order.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Cloud<'a> {
    /// world = X · scale + offset.
    pub lattice: Lattice,
    /// Integers on the lattice: x, y, z, equally long.
    pub positions: [&'a [i64]; 3],
    /// `r | g<<8 | b<<16`, one per point; the top byte is ignored ([`super::colour_word`], [`super::eight_bit`]).
    pub colours: &'a [u32],
    /// Extra attributes with their raw values, little-endian, [`Attribute::size`] bytes per point.
    pub attributes: &'a [(Attribute, &'a [u8])],
}

impl<'a> Cloud<'a> {
    /// A cloud without extra attributes; [`Self::attributes`] can be set. `colours` are as long as each of `positions`.
    #[must_use]
    pub const fn new(lattice: Lattice, positions: [&'a [i64]; 3], colours: &'a [u32]) -> Self {
        Self { lattice, positions, colours, attributes: &[] }
    }
}

/// How a file is written.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct WriteOptions {
    /// Side of the cells of level 0, world units, > 0.
    pub cell: f64,
    /// The planes to write; `None`: those that the lattice needs ([`Precision::for_steps`]).
    pub precision: Option<Precision>,
    /// The description of the cloud; [`write()`] fills in attributes and errors.
    pub description: Description,
}

impl WriteOptions {
    /// Cells of 1 unit, as many planes as the lattice needs, colours from the source.
    #[must_use]
    pub fn new(lattice: Lattice) -> Self {
        let description = Description { colour: ColourSource::Rgb, ..Description::new(lattice) };
        Self { cell: 1.0, precision: None, description }
    }

    /// Sets [`Self::cell`].
    #[must_use]
    pub fn cell(mut self, cell: f64) -> Self {
        self.cell = cell;
        self
    }

    /// Sets [`Self::precision`].
    #[must_use]
    pub fn precision(mut self, precision: Precision) -> Self {
        self.precision = Some(precision);
        self
    }

    /// Sets [`Self::description`].
    #[must_use]
    pub fn description(mut self, description: Description) -> Self {
        self.description = description;
        self
    }
}

/// What was written.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Written {
    /// The fields of the header.
    pub header: Header,
    /// The description, with attributes and errors.
    pub description: Description,
    /// Points of each level, 0–3.
    pub lod_points: [u64; 4],
    /// Bytes of the file.
    pub bytes: u64,
}

/// Writes a complete file to `out`, from its position 0 on.
///
/// The same points in another order give the same bytes.
///
/// ```
/// use pointmill_format::{Lattice, batches::{Batches, Cloud, AlignedBytes, WriteOptions, write}};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let lattice = Lattice { scale: [0.001; 3], offset: [500_000.0, 5_400_000.0, 0.0] };
/// let (x, y, z) = ([0, 250, 1500], [0, 10, 20], [7, 7, 7]);
/// let cloud = Cloud::new(lattice, [&x, &y, &z], &[0xff, 0xff00, 0xff_0000]);
/// let mut file = std::io::Cursor::new(Vec::new());
/// write(&mut file, &cloud, &WriteOptions::new(lattice))?;
///
/// let batches = Batches::from_bytes(AlignedBytes::from(file.get_ref().as_slice()), "points.qbatch")?;
/// assert_eq!((batches.header().points, batches.records()[0].points), (3, 3));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A cloud or options that the format cannot hold; the disk.
pub fn write(out: &mut (impl Write + Seek), cloud: &Cloud, options: &WriteOptions) -> Result<Written, WriteError> {
    check(cloud)?;
    let world: Vec<[f64; 3]> = (0..cloud.colours.len()).map(|i| cloud.world(i)).collect();
    let mut tight = Aabb::EMPTY;
    world.iter().for_each(|p| tight.grow(*p));
    let grid = Grid::new(&tight, options.cell)?;
    let relative: Vec<[f64; 3]> = world.iter().map(|p| grid.relative(*p)).collect();
    let cells: Vec<[f64; 3]> = relative.iter().map(|r| grid.cells(*r)).collect();

    let order = order(cloud, &grid, &cells);
    let colours = levels_of_detail(cloud, &cells, &order);

    let attributes: Vec<Attribute> = cloud.attributes.iter().map(|(a, _)| a.clone()).collect();
    let points = order.len() as u64;
    let mut layout = Layout::new(points, &attributes, options.precision.unwrap_or(Precision::Thirty))?;
    let (batches, errors) = encode(&layout, &relative, &order)?;
    if options.precision.is_none() {
        let records = batches.iter().map(|b| &b.record);
        layout = layout.with_precision(Precision::for_steps(records, cloud.lattice.scale));
    }
    let stored: Vec<usize> = (0..layout.batches).flat_map(|slot| members(&layout, slot, &order)).copied().collect();
    let originals: Vec<u32> = stored
        .iter()
        .enumerate()
        .filter(|(_, i)| rgb_of(colours[**i]) != rgb_of(cloud.colours[**i]))
        .flat_map(|(index, i)| [index as u32, cloud.word(*i)])
        .collect();
    let count = originals.len() as u64 / 2;
    let mut lod_points = [0; 4];
    colours.iter().for_each(|word| lod_points[usize::from(lod_of(*word)).min(3)] += 1);
    let mut description = options.description.clone();
    description.lattice = cloud.lattice.into();
    description.errors = errors.figures();
    let averaging = Averaging::of(count, true);
    let finish = layout.finish(&grid, &tight, averaging, description)?;

    let mut file = InOrder { out, at: 0 };
    file.out.seek(SeekFrom::Start(0))?;
    file.put(&finish.header_bytes)?;
    file.begin(layout.records)?;
    let mut records: Vec<_> = batches.iter().map(|b| b.record).collect();
    records.sort_by_key(|r| r.first_point);
    for r in &records {
        file.put(&r.min.map(f32::to_le_bytes).concat())?;
        file.put(&r.first_point.to_le_bytes())?;
        file.put(&r.max.map(f32::to_le_bytes).concat())?;
        file.put(&r.points.to_le_bytes())?;
    }
    let slots = || (0..layout.batches).map(|slot| &batches[layout.slot(slot).0 as usize]);
    for PointSection { part, section, .. } in layout.sections() {
        file.begin(section)?;
        match part {
            Part::Hi10 => slots().try_for_each(|b| file.put(&le_bytes(&b.hi10)))?,
            Part::Mid10 => slots().try_for_each(|b| file.put(&le_bytes(&b.mid10)))?,
            Part::Lo10 => slots().try_for_each(|b| file.put(&le_bytes(&b.lo10)))?,
            Part::Colour => stored.iter().try_for_each(|i| file.put(&colours[*i].to_le_bytes()))?,
            Part::Attribute(a) => {
                let (attribute, values) = &cloud.attributes[a];
                let size = attribute.size();
                stored.iter().try_for_each(|i| file.put(&values[i * size..][..size]))?;
            }
        }
    }
    if let Some(bytes) = averaging.originals_bytes() {
        file.begin(Section { offset: layout.originals, bytes })?;
        file.put(&count.to_le_bytes())?;
        file.put(&le_bytes(&originals))?;
    }
    file.begin(Section { offset: finish.description_offset, bytes: finish.header.description_bytes })?;
    file.put(&finish.description_bytes)?;
    file.out.flush()?;
    Ok(Written { header: finish.header, description: finish.description, lod_points, bytes: file.at })
}

impl Cloud<'_> {
    fn quantized(&self, i: usize) -> [i64; 3] {
        self.positions.map(|p| p[i])
    }

    fn world(&self, i: usize) -> [f64; 3] {
        self.lattice.world(self.quantized(i))
    }

    fn word(&self, i: usize) -> u32 {
        colour_word(rgb_of(self.colours[i]), 0)
    }

    /// The attributes' bytes of a point, one behind the other.
    fn extra(&self, i: usize) -> impl Iterator<Item = &u8> {
        self.attributes.iter().flat_map(move |(a, values)| &values[i * a.size()..][..a.size()])
    }
}

fn check(cloud: &Cloud) -> Result<(), WriteError> {
    let points = cloud.colours.len();
    if !cloud.lattice.is_valid() {
        let Lattice { scale, offset } = cloud.lattice;
        return Err(WriteError::input(format!("the scales {scale:?} and offsets {offset:?} are those of no lattice")));
    }
    if cloud.positions.iter().any(|p| p.len() != points) {
        return Err(WriteError::input("positions and colours are not equally many"));
    }
    for (attribute, values) in cloud.attributes {
        if values.len() != points * attribute.size() {
            let (name, found, expected) = (&attribute.name, values.len(), points * attribute.size());
            return Err(WriteError::input(format!("attribute \"{name}\" has {found} bytes instead of {expected}")));
        }
    }
    Ok(())
}

/// Points in the order of the format (§3.1).
fn order(cloud: &Cloud, grid: &Grid, cells: &[[f64; 3]]) -> Vec<usize> {
    let key = |i: usize| (grid.morton_code(cells[i]), cloud.quantized(i), cloud.word(i));
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by(|a, b| key(*a).cmp(&key(*b)).then_with(|| cloud.extra(*a).cmp(cloud.extra(*b))));
    order
}

/// The colour word of each point of the input: level of detail, and mean colour where it is below 3 (§4).
fn levels_of_detail(cloud: &Cloud, cells: &[[f64; 3]], order: &[usize]) -> Vec<u32> {
    /// What is known of a cell.
    struct Cell {
        candidate: usize,
        distance_squared: f64,
        colours: ColourSum,
    }
    let mut words: Vec<u32> =
        (0..cells.len()).map(|i| colour_word(rgb_of(cloud.colours[i]), LOD_LEVELS as u8)).collect();
    for level in (0..LOD_LEVELS).rev() {
        let mut occupied: HashMap<[u32; 3], Cell> = HashMap::new();
        for &i in order {
            let distance_squared = Grid::centre_distance_squared(cells[i], level);
            let cell = occupied.entry(Grid::lod_cell(cells[i], level)).or_insert(Cell {
                candidate: i,
                distance_squared,
                colours: ColourSum::default(),
            });
            if distance_squared < cell.distance_squared {
                (cell.candidate, cell.distance_squared) = (i, distance_squared);
            }
            cell.colours.add(cloud.colours[i]);
        }
        // a point that is a candidate again, of a coarser cell, takes that one's colour
        for cell in occupied.values() {
            words[cell.candidate] = colour_word(cell.colours.mean(), level as u8);
        }
    }
    words
}

/// All batches in Morton order, and the errors of their points.
fn encode(
    layout: &Layout,
    relative: &[[f64; 3]],
    order: &[usize],
) -> Result<(Vec<EncodedBatch>, ErrorSums), WriteError> {
    let mut errors = ErrorSums::default();
    let mut batches = Vec::new();
    for (m, members) in (0..).zip(order.chunks(BATCH_POINTS as usize)) {
        let [x, y, z]: [Vec<f64>; 3] = std::array::from_fn(|a| members.iter().map(|i| relative[*i][a]).collect());
        let mut batch = EncodedBatch::default();
        encode_batch(layout.slot(m).1, [&x, &y, &z], &mut batch)?;
        errors.merge(&batch.errors);
        batches.push(batch);
    }
    Ok((batches, errors))
}

/// The points of a slot, in storage order.
fn members<'a>(layout: &Layout, slot: u32, order: &'a [usize]) -> &'a [usize] {
    let batch = layout.slot(slot).0 as usize; // the exchange undoes itself
    order.chunks(BATCH_POINTS as usize).nth(batch).unwrap_or(&[])
}

/// A file that is written from its start to its end.
struct InOrder<'a, W> {
    out: &'a mut W,
    at: u64,
}

impl<W: Write + Seek> InOrder<'_, W> {
    fn put(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        self.out.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    /// Zeros up to the section.
    fn begin(&mut self, section: Section) -> Result<(), WriteError> {
        debug_assert_eq!(align(self.at), section.offset);
        let gap = section.offset.saturating_sub(self.at).min(HEADER_BYTES);
        self.put(&[0; HEADER_BYTES as usize][..gap as usize])
    }
}
