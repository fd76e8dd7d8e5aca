//! Draws all units of a source on all threads.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

use pointmill_format::Positions;

use crate::canvas::Canvas;
use crate::colours::Paint;
use crate::projection::Frame;
use crate::raster::Sizes;
use crate::sources::{Buffers, Points, Source, Unit, UnitSize};
use crate::{Camera, Picture, RenderError, Size, Style, boxes, workers};

/// Up to that many points stay in memory for a second pass; more are read again.
const KEPT_POINTS: u64 = 4 << 20;

/// A point this many pixels outside of the picture does not reach into it.
const BESIDE: f64 = 34.0;

/// Points of a unit that may be seen.
#[derive(Debug, Default)]
struct Block {
    /// Right, up and depth from the eye, world units.
    views: Vec<[f32; 3]>,
    colours: Vec<u32>,
    /// World units, of each point; empty if they do not differ.
    sizes: Vec<f32>,
}

/// What a thread keeps.
#[derive(Default)]
struct State {
    buffers: Buffers,
    block: Block,
    colours: Vec<u32>,
}

/// The picture of a source.
///
/// # Errors
/// A camera that cannot be used, an attribute that is not there, points that cannot be read.
pub(crate) fn draw(
    source: &dyn Source,
    camera: &Camera,
    size: Size,
    style: &Style,
    threads: usize,
) -> Result<Picture, RenderError> {
    let canvas = Canvas::new(size, camera, style)?;
    let paint = Paint::new(style.colour, source)?;
    let units: Vec<Unit> = (0..source.len()).map(|i| source.unit(i)).collect();
    let total = units.iter().fold(0u64, |sum, unit| sum.saturating_add(unit.points));
    let is_kept = style.is_averaged && total <= KEPT_POINTS;
    let kept = if is_kept { units.iter().map(|_| Mutex::new(Vec::new())).collect() } else { Vec::new() };
    let mut drawing = Drawing { source, canvas, paint, units, kept, points: 0.into(), bytes: 0.into() };
    workers::for_each(drawing.units.len(), threads, |unit, state| drawing.first(unit, state))?;
    if drawing.canvas.next_pass() {
        workers::for_each(drawing.units.len(), threads, |unit, state| drawing.again(unit, state))?;
    }
    let Drawing { canvas, paint, units, points, bytes, .. } = drawing;
    let projection = canvas.projection.clone();
    let mut picture = canvas.finish_on(threads);
    if style.has_boxes {
        boxes::overlay(&mut picture, &projection, &units);
    }
    picture.drawn.nodes = units.len() as u64;
    (picture.drawn.points, picture.drawn.bytes) = (points.into_inner(), bytes.into_inner());
    picture.drawn.colour = paint.colour;
    Ok(picture)
}

struct Drawing<'a> {
    source: &'a dyn Source,
    canvas: Canvas,
    paint: Paint,
    units: Vec<Unit>,
    /// The blocks of each unit, for the second pass.
    kept: Vec<Mutex<Vec<Block>>>,
    points: AtomicU64,
    bytes: AtomicU64,
}

impl Drawing<'_> {
    fn first(&self, unit: usize, state: &mut State) -> Result<(), RenderError> {
        let bytes = self.pass(unit, state, true)?;
        self.bytes.fetch_add(bytes, Relaxed);
        Ok(())
    }

    fn again(&self, unit: usize, state: &mut State) -> Result<(), RenderError> {
        let Some(kept) = self.kept.get(unit) else { return self.pass(unit, state, false).map(drop) };
        for block in std::mem::take(&mut *kept.lock().unwrap_or_else(PoisonError::into_inner)) {
            self.draw_block(unit, &block);
        }
        Ok(())
    }

    /// Reads a unit and draws it. Gives the bytes that were read.
    fn pass(&self, unit: usize, state: &mut State, is_first: bool) -> Result<u64, RenderError> {
        let attributes = self.source.attributes(unit);
        let State { buffers, block, colours } = state;
        let wanted = Paint::wanted(self.paint.colour);
        let bytes = self.source.read(unit, wanted, buffers, &mut |points| {
            if let Some(info) = self.units.get(unit) {
                self.paint.paint(&points, &attributes, info, colours);
            }
            self.fill(unit, &points, colours, block, is_first);
            self.draw_block(unit, block);
            if is_first && let Some(kept) = self.kept.get(unit) {
                kept.lock().unwrap_or_else(PoisonError::into_inner).push(std::mem::take(block));
            }
            ControlFlow::Continue(())
        })?;
        Ok(bytes)
    }

    /// The points that may be seen.
    fn fill(&self, unit: usize, points: &Points<'_>, colours: &[u32], block: &mut Block, is_first: bool) {
        let projection = &self.canvas.projection;
        let drawn = match points.positions {
            Positions::Quantized([x, y, z]) => {
                let frame = projection.lattice_frame(&points.lattice);
                let stored = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z].map(f64::from));
                self.fill_with(unit, points, (&frame, stored), colours, block)
            }
            Positions::World([x, y, z]) => {
                let stored = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]);
                self.fill_with(unit, points, (&projection.world_frame(), stored), colours, block)
            }
        };
        if is_first {
            self.points.fetch_add(drawn, Relaxed);
        }
    }

    fn fill_with(
        &self,
        unit: usize,
        points: &Points<'_>,
        (frame, stored): (&Frame, impl Iterator<Item = [f64; 3]>),
        colours: &[u32],
        block: &mut Block,
    ) -> u64 {
        let projection = &self.canvas.projection;
        let half = |side: u32| f64::from(side) / 2.0 + BESIDE;
        let [width, height] = [half(projection.size.width()), half(projection.size.height())];
        let has_sizes = self.units.get(unit).is_some_and(|unit| unit.size == UnitSize::Each);
        let mut drawn = 0;
        let Block { views, colours: words, sizes } = block;
        views.clear();
        words.clear();
        sizes.clear();
        for ((index, stored), word) in stored.enumerate().zip(colours) {
            let view = projection.view(frame, stored);
            if !self.source.keeps(unit, points, index, view) {
                continue;
            }
            drawn += 1;
            let [x, y, depth] = view;
            let beside = x.abs() * projection.focal > width * depth || y.abs() * projection.focal > height * depth;
            if beside || depth.is_nan() || depth <= 0.0 {
                continue;
            }
            views.push(view.map(|c| c as f32));
            words.push(*word);
            if has_sizes {
                sizes.push(self.source.size_at(unit, points, index, view));
            }
        }
        drawn
    }

    fn draw_block(&self, unit: usize, block: &Block) {
        let sizes = match self.units.get(unit).map(|unit| unit.size) {
            Some(UnitSize::Pixels(pixels)) => Sizes::Pixels(pixels),
            Some(UnitSize::World(size)) => Sizes::World(size),
            Some(UnitSize::Each) => Sizes::Each(&block.sizes),
            Some(UnitSize::One) | None => Sizes::One,
        };
        self.canvas.draw(&block.views, &block.colours, sizes);
    }
}
