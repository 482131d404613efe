//! A render on disk that was looked through: what is known of it as a whole, and its pixels part by part. No more of
//! it is held in memory than the caller has room for.

use std::path::Path;
use std::sync::OnceLock;

use exr::meta::attribute::IntegerBounds;

use super::components::Sum;
use super::decode::ChannelAt;
use super::document::Document;
use super::halves::{Twins, merge_halves};
use super::layout::Layout;
use super::picture::ReadOptions;
use super::pixels::{Held, part_of};
use super::region::{Place, told, write_region};
use super::rewrite::{Addition, DENOISED, Replacement, is_denoised, rewrite};
use super::source::{Hold, Source};
use super::sums::{Deviation, Differences, SumCheck};
use super::variance::Noise;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{Denoised, Frame};
use crate::image::{Plane, Rect, Rgb};

/// A file that was looked through, and the file of its other half where there is one.
#[derive(Debug)]
pub struct Survey {
    main: Source,
    half: Option<Source>,
    layout: Layout,
    signature: OnceLock<String>,
}

/// What all rows together show.
struct Seen {
    /// Of the components that were added up, for each sum.
    differences: Vec<Differences>,
    twins: Twins,
    noise: Noise,
}

/// The planes of one file or two.
type BothHeld = (Held, Option<Held>);

impl Survey {
    /// Looks through the file at `path`, band by band, and shows all rows to `look`, in order. Up to `room` bytes of
    /// what is decoded are kept, so that they need not be read again.
    ///
    /// # Errors
    /// As [`Picture::read`](super::Picture::read).
    pub fn open(
        path: impl AsRef<Path>,
        options: &ReadOptions,
        room: usize,
        mut look: impl FnMut(&Frame),
    ) -> Result<Self> {
        let (mut survey, _) = Self::of_files(path.as_ref(), options, Hold::Blocks(room))?;
        let mut seen = survey.nothing_seen();
        for band in survey.main.bands() {
            let rows = survey.read(band)?;
            survey.see(&rows, &mut seen);
            look(&rows);
        }
        let pixel = survey.read(Rect::whole((1, 1)))?; // tells which planes there are
        survey.complete(&pixel, &seen)?;
        Ok(survey)
    }

    /// The same with all planes held at once: the frame, and the samples of each pixel.
    pub(super) fn open_whole(path: &Path, options: &ReadOptions) -> Result<(Self, Frame, Option<Plane>)> {
        let (mut survey, held) = Self::of_files(path, options, Hold::Planes)?;
        let (frame, counts) = survey.frame(held.expect("it was asked for"), survey.main.window)?;
        let mut seen = survey.nothing_seen();
        survey.see(&frame, &mut seen);
        survey.complete(&frame, &seen)?;
        Ok((survey, frame, counts))
    }

    fn of_files(path: &Path, options: &ReadOptions, hold: Hold) -> Result<(Self, Option<BothHeld>)> {
        let open =
            |path: &Path, hold: Hold| Source::open(path, options, hold).map_err(|error| error.in_file(path));
        let (main, planes) = open(path, hold)?;
        let (half, half_planes) = match &options.half {
            Some(path) => {
                let hold = match hold {
                    Hold::Planes => Hold::Planes,
                    Hold::Blocks(room) => Hold::Blocks(main.keep(room)),
                };
                let (half, planes) = open(path, hold)?;
                check_window(&half, &main).map_err(|error| error.in_file(path))?;
                (Some(half), planes)
            }
            None => (None, None),
        };
        let mut layout = main.layout.clone();
        layout.half = options.half.as_ref().map(|half| half.display().to_string());
        layout.warnings.extend(std::iter::once(&main).chain(&half).filter_map(warn_of_denoised));
        let survey = Self { main, half, layout, signature: OnceLock::new() };
        Ok((survey, planes.map(|planes| (planes, half_planes))))
    }

