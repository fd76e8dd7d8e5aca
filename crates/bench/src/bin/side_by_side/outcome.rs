//! What came of a case.

use pointmill_bench::process::Cost;

use crate::cases::Case;

/// All runs of one case, or why they stopped.
pub(crate) struct Outcome {
    pub(crate) case: Case,
    pub(crate) costs: Vec<Cost>,
    pub(crate) output_bytes: u64,
    /// Bytes that pointmill wrote to temporary files, by its report.
    pub(crate) temp_bytes: u64,
    /// What the last validation cost, if there was one; exit code 0 if it found no fault.
    pub(crate) validation: Option<Cost>,
    pub(crate) fault: Option<String>,
}

impl Outcome {
    pub(crate) fn new(case: Case) -> Self {
        Self { case, costs: Vec::new(), output_bytes: 0, temp_bytes: 0, validation: None, fault: None }
    }

    /// Sorted.
    pub(crate) fn values(&self, of: impl Fn(&Cost) -> f64) -> Vec<f64> {
        let mut values: Vec<f64> = self.costs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values
    }

    /// Median of all runs, seconds.
    pub(crate) fn cpu(&self) -> f64 {
        median(&self.values(Cost::cpu_secs))
    }

    /// Median of all runs, seconds.
    pub(crate) fn user(&self) -> f64 {
        median(&self.values(|c| c.user_secs))
    }

    /// Median of all runs, seconds.
    pub(crate) fn system(&self) -> f64 {
        median(&self.values(|c| c.system_secs))
    }

    /// Median of all runs, seconds.
    pub(crate) fn wall(&self) -> f64 {
        median(&self.values(|c| c.wall_secs))
    }

    /// Seconds.
    pub(crate) fn cpu_per_point(&self) -> f64 {
        self.cpu() / self.case.scene.points as f64
    }

    /// The highest of all runs.
    pub(crate) fn peak_bytes(&self) -> f64 {
        self.costs.iter().map(|c| c.peak_bytes).max().unwrap_or(0) as f64
    }
}

/// Of sorted values; NaN of none.
pub(crate) fn median(sorted: &[f64]) -> f64 {
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!((median(&[1.0, 2.0, 9.0]), median(&[1.0, 3.0])), (2.0, 2.0));
    }
}
