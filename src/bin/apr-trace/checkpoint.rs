//! `--reference`: a long render's state beside its output, so that a killed run goes on.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use apr::io::write_bytes;
use apr::trace::{RenderOptions, Renderer, Scene};
use apr::{Error, ErrorKind, Result};

use super::Args;

/// The state of a long render beside its output. None is kept of others.
pub struct Checkpoint {
    path: Option<PathBuf>,
    every: Duration,
    saved: Instant,
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
        let key = format!("apr-trace checkpoint 1\n{:016x}\n{what:?}\n", scene.fingerprint()).into_bytes();
        let every = Duration::try_from_secs_f64(args.checkpoint_every.max(0.0)).unwrap_or(Duration::MAX);
        Self { path: path(args), every, saved: Instant::now(), key }
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
        let film = bytes.strip_prefix(self.key.as_slice());
        let film = film.ok_or_else(|| unreadable("belongs to another scene, seed or options".into()))?;
        renderer
            .film_mut()
            .restore(film)
            .map_err(|error| error.in_file(path).remedy("remove it to start anew"))?;
        match renderer.film().counts()[0].drawn {
            more if more > spp => Err(unreadable(format!("holds {more} samples per pixel already"))),
            done => Ok(done),
        }
    }

    /// What a pass may take: little of the time between checkpoints, and enough to cost nothing by itself.
    pub fn pass_time(&self) -> Duration {
        (self.every / 4).max(Duration::from_millis(50))
    }

    /// Writes it where it is time to.
    pub fn save_at_times(&mut self, renderer: &Renderer) -> Result<()> {
        if self.saved.elapsed() >= self.every { self.save(renderer) } else { Ok(()) }
    }

    /// Writes it now: after the last pass, so that a picture which cannot be written costs no second render.
    pub fn save(&mut self, renderer: &Renderer) -> Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        write_bytes(path, &[self.key.clone(), renderer.film().to_bytes()].concat())?;
        self.saved = Instant::now();
        Ok(())
    }
}
