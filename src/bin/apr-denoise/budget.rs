//! What a run that goes through a picture in parts takes of memory, and what it may take.
//!
//! What is not needed for planes keeps blocks of the file as they were decoded, which are read once then.

use std::str::FromStr;

use apr::error::{Error, ErrorKind, Result};
use apr::image::Rect;
use apr::{Frame, Options};

/// Fewest rows of a band: less would be nearly nothing but halo.
const LEAST_ROWS: usize = 32;

/// Rows that outliers are looked for in at once, where there is room: with some thirty on both sides fewer than any band is
/// read with, and many times those, which are read twice.
const OUTLIER_ROWS: usize = 256;

/// The most that the program holds besides planes, and what is set aside for it before the files are known: measured with
/// blocks of 11 MiB, and with 64 threads, of 272 MiB.
const MOST_FIXED_BYTES: usize = 350 << 20;

/// What a run holds however high its bands are.
#[derive(Debug, Clone, Copy)]
pub struct Fixed {
    /// Besides planes: see [`fixed`].
    pub bytes: usize,
    /// Planes while the picture is looked through.
    pub band: usize,
}

/// How many pixels around what is worked on are read.
#[derive(Debug, Clone, Copy)]
pub struct Halos {
    /// Of what is denoised.
    pub part: usize,
    /// Of rows in which outliers are looked for; none where they are not.
    pub outliers: Option<usize>,
}

/// What it holds besides planes: its code, and for each thread blocks of `block` bytes, one as it is stored and one as it
/// is decoded, and windows with what the allocator keeps of them. Of pictures of 128×96 that is, measured, 18 MiB and 11
/// for each thread.
pub fn fixed(threads: usize, block: usize) -> usize {
    const PROGRAM: usize = 40 << 20;
    const WINDOWS: usize = 12 << 20;
    (PROGRAM + threads * (WINDOWS + 2 * block)).min(MOST_FIXED_BYTES)
}

/// A bound of memory in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryBound(usize);

impl FromStr for MemoryBound {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || "expected a number of bytes with K, M, G or T, such as 512M or 8G".to_owned();
        let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let (number, unit) = text.split_at(digits);
        let unit = unit.to_ascii_uppercase();
        let unit = unit.strip_suffix("IB").or_else(|| unit.strip_suffix('B')).unwrap_or(&unit);
        let power = ["", "K", "M", "G", "T"].iter().position(|known| *known == unit).ok_or_else(wrong)?;
        let number: f64 = number.parse().map_err(|_| wrong())?;
        Ok(Self((number * 1024f64.powi(power as i32)) as usize))
    }
}

/// The memory of a run, in bytes.
#[derive(Debug)]
pub struct Budget {
    /// What it may take in all.
    bound: usize,
    /// What it has taken when the picture was looked through.
    looked: usize,
    /// What it takes whatever is read: the results among it.
    held: usize,
    planes: Planes,
    /// Rows of what is to be denoised.
    rows: usize,
    /// Of the picture, in which outliers are looked for in its full width.
    size: (usize, usize),
    /// Columns that are read.
    width: usize,
    halos: Halos,
    /// Not all of the picture is denoised.
    is_region: bool,
    /// Whether there is no other frame that is denoised while this one is looked through.
    alone: bool,
}

/// Bytes of a file that may be kept while it is looked through, before it is known what is in it: where there is no
/// bound, what denoising a region takes in any case, which needs so many `pixels`.
pub fn before(bound: Option<MemoryBound>, pixels: usize, frames: usize) -> usize {
    let least = pixels.saturating_mul(Planes::default().per_pixel());
    let room = bound.map_or(least, |MemoryBound(bound)| bound.saturating_sub(MOST_FIXED_BYTES));
    if frames == 1 { room } else { 0 }
}