    /// Keeps from now on up to `room` bytes of what is decoded, and gives up the rest of it.
    pub fn keep(&self, room: usize) {
        let left = self.main.keep(room);
        if let Some(half) = &self.half {
            half.keep(left);
        }
    }

    /// Columns and rows of the colour.
    pub fn size(&self) -> (usize, usize) {
        self.main.size()
    }

    /// Bytes of the largest block of its files, decoded: what is read or written at once is whole ones.
    pub fn block_bytes(&self) -> usize {
        let documents = std::iter::once(&self.main).chain(&self.half).flat_map(|source| &source.documents);
        let headers = documents.flat_map(Document::headers);
        headers.map(|header| header.max_block_byte_size()).max().unwrap_or(0)
    }

    /// Bytes of the planes that were held at once when it was looked through.
    pub fn band_bytes(&self) -> usize {
        std::iter::once(&self.main).chain(&self.half).map(Source::band_bytes).sum()
    }

    /// What was found.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The pixels of the picture that have these coordinates in the file.
    ///
    /// # Errors
    /// `Usage` when some are outside of the data window.
    pub fn locate(&self, (x, y): (i32, i32), (width, height): (usize, usize)) -> Result<Rect> {
        let IntegerBounds { position, size } = self.main.window;
        let along = |at: i32, length: usize, from: i32, size: usize| {
            let start = i64::from(at) - i64::from(from);
            let start = usize::try_from(start).ok().filter(|_| length > 0)?;
            start.checked_add(length).filter(|end| *end <= size).map(|_| start)
        };
        let columns = along(x, width, position.x(), size.width());
        let rows = along(y, height, position.y(), size.height());
        columns.zip(rows).map(|(x, y)| Rect { x, y, width, height }).ok_or_else(|| {
            let what = format!(
                "the region {x},{y},{width},{height} is not inside the picture, which is {},{},{},{}",
                position.x(),
                position.y(),
                size.width(),
                size.height()
            );
            let remedy = "give x and y of its first pixel, width and height in the file's coordinates";
            Error::new(ErrorKind::Usage, what).remedy(remedy).in_file(self.main.documents[0].path())
        })
    }

    /// The frame of the pixels `rect`.
    ///
    /// # Errors
    /// `Unreadable` when a file is damaged or was changed.
    pub fn read(&self, rect: Rect) -> Result<Frame> {
        let main = self.main.planes(rect)?;
        let half = self.half.as_ref().map(|half| half.planes(rect)).transpose()?;
        Ok(self.frame((main, half), part_of(self.main.window, rect))?.0)
    }

    /// The frame of the planes under `window`, and the samples of each pixel.
    fn frame(&self, held: BothHeld, window: IntegerBounds) -> Result<(Frame, Option<Plane>)> {
        let (frame, counts) = self.merged(held)?;
        let origin = window.position;
        Ok((frame.with_origin((origin.x(), origin.y())), counts))
    }

    fn merged(&self, (main, half): BothHeld) -> Result<(Frame, Option<Plane>)> {
        let in_file = |source: &Source, error: Error| error.in_file(source.documents[0].path());
        let (frame, counts) = self.main.frame(main).map_err(|error| in_file(&self.main, error))?;
        let (Some(source), Some(planes)) = (&self.half, half) else { return Ok((frame, counts)) };
        let merged = source.frame(planes).and_then(|(other, _)| merge_halves(&frame, &other));
        // The counts were those of one of the two.
        merged.map(|frame| (frame, None)).map_err(|error| in_file(source, error))
    }

    /// Whether the components that ought to sum to the beauty do so, before and after; `denoised` holds the picture, or
    /// a part of it.
    ///
    /// # Errors
    /// `Usage` when `denoised` is of another picture: it has other AOVs.
    pub fn sums(&self, denoised: &Denoised) -> Result<Vec<SumCheck>> {
        self.check(denoised, denoised.color[0].size())?;
        let after = |sum: &Sum| {
            let addends: Vec<&Rgb> = sum.addends.iter().map(|&i| &denoised.aovs[i].color).collect();
            Deviation::of(&denoised.color, &addends)
        };
        let checks = self.layout.sums.iter().zip(&self.main.sums);
        Ok(checks.map(|(before, sum)| SumCheck { after: Some(after(sum)), ..before.clone() }).collect())
    }

