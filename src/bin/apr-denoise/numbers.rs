//! Numbers of the command line.

use std::str::FromStr;

/// Reads a number above 0.
///
/// # Errors
/// What was expected, where it is none, 0 or less, or not finite.
pub fn positive<T: FromStr + Copy + Into<f64>>(text: &str) -> Result<T, String> {
    match text.parse::<T>() {
        Ok(n) if n.into() > 0.0 && n.into().is_finite() => Ok(n),
        _ => Err("expected a number above 0".to_owned()),
    }
}
