//! Is every point of the sources in the dataset exactly once?
//!
//! Both sides are sums, modulo 2¹²⁸, of a hash of each record: integer position on the dataset's lattice, then the
//! bits of every attribute of the dataset. Equal sums and counts mean equal multisets, in any order, whatever the
//! size, in constant memory; an accident has a chance of about 2⁻¹²⁸ (the hash does not withstand someone who builds
//! collisions on purpose). Unequal sums are narrowed down in further passes ([`narrow`]).

pub(crate) mod block;
mod distinct;
mod exact;
mod follows;
mod meaning;
mod measured;
mod narrow;
mod opened;
pub(crate) mod rules;
mod selection;
mod shelf;
mod sides;
mod sources;

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use pointmill_format::ReadError;

use crate::check::Check;
use crate::finding::Finding;
use crate::memory::on_threads;
use crate::outcome::AgainstSummary;
use measured::Parts;
use rules::RgbDepth;
use sides::{COLOURS, Colour, Sum, rgb_of};

pub(crate) use rules::Rules;
pub(crate) use sides::{Against, Context, Records, Sink, Sums};

/// How positions become integers; the first is right, the others are known faults of other converters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct PositionRule {
    truncated: bool,
    shift: i64,
    words: &'static str,
}

const POSITION_RULES: [PositionRule; 4] = [
    PositionRule { truncated: false, shift: 0, words: "rounded to the nearest step" },
    PositionRule { truncated: true, shift: 0, words: "truncated instead of rounded" },
    PositionRule { truncated: false, shift: 1, words: "shifted by +1 step on every axis" },
    PositionRule {
        truncated: true,
        shift: 1,
        words: "truncated instead of rounded, and shifted by +1 step on every axis",
    },
];

/// What one file adds up to, by colour and position rule.
struct FileSums {
    sums: Mutex<[[Sum; POSITION_RULES.len()]; COLOURS.len()]>,
    /// A colour value above 255 was seen, or the file declares 16 bits.
    wide: AtomicBool,
}

impl Against {
    /// Decodes the sources and compares. The dataset's side must be complete.
    ///
    /// # Errors
    /// A source that cannot be decoded to its end: nothing can be proven then.
    pub(crate) fn compare(&self, context: &Context<'_>) -> Result<AgainstSummary, ReadError> {
        let mut budget = context.budget.clone();
        let threads = budget.threads(self.sources.thread_bytes())?;
        let context = Context { budget: &budget, ..*context };
        on_threads(threads, budget.path(), || self.compare_within(&context))
    }

    fn compare_within(&self, context: &Context<'_>) -> Result<AgainstSummary, ReadError> {
        let rules = &self.sums.rules;
        let position_rules = if rules.foreign { &POSITION_RULES[..] } else { &POSITION_RULES[..1] };
        let parts = Parts::new(rules, self.sources.points, context.budget.left());
        let files = self.sum_sources(position_rules, &parts, context)?;
        if let Ok(mut measured) = self.measured.lock() {
            *measured = Some(parts.finish());
        }
        let found = self.sums.total();
        let colours = self.colour_rules(&files);
        let candidates = self.candidates(&files, &colours, position_rules);
        let expected = candidates[0].2;
        context.findings.checked(Check::Against, found.count);
        let matching = candidates.iter().find(|(_, _, sum)| *sum == found);
        match matching {
            Some((rule, _, _)) if !rules.drop_duplicates => {
                if *rule != POSITION_RULES[0] {
                    let (right, is) = (POSITION_RULES[0].words, rule.words);
                    let finding = Finding::new(Check::Against, "positions", right, is);
                    context.findings.push(finding.points(found.count));
                }
            }
            _ => narrow::narrow(self, &colours, context)?,
        }
        for (name, expected, count) in self.sources.deviating(rules) {
            let finding = Finding::new(Check::Against, format!("dropped attribute {name}"), expected, "other values");
            context.findings.push(finding.points(count));
        }
        Ok(AgainstSummary {
            sources: self.sources.list.len(),
            points_expected: expected.count,
            points_found: found.count,
            sum_expected: format!("{:032x}", expected.hash),
            sum_found: format!("{:032x}", found.hash),
            attributes_not_in_dataset: self.not_in_dataset(),
        })
    }