    /// Refuses the result of another picture than this one, of which it is to hold so many columns and rows.
    fn check(&self, denoised: &Denoised, size: (usize, usize)) -> Result<()> {
        let (got, expected) = (denoised.aovs.len(), self.main.aovs.len());
        if got != expected {
            return Err(foreign(format!("the result has {got} AOVs where the picture has {expected}")));
        }
        let Denoised { color, aovs, mse, order, .. } = denoised;
        let planes = color.iter().chain(aovs.iter().flat_map(|aov| &aov.color)).chain(mse).chain([order]);
        match planes.map(Plane::size).find(|got| *got != size) {
            Some((width, height)) => {
                let (columns, rows) = size;
                Err(foreign(format!("the result is {width}×{height} where {columns}×{rows} was expected")))
            }
            None => Ok(()),
        }
    }

    /// Has the results say in their attribute `apr.settings` what they were made by;
    /// [`provenance`](super::provenance()) reads it back. Keep to ASCII: what other letters become is not
    /// promised. Once: what was said first stays.
    pub fn sign(&self, signature: impl Into<String>) {
        self.signature.get_or_init(|| signature.into());
    }

    fn signature(&self) -> Option<&str> {
        self.signature.get().map(String::as_str)
    }

    /// Writes the file again with the denoised beauty and its components; with `aux` also the estimated error,
    /// where there is one (`apr.mse.Y`), and the order chosen (`apr.order.Y`). Everything else passes through bit for
    /// bit. Returns what the user should know.
    ///
    /// # Errors
    /// `Usage` when `denoised` is of another picture; `Misplaced` or `Unwritable` when the folder or the disk does not
    /// take it: `target` is then as it was.
    pub fn write(&self, target: impl AsRef<Path>, denoised: &Denoised, aux: bool) -> Result<Vec<String>> {
        self.check(denoised, self.size())?;
        let (replacements, additions) = self.results(denoised, aux);
        let document = &self.main.documents[0];
        rewrite(document, target.as_ref(), &replacements, &additions, self.signature())
    }

    /// Writes the region `region` of the picture, whose pixels `denoised` holds, as a file of its own: its
    /// data window is the region, and [`merge`](super::merge) puts such files together to what
    /// [`Self::write`] would have written.
    ///
    /// # Errors
    /// As [`Self::write`]; `Usage` too when the region is not inside the picture.
    pub fn write_region(
        &self,
        target: impl AsRef<Path>,
        region: Rect,
        denoised: &Denoised,
        aux: bool,
    ) -> Result<Vec<String>> {
        if !Rect::whole(self.size()).holds(region) {
            return Err(foreign(format!("the region {region:?} is not inside the picture")));
        }
        self.check(denoised, region.size())?;
        let (replacements, additions) = self.results(denoised, aux);
        let sources = std::iter::once(&self.main).chain(&self.half);
        let mut inputs = Vec::new();
        for document in sources.flat_map(|source| &source.documents) {
            inputs.push(format!("{:016x}", document.fingerprint()?));
        }
        let place = Place { picture: self.main.window, region: part_of(self.main.window, region), inputs };
        let document = &self.main.documents[0];
        write_region(document, target.as_ref(), &replacements, &additions, self.signature(), &place)
    }

