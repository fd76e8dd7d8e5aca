//! Points of a node in the caller's buffers.

use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pointmill_format::{Column, NodePoints, with_column};

use crate::about::{About, Colours};
use crate::axes::PmAxes;
use crate::border::{buffer, corner, fill, given, put};
use crate::colours::colour;
use crate::dataset::PmDataset;
use crate::decode::Decoder;
use crate::info::no_attribute;
use crate::status::{Fault, Outcome, PmStatus, guard};

/// Most vertices of a mesh whose indices have 16 bits, as engines count: what a window of pm_points_positions() may have.
pub const PM_MESH_VERTICES: usize = 65_000;

/// The points of one node, decoded. It lives on when its dataset is closed. Calls may come from several threads; they wait
/// for each other, so give each thread its own.
pub struct PmPoints(Mutex<Decoded>);

#[derive(Default)]
struct Decoded {
    decoder: Decoder,
    /// Of the dataset that the points are from.
    about: Option<Arc<About>>,
    axes: Option<PmAxes>,
    colours: Option<Colours>,
}

impl PmPoints {
    fn lock(&self) -> MutexGuard<'_, Decoded> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Decoded {
    fn points(&self) -> &NodePoints {
        &self.decoder.points
    }

    /// The window of `count` points from `first` on.
    fn window(&self, first: usize, count: usize) -> Outcome<std::ops::Range<usize>> {
        let points = self.points().len();
        let end = first.checked_add(count).filter(|end| *end <= points);
        let end = end.ok_or_else(|| {
            Fault::argument(format!("{count} points from {first} on were requested, there are {points}"))
        })?;
        Ok(first..end)
    }

    /// Positions of a window, in the caller's axes.
    fn positions(&self, window: std::ops::Range<usize>) -> impl Iterator<Item = [f64; 3]> + '_ {
        let axes = self.axes.unwrap_or(PmAxes::ZUp);
        window.filter_map(|i| self.points().world(i)).map(move |p| axes.outward(p))
    }

    /// A column, and the elements that a point has of it.
    fn column(&self, index: u32) -> Outcome<(&Column, &pointmill_format::Attribute)> {
        let columns = self.about.as_ref().map_or(&[][..], |about| &about.columns);
        let found = self.points().columns().get(index as usize).zip(columns.get(index as usize));
        let (column, about) = found.ok_or_else(|| no_attribute(index, columns.len()))?;
        Ok((column, &about.attribute))
    }
}

/// A place for decoded points, to be used for node after node: its memory is reused.
///
/// `*points` is the caller's and ends with pm_points_free(). Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_points_new(points: Option<&mut MaybeUninit<Option<Box<PmPoints>>>>) -> PmStatus {
    guard(|| put(points, "points", Some(Box::new(PmPoints(Mutex::default())))))
}

/// Ends a place for points. NULL does nothing. Ending it twice, or while another thread uses it, is an error that cannot be
/// detected.
#[unsafe(no_mangle)]
pub extern "C" fn pm_points_free(points: Option<Box<PmPoints>>) {
    guard(|| {
        drop(points);
        Ok(())
    });
}

/// Decodes the points of node `id` in place of those that are there; after an error there are none.
///
/// A node of an octree (a proxy: PM_STATUS_MISSING), a leaf of a binary tree (an inner node: PM_STATUS_UNSUPPORTED), or a
/// batch. `bits` of a position on each axis, for batches: 10, 20 or 30, or 0 for all that the file has; others ignore it.
///
/// `*count`: how many points there are; may be NULL. Reads from the disk; takes a lock on `points`, none on `dataset`.
#[unsafe(no_mangle)]
pub extern "C" fn pm_decode(
    dataset: Option<&PmDataset>,
    id: u32,
    bits: u32,
    points: Option<&PmPoints>,
    count: Option<&mut MaybeUninit<usize>>,
) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        let mut decoded = given(points, "points")?.lock();
        let result = decoded.decoder.decode(dataset, id, bits).and_then(|()| dataset.known_colours());
        match result {
            Ok(colours) => {
                decoded.about = Some(Arc::clone(&dataset.about));
                decoded.axes = Some(dataset.axes);
                decoded.colours = colours;
            }
            Err(fault) => {
                *decoded = Decoded::default();
                return Err(fault);
            }
        }
        let found = decoded.points().len();
        count.map_or(Ok(()), |count| put(Some(count), "count", found))
    })
}

/// `*count`: how many points there are.
#[unsafe(no_mangle)]
pub extern "C" fn pm_points_count(points: Option<&PmPoints>, count: Option<&mut MaybeUninit<usize>>) -> PmStatus {
    guard(|| put(count, "count", given(points, "points")?.lock().points().len()))
}

