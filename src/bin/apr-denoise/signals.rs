//! Being told to stop: say what is known, clean up and go.

use std::sync::{Mutex, PoisonError};

/// What is still to be done by a run that is told to stop.
static LAST_WORDS: Mutex<Option<Box<dyn FnOnce() + Send>>> = Mutex::new(None);

/// Has a run that is told to stop do this first.
pub fn before_the_end(words: impl FnOnce() + Send + 'static) {
    *LAST_WORDS.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(words));
}

/// From now on SIGTERM, SIGINT and SIGHUP remove the temporary files before they end the program. It dies by the signal
/// itself: after one that ends with a code of its own a shell's loop would go on.
#[cfg(unix)]
pub fn clean_up_when_stopped() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    /// What shells add to a signal's number.
    const SIGNALLED: i32 = 128;
    let mut heeded = vec![SIGTERM, SIGINT];
    if !may_be_ignored(SIGHUP) {
        heeded.push(SIGHUP);
    }
    // Without the handler the next run removes what this one leaves: no reason not to work.
    let Ok(mut signals) = signal_hook::iterator::Signals::new(heeded) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            let words = LAST_WORDS.lock().unwrap_or_else(PoisonError::into_inner).take();
            words.into_iter().for_each(|words| words());
            apr::io::abandon_temporaries(); // after which nothing is written
            // The first process of a container is ended by no signal, and would be aborted then.
            if std::process::id() != 1 {
                let _ = signal_hook::low_level::emulate_default_handler(signal);
            }
            std::process::exit(SIGNALLED + signal);
        }
    });
}

/// Whether the program may have been started to live on in spite of the signal, as `nohup` does. Only Linux tells;
/// elsewhere a run that ends by a hangup leaves its temporary file to the next one.
#[cfg(unix)]
fn may_be_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Other systems end the program; the next run removes its temporary files.
#[cfg(not(unix))]
pub fn clean_up_when_stopped() {}
