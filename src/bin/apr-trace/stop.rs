//! A run that is told to stop ends with a last checkpoint.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use crate::signals;

/// How long the end waits for the pass that is under way: less than what cluster managers wait before they kill.
const PATIENCE: Duration = Duration::from_secs(20);

/// Whether the run is to stop, and the way to say that it may.
pub struct Stop {
    asked: Arc<AtomicBool>,
    /// Closed when nothing more is to be kept: at the render's end, too, whatever that is.
    open: Sender<()>,
}

impl Stop {
    /// From now on a run that is told to stop waits for [`Self::end`], or until this is dropped.
    pub fn after_checkpoint() -> Self {
        let (open, closed) = channel();
        let stop = Self { asked: Arc::default(), open };
        let asked = Arc::clone(&stop.asked);
        signals::before_the_end(move || {
            asked.store(true, Ordering::Relaxed);
            let _ = closed.recv_timeout(PATIENCE); // nothing is ever sent
        });
        stop
    }

    /// Whether the run was told to stop.
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Lets the program end, as whoever told it to stop expects.
    pub fn end(self) -> ! {
        drop(self.open);
        loop {
            std::thread::park();
        }
    }
}
