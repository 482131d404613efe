//! `--reference`: a long render's state beside its output, so that a killed run goes on.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use apr::io::write_bytes;
use apr::trace::{RenderOptions, Renderer, Scene};
use apr::{Error, ErrorKind, Result};

use super::Args;
use super::stop::Stop;
use crate::answer::complain;

/// How every checkpoint begins, of whatever version.
const BEGIN: &str = "apr-trace checkpoint";

/// The state of a long render beside its output. None is kept of others.
pub struct Checkpoint {
    path: Option<PathBuf>,
    every: Duration,
    saved: Instant,
    /// It was told that it cannot be written, or nothing is to be told.
    told: bool,
    stop: Option<Stop>,
    /// What must be the same for a checkpoint to be continued.
    key: Vec<u8>,
}

/// Where it is; none unless the render is a reference.
pub fn path(args: &Args) -> Option<PathBuf> {
    let mut path = args.out.clone().filter(|_| args.reference.is_some())?.into_os_string();
    path.push(".checkpoint");
    Some(path.into())
}

/// Removes it when the picture is written.
pub fn remove(args: &Args) {
    if let Some(path) = path(args) {
        let _ = std::fs::remove_file(path); // a later run would refuse it or take it up: both are told
    }
}

impl Checkpoint {
    /// Of a render of `scene` with these; none unless it is a reference.
    pub fn new(args: &Args, options: &RenderOptions, scene: &Scene) -> Self {
        let what = RenderOptions { spp: 0, ..options.clone() };
        let version = env!("CARGO_PKG_VERSION");
        let key = format!("{BEGIN} {version}\n{:016x}\n{what:?}\n", scene.fingerprint()).into_bytes();
        let every = Duration::try_from_secs_f64(args.checkpoint_every.max(0.0)).unwrap_or(Duration::MAX);
        let path = path(args);
        let stop = path.is_some().then(Stop::after_checkpoint);
        Self { path, every, saved: Instant::now(), told: args.quiet, stop, key }
    }

    /// Takes up the film of an earlier run, if there is one, towards `spp` samples per pixel; how many of
    /// them are done by it.
    pub fn restore(&self, renderer: &mut Renderer, spp: u32) -> Result<u32> {
        let Some(path) = self.path.as_ref().filter(|path| path.exists()) else { return Ok(0) };
        let unreadable = |what: String| {
            let error = Error::new(ErrorKind::Unreadable, what).in_file(path);
            error.remedy("remove it to start anew")
        };
        let bytes = std::fs::read(path).map_err(|error| unreadable(format!("cannot be read: {error}")))?;
        if !bytes.starts_with(BEGIN.as_bytes()) {
            return Err(unreadable("is no checkpoint: it is empty or damaged".into()));
        }
        let film = bytes.strip_prefix(self.key.as_slice()).ok_or_else(|| {
            unreadable("belongs to another scene, seed or options, or another version of this program".into())
        })?;
        renderer
            .film_mut()
            .restore(film)
            .map_err(|error| error.in_file(path).remedy("remove it to start anew"))?;
        match renderer.film().counts()[0].drawn {
            more if more > spp => Err(unreadable(format!("holds {more} samples per pixel already"))),
            done => Ok(done),
        }
    }

    /// What a pass may take: little of the time between checkpoints, and of the patience of whoever stops the run; and
    /// enough to cost nothing by itself.
    pub fn pass_time(&self) -> Duration {
        (self.every / 4).clamp(Duration::from_millis(50), Duration::from_secs(5))
    }

    /// Writes it where it is time to. A run that was told to stop ends with that.
    pub fn save_at_times(&mut self, renderer: &Renderer) {
        let stop = self.stop.take_if(|stop| stop.is_asked());
        if stop.is_some() || self.saved.elapsed() >= self.every {
            self.save(renderer);
        }
        if let Some(stop) = stop {
            stop.end();
        }
    }

    /// Writes it now. Where that fails the render goes on: there may be room for the picture all the same.
    pub fn save(&mut self, renderer: &Renderer) {
        let Some(path) = &self.path else { return };
        self.saved = Instant::now();
        let saved = write_bytes(path, &[self.key.clone(), renderer.film().to_bytes()].concat());
        if let Err(error) = saved
            && !std::mem::replace(&mut self.told, true)
        {
            complain(&format!("warning: {error}; the render goes on, and begins anew if it is killed"));
        }
    }
}
