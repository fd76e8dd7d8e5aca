//! Units of a tree that several processes build, each for itself: what a unit needs comes from the files of those before it, what
//! it comes to goes into one of its own.

use std::collections::{BTreeSet, HashMap};
use std::time::{Duration, Instant};

use pointmill_format::NodeKey;

use super::keep;
use super::sample::{Sampler, Sampling};
use super::sinks::{Encoders, Sinks};
use super::unit::{BuiltUnit, Shared, UnitBuilder};
use super::units::{Unit, Work};
use crate::cloud::xyz;
use crate::error::{ConvertError, JobFault};
use crate::job::{GroupUnits, SharedJob};
use crate::runtime::os_hints;

/// Between two looks whether others have done their units.
const PAUSE: Duration = Duration::from_millis(200);

/// Does those units of a tree that are to be done here, and tells how far all of them are.
pub(super) fn share<S: Sinks>(
    units: &[Unit],
    of: GroupUnits<'_>,
    job: &SharedJob,
    shared: &Shared<'_>,
    sinks: &S,
    sampling: Sampling,
) -> Result<(), ConvertError> {
    let needs = needs(units);
    let mut open: Vec<usize> = (0..units.len()).filter(|i| job.wants(of.name(*i))).collect();
    let mut news = (job.done(), Instant::now());
    loop {
        let is_ready = |i: &usize| needs[*i].iter().all(|need| job.is_done(of.name(*need)));
        let (ready, others): (Vec<usize>, Vec<usize>) = open.iter().partition(|i| is_ready(i));
        let is_worth_it = |patience| news.1.elapsed() < patience;
        if ready.is_empty() && !others.is_empty() && job.waits().is_some_and(is_worth_it) {
            shared.rt.check_stop()?;
            std::thread::sleep(PAUSE);
            job.look_again()?;
            if job.done() != news.0 {
                news = (job.done(), Instant::now());
            }
            continue;
        }
        if ready.is_empty() {
            break;
        }
        shared.rt.in_parallel(
            ready.len(),
            || UnitBuilder::new(shared, Sampler::new(sampling, shared.borders.spacing()), sinks.encoders()),
            |builder, i| one(ready[i], units, &needs, of, shared, builder),
            |_| (),
        )?;
        (open, news) = (others, (job.done(), Instant::now()));
    }
    let points = |i: usize| units[i].points();
    let listed = (0..units.len()).zip(needs).map(|(i, needs)| of.listed(job, i, points(i), needs)).collect();
    Err(JobFault::Unfinished { units: listed }.into())
}

fn one<E: Encoders>(
    index: usize,
    units: &[Unit],
    needs: &[Vec<usize>],
    of: GroupUnits<'_>,
    shared: &Shared<'_>,
    builder: &mut UnitBuilder<'_, E>,
) -> Result<(), ConvertError> {
    let unit = &units[index];
    let gone = |need: usize| JobFault::NoUnit { unit: of.name(need).to_string() };
    let mut roots = HashMap::new();
    for &need in &needs[index] {
        let is_child = units[need].key.parent() == Some(unit.key);
        let unit = keep::Of { key: units[need].key, streams: builder.streams() };
        let (outer, root) = of
            .recall(need, |file| {
                let root = if is_child { keep::read_root(file, unit, &shared.lists)? } else { None };
                Ok((keep::read_outer(file, unit)?, root))
            })?
            .ok_or_else(|| gone(need))?;
        shared.borders.publish(outer)?;
        roots.extend(root.map(|root| (root.key, root)));
    }
    let buffers = (0..builder.streams()).map(|_| os_hints::buffer(0)).collect();
    let built = match &unit.work {
        Work::Subtree(chunks) => builder.subtree(unit.key, chunks, buffers, || true)?,
        Work::Above(children) => {
            let children = children.iter().map(|key| roots.remove(key)).collect::<Option<Vec<_>>>();
            let missing = || ConvertError::Internal("a subtree is missing".into());
            Some(builder.above(unit.key, children.ok_or_else(missing)?, buffers)?)
        }
    };
    let Some(mut built) = built else { return Ok(()) };
    built.take_notes(&mut builder.encoder)?;
    of.keep(index, |file| keep::write(&built, &shared.lists, file))?;
    shared.rt.advance(unit.points());
    Ok(())
}

impl BuiltUnit {
    /// Takes what was noticed of its points.
    pub(super) fn take_notes(&mut self, encoders: &mut impl Encoders) -> Result<(), ConvertError> {
        self.outer.sort_unstable_by_key(|(key, _)| (key.level, xyz(*key)));
        self.notes = encoders.take_notes()?;
        Ok(())
    }
}

