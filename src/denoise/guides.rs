//! What the weights compare pixels by: the noisy colour, colour over albedo, the features.
//!
//! Padded copies of many planes: they are made when a stage first asks for them and go when the next one does not.

use super::distances::Compared;
use super::surfaces::{Spread, Surfaces};
use super::weights::Guide;
use crate::image::{Plane, Rect, Rgb};
use crate::options::{Kernel, Options};

/// What the guides of a picture are made of.
#[derive(Clone, Copy)]
pub struct Guided<'a> {
    /// The noisy colour.
    pub color: [&'a Plane; 3],
    /// The variance of its mean.
    pub variance: &'a Rgb,
    /// What the weights may believe of a variance.
    pub trusted: fn(&Plane) -> Plane,
    /// The albedo, its floor added.
    pub albedo: Option<&'a Rgb>,
    /// The features of the design.
    pub features: &'a [Plane],
    /// What these planes belong to.
    pub spreads: &'a [Spread],
}

/// The guides that some kernels ask for.
#[derive(Default)]
pub struct Guides {
    color: Option<Guide>,
    irradiance: Option<Guide>,
    /// Of no feature where no kernel asks.
    surfaces: Surfaces,
}

impl Guides {
    /// Those that `kernels` ask for of `picture`: what is among these already is kept, the rest of them given up. Colours'
    /// differences pass for noise as far as is [`forgiven`](super::forgiveness).
    #[must_use]
    pub fn turned_to<'k>(
        self,
        kernels: impl IntoIterator<Item = &'k Kernel> + Clone,
        picture: Guided<'_>,
        options: &Options,
        forgiven: Option<&Plane>,
    ) -> Self {
        let some = |asks: &dyn Fn(&Kernel) -> bool| kernels.clone().into_iter().any(asks);
        let demodulates = |kernel: &Kernel| kernel.demodulate && picture.albedo.is_some();
        let (by_color, by_irradiance) = (some(&|kernel| !demodulates(kernel)), some(&demodulates));
        let by_surfaces = some(&|kernel| kernel.feature_bandwidth.is_some());

        let surfaces = if by_surfaces { self.surfaces } else { Surfaces::default() };
        let irradiance = self.irradiance.filter(|_| by_irradiance);
        let asked = by_color || (by_irradiance && irradiance.is_none());
        let color = asked.then(|| self.color.unwrap_or_else(|| color(picture, options)));
        let over_albedo =
            || color.as_ref().zip(picture.albedo).map(|(color, albedo)| over(color, albedo, options));
        let irradiance = if by_irradiance { irradiance.or_else(over_albedo) } else { None };
        let tolerating = |guide: Guide| guide.tolerating(options.tolerance, forgiven);
        Self {
            irradiance: irradiance.map(tolerating),
            color: color.filter(|_| by_color).map(tolerating),
            surfaces: if by_surfaces && surfaces.is_empty() {
                Surfaces::new(picture.features, picture.spreads, options.window_radius)
            } else {
                surfaces
            },
        }
    }

    /// The same where no more than this is `forgiven`.
    #[must_use]
    pub fn forgiving(self, forgiven: &Plane, options: &Options) -> Self {
        let tolerating = |guide: Guide| guide.tolerating(options.tolerance, Some(forgiven));
        Self { color: self.color.map(tolerating), irradiance: self.irradiance.map(tolerating), ..self }
    }

    /// What a kernel compares, colour over albedo or colour; it must be one of those that these were
    /// [turned to](Self::turned_to).
    pub fn compared(&self, demodulated: bool) -> Compared<'_> {
        let color = if demodulated { &self.irradiance } else { &self.color };
        let color = color.as_ref().expect("the guides were turned to the stage's kernels");
        Compared { color, surfaces: &self.surfaces }
    }
}

fn radii(options: &Options) -> [usize; 2] {
    [options.window_radius, options.largest_patch()]
}

/// The guide of the noisy colour.
fn color(picture: Guided<'_>, options: &Options) -> Guide {
    let trusted = picture.variance.each_ref().map(picture.trusted);
    let whole = Rect::whole(picture.color[0].size());
    Guide::new(&picture.color, &trusted.each_ref(), whole, radii(options))
}

/// The guide of the whole picture's `color` over the `albedo`.
fn over(color: &Guide, albedo: &Rgb, options: &Options) -> Guide {
    let size = albedo[0].size();
    let divide = |c: usize, [x, y]: [usize; 2], out: &mut [f32]| {
        out.iter_mut().zip(&albedo[c].row(y)[x..]).for_each(|(value, albedo)| *value /= albedo);
    };
    let value = |c: usize, at: [usize; 2], out: &mut [f32]| {
        color.copy_row(c, at, out);
        divide(c, at, out);
    };
    let variance = |c: usize, at: [usize; 2], out: &mut [f32]| {
        color.copy_variance_row(c, at, out);
        divide(c, at, out);
        divide(c, at, out);
    };
    Guide::of(size, Rect::whole(size), radii(options), 3, value, variance)
}
