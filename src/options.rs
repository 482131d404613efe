//! Every tunable of the denoiser, each with its one default.

use serde::{Deserialize, Serialize};

/// Options of [`crate::denoise::denoise`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {}
