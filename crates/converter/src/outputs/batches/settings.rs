//! What can be chosen of quantised batches.

/// Settings of quantised batches (`docs/formats/batches.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatchesSettings {
    /// Cell of the coarsest level of detail, world units; `None`: the power of two that gives about one
    /// occupied cell for every 64 points.
    pub lod_cell: Option<f64>,
    /// Position planes of ten bits to write, 1 to 3; `None`: those that the scene needs.
    pub planes: Option<u8>,
    /// Zstandard level of the sections; `None`: stored as they are, ready to be mapped.
    pub zstd_level: Option<i32>,
    /// Keep the colours that averaging replaces.
    pub originals: bool,
}

impl Default for BatchesSettings {
    fn default() -> Self {
        Self { lod_cell: None, planes: None, zstd_level: None, originals: true }
    }
}