impl Budget {
    /// Of a run of `frames` pictures of this `size`, each denoised under `target` with its halo around it. Without a
    /// bound that is what it takes at once.
    pub fn new(
        bound: Option<MemoryBound>,
        (fixed, planes): (Fixed, Planes),
        target: Rect,
        size: (usize, usize),
        halos: Halos,
        frames: usize,
    ) -> Self {
        // Of a sequence one result is written while the next is made.
        let (held, looked) = (fixed.bytes, fixed.bytes + fixed.band);
        let held = held + planes.result(target) * frames.min(2);
        let (width, alone) = (target.grown(halos.part, size).width, frames == 1);
        let (rows, is_region) = (target.height, target != Rect::whole(size));
        let mut budget = Self { bound: 0, looked, held, planes, rows, size, width, halos, is_region, alone };
        budget.bound = bound.map_or_else(
            || budget.need(rows).max(budget.need_for_outliers(rows, OUTLIER_ROWS)),
            |MemoryBound(bound)| bound,
        );
        budget
    }

    /// What it takes in bands of so many rows.
    fn need(&self, rows: usize) -> usize {
        let stages = self.width * self.planes.per_pixel() * (rows + 2 * self.halos.part).min(self.size.1);
        self.looked.max(self.held + stages).max(self.need_for_outliers(rows, LEAST_ROWS))
    }

    /// What it takes to look for outliers in so many rows, before bands of `band` rows are denoised; nothing where that
    /// is the whole picture, whose outliers are looked for with it.
    fn need_for_outliers(&self, band: usize, rows: usize) -> usize {
        let (width, height) = self.size;
        let apart = self.is_region || band < self.rows;
        let bytes = |halo: usize| width * self.planes.looked_through() * (rows + 2 * halo).min(height);
        self.halos.outliers.filter(|_| apart).map_or(0, |halo| self.held + bytes(halo))
    }

    /// Rows in which outliers are looked for at once.
    pub fn outlier_rows(&self) -> usize {
        let room = self.bound.saturating_sub(self.held) / (self.size.0 * self.planes.looked_through());
        let halo = self.halos.outliers.unwrap_or(0);
        room.saturating_sub(2 * halo).clamp(LEAST_ROWS, OUTLIER_ROWS)
    }

    /// Rows of a band with which the run keeps to the bound.
    pub fn rows(&self) -> Result<usize> {
        let (rows, bound) = (self.rows, self.bound);
        if self.need(rows) <= bound {
            return Ok(rows);
        }
        let least = self.need(LEAST_ROWS.min(rows));
        if least > bound {
            const MIB: usize = 1 << 20;
            let given = if bound < MIB { format!("of {bound} bytes") } else { format!("{}M", bound / MIB) };
            let what = format!("--memory {given} is too little for this picture");
            let remedy = format!("give at least {}M", least.div_ceil(MIB));
            return Err(Error::new(ErrorKind::Usage, what).remedy(remedy));
        }
        let most = (bound - self.held) / (self.width * self.planes.per_pixel()) - 2 * self.halos.part;
        // Bands of equal height: the last one should not be nearly nothing but halo.
        Ok(rows.div_ceil(rows.div_ceil(most)))
    }

    /// What is left while the pixels `read` are in memory as they were read.
    pub fn beside_planes(&self, read: Rect) -> usize {
        self.beside(self.planes.all * size_of::<f32>(), read)
    }

    /// What is left while the stages work on the pixels `read`.
    pub fn beside_stages(&self, read: Rect) -> usize {
        self.beside(self.planes.per_pixel(), read)
    }

    fn beside(&self, per_pixel: usize, read: Rect) -> usize {
        // Of the memory of the band before the allocator keeps some, 4 % of the bound, measured (3840×2160, 2000M).
        let of_the_band_before = if self.need(self.rows) > self.bound { self.bound / 16 } else { 0 };
        let taken = self.held + per_pixel * read.width * read.height + of_the_band_before;
        if self.alone { self.bound.saturating_sub(taken) } else { 0 }
    }
}

