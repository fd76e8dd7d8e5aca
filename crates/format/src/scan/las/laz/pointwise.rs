//! Records compressed one after the other: point formats 0–5.
//!
//! A chunk begins with a record as it is; all others are symbols of one arithmetic decoder, item after item, point
//! after point.

use super::coder::{Coder, Paused};
use super::input::Input;
use super::lanes::{LANES, PointwiseModels};
use super::stop::Stop;

/// How many records are good, and why there are no more if those are not all.
pub(in super::super) type Filled = (usize, Result<(), Stop>);

/// Decodes consecutive records of one chunk, or of several that follow one another.
pub(in super::super) struct Pointwise<'m, 'a> {
    models: &'m mut PointwiseModels,
    stream: Stream<'a>,
}

impl<'m, 'a> Pointwise<'m, 'a> {
    pub(in super::super) fn new(models: &'m mut PointwiseModels, input: Input<'a>) -> Self {
        Self { models, stream: Stream::new(input) }
    }

    /// Fills `out` with whole records.
    pub(in super::super) fn fill(&mut self, out: &mut [u8]) -> Filled {
        self.stream.fill(self.models, 0, out)
    }

    /// The next record begins another chunk.
    pub(in super::super) fn next_chunk(&mut self) {
        self.stream.next_chunk();
    }

    /// True if no byte is left.
    pub(in super::super) fn is_at_end(&mut self) -> bool {
        self.stream.is_at_end()
    }
}

/// Decodes two chunks in turn.
pub(in super::super) struct Pair<'m, 'a> {
    models: &'m mut PointwiseModels,
    streams: [Stream<'a>; LANES],
}

impl<'m, 'a> Pair<'m, 'a> {
    pub(in super::super) fn new(models: &'m mut PointwiseModels, chunks: [&'a [u8]; LANES]) -> Self {
        Self { models, streams: chunks.map(|chunk| Stream::new(Input::Whole(chunk))) }
    }

    /// Fills `outs` with whole records of the one and of the other chunk, of which none has stopped before.
    pub(in super::super) fn fill(&mut self, mut outs: [&mut [u8]; LANES]) -> [Filled; LANES] {
        let Self { models, streams } = self;
        let len = models.record_len();
        let mut filled = [(0, Ok(())), (0, Ok(()))];
        for (lane, (out, filled)) in outs.iter_mut().zip(&mut filled).enumerate() {
            if streams[lane].coder.is_none() && !out.is_empty() {
                *filled = streams[lane].first(models, lane, &mut out[..len]);
            }
        }
        if let (
            [Stream { coder: Some(one), input: in_one, .. }, Stream { coder: Some(other), input: in_other, .. }],
            [(a, Ok(())), (b, Ok(()))],
        ) = (&mut *streams, &mut filled)
        {
            let [out_one, out_other] = &mut outs;
            let rest = [&mut out_one[*a * len..], &mut out_other[*b * len..]];
            let (more, paused) = models.run(0, [*one, *other], [in_one, in_other], rest);
            [*one, *other] = paused;
            (*a, *b) = (*a + more[0], *b + more[1]);
            for (lane, (_, result)) in filled.iter_mut().enumerate() {
                *result = streams[lane].check(paused[lane]);
            }
        }
        for (lane, (out, (good, result))) in outs.into_iter().zip(&mut filled).enumerate() {
            if result.is_ok() {
                let (more, why) = streams[lane].fill(models, lane, &mut out[*good * len..]);
                (*good, *result) = (*good + more, why);
            }
        }
        filled
    }
}

/// A place in one chunk, or in several that follow one another.
struct Stream<'a> {
    input: Input<'a>,
    /// Behind the first record of the chunk.
    coder: Option<Paused>,
    /// The next byte, before the chunk has begun.
    at: usize,
}

impl<'a> Stream<'a> {
    fn new(input: Input<'a>) -> Self {
        Self { input, coder: None, at: 0 }
    }

    fn fill(&mut self, models: &mut PointwiseModels, lane: usize, out: &mut [u8]) -> Filled {
        let len = models.record_len();
        let points = out.len() / len;
        let mut good = 0;
        while good < points {
            let rest = &mut out[good * len..];
            let result = match self.coder {
                None => self.first(models, lane, &mut rest[..len]),
                Some(paused) => self.others(models, lane, paused, rest),
            };
            match result {
                (more, Ok(())) => good += more,
                (more, Err(stop)) => return (good + more, Err(stop)),
            }
        }
        (good, Ok(()))
    }

    fn next_chunk(&mut self) {
        if let Some(paused) = self.coder.take() {
            self.at = paused.at;
        }
    }

    fn is_at_end(&mut self) -> bool {
        let mut at = self.coder.map_or(self.at, |paused| paused.at);
        let more = self.input.refill(&mut at, 1);
        more.is_ok() && at == self.input.bytes().len()
    }

    fn first(&mut self, models: &mut PointwiseModels, lane: usize, record: &mut [u8]) -> Filled {
        let behind = record.len() + Coder::START;
        if let Err(stop) = self.input.refill(&mut self.at, behind) {
            return (0, Err(stop));
        }
        let Some(bytes) = self.input.bytes().get(self.at..).and_then(|bytes| bytes.get(..behind)) else {
            return (0, Err(Stop::CutShort));
        };
        record.copy_from_slice(&bytes[..record.len()]);
        models.start(lane, record);
        let coder = Coder::start(self.input.bytes(), self.at + record.len());
        self.coder = Some(coder.pause());
        match coder.is_off() {
            true => (0, Err(Stop::senseless(self.input.place(coder.at())))),
            false => (1, Ok(())),
        }
    }

    fn others(&mut self, models: &mut PointwiseModels, lane: usize, mut paused: Paused, out: &mut [u8]) -> Filled {
        if let Err(stop) = self.input.refill(&mut paused.at, models.most_bytes()) {
            return (0, Err(stop));
        }
        let ([good], [paused]) = models.run(lane, [paused], [&self.input], [out]);
        self.coder = Some(paused);
        (good, self.check(paused))
    }

    /// An error if the decoder has met what no encoder writes, or the end of the bytes.
    fn check(&self, paused: Paused) -> Result<(), Stop> {
        let coder = paused.resume(self.input.bytes());
        match (coder.is_off(), coder.is_broken()) {
            (false, _) => Ok(()),
            (true, false) => Err(Stop::CutShort),
            (true, true) => Err(Stop::senseless(self.input.place(coder.at()))),
        }
    }
}
