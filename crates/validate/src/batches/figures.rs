//! Error figures (§6.5): largest error and root of the mean square, by planes and axis.

use serde_json::json;

use super::description::{Description, Figures};
use super::header::Header;
use crate::accuracy::Side;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Errors of some points: [plane][axis].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Errors {
    pub(crate) max: [[f64; 3]; 3],
    /// Sums of squares.
    pub(crate) squares: [[f64; 3]; 3],
    /// Of all planes that are there.
    pub(crate) side: Side,
}

impl Errors {
    /// Takes in an error.
    #[inline]
    pub(crate) fn add(&mut self, plane: usize, axis: usize, error: f64) {
        self.max[plane][axis] = self.max[plane][axis].max(error);
        self.squares[plane][axis] += error * error;
    }

    /// Takes in the next batch.
    pub(crate) fn merge(&mut self, batch: &Self) {
        for plane in 0..3 {
            for axis in 0..3 {
                self.max[plane][axis] = self.max[plane][axis].max(batch.max[plane][axis]);
                self.squares[plane][axis] += batch.squares[plane][axis];
            }
        }
        self.side.merge(&batch.side);
    }

    /// Root of the mean square of `points`.
    fn rms(&self, plane: usize, points: u64) -> [f64; 3] {
        self.squares[plane].map(|sum| (sum / points.max(1) as f64).sqrt())
    }
}

/// Other software may add squares in another order.
const RMS_TOLERANCE: f64 = 1e-9;

/// Compares the description's figures with those of all points: the largest exactly, the rms to 10⁻⁹.
pub(crate) fn check(header: &Header, description: &Description, errors: &Errors, findings: &Findings) {
    for (plane, stated) in description.errors.iter().enumerate().take(header.planes()) {
        let Some(Figures { max, rms }) = stated else { continue }; // an error of the description, reported there
        findings.checked(Check::Errors, 6);
        let bits = 10 * (plane + 1);
        if *max != errors.max[plane] {
            let subject = format!("largest error of {bits} bits");
            findings.push(Finding::new(Check::Errors, subject, json!(errors.max[plane]), json!(max)));
        }
        let expected = errors.rms(plane, header.points);
        if (0..3).any(|a| (rms[a] - expected[a]).abs() > RMS_TOLERANCE * expected[a].max(rms[a])) {
            findings.push(Finding::new(Check::Errors, format!("rms of {bits} bits"), json!(expected), json!(rms)));
        }
    }
}