/// How many planes a frame has.
#[derive(Debug, Clone, Copy, Default)]
pub struct Planes {
    all: usize,
    /// Of the features that fits read.
    features: usize,
    aovs: usize,
    /// Sums that are held at once.
    sums: usize,
}

impl Planes {
    pub fn of(frame: &Frame, options: &Options) -> Self {
        let rgb = |there: bool| if there { 3 } else { 0 };
        let read = frame.features().iter().filter(|feature| options.features.contains(&feature.kind));
        let features = read.map(|feature| feature.planes.len()).sum();
        let all_features = frame.features().iter().map(|feature| {
            let halves = if feature.halves.is_some() { 2 } else { 0 };
            feature.planes.len() * (1 + usize::from(feature.var_of_mean.is_some()) + halves)
        });
        let aovs = 3 * frame.aovs().len();
        let color = 3 + rgb(frame.color_var_of_mean().is_some()) + 2 * rgb(frame.halves().is_some());
        let sums = options.bandwidths.len().min(2);
        Self { all: color + all_features.sum::<usize>() + aovs, features, aovs, sums }
    }

    /// Bytes for each pixel in which outliers are looked for: the planes as they were read, and the light and the deviation
    /// with what they are made of. In 8192 columns of 56 planes 274 MiB are taken where this lets 317, measured.
    fn looked_through(&self) -> usize {
        const JUDGED: usize = 8;
        (self.all + JUDGED) * size_of::<f32>()
    }

    /// Bytes of the result.
    fn result(&self, target: Rect) -> usize {
        (5 + self.aovs) * size_of::<f32>() * target.width * target.height
    }

    /// Bytes for each pixel that is read, when most is held. That is while features are filtered: the planes as they
    /// were read, the filtered ones, the albedo, the variance and what is smoothed of it; or in the last stage: what fits
    /// read, the guides of colour, of colour over albedo and of the features, the pilot, what is not forgiven, the sums and
    /// their coverage; or, with many components, at its end: what fits read, the sums and the result. Of 31 channels it is
    /// 67 planes, measured in 3840×2160, where this tells 70.
    fn per_pixel(&self) -> usize {
        let (albedo, variance, smoothed, guide, pilot, coverage, input_error) = (3, 3, 4, 8, 4, 1, 3);
        let targets = 3 + self.aovs;
        let (sums, result) = (targets + 4, targets + 3);
        let feature_noise = 2; // the albedo's and the depth's
        let (forgiven, kept_by_allocator) = (1, 1);
        let filtering = self.all + self.features + feature_noise + albedo + variance + smoothed;
        let read = targets + variance + smoothed + self.features + feature_noise + albedo;
        let fitting = read + 2 * guide + 2 * self.features + pilot + forgiven + self.sums * sums + coverage;
        let ending = read + sums + result;
        (filtering.max(fitting).max(ending) + input_error + kept_by_allocator) * size_of::<f32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of what is denoised alone.
    fn halos(part: usize) -> Halos {
        Halos { part, outliers: None }
    }

    #[test]
    fn outliers_of_a_wide_picture_are_looked_for_within_the_bound() {
        let planes = Planes { all: 20, features: 7, aovs: 0, sums: 1 };
        let (size, target) = ((100_000, 4000), Rect { x: 0, y: 0, width: 16, height: 16 });
        let (halos, fixed) = (Halos { part: 300, outliers: Some(26) }, Fixed { bytes: 0, band: 0 });
        let budget =
            |bound: usize| Budget::new(Some(MemoryBound(bound)), (fixed, planes), target, size, halos, 1);
        let need = |rows: usize| planes.result(target) + 100_000 * planes.looked_through() * (rows + 2 * 26);
        assert_eq!(budget(need(100)).outlier_rows(), 100);
        assert_eq!(budget(2 * need(256)).outlier_rows(), 256);
        assert_eq!((budget(need(32)).rows(), budget(need(32)).outlier_rows()), (Ok(16), 32));
        assert!(budget(need(32) - 1).rows().is_err(), "of the region alone there is room for much less");
        // Nothing is looked for before a whole picture that is denoised at once.
        let whole = Budget::new(None, (fixed, planes), Rect::whole(size), size, halos, 1);
        assert_eq!(whole.need_for_outliers(size.1, 256), 0);
    }

    #[test]
    fn sizes_are_read_and_nonsense_is_refused() {
        for (text, bytes) in [("512M", 512 << 20), ("8G", 8 << 30), ("1.5GiB", 3 << 29), ("100", 100)] {
            assert_eq!(text.parse(), Ok(MemoryBound(bytes)), "{text}");
        }
        assert!(["", "G", "8X", "-1G"].iter().all(|text| text.parse::<MemoryBound>().is_err()));
    }

    #[test]
    fn bands_fill_the_bound_and_too_small_a_bound_names_the_least() {
        const HALO: usize = 300;
        let planes = Planes { all: 20, features: 7, aovs: 0, sums: 1 };
        let target = Rect::whole((7680, 4320));
        let budget = |bound| {
            let fixed = Fixed { bytes: MOST_FIXED_BYTES, band: 64 << 20 };
            Budget::new(Some(MemoryBound(bound)), (fixed, planes), target, target.size(), halos(HALO), 1)
        };
        let need = |rows: usize| {
            MOST_FIXED_BYTES + planes.result(target) + planes.per_pixel() * 7680 * (rows + 2 * HALO)
        };
        assert_eq!(budget(64 << 30).rows(), Ok(4320));
        let chosen = budget(4 << 30).rows().unwrap();
        assert!(need(chosen) <= 4 << 30 && chosen >= LEAST_ROWS, "{chosen}");
        let error = budget(1 << 30).rows().unwrap_err();
        let least = need(LEAST_ROWS);
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains(&format!("{}M", least.div_ceil(1 << 20))), "{error}");
        assert_eq!(budget(least).rows(), Ok(LEAST_ROWS));
        assert!(
            budget(100).rows().unwrap_err().to_string().starts_with("--memory of 100 bytes is too little")
        );
    }