    /// Names of columns of the scans that the dataset does not have, sorted.
    fn not_in_dataset(&self) -> Vec<String> {
        let is_derived = |name: &String| self.sums.rules.derived.contains(&name.as_str());
        let mut names = self.sources.not_in_dataset();
        names.retain(|name| !is_derived(name));
        names
    }

    /// One pass over the sources: sums by file, for every colour and position rule in question.
    fn sum_sources(
        &self,
        positions: &[PositionRule],
        parts: &Parts<'_>,
        context: &Context<'_>,
    ) -> Result<Vec<FileSums>, ReadError> {
        let rules = &self.sums.rules;
        let files: Vec<FileSums> = self
            .sources
            .list
            .iter()
            .map(|source| {
                let is_wide = rules.rgb.is_none() || source.declares_16_bit_colour;
                FileSums { sums: Mutex::default(), wide: AtomicBool::new(is_wide) }
            })
            .collect();
        self.sources.each_block(rules, context.progress, "sources", |block, at| {
            let file = &files[at];
            parts.add(block, at);
            if let Some(rgb) = rules.rgb
                && block.words[rgb].iter().any(|v| *v > 255)
            {
                file.wide.store(true, Relaxed);
            }
            block.start_hashes(&rules.attributes, rules.rgb);
            // once a wide value was seen, the other reading of this file's colours is out of the question
            let both = !file.wide.load(Relaxed) || rules.rgb_depth == RgbDepth::Eight;
            let colours = &COLOURS[..if both { 2 } else { 1 }];
            let mut sums = [[Sum::default(); POSITION_RULES.len()]; COLOURS.len()];
            for i in (0..block.len()).filter(|i| block.keep[*i]) {
                let rgb = rgb_of(block, rules, i);
                for (colour, sums) in colours.iter().zip(&mut sums) {
                    let rgb = rgb.map(|v| colour.apply(v, rules));
                    for (rule, sum) in positions.iter().zip(sums) {
                        let from = if rule.truncated { &block.truncated } else { &block.positions };
                        let position = [0, 1, 2].map(|axis| from[axis][i] + rule.shift);
                        sum.add(Sum { count: 1, hash: block.hash(i, rgb, position) });
                    }
                }
            }
            if let Ok(mut total) = file.sums.lock() {
                total.iter_mut().flatten().zip(sums.iter().flatten()).for_each(|(a, b)| a.add(*b));
            }
        })?;
        Ok(files)
    }

    /// How the colours of each file are expected to be stored.
    fn colour_rules(&self, files: &[FileSums]) -> Vec<Colour> {
        let rule = |file: &FileSums| match self.sums.rules.rgb_depth {
            RgbDepth::Eight => Colour::Times257,
            RgbDepth::Auto if !file.wide.load(Relaxed) && !self.sums.rules.foreign => Colour::Times257,
            _ => Colour::AsIs,
        };
        files.iter().map(rule).collect()
    }

    /// What the dataset may add up to; the first is right. Foreign datasets may have 8-bit colours either way.
    fn candidates(
        &self,
        files: &[FileSums],
        colours: &[Colour],
        positions: &[PositionRule],
    ) -> Vec<(PositionRule, Colour, Sum)> {
        let mut candidates = Vec::new();
        let scaled: Vec<Colour> =
            files.iter().map(|f| if f.wide.load(Relaxed) { Colour::AsIs } else { Colour::Times257 }).collect();
        let choices = if self.sums.rules.foreign { vec![colours, &scaled[..]] } else { vec![colours] };
        for (p, rule) in positions.iter().enumerate() {
            for choice in &choices {
                let mut sum = Sum::default();
                for (file, colour) in files.iter().zip(*choice) {
                    sum.add(
                        file.sums
                            .lock()
                            .map_or_else(|e| e.into_inner()[*colour as usize][p], |s| s[*colour as usize][p]),
                    );
                }
                candidates.push((*rule, choice.first().copied().unwrap_or(Colour::AsIs), sum));
            }
        }
        candidates
    }
}
