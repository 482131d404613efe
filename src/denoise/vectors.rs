//! The vectors that the kernels run on: the widest of this machine.
//!
//! rustc neither fuses nor reorders what a kernel computes, so the width changes no bit, but in the sums of
//! [`gram`](super::gram), whose order is that of the lanes, and where there are no fused multiply-adds. All machines
//! with AVX2 or AVX-512 give the same bits.

use pulp::Arch;

/// The widest vectors that this machine has.
#[cfg(not(test))]
pub fn widest() -> Arch {
    Arch::new()
}

/// The same, or what a test wants of this thread.
#[cfg(test)]
pub fn widest() -> Arch {
    tests::WANTED.get()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline::{Denoiser, Method};
    use crate::denoise::Silent;
    use crate::image::Plane;
    use crate::io::{Picture, ReadOptions};
    use crate::{Denoised, Frame};
    use std::cell::Cell;

    thread_local! {
        pub static WANTED: Cell<Arch> = Cell::new(Arch::new());
    }

    /// AVX2, where this machine has more than that.
    fn avx2() -> Option<Arch> {
        #[cfg(target_arch = "x86_64")]
        if let Arch::V4(simd) = Arch::new() {
            return Some(Arch::V3(*simd));
        }
        None
    }

    fn picture(name: &str) -> Picture {
        let path = format!("{}/fixtures/trace/{name}.exr", env!("CARGO_MANIFEST_DIR"));
        Picture::read(path, &ReadOptions::default()).unwrap()
    }

    fn denoised(frame: &Frame, method: Method, arch: Arch) -> Denoised {
        let thread = rayon::ThreadPoolBuilder::new().num_threads(1).start_handler(move |_| WANTED.set(arch));
        thread.build().unwrap().install(|| Denoiser::new(method).denoise(frame, &Silent).unwrap())
    }

    /// Root of the mean square.
    fn rms(values: impl Iterator<Item = f32>) -> f64 {
        let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + f64::from(v).powi(2), n + 1.0));
        f64::sqrt(sum / n)
    }

    /// What stands at its threshold may tip: a column that is dropped, the order of two, or whether a pixel is covered.
    /// Something does in fog: 3.5e-3 of the picture and 1.3e-2 of its error. The others differ by 3.2e-4 and 1.1e-2 at most.
    #[test]
    fn a_picture_without_vectors_is_the_same_to_a_twentieth_of_its_error_but_for_what_tips() {
        let tips = ("fog_shaft", [1e-2, 5e-2]);
        let others =
            ["foliage", "frosted_glass", "teapot_specular", "lens_table"].map(|name| (name, [1e-3, 5e-2]));
        for (name, [picture_bound, error_bound]) in [tips].into_iter().chain(others) {
            let picture = picture(name);
            let widest = denoised(picture.frame(), Method::Apr, Arch::new());
            let color = || widest.color.iter().flat_map(Plane::data);
            let error = rms(widest.mse.iter().flat_map(Plane::data).map(|mse| mse.sqrt()));
            if let Some(avx2) = avx2() {
                assert!(denoised(picture.frame(), Method::Apr, avx2).color == widest.color, "{name}: bits");
            }
            let other = denoised(picture.frame(), Method::Apr, Arch::Scalar);
            let pairs = color().zip(other.color.iter().flat_map(Plane::data));
            let difference = rms(pairs.map(|(a, b)| a - b));
            let (of_picture, of_error) = (difference / rms(color().copied()), difference / error);
            let told = format!("{name}: {of_picture:.1e}, {of_error:.1e}");
            assert!(of_picture < picture_bound && of_error < error_bound, "{told}");
        }
    }

    #[test]
    fn only_the_sums_over_windows_depend_on_the_width() {
        let picture = picture("teapot_specular");
        let of = |arch| denoised(picture.frame(), Method::Nlm, arch).color;
        let widest = of(Arch::new());
        assert!(of(Arch::Scalar) == widest, "weights and means differ");
    }
}
