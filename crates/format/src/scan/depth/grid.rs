//! The pixels of a depth image, in metres.

/// Depths row by row; 0 where nothing was measured. Neither side is 0.
#[derive(Debug)]
pub(super) struct Grid {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) depths: Vec<f64>,
}

impl Grid {
    /// The depth at a column and a row; `None` outside, and where nothing was measured.
    #[inline]
    pub(super) fn depth(&self, column: usize, row: usize) -> Option<f64> {
        if column >= self.width {
            return None;
        }
        self.depths.get(row * self.width + column).copied().filter(|depth| *depth > 0.0)
    }
}