    #[test]
    fn small_pictures_on_few_threads_take_little_besides() {
        const MIB: usize = 1 << 20;
        assert_eq!([1, 2, 8].map(|threads| fixed(threads, 0) / MIB), [52, 64, 136]);
        assert_eq!(fixed(2, 15 * MIB) / MIB, 124);
        assert_eq!([fixed(64, 0), fixed(8, 1 << 40)], [MOST_FIXED_BYTES; 2]);
        // A high and narrow picture is looked through in more rows than a band has.
        let (planes, target) =
            (Planes { all: 20, features: 7, aovs: 0, sums: 1 }, Rect::whole((16, 100_000)));
        let run = Fixed { bytes: fixed(1, 0), band: 64 * MIB };
        let error =
            Budget::new(Some(MemoryBound(1)), (run, planes), target, target.size(), halos(30), 1).rows();
        assert!(error.unwrap_err().to_string().ends_with("give at least 116M"));
    }

    #[test]
    fn what_is_left_of_the_bound_keeps_blocks() {
        let planes = Planes { all: 20, features: 7, aovs: 0, sums: 1 };
        let target = Rect::whole((1000, 1000));
        let fixed = fixed(2, 1 << 20);
        let of_run = Fixed { bytes: fixed, band: 0 };
        let budget =
            |bound, frames| Budget::new(bound, (of_run, planes), target, target.size(), halos(300), frames);
        let stages = planes.per_pixel() * 1_000_000;
        let need = fixed + planes.result(target) + stages;
        let ample = budget(Some(MemoryBound(need + 7)), 1);
        assert_eq!([ample.beside_stages(target), ample.beside_planes(target)], [7, 7 + stages - 80_000_000]);
        assert_eq!(budget(None, 1).beside_stages(target), 0, "without a bound it takes what it needs");
        assert_eq!(budget(Some(MemoryBound(2 * need)), 2).beside_planes(target), 0, "another frame needs it");
    }
}
