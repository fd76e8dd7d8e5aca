//! All checks of a batch that need no other batch.

use pointmill_format::AttributeType;

use super::batch::{Grid, Points, Raw};
use super::boxes;
use super::description::{Colour, Description};
use super::figures::Errors;
use super::formulas::{BATCH, power};
use super::order::Key;
use super::positions::Axis;
use super::ranges::number;
use super::task::Task;
use crate::accuracy::Side;
use crate::against::rules::grey;
use crate::check::Check;
use crate::finding::Finding;
use crate::place::Place;

/// The planes leave a choice of positions.
pub(crate) const POSITION_UNCERTAIN: u8 = 1;
/// The colour before averaging is not known.
pub(crate) const COLOUR_UNKNOWN: u8 = 2;

/// What the pass in Morton order needs of a batch.
#[derive(Debug)]
pub(crate) struct Seen {
    /// In Morton order.
    pub(crate) number: u64,
    /// Storage index of the first point.
    pub(crate) first_index: u64,
    pub(crate) grid: Grid,
    pub(crate) codes: Vec<u128>,
    /// From the centres of the cells of level 0, 1, 2; empty if there are no levels.
    pub(crate) distances: Vec<[f64; 3]>,
    /// Colour words.
    pub(crate) stored: Vec<u32>,
    /// Colours before averaging, top byte 0.
    pub(crate) original: Vec<u32>,
    /// [`POSITION_UNCERTAIN`], [`COLOUR_UNKNOWN`].
    pub(crate) flags: Vec<u8>,
    /// Keys of the first and the last point.
    pub(crate) ends: Option<[Key; 2]>,
    pub(crate) errors: Errors,
    /// Least and greatest world coordinate of each axis.
    pub(crate) world: [[f64; 2]; 3],
    /// Points that are no lattice points.
    pub(crate) foreign: u64,
    /// Points whose lattice integers the planes do not determine.
    pub(crate) uncertain: u64,
}

/// Examines a batch.
pub(crate) fn examine(task: &Task<'_>, raw: &Raw) -> (Seen, Points) {
    let grid = Grid::new(task.header);
    let bits = task.header.bits();
    let axes = axes(task, raw);
    let points = points_of(task, raw, &axes);
    plane_words(task, raw);
    quantisation(task, raw, &points);
    boxes::check(raw, &points, bits, task.findings);

    let n = raw.len();
    let mut flags: Vec<u8> = points.ambiguous.iter().map(|a| u8::from(*a) * POSITION_UNCERTAIN).collect();
    let original = originals(task, raw, &mut flags);
    own_colours(task, raw, &original, &flags);
    levels_in_range(task, raw);

    let relative = |i: usize| [points.r[0][i], points.r[1][i], points.r[2][i]];
    let codes: Vec<u128> = (0..n).map(|i| grid.code(relative(i))).collect();
    let distances =
        if task.header.levels() { (0..n).map(|i| grid.distances(relative(i))).collect() } else { Vec::new() };
    let key = |i: usize| {
        let colour = (flags[i] & COLOUR_UNKNOWN == 0).then_some(original[i]);
        Key::new(raw, &points, &grid, bits, codes[i], i, colour)
    };
    order(task, raw, &points, &codes, &key);
    let seen = Seen {
        number: raw.number,
        first_index: raw.index(0),
        grid,
        ends: (n > 0).then(|| [key(0), key(n - 1)]),
        errors: errors(task, raw, &points, &axes),
        world: [0, 1, 2].map(|a| {
            let world = points.x[a].iter().map(|x| axes[a].world(*x));
            world.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(p), h.max(p)])
        }),
        foreign: points.foreign.map_or(0, |(count, _)| count),
        uncertain: flags.iter().filter(|f| **f & POSITION_UNCERTAIN != 0).count() as u64,
        codes,
        distances,
        stored: raw.colours.clone(),
        original,
        flags,
    };
    (seen, points)
}

/// The points of a batch: from the sources, or from its planes.
pub(crate) fn points_of(task: &Task<'_>, raw: &Raw, axes: &[Axis; 3]) -> Points {
    let first = (BATCH * raw.number) as usize;
    match task.known.and_then(|known| known.get(first..first + raw.len())) {
        Some(known) => Points::known(raw, axes, task.header.bits(), known),
        None => Points::new(raw, axes, task.header.bits()),
    }
}

/// How q becomes positions in this batch.
pub(crate) fn axes(task: &Task<'_>, raw: &Raw) -> [Axis; 3] {
    let (lattice, header) = (&task.description.lattice, task.header);
    [0, 1, 2].map(|axis| Axis::new(lattice, header.origin, &raw.bounds, axis, header.bits()))
}

/// Pushes a finding about `count` points of the batch, the first of which is `first`.
fn points_finding(task: &Task<'_>, raw: &Raw, check: Check, what: &str, count: u64, first: usize, values: [String; 2]) {
    let [expected, found] = values;
    let finding = Finding::new(check, format!("{what} of point {}", raw.index(first)), expected, found);
    task.findings.push(finding.points(count).at(Place::Batch(raw.number as u32)));
}

