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
    /// Those that `kernels` ask for of `picture`: what is among these already is kept, the rest of them given up.
    #[must_use]
    pub fn turned_to<'k>(
        self,
        kernels: impl IntoIterator<Item = &'k Kernel> + Clone,
        picture: Guided<'_>,
        options: &Options,
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
        Self {
            irradiance: if by_irradiance { irradiance.or_else(over_albedo) } else { None },
            color: color.filter(|_| by_color),
            surfaces: if by_surfaces && surfaces.is_empty() {
                Surfaces::new(picture.features, picture.spreads, options.window_radius)
            } else {
                surfaces
            },
        }
    }

    /// Lets the colours' differences pass for noise no farther than is `forgiven`.
    pub fn forgive(&mut self, tolerance: f32, forgiven: &Plane) {
        for guide in [&mut self.color, &mut self.irradiance].into_iter().flatten() {
            guide.forgive_where(tolerance, forgiven);
        }
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
    Guide::new(&picture.color, &trusted.each_ref(), whole, radii(options), options.tolerance)
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
    Guide::of(size, Rect::whole(size), radii(options), options.tolerance, 3, value, variance)
}
