//! The processor time of this program, as Linux counts it; elsewhere nothing is known.

/// Seconds that all of its threads together have run so far.
pub fn seconds() -> Option<f64> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    let mut nanoseconds = 0;
    for thread in threads {
        // The first number of schedstat is the time on a processor; see proc_pid_schedstat(5).
        let figures = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        nanoseconds += figures.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(nanoseconds as f64 * 1e-9)
}