fn plane_words(task: &Task<'_>, raw: &Raw) {
    for (plane, name) in raw.planes.iter().zip(["hi10", "mid10", "lo10"]) {
        task.findings.checked(Check::PlaneWords, plane.len() as u64);
        let wrong = |w: &u32| w >> 30 != 0;
        if let Some(first) = plane.iter().position(wrong) {
            let count = plane.iter().filter(|w| wrong(w)).count() as u64;
            let values = ["bits 30 and 31 are 0".into(), format!("{:#010x}", plane[first])];
            points_finding(task, raw, Check::PlaneWords, &format!("{name} word"), count, first, values);
        }
    }
}

fn quantisation(task: &Task<'_>, raw: &Raw, points: &Points) {
    task.findings.checked(Check::Quantisation, raw.len() as u64);
    if let Some((count, first)) = points.foreign {
        let q = [0, 1, 2].map(|axis| format!("{:#010x}", raw.q(first, axis)));
        let whose = if task.known.is_some() { "the source's point" } else { "a lattice point; the nearest is" };
        let expected = format!("the code of {whose} {:?}", points.lattice(first));
        points_finding(task, raw, Check::Quantisation, "q", count, first, [expected, q.join(" ")]);
    }
}

fn levels_in_range(task: &Task<'_>, raw: &Raw) {
    let most = if task.header.levels() { 3 } else { 0 };
    let wrong = |i: &usize| raw.level(*i) > most;
    if let Some(first) = (0..raw.len()).find(wrong) {
        let count = (0..raw.len()).filter(wrong).count() as u64;
        let values = [format!("0 to {most}"), raw.level(first).to_string()];
        points_finding(task, raw, Check::Levels, "level", count, first, values);
    }
}

/// Colours before averaging: those of the originals, which must be of points below level 3 and differ from what these
/// show; all other points show their own.
fn originals(task: &Task<'_>, raw: &Raw, flags: &mut [u8]) -> Vec<u32> {
    let mut colours: Vec<u32> = raw.colours.iter().map(|w| w & 0xff_ffff).collect();
    if !task.header.averaged() {
        return colours;
    }
    let Some(entries) = &raw.originals else {
        // a level above 3 is a separate error; it was not averaged
        let unknown = (0..raw.len()).filter(|i| raw.level(*i) < 3);
        unknown.for_each(|i| flags[i] |= COLOUR_UNKNOWN);
        return colours;
    };
    let (mut finest, mut unchanged) = (Vec::new(), Vec::new());
    for entry in entries {
        let i = (u64::from(entry.index) - raw.index(0)) as usize; // the slot's own, by the table
        let original = entry.word & 0xff_ffff;
        if raw.level(i) >= 3 {
            finest.push(i);
            flags[i] |= COLOUR_UNKNOWN;
        } else if original == colours[i] {
            unchanged.push(i);
        }
        colours[i] = original;
    }
    for (wrong, expected, found) in [
        (finest, "no entry, its level is 3 or more", "one"),
        (unchanged, "no entry, its colour was not changed", "one"),
    ] {
        if let Some(first) = wrong.first() {
            let values = [expected.into(), found.into()];
            points_finding(task, raw, Check::Originals, "original", wrong.len() as u64, *first, values);
        }
    }
    colours
}

/// White without a source of colour, grey by the intensity where that is stored too (§6.2).
fn own_colours(task: &Task<'_>, raw: &Raw, original: &[u32], flags: &[u8]) {
    let expected: Box<dyn Fn(usize) -> u32> = match task.description.colour {
        Colour::Rgb => return,
        Colour::None => Box::new(|_| 0xff_ffff),
        Colour::Intensity => {
            if let Some((bytes, ty, range)) = intensities(task.description, raw) {
                Box::new(move |i| {
                    grey(number(&bytes[i * ty.size()..(i + 1) * ty.size()], ty) as u64, range) as u32 * 0x01_0101
                })
            } else if let Some((bytes, ty, range)) = wide_intensities(task.description, raw) {
                Box::new(move |i| wide_grey(number(&bytes[i * ty.size()..(i + 1) * ty.size()], ty), range) * 0x01_0101)
            } else {
                return;
            }
        }
    };
    task.findings.checked(Check::Colours, raw.len() as u64);
    let wrong = |i: &usize| flags[*i] & COLOUR_UNKNOWN == 0 && original[*i] != expected(*i);
    if let Some(first) = (0..raw.len()).find(wrong) {
        let count = (0..raw.len()).filter(wrong).count() as u64;
        let values = [expected(first), original[first]].map(|word| format!("{word:#08x}"));
        points_finding(task, raw, Check::Colours, "colour", count, first, values);
    }
}

