//! Being told to stop: clean up and go.

/// From now on SIGTERM and SIGINT remove the temporary files and end the program with 143 and 130.
#[cfg(unix)]
pub fn clean_up_when_stopped() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    /// What shells add to a signal's number.
    const SIGNALLED: i32 = 128;
    // Without the handler the next run removes what this one leaves: no reason not to work.
    let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGTERM, SIGINT]) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            apr::io::abandon_temporaries();
            std::process::exit(SIGNALLED + signal);
        }
    });
}

/// Other systems end the program; the next run removes its temporary files.
#[cfg(not(unix))]
pub fn clean_up_when_stopped() {}