    /// What `denoised` puts in the place of which channels, and what it adds.
    fn results<'a>(&self, denoised: &'a Denoised, aux: bool) -> (Vec<Replacement<'a>>, Vec<Addition<'a>>) {
        let components = self.main.aovs.iter().zip(&denoised.aovs).map(|(places, aov)| (places, &aov.color));
        let replace = |(places, rgb): (&Vec<ChannelAt>, &'a Rgb)| {
            let pairs = places.iter().zip(rgb).map(|(&at, plane)| Replacement { at, plane });
            pairs.collect::<Vec<_>>()
        };
        let beauty = std::iter::once((&self.main.beauty, &denoised.color));
        let replacements = beauty.chain(components).flat_map(replace).collect();
        let mut additions = Vec::new();
        if aux {
            additions.extend(denoised.mse.iter().map(|plane| Addition { name: "apr.mse.Y", plane }));
            additions.push(Addition { name: "apr.order.Y", plane: &denoised.order });
        }
        (replacements, additions)
    }

    fn nothing_seen(&self) -> Seen {
        let differences = vec![Differences::default(); self.main.sums.len()];
        Seen { differences, twins: Twins::default(), noise: Noise::default() }
    }

    /// Looks at the next rows.
    fn see(&self, rows: &Frame, seen: &mut Seen) {
        if self.half.is_some() {
            seen.twins.add(rows);
        }
        seen.noise.add(rows);
        for (differences, sum) in seen.differences.iter_mut().zip(&self.main.sums) {
            let addends = sum.addends.iter().map(|&i| rows.aovs()[i].color.each_ref());
            differences.add(rows.color().each_ref(), &addends.collect::<Vec<_>>());
        }
    }

    /// Adds to the layout what the frames showed, of which `frame` is one.
    ///
    /// # Errors
    /// `Lacking` when both halves are the same render.
    fn complete(&mut self, frame: &Frame, seen: &Seen) -> Result<()> {
        let half = self.half.as_ref().map_or(Path::new(""), |half| half.documents[0].path());
        let strange = seen.twins.check().map_err(|error| error.in_file(half))?;
        self.layout.warnings.extend(strange.map(|words| format!("{}: {words}", half.display())));
        self.layout.warnings.extend(seen.noise.warning());
        self.layout.complete(frame);
        for (sum, differences) in self.main.sums.iter().zip(&seen.differences) {
            let before = differences.deviation();
            let layers: Vec<String> = sum.addends.iter().map(|&i| frame.aovs()[i].name.clone()).collect();
            let (set, names) = (sum.name, layers.join("' + '"));
            if sum.by_itself && before.relative_rms.is_nan() {
                self.layout.warnings.push(format!(
                    "{set}: whether '{names}' sum to the beauty cannot be told: at every pixel one of them is no \
                     number"
                ));
            } else if sum.by_itself && !before.is_small() {
                self.layout.warnings.push(format!(
                    "{set}: '{names}' do not sum to the beauty: the noisy ones already differ from it by {:.2} % \
                     (relative RMS); something that the beauty shows is in none of them (emission, background, \
                     lights without a group?) or in several",
                    100.0 * before.relative_rms
                ));
            }
            self.layout.sums.push(SumCheck { set: sum.name.to_owned(), layers, before, after: None });
        }
        Ok(())
    }
}

fn foreign(what: String) -> Error {
    Error::new(ErrorKind::Usage, what).remedy("denoise the frame of this very picture")
}

/// Tells of a colour that is a result itself: what noise it still has is none that anything here expects.
fn warn_of_denoised(source: &Source) -> Option<String> {
    let file = &source.documents[0];
    source.color().any(|at| is_denoised(file.headers(), at)).then(|| {
        let file = file.path().display();
        format!(
            "{file}: is denoised already, as its attribute {DENOISED} tells: its noise is no longer the render's, so that \
             detail passes for noise and the estimated error is wrong; give the render itself"
        )
    })
}

/// Refuses another half whose pixels are not the first's.
fn check_window(half: &Source, first: &Source) -> Result<()> {
    if half.window == first.window {
        return Ok(());
    }
    let [here, there] = [half, first].map(|source| told(source.window));
    let what = format!("its data window is {here} where the first half's is {there}");
    let remedy = "give two renders of the same frame and region with different seeds";
    Err(Error::new(ErrorKind::Lacking, what).remedy(remedy))
}
