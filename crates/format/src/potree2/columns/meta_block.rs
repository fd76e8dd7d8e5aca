//! Meta-blocks of a Brotli stream (RFC 7932, section 9.2).

use super::bits::BitWriter;
use super::commands::{
    Command, Commands, Recent, WITH_DISTANCE, coded_copy, coded_distance, coded_insert, command_symbol,
};
use super::literals::Literals;
use super::parse::{Part, Search};
use super::prefix::PrefixCode;

/// Symbols of commands.
const COMMAND_SYMBOLS: usize = 704;

/// Low bits of a distance that belong to its symbol, at most.
const MAX_POSTFIX: u32 = 3;

/// Symbols of distances: recent ones, then by the number of bits.
const fn distance_symbols(postfix: u32) -> usize {
    16 + (48 << postfix)
}

/// Memory that is kept from meta-block to meta-block.
#[derive(Debug, Default)]
pub(super) struct MetaBlocks {
    search: Search,
    commands: Commands,
    literals: Literals,
    coded: Vec<CodedCommand>,
    command_code: PrefixCode,
    distance_code: PrefixCode,
    map_code: PrefixCode,
}

/// A command as it is written.
#[derive(Debug, Clone, Copy)]
struct CodedCommand {
    symbol: u16,
    /// The symbol of the distance, if it is stored.
    distance: Option<u16>,
    inserted: u32,
    extra: u64,
    extra_bits: u32,
    distance_extra: u32,
    distance_bits: u32,
}

impl MetaBlocks {
    /// Writes `parts`, which lie one behind the other in `planes` from `start` on, as a meta-block that is not the last.
    /// `recent`: the distances that a decoder knows. Nothing is written of nothing.
    pub(super) fn write(
        &mut self,
        planes: &[u8],
        start: usize,
        parts: &[Part],
        recent: &mut Recent,
        bits: &mut BitWriter<'_>,
    ) {
        let Some(first) = parts.first() else { return };
        let len: usize = parts.iter().map(|part| part.len).sum();
        let postfix = first.size.trailing_zeros().min(MAX_POSTFIX);
        let mode = self.search.run(&planes[start..start + len], parts, &mut self.commands);
        self.literals.start(mode);
        self.coded.clear();
        let mut command_counts = [0; COMMAND_SYMBOLS];
        let mut distance_counts = [0; distance_symbols(MAX_POSTFIX)];
        let distance_counts = &mut distance_counts[..distance_symbols(postfix)];
        let mut at = start;
        for command in self.commands.finish() {
            let end = at + command.insert as usize;
            self.literals.add(&planes[at..end], two_before(planes, at));
            at = end + command.copy as usize;
            let coded = code(*command, postfix, recent);
            command_counts[usize::from(coded.symbol)] += 1;
            if let Some(distance) = coded.distance {
                distance_counts[usize::from(distance)] += 1;
            }
            self.coded.push(coded);
        }
        self.literals.group();
        self.write_header(len, postfix, bits);
        self.literals.write_descriptions(bits);
        self.command_code.write_description(&command_counts, bits);
        self.distance_code.write_description(distance_counts, bits);
        self.write_commands(bits);
    }

    fn write_header(&mut self, len: usize, postfix: u32, bits: &mut BitWriter<'_>) {
        bits.write(0, 1); // not the last
        write_len(len, bits);
        bits.write(0, 1); // compressed
        bits.write(0, 3); // one type of blocks each
        bits.write(u64::from(postfix), 2);
        bits.write(0, 4); // no direct distances
        bits.write(self.literals.mode() as u64, 2);
        write_count(self.literals.codes(), bits);
        if self.literals.codes() > 1 {
            self.literals.write_map(&mut self.map_code, bits);
        }
        write_count(1, bits); // codes of distances
    }

    fn write_commands(&self, bits: &mut BitWriter<'_>) {
        let mut literal = 0;
        for command in &self.coded {
            let (code, len) = self.command_code.code(usize::from(command.symbol));
            let mut waiting = (code | command.extra << len, len + command.extra_bits);
            if waiting.1 > 32 {
                bits.write(code, len);
                bits.write(command.extra, command.extra_bits);
                waiting = (0, 0);
            }
            let end = literal + command.inserted as usize;
            waiting = self.literals.write(literal..end, waiting, bits);
            literal = end;
            if let Some(distance) = command.distance {
                let (code, len) = self.distance_code.code(usize::from(distance));
                if waiting.1 > 16 {
                    bits.write(waiting.0, waiting.1);
                    waiting = (0, 0);
                }
                let stored = code | u64::from(command.distance_extra) << len;
                waiting = (waiting.0 | stored << waiting.1, waiting.1 + len + command.distance_bits);
            }
            bits.write(waiting.0, waiting.1);
        }
    }
}

/// The two bytes before `at`, the last one last; zeros before the first.
#[inline]
fn two_before(bytes: &[u8], at: usize) -> [u8; 2] {
    match at {
        0 => [0, 0],
        1 => [0, bytes[0]],
        _ => [bytes[at - 2], bytes[at - 1]],
    }
}

#[inline]
fn code(command: Command, postfix: u32, recent: &mut Recent) -> CodedCommand {
    let (insert, copy) = (coded_insert(command.insert), coded_copy(command.copy));
    // the last one may copy nothing: the meta-block ends before its distance
    let known = if command.copy > 0 { recent.take(command.distance) } else { Some(0) };
    let symbol = command_symbol(insert.code, copy.code, known == Some(0));
    let mut coded = CodedCommand {
        symbol: symbol as u16,
        distance: None,
        inserted: command.insert,
        extra: insert.extra | copy.extra << insert.extra_bits,
        extra_bits: insert.extra_bits + copy.extra_bits,
        distance_extra: 0,
        distance_bits: 0,
    };
    if symbol < WITH_DISTANCE || command.copy == 0 {
        return coded;
    }
    match known {
        Some(at) => coded.distance = Some(at as u16),
        None => {
            let distance = coded_distance(command.distance, postfix);
            coded.distance = Some(distance.code as u16);
            (coded.distance_extra, coded.distance_bits) = (distance.extra as u32, distance.extra_bits);
        }
    }
    coded
}

/// Writes the length of a meta-block, in four to six digits of four bits.
fn write_len(len: usize, bits: &mut BitWriter<'_>) {
    let last = len as u64 - 1;
    let digits = (u64::BITS - last.leading_zeros()).div_ceil(4).max(4);
    bits.write(u64::from(digits - 4), 2);
    bits.write(last, 4 * digits);
}

/// Writes a number from 1 to 256.
fn write_count(count: usize, bits: &mut BitWriter<'_>) {
    if count == 1 {
        bits.write(0, 1);
        return;
    }
    let rest = count as u64 - 1;
    let digits = rest.ilog2();
    bits.write(1, 1);
    bits.write(u64::from(digits), 3);
    bits.write(rest - (1 << digits), digits);
}
