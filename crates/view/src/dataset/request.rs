//! What a browser asks for, and the work that it makes.

use super::ranges::Attributes;
use crate::encode::Look;
use crate::refusal::Refusal;

/// Points of nodes or leaves.
#[derive(Debug, Clone, Default)]
pub(crate) struct PointsRequest {
    pub(crate) units: Vec<String>,
    pub(crate) attribute: Option<String>,
    /// Of the points of a unit those with the index 0, K, 2K, …; at least 1.
    pub(crate) every: usize,
}

impl PointsRequest {
    /// What is to be encoded of points with these columns.
    pub(super) fn look<'a>(&self, attributes: &'a Attributes) -> Result<Look<'a>, Refusal> {
        Ok(Look {
            attributes: &attributes.all,
            attribute: self.attribute.as_deref().map(|name| attributes.find(name)).transpose()?,
            every: self.every,
            is_16_bit: attributes.is_16_bit(),
            intensities: attributes.range_of("intensity"),
        })
    }
}

/// Words of batches.
#[derive(Debug, Clone, Default)]
pub(crate) struct BatchesRequest {
    /// Slots.
    pub(crate) units: Vec<u32>,
    /// 1 to 3.
    pub(crate) planes: usize,
    /// The levels of detail from and to, 0 to 255.
    pub(crate) levels: [u8; 2],
    pub(crate) attribute: Option<String>,
}

/// Bytes that are to be made.
pub(crate) struct Work {
    /// How many there are at most.
    pub(crate) cost: u64,
    run: Box<dyn FnOnce() -> Result<Vec<u8>, Refusal> + Send>,
}

/// The most bytes of an answer.
const MOST_BYTES: u64 = 256 << 20;

impl Work {
    pub(super) fn new(cost: u64, run: impl FnOnce() -> Result<Vec<u8>, Refusal> + Send + 'static) -> Self {
        Self { cost, run: Box::new(run) }
    }

    /// Refuses more than an answer may have.
    pub(crate) fn check(self) -> Result<Self, Refusal> {
        if self.cost <= MOST_BYTES {
            return Ok(self);
        }
        let line = format!(
            "the answer would have up to {} bytes, more than {MOST_BYTES}; request fewer units, or every=K of their points",
            self.cost
        );
        Err(Refusal::bad(line))
    }

    pub(crate) fn run(self) -> Result<Vec<u8>, Refusal> {
        (self.run)()
    }
}

impl std::fmt::Debug for Work {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Work").field("cost", &self.cost).finish_non_exhaustive()
    }
}
