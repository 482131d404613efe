//! PNG pictures: tone-mapped results side by side, and heat maps of error.

use image::{ImageBuffer, ImageFormat, Rgb as Pixel, RgbImage};

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Plane, Rgb};
use crate::metrics::REL_MSE_EPSILON;
use crate::tone::{luminance, srgb};

/// The chunk that tells whose a picture is: its type, a keyword that PNG knows, and the program's name.
pub(super) const MARK: &str = concat!("tEXtSoftware\0", env!("CARGO_PKG_NAME"));

/// Columns of white between pictures that stand side by side.
const GAP: u32 = 4;

/// The heat map's range of relMSE: it spans the decades from "nobody sees it" to "plainly wrong".
pub const HEAT_RANGE: (f32, f32) = (1e-5, 1e1);

/// Anchors of the heat map, dark to bright, evenly spaced: matplotlib's `inferno`, which rises
/// steadily in lightness and so can be read in grey too.
const INFERNO: [[u8; 3]; 9] = [
    [0, 0, 4],
    [31, 12, 72],
    [85, 15, 109],
    [136, 34, 106],
    [186, 54, 85],
    [227, 89, 51],
    [249, 140, 10],
    [249, 201, 50],
    [252, 255, 164],
];

/// `pictures` from left to right under the fixed tone map of [`crate::tone`], as PNG.
///
/// # Errors
/// When there is none, their heights differ, or a picture is too large for PNG.
pub fn side_by_side(pictures: &[&Rgb]) -> Result<Vec<u8>> {
    let tone_mapped: Vec<RgbImage> = pictures
        .iter()
        .map(|p| {
            let pixel = |x, y| Pixel(p.each_ref().map(|plane| byte(srgb(plane.get(x as usize, y as usize)))));
            ImageBuffer::from_fn(p[0].width() as u32, p[0].height() as u32, pixel)
        })
        .collect();
    encode(&row(&tone_mapped)?)
}

/// Planes of squared relative error from left to right, each on one logarithmic scale over
/// [`HEAT_RANGE`] (black is the lower end or less, pale yellow the upper end or more), as PNG.
///
/// # Errors
/// When there is none, their heights differ, or a picture is too large for PNG.
pub fn heat_maps(planes: &[&Plane]) -> Result<Vec<u8>> {
    let (low, high) = (HEAT_RANGE.0.log10(), HEAT_RANGE.1.log10());
    let maps: Vec<RgbImage> = planes
        .iter()
        .map(|plane| {
            colored(plane, |value| inferno((value.max(f32::MIN_POSITIVE).log10() - low) / (high - low)))
        })
        .collect();
    encode(&row(&maps)?)
}

/// (x − r) / √(r² + 0.01) of the luminance, on a scale from blue (−0.5 or less: too dark) over white
/// to red (0.5 or more: too bright), as PNG.
///
/// # Errors
/// When the picture is too large for PNG.
///
/// # Panics
/// When the pictures differ in size.
pub fn signed_error(result: &Rgb, reference: &Rgb) -> Result<Vec<u8>> {
    const FULL: f32 = 0.5;
    let width = reference[0].width();
    let error = Plane::from_fn(width, reference[0].height(), |x, y| {
        let (a, r) = (luminance(result, y * width + x), luminance(reference, y * width + x));
        (a - r) / (r * r + REL_MSE_EPSILON as f32).sqrt()
    });
    encode(&colored(&error, |value| {
        let t = (value / FULL).clamp(-1.0, 1.0);
        let [rise, fall] = [t.max(0.0), (-t).max(0.0)];
        [1.0 - fall, 1.0 - rise.max(fall), 1.0 - rise].map(byte)
    }))
}

/// A map of polynomial orders, 0 (black) to 3 (pale yellow), as PNG.
///
/// # Errors
/// When the picture is too large for PNG.
pub fn order_map(order: &Plane) -> Result<Vec<u8>> {
    encode(&colored(order, |value| inferno(value / 3.0)))
}

/// `plane` through `color`.
fn colored(plane: &Plane, color: impl Fn(f32) -> [u8; 3]) -> RgbImage {
    ImageBuffer::from_fn(plane.width() as u32, plane.height() as u32, |x, y| {
        Pixel(color(plane.get(x as usize, y as usize)))
    })
}