/// Raw intensities of the batch, if they are there as integers of 8 or 16 bits.
fn intensities<'a>(description: &Description, raw: &'a Raw) -> Option<(&'a [u8], AttributeType, [u64; 2])> {
    let at = description.intensity_column()?;
    let ty = description.attributes[at].attribute.ty;
    let bytes = raw.extras.get(at).filter(|b| b.len() == ty.size() * raw.len())?;
    Some((bytes, ty, description.intensity_range?))
}

/// Raw intensities of the batch of other types, and the span that the description states: that it is attained is another
/// check.
fn wide_intensities<'a>(description: &Description, raw: &'a Raw) -> Option<(&'a [u8], AttributeType, [f64; 2])> {
    let at = description.wide_intensity_column()?;
    let extra = &description.attributes[at];
    let (Some(&[lo]), Some(&[hi])) = (extra.min.as_deref(), extra.max.as_deref()) else { return None };
    let ty = extra.attribute.ty;
    let bytes = raw.extras.get(at).filter(|b| b.len() == ty.size() * raw.len())?;
    Some((bytes, ty, [lo, hi]))
}

/// The grey of an intensity of any type among those from `lo` to `hi`.
fn wide_grey(v: f64, [lo, hi]: [f64; 2]) -> u32 {
    match v.is_nan() {
        true => 0,
        false if hi > lo => ((v - lo) / (hi - lo) * 255.0 + 0.5).floor().clamp(0.0, 255.0) as u32,
        false => 255,
    }
}

/// Order inside the batch.
fn order(task: &Task<'_>, raw: &Raw, points: &Points, codes: &[u128], key: &dyn Fn(usize) -> Key) {
    task.findings.checked(Check::StorageOrder, raw.len() as u64);
    let mut wrong: Option<(u64, usize)> = None;
    for i in 1..raw.len() {
        // keys are built only where the codes do not decide
        let plain = !points.ambiguous[i - 1] && !points.ambiguous[i];
        if plain && codes[i - 1] < codes[i] {
            continue;
        }
        if key(i - 1).is_behind(&key(i)) {
            wrong = Some(wrong.map_or((1, i), |(n, first)| (n + 1, first)));
        }
    }
    if let Some((count, first)) = wrong {
        let values = [format!("behind {}", key(first - 1).describe()), key(first).describe()];
        points_finding(task, raw, Check::StorageOrder, "place", count, first, values);
    }
}

/// Errors of all points by planes and axis; none may be above half a cell and the rounding of §5.
fn errors(task: &Task<'_>, raw: &Raw, points: &Points, axes: &[Axis; 3]) -> Errors {
    let mut errors = Errors::default();
    if points.ambiguous.contains(&true) {
        return errors;
    }
    errors.side = side(task, raw, points, axes);
    for plane in 0..task.header.planes() {
        let bits = 10 * (plane as u32 + 1);
        for (a, axis) in axes.iter().enumerate() {
            for i in 0..raw.len() {
                errors.add(plane, a, (axis.decoded(raw.q(i, a as u32), bits) - points.r[a][i]).abs());
            }
            let most = raw.bounds.side(a) / power(bits as i32 + 1) + raw.bounds.rounding(a);
            let found = errors.max[plane][a];
            if found > most && points.foreign.is_none() {
                let subject = format!("largest {} error of {bits} bits", ["x", "y", "z"][a]);
                let finding = Finding::new(Check::Errors, subject, format!("at most {most}"), found);
                task.findings.push(finding.at(Place::Batch(raw.number as u32)));
            }
        }
    }
    errors
}

/// What decoding does to the points of a batch, with all planes that are there.
fn side(task: &Task<'_>, raw: &Raw, points: &Points, axes: &[Axis; 3]) -> Side {
    let (lattice, bits) = (&task.description.lattice, task.header.bits());
    let mut side = Side::default();
    let mut rows: Vec<([u64; 3], [i64; 3])> = Vec::with_capacity(raw.len());
    for i in 0..raw.len() {
        let x = points.lattice(i);
        let decoded = [0, 1, 2].map(|a| axes[a].decoded(raw.q(i, a as u32), bits));
        let meant = [0, 1, 2].map(|a| points.r[a][i]);
        side.deviation.add([0, 1, 2].map(|a| decoded[a] - meant[a]), [0, 1, 2].map(|a| axes[a].world(x[a])));
        let world = [0, 1, 2].map(|a| task.header.origin[a] + decoded[a]);
        side.lost += u64::from([0, 1, 2].map(|a| lattice.quantize(a, world[a])) != x);
        rows.push((decoded.map(f64::to_bits), x));
    }
    let is_apart = |a: usize| side.deviation.max[a] < 0.49 * lattice.scale[a];
    if !(0..3).all(is_apart) {
        rows.sort_unstable();
        let places = rows.chunk_by(|a, b| a.0 == b.0).filter(|p| p.first().map(|r| r.1) != p.last().map(|r| r.1));
        side.merged = Some(places.map(|place| place.len() as u64).sum());
    }
    side
}