/// Positions of the `count` points from number `first` on, as stored: x, y, z in single precision **relative to `origin`**
/// (3 doubles, in the axes of the handle; NULL is 0, 0, 0), world units. The difference is computed in double precision
/// and then rounded, so with an origin near by (PmNode::center) nothing is lost that single precision can hold.
///
/// A mesh with at most PM_MESH_VERTICES vertices takes windows of as many points: `first` 0, then 65,000, …
///
/// `out` has room for `capacity` floats, 3 · `count` at least.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_points_positions(
    points: Option<&PmPoints>,
    first: usize,
    count: usize,
    origin: *const f64,
    out: *mut f32,
    capacity: usize,
) -> PmStatus {
    guard(|| {
        let decoded = given(points, "points")?.lock();
        let window = decoded.window(first, count)?;
        // SAFETY: the caller's promise, for both
        let (origin, out) = unsafe { (corner(origin, "origin")?, buffer(out, capacity, "out")?) };
        let origin = origin.unwrap_or_default();
        let relative = |p: [f64; 3]| [0, 1, 2].map(|a| (p[a] - origin[a]) as f32);
        fill(out, 3 * count, decoded.positions(window).flat_map(relative), "out")
    })
}

/// As pm_points_positions(), in double precision and not relative to anything: exactly what was decoded.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_points_world(
    points: Option<&PmPoints>,
    first: usize,
    count: usize,
    out: *mut f64,
    capacity: usize,
) -> PmStatus {
    guard(|| {
        let decoded = given(points, "points")?.lock();
        let window = decoded.window(first, count)?;
        // SAFETY: the caller's promise
        let out = unsafe { buffer(out, capacity, "out") }?;
        fill(out, 3 * count, decoded.positions(window).flatten(), "out")
    })
}

/// Colours of the `count` points from number `first` on: red, green, blue and alpha (255), a byte each. PM_STATUS_MISSING
/// if the dataset has none (PmInfo::has_colours).
///
/// Colours of 16 bits become the nearest of 8 (v · 255 / 65535, rounded), unless no value of the dataset, or of a sample
/// where it does not say its range, is above 255: then they are 8 bits already.
///
/// `out` has room for `capacity` bytes, 4 · `count` at least.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_points_colours(
    points: Option<&PmPoints>,
    first: usize,
    count: usize,
    out: *mut u8,
    capacity: usize,
) -> PmStatus {
    guard(|| {
        let decoded = given(points, "points")?.lock();
        let window = decoded.window(first, count)?;
        // SAFETY: the caller's promise
        let out = unsafe { buffer(out, capacity, "out") }?;
        if count == 0 {
            return Ok(());
        }
        let missing = || Fault::new(PmStatus::Missing, "the dataset has no colours");
        let colours = decoded.colours.ok_or_else(missing)?;
        let (_, attribute) = decoded.column(colours.column as u32)?;
        let of = |i| colour(decoded.points(), colours, attribute.elements, i).unwrap_or([0, 0, 0, 255]);
        fill(out, 4 * count, window.flat_map(of), "out")
    })
}

/// Raw values of attribute `index` (as pm_attribute() counts) of the `count` points from number `first` on: little-endian
/// elements of PmAttribute::element_type, those of a point side by side.
///
/// `out` has room for `capacity` bytes, PmAttribute::size · `count` at least; it need not be aligned.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_points_attribute(
    points: Option<&PmPoints>,
    index: u32,
    first: usize,
    count: usize,
    out: *mut c_void,
    capacity: usize,
) -> PmStatus {
    guard(|| {
        let decoded = given(points, "points")?.lock();
        let (column, attribute) = decoded.column(index)?;
        let window = decoded.window(first, count)?;
        // SAFETY: the caller's promise
        let out = unsafe { buffer(out.cast::<u8>(), capacity, "out") }?;
        let values = window.start * attribute.elements..window.end * attribute.elements;
        with_column!(column, v => {
            let bytes = v.get(values).unwrap_or(&[]).iter().flat_map(|v| v.to_le_bytes());
            fill(out, count * attribute.size(), bytes, "out")
        })
    })
}

/// As pm_points_attribute(), as doubles, and as they are meant: raw · scale + offset. Whole numbers above 2^53 are rounded.
///
/// `out` has room for `capacity` doubles, PmAttribute::elements · `count` at least.
#[unsafe(no_mangle)]
#[allow(clippy::unnecessary_cast)] // of doubles
pub unsafe extern "C" fn pm_points_values(
    points: Option<&PmPoints>,
    index: u32,
    first: usize,
    count: usize,
    out: *mut f64,
    capacity: usize,
) -> PmStatus {
    guard(|| {
        let decoded = given(points, "points")?.lock();
        let (column, attribute) = decoded.column(index)?;
        let window = decoded.window(first, count)?;
        // SAFETY: the caller's promise
        let out = unsafe { buffer(out, capacity, "out") }?;
        let values = window.start * attribute.elements..window.end * attribute.elements;
        let scaling = attribute.scale.iter().zip(&attribute.offset).cycle();
        with_column!(column, v => {
            let raw = v.get(values).unwrap_or(&[]).iter().map(|v| *v as f64);
            let meant = raw.zip(scaling).map(|(raw, (scale, offset))| raw * scale + offset);
            fill(out, count * attribute.elements, meant, "out")
        })
    })
}