/// The heat map's colour at `t`, 0 (dark) to 1 (bright); what lies outside is cut.
fn inferno(t: f32) -> [u8; 3] {
    let steps = (INFERNO.len() - 1) as f32;
    let at = t.clamp(0.0, 1.0) * steps;
    let i = (at as usize).min(INFERNO.len() - 2);
    std::array::from_fn(|c| {
        let (a, b) = (f32::from(INFERNO[i][c]), f32::from(INFERNO[i + 1][c]));
        (a + (b - a) * (at - i as f32)).round() as u8
    })
}

fn byte(value: f32) -> u8 {
    (value * 255.0).round() as u8
}

fn row(pictures: &[RgbImage]) -> Result<RgbImage> {
    let wrong = |what: &str| Err(Error::new(ErrorKind::Lacking, format!("side by side: {what}")));
    let Some(height) = pictures.first().map(ImageBuffer::height) else {
        return wrong("there is no picture");
    };
    if pictures.iter().any(|p| p.height() != height) {
        return wrong("the pictures differ in height");
    }
    let width = pictures.iter().map(|p| p.width() + GAP).sum::<u32>() - GAP;
    let mut joined = RgbImage::from_pixel(width, height, Pixel([255; 3]));
    let mut left = 0;
    for picture in pictures {
        image::imageops::replace(&mut joined, picture, i64::from(left), 0);
        left += picture.width() + GAP;
    }
    Ok(joined)
}

fn encode(picture: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|error| Error::new(ErrorKind::Internal, format!("the PNG cannot be encoded: {error}")))?;
    let mut bytes = bytes.into_inner();
    bytes.splice(HEADER..HEADER, mark());
    Ok(bytes)
}

/// Bytes of PNG's signature and of its first chunk, which the others follow.
const HEADER: usize = 8 + 4 + 4 + 13 + 4;

/// [`MARK`] as a chunk: its length without the type, and a checksum behind it.
fn mark() -> Vec<u8> {
    let length = (MARK.len() - 4) as u32;
    let checksum = libdeflater::crc32(MARK.as_bytes());
    [&length.to_be_bytes(), MARK.as_bytes(), &checksum.to_be_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(png: &[u8]) -> RgbImage {
        image::load_from_memory(png).unwrap().to_rgb8()
    }

    #[test]
    fn pictures_stand_in_order_with_a_white_gap() {
        let grey = |v: f32| -> Rgb { std::array::from_fn(|_| Plane::filled(3, 2, v)) };
        let joined = decode(&side_by_side(&[&grey(0.0), &grey(0.215_86)]).unwrap());
        assert_eq!(joined.dimensions(), (3 + GAP + 3, 2));
        assert_eq!(joined.get_pixel(2, 1).0, [0; 3]);
        assert_eq!(joined.get_pixel(3, 0).0, [255; 3]);
        assert_eq!(joined.get_pixel(3 + GAP, 1).0, [128; 3]); // sRGB's middle grey
    }

    #[test]
    fn heat_rises_with_the_error_and_is_cut_at_both_ends() {
        let plane = Plane::from_vec(5, 1, vec![0.0, 1e-5, 1e-2, 1e1, 1e9]).unwrap();
        let map = decode(&heat_maps(&[&plane]).unwrap());
        let at = |x: u32| map.get_pixel(x, 0).0;
        assert_eq!([at(0), at(1)], [INFERNO[0]; 2]);
        assert_eq!(at(2), INFERNO[4]);
        assert_eq!([at(3), at(4)], [INFERNO[8]; 2]);
    }

    #[test]
    fn too_dark_is_blue_right_is_white_and_too_bright_is_red() {
        let picture = |values: [f32; 3]| -> Rgb {
            std::array::from_fn(|_| Plane::from_vec(3, 1, values.to_vec()).unwrap())
        };
        let map = decode(&signed_error(&picture([0.0, 1.0, 9.0]), &picture([1.0; 3])).unwrap());
        assert_eq!([0, 1, 2].map(|x| map.get_pixel(x, 0).0), [[0, 0, 255], [255; 3], [255, 0, 0]]);
    }

    #[test]
    fn pictures_of_different_heights_are_refused() {
        let (a, b) = (Plane::filled(2, 2, 0.0), Plane::filled(2, 3, 0.0));
        assert!(heat_maps(&[&a, &b]).is_err());
        assert!(heat_maps(&[]).is_err());
    }
}
