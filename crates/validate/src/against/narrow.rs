//! Finds out which records differ, within a memory limit.
//!
//! First pass: 65,536 buckets by position, each with a sum (or, where equal records count once, its sorted hashes).
//! Second pass: the whole records of as many differing buckets as memory allows, from both sides; what is left after
//! equal ones cancel is missing, surplus, or has another attribute.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Mutex;

use pointmill_format::{Attribute, ReadError};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::block::{BUCKETS, Block, bucket, value};
use super::sides::{Against, Colour, Context, Sum};
use crate::check::Check;
use crate::finding::Finding;
use crate::place::Place;

/// Reports how the records of the dataset differ from those of the sources.
pub(super) fn narrow(against: &Against, colours: &[Colour], context: &Context<'_>) -> Result<(), ReadError> {
    let pass = Pass { against, colours, context };
    let differing = if against.sums.rules.drop_duplicates { pass.by_set()? } else { pass.by_sum()? };
    let total = differing.iter().filter(|d| d.is_some()).count();
    if total == 0 {
        return Ok(());
    }
    let row_bytes = 8 * (3 + against.sums.rules.attributes.iter().map(|a| a.elements).sum::<usize>()) + 192;
    let budget = context.budget.left() / 4 / row_bytes as u64;
    let mut chosen = vec![false; BUCKETS];
    let (mut rows, mut taken) = (0, 0);
    for (bucket, count) in differing.iter().enumerate().filter_map(|(b, d)| Some((b, (*d)?))) {
        if rows + count > budget {
            continue;
        }
        rows += count;
        taken += 1;
        chosen[bucket] = true;
    }
    pass.rows(&chosen)?;
    if taken < total {
        let found = format!("{total} of {BUCKETS} parts of the cloud differ; {taken} of them were looked into");
        context.findings.push(Finding::new(Check::Against, "records", "equal on both sides", found));
    }
    Ok(())
}

struct Pass<'a> {
    against: &'a Against,
    colours: &'a [Colour],
    context: &'a Context<'a>,
}

/// One side's records of one position and content: how many more the sources have than the dataset.
#[derive(Default)]
struct Balance {
    sources: i64,
    dataset: i64,
    /// What the lattice takes away of those of the sources, where equal records count once.
    residues: BTreeSet<u64>,
    node: Option<Place>,
}

