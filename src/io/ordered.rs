//! What is made on all threads is taken in order, while more of it is made.

use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;

use crate::error::Result;

/// How many things a thread may be ahead of the one that is to be taken next: what waits for its turn is a small
/// share of the memory.
const AHEAD: usize = 4;

/// A thing and its place, or the panic that its making ended with.
type Made<T> = (usize, std::result::Result<Result<T>, Box<dyn Any + Send>>);

/// Makes the things `0..count` on all of rayon's threads, each of which has its own tools, and hands them in their
/// order to `take`, on a thread of its own.
///
/// # Errors
/// The first one, in that order, of `make` and `take`. Nothing that follows is taken.
pub(super) fn make_in_order<Tools: Default, T: Send>(
    count: usize,
    make: impl Fn(&mut Tools, usize) -> Result<T> + Sync,
    take: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let (tickets, work) = mpsc::channel();
    let (sender, made) = mpsc::channel();
    let ahead = AHEAD * rayon::current_num_threads();
    let work = Mutex::new(work);
    thread::scope(|scope| {
        let taker = scope.spawn(move || take_in_order(count, ahead, &tickets, &made, take));
        rayon::broadcast(|_| {
            let mut tools = Tools::default();
            // Without tickets there is nothing more to do: all is taken, or something has failed.
            let next = || work.lock().unwrap_or_else(PoisonError::into_inner).recv();
            while let Ok(n) = next() {
                let thing = catch_unwind(AssertUnwindSafe(|| make(&mut tools, n)));
                if sender.send((n, thing)).is_err() {
                    break;
                }
            }
        });
        taker.join().unwrap_or_else(|panic| resume_unwind(panic))
    })
}

/// Gives out tickets, and takes what comes of them in their order.
fn take_in_order<T>(
    count: usize,
    ahead: usize,
    tickets: &mpsc::Sender<usize>,
    made: &mpsc::Receiver<Made<T>>,
    mut take: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    let give = |n: usize| {
        if n < count {
            let _ = tickets.send(n); // the other end outlives this thread
        }
    };
    (0..ahead).for_each(give);
    let mut waiting = BTreeMap::new();
    for n in 0..count {
        let thing = loop {
            match waiting.remove(&n) {
                Some(thing) => break thing,
                None => {
                    let (n, thing) = made.recv().expect("makers wait for tickets");
                    waiting.insert(n, thing);
                }
            }
        };
        take(thing.unwrap_or_else(|panic| resume_unwind(panic))?)?;
        give(n + ahead);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{Error, ErrorKind};

    fn on_threads<R: Send>(threads: usize, run: impl FnOnce() -> R + Send) -> R {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run)
    }

    #[test]
    fn what_takes_longest_first_is_taken_in_order_all_the_same() {
        for (threads, count) in [(1, 0), (1, 9), (3, 100), (7, 2)] {
            let mut taken = vec![];
            let make = |used: &mut usize, n: usize| {
                *used += 1;
                let busy = std::time::Duration::from_micros(if n.is_multiple_of(5) { 900 } else { 10 });
                thread::sleep(busy);
                Ok((n, *used))
            };
            let take = |thing| {
                taken.push(thing);
                Ok(())
            };
            on_threads(threads, || make_in_order(count, make, take)).unwrap();
            assert!(taken.iter().map(|(n, _)| *n).eq(0..count));
            if threads == 1 {
                assert!(taken.iter().all(|(n, used)| *used == n + 1), "a thread keeps its tools");
            }
        }
    }

    #[test]
    fn the_first_failure_is_told_and_nothing_behind_it_is_taken() {
        let failed = |n: usize| Error::new(ErrorKind::Unreadable, format!("block {n}"));
        let make = |(): &mut (), n: usize| if n == 20 || n == 23 { Err(failed(n)) } else { Ok(n) };
        let mut taken = 0;
        let take = |_| {
            taken += 1;
            Ok(())
        };
        let result = on_threads(3, || make_in_order(90, make, take));
        assert_eq!((result, taken), (Err(failed(20)), 20));
        let take = |n: usize| if n == 7 { Err(failed(n)) } else { Ok(()) };
        assert_eq!(on_threads(3, || make_in_order(90, make, take)), Err(failed(7)));
    }

    #[test]
    #[should_panic(expected = "at 5")]
    fn a_panic_comes_through() {
        let make = |(): &mut (), n: usize| if n == 5 { panic!("at {n}") } else { Ok(n) };
        let _ = on_threads(2, || make_in_order(90, make, |_| Ok(())));
    }
}