/// For each unit those before it that it must see: the children of a node, and units that touch it and have nodes of the same
/// levels.
fn needs(units: &[Unit]) -> Vec<Vec<usize>> {
    let by_key: HashMap<NodeKey, usize> = units.iter().enumerate().map(|(i, unit)| (unit.key, i)).collect();
    let levels: BTreeSet<u8> = units.iter().map(|unit| unit.key.level).collect();
    let is_above = |i: usize| matches!(units[i].work, Work::Above(_));
    let mut needs = vec![Vec::new(); units.len()];
    for (i, unit) in units.iter().enumerate() {
        let mut see = |other: usize| {
            let (a, b) = (i.max(other), i.min(other));
            if a != b {
                needs[a].push(b);
            }
        };
        // units of its own level and of higher ones that touch it; of deeper ones, these look at it
        for level in levels.iter().copied().filter(|level| *level <= unit.key.level) {
            for key in around(unit.key, level) {
                let Some(&other) = by_key.get(&key) else { continue };
                // nodes above subtrees are units of one level
                let has_level = |one: usize, of: usize| !is_above(one) || units[of].key.level == units[one].key.level;
                if has_level(other, i) && (has_level(i, other) || units[other].key.level < unit.key.level) {
                    see(other);
                }
            }
        }
        if let Work::Above(children) = &unit.work {
            let found = children.iter().filter_map(|child| by_key.get(child));
            found.for_each(|&child| see(child));
        }
    }
    for list in &mut needs {
        list.sort_unstable();
        list.dedup();
    }
    needs
}

/// Nodes of a level that touch a node from outside and are no ancestors of it.
fn around(key: NodeKey, level: u8) -> impl Iterator<Item = NodeKey> {
    let up = u32::from(key.level - level);
    let side = 1i64 << level;
    let range = move |c: u32| {
        let c = i64::from(c);
        // cells of the level that hold its neighbours of its own level
        let (low, high) = ((c - 1) >> up, (c + 1) >> up);
        (low.max(0)..=high.min(side - 1)).map(|c| c as u32)
    };
    let own = key.ancestor(level);
    range(key.x)
        .flat_map(move |x| range(key.y).flat_map(move |y| range(key.z).map(move |z| NodeKey { level, x, y, z })))
        .filter(move |node| Some(*node) != own)
}

#[cfg(test)]
mod tests {
    use super::super::divide::Subtree;
    use super::super::units::in_order;
    use super::*;

    fn key(level: u8, x: u32, y: u32, z: u32) -> NodeKey {
        NodeKey { level, x, y, z }
    }

    /// True if nodes of both at one level may touch.
    fn meet(a: &Unit, b: &Unit) -> bool {
        let level = a.key.level.max(b.key.level);
        let is_above = |unit: &Unit| matches!(unit.work, Work::Above(_));
        if [a, b].into_iter().any(|unit| is_above(unit) && unit.key.level < level) {
            return false;
        }
        let cube = |unit: &Unit| {
            let shift = level - unit.key.level;
            xyz(unit.key).map(|c| (i64::from(c) << shift, i64::from(c + 1) << shift))
        };
        cube(a).iter().zip(cube(b)).all(|(a, b)| a.0 <= b.1 && b.0 <= a.1)
    }

    #[test]
    fn a_unit_needs_its_children_and_whoever_before_it_shares_a_border_of_a_level() {
        let subtrees = [
            key(1, 0, 0, 0),
            key(2, 2, 0, 0),
            key(2, 3, 1, 1),
            key(3, 4, 2, 0),
            key(3, 5, 3, 1),
            key(4, 15, 0, 8),
            key(2, 0, 3, 3),
            key(3, 1, 7, 4),
            key(2, 2, 2, 2),
        ];
        let units = in_order(subtrees.map(|key| Subtree { key, chunks: Vec::new() }).into());
        let found = needs(&units);
        for (i, unit) in units.iter().enumerate() {
            let is_needed = |j: &usize| match &unit.work {
                Work::Above(children) if children.contains(&units[*j].key) => true,
                _ => meet(unit, &units[*j]),
            };
            let expected: Vec<usize> = (0..i).filter(is_needed).collect();
            assert_eq!(found[i], expected, "unit {i}, {:?}", unit.key);
        }
        assert!(found.iter().map(Vec::len).sum::<usize>() > 20);
    }
}