impl Pass<'_> {
    /// Buckets whose sums differ, with the number of records to look at.
    fn by_sum(&self) -> Result<Vec<Option<u64>>, ReadError> {
        // some threads share their sums where memory is scarce
        let most = self.context.budget.left() / 4 / (2 * BUCKETS * size_of::<Sum>()) as u64;
        let shares = most.clamp(1, rayon::current_num_threads() as u64 + 1) as usize;
        let sides: [Vec<Mutex<Vec<Sum>>>; 2] = [(); 2].map(|()| (0..shares).map(|_| Mutex::default()).collect());
        self.each_record(|side, block, i, _| {
            let thread = rayon::current_thread_index().map_or(0, |t| t + 1);
            let Some(Ok(mut sums)) = sides[side].get(thread % shares).map(Mutex::lock) else { return };
            sums.resize(BUCKETS, Sum::default());
            let hash = self.hash(block, i);
            sums[bucket(block.position(i))].add(Sum { count: 1, hash });
        })?;
        let [sources, dataset] = sides.map(|threads| {
            let mut total = vec![Sum::default(); BUCKETS];
            for sums in threads.into_iter().filter_map(|t| t.into_inner().ok()) {
                total.iter_mut().zip(&sums).for_each(|(a, b)| a.add(*b));
            }
            total
        });
        let differ = |(a, b): (&Sum, &Sum)| (a != b).then_some(a.count + b.count);
        Ok(sources.iter().zip(&dataset).map(differ).collect())
    }

    /// Buckets whose sets of records differ; a record that the dataset has twice differs too. Takes as many passes as
    /// memory asks for.
    fn by_set(&self) -> Result<Vec<Option<u64>>, ReadError> {
        let hash_bytes = 2 * size_of::<(u16, u128, u64)>() as u64; // vectors that grow take twice
        let needed = (self.against.sources.points + self.against.sums.total().count) * hash_bytes;
        let passes = needed.div_ceil((self.context.budget.left() / 4).max(1)).clamp(1, BUCKETS as u64) as usize;
        let mut differing = vec![None; BUCKETS];
        for pass in 0..passes {
            let buckets = BUCKETS * pass / passes..BUCKETS * (pass + 1) / passes;
            let sides: [Mutex<Vec<(u16, u128, u64)>>; 2] = Default::default();
            self.each_record(|side, block, i, _| {
                let at = bucket(block.position(i));
                if buckets.contains(&at)
                    && let Ok(mut hashes) = sides[side].lock()
                {
                    hashes.push((at as u16, self.hash(block, i), residue(block, i)));
                }
            })?;
            let [mut sources, mut dataset] = sides.map(|side| side.into_inner().unwrap_or_default());
            sources.par_sort_unstable();
            dataset.par_sort_unstable();
            let mut counts = vec![0; BUCKETS];
            sources.iter().chain(&dataset).for_each(|(b, ..)| counts[usize::from(*b)] += 1);
            sources.dedup();
            let [sources, dataset] =
                [sources, dataset].map(|side| side.into_iter().map(|(at, hash, _)| (at, hash)).collect::<Vec<_>>());
            for at in differences(&sources, &dataset) {
                differing[usize::from(at)] = Some(counts[usize::from(at)]);
            }
        }
        Ok(differing)
    }

    /// Compares the whole records of the chosen buckets.
    fn rows(&self, chosen: &[bool]) -> Result<(), ReadError> {
        let rules = &self.against.sums.rules;
        let balances: Mutex<HashMap<Box<[u64]>, Balance>> = Mutex::default();
        self.each_record(|side, block, i, node| {
            if chosen[bucket(block.position(i))]
                && let Ok(mut balances) = balances.lock()
            {
                let row = block.row(i, &rules.attributes);
                let balance = balances.entry(row).or_default();
                match side {
                    0 if rules.drop_duplicates => {
                        balance.sources += i64::from(balance.residues.insert(residue(block, i)));
                    }
                    0 => balance.sources += 1,
                    _ => {
                        balance.dataset += 1;
                        balance.node = balance.node.min(node).or(node);
                    }
                }
            }
        })?;
        let balances = balances.into_inner().unwrap_or_default();
        let mut by_position: BTreeMap<[u64; 3], (Vec<Row>, Vec<Row>)> = BTreeMap::new();
        for (row, balance) in balances {
            let surplus = balance.dataset - balance.sources;
            if surplus == 0 {
                continue;
            }
            let lists = by_position.entry([row[0], row[1], row[2]]).or_default();
            let list = if surplus > 0 { &mut lists.1 } else { &mut lists.0 };
            list.extend((0..surplus.unsigned_abs()).map(|_| (row.clone(), balance.node)));
        }
        let mut listed = 0;
        for (mut missing, mut surplus) in by_position.into_values() {
            missing.sort_unstable();
            surplus.sort_unstable();
            let findings = self.report(&missing, &surplus);
            // positions come in order, so the same ones are listed every time
            let left = self.context.findings.cap().saturating_sub(listed).min(findings.len());
            listed += left;
            self.context.findings.more(Check::Against, (findings.len() - left) as u64);
            findings.into_iter().take(left).for_each(|f| self.context.findings.push(f));
        }
        Ok(())
    }

    /// Differences at one position: what is there on both sides has other attributes, the rest is missing or surplus.
    fn report(&self, missing: &[Row], surplus: &[Row]) -> Vec<Finding> {
        let attributes = &self.against.sums.rules.attributes;
        let both = missing.len().min(surplus.len());
        let mut findings = Vec::new();
        for ((expected, _), (found, node)) in missing.iter().zip(surplus) {
            for (name, expected, found) in differing_attributes(attributes, expected, found) {
                let finding = Finding::new(Check::Against, format!("{name} of a point"), expected, found);
                findings.push(blame(finding, *node).points(1));
            }
        }
        for (row, _) in &missing[both..] {
            findings.push(Finding::new(Check::Against, "missing point", self.describe(row), Value::Null).points(1));
        }
        for (row, node) in &surplus[both..] {
            let finding = Finding::new(Check::Against, "surplus point", Value::Null, self.describe(row));
            findings.push(blame(finding, *node).points(1));
        }
        findings
    }

    /// World position and attributes of a record.
    fn describe(&self, row: &[u64]) -> Value {
        let world = self.against.sums.rules.world([row[0] as i64, row[1] as i64, row[2] as i64]);
        let mut map = Map::from_iter([("position".to_owned(), json!(world))]);
        let mut at = 3;
        for attribute in &self.against.sums.rules.attributes {
            map.insert(attribute.name.clone(), values(attribute, &row[at..at + attribute.elements]));
            at += attribute.elements;
        }
        map.into()
    }

    fn hash(&self, block: &Block, i: usize) -> u128 {
        block.hash(i, None, block.position(i))
    }

    /// Hands over every record of both sides: side (0: sources), block, index, node.
    fn each_record(&self, work: impl Fn(usize, &Block, usize, Option<Place>) + Sync) -> Result<(), ReadError> {
        let rules = &self.against.sums.rules;
        self.against.sources.each_block(rules, self.context.progress, "differences", |block, at| {
            if let Some(rgb) = rules.rgb {
                let colour = self.colours[at];
                let (colours, _) = block.words[rgb].as_chunks_mut::<3>();
                colours.iter_mut().for_each(|c| *c = colour.apply(*c, rules));
            }
            block.start_hashes(&rules.attributes, None);
            (0..block.len()).filter(|i| block.keep[*i]).for_each(|i| work(0, block, i, None));
        })?;
        self.context.records.each_block(rules, &|block, place| {
            rules.mask(block);
            block.start_hashes(&rules.attributes, None);
            (0..block.len()).for_each(|i| work(1, block, i, Some(place)));
        })
    }
}

