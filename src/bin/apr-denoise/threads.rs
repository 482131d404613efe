//! `--threads`: how many work at once. No result depends on it.

use std::num::NonZero;

use apr::error::{Error, ErrorKind, Result};

/// `[choice]` More threads than cores only wait for one another, a thousand of them for hours. So few cost nothing on any
/// machine, and the same bits can be tried on small ones.
const FEW: usize = 8;

/// How many are started on so many `cores` where so many are `wanted`.
fn started(wanted: u32, cores: usize) -> usize {
    (wanted as usize).min(cores.max(FEW))
}

/// Has all work of this process done by so many.
///
/// # Errors
/// `Usage` when the system does not start them.
pub fn start(wanted: Option<u32>) -> Result<()> {
    let Some(wanted) = wanted else { return Ok(()) }; // one for each core, or as RAYON_NUM_THREADS says
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let threads = started(wanted, cores);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(|error| {
        let error = Error::new(ErrorKind::Usage, format!("{threads} threads cannot be started: {error}"));
        error.remedy("give fewer --threads, or none for one on each core")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_are_started_than_do_good() {
        assert_eq!([1, 64, 128, u32::MAX].map(|wanted| started(wanted, 64)), [1, 64, 64, 64]);
        assert_eq!([2, 5000].map(|wanted| started(wanted, 2)), [2, FEW]);
    }
}
