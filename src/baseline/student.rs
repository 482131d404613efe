//! The student's version that this project grew from, to show what the full method adds: polynomials in
//! windows of 15×15, centres 15 apart, no outlier step, the order by the residual instead of the risk.
//!
//! It is the pipeline of [`crate::denoise()`] under other options: one stage, one kernel, no coverage
//! centres (a pixel whose window's centre nothing resembles stays noisy), nothing restored. The order with the
//! least residual is the highest there is, for a residual never grows with the columns.
//!
//! `[choice]` the kernel is that of the published preset. The grid of centres is the pipeline's: centres
//! lie in the middle of the cells of 15×15 pixels, so that the windows tile the picture.

use crate::options::{Options, OrderChoice, OutlierOptions};

/// The options that make the pipeline the student's.
pub fn options() -> Options {
    let published = Options::published();
    Options {
        window_radius: 7,
        center_spacing: 15,
        min_coverage: 0.0,
        order_choice: OrderChoice::Residual,
        stages: published.stages[..1].to_vec(),
        outliers: OutlierOptions { enabled: false, ..published.outliers },
        ..published
    }
}