/// What the lattice takes away of a position; 0 for records of the dataset.
fn residue(block: &Block, i: usize) -> u64 {
    block.residues.get(i).copied().unwrap_or(0)
}

type Row = (Box<[u64]>, Option<Place>);

fn blame(finding: Finding, node: Option<Place>) -> Finding {
    match node {
        Some(node) => finding.at(node),
        None => finding,
    }
}

/// Buckets of entries that only one of two sorted lists has (or has more often).
fn differences(a: &[(u16, u128)], b: &[(u16, u128)]) -> Vec<u16> {
    let (mut i, mut j, mut out) = (0, 0, Vec::new());
    while i < a.len() || j < b.len() {
        let order = match (a.get(i), b.get(j)) {
            (Some(x), Some(y)) => x.cmp(y),
            (Some(_), None) => std::cmp::Ordering::Less,
            (None, _) => std::cmp::Ordering::Greater,
        };
        match order {
            std::cmp::Ordering::Less => out.push(a[i].0),
            std::cmp::Ordering::Greater => out.push(b[j].0),
            std::cmp::Ordering::Equal => {}
        }
        i += usize::from(order.is_le());
        j += usize::from(order.is_ge());
    }
    out.dedup();
    out
}

/// Name and values of the attributes in which two records differ.
fn differing_attributes<'a>(
    attributes: &'a [Attribute],
    expected: &[u64],
    found: &[u64],
) -> Vec<(&'a str, Value, Value)> {
    let mut at = 3;
    let mut out = Vec::new();
    for attribute in attributes {
        let range = at..at + attribute.elements;
        at = range.end;
        if expected[range.clone()] != found[range.clone()] {
            let [expected, found] = [expected, found].map(|row| values(attribute, &row[range.clone()]));
            out.push((attribute.name.as_str(), expected, found));
        }
    }
    out
}

/// One number, or several as an array.
fn values(attribute: &Attribute, words: &[u64]) -> Value {
    match words {
        [word] => value(*word, attribute.ty),
        words => words.iter().map(|w| value(*w, attribute.ty)).collect(),
    }
}
