//! The colour of a file and nothing else, for comparisons and references.

use std::path::Path;

use exr::meta::attribute::IntegerBounds;

use super::channels::{Role, Statistic};
use super::decode::{ChannelAt, read_planes};
use super::document::Document;
use super::layers::Channel;
use super::mapping::mapped_choice;
use super::mapping::{Mapping, Target};
use super::names::told_name;
use super::recognize::{detect, layers};
use super::region::{bounds, numbers, text, told};
use super::rewrite::signature_in;
use super::roles::Casting;
use super::source::no_color;
use crate::error::{Error, ErrorKind, Result};
use crate::image::Rgb;

/// Where the colour of a file is. Windows are x, y, width and height in the file's pixel coordinates.
#[derive(Debug)]
pub struct Beauty {
    document: Document,
    places: Vec<ChannelAt>,
    channels: Vec<String>,
    others: Vec<String>,
    noisy: Vec<String>,
}

impl Beauty {
    /// Finds the colour of the file at `path`: the channels that are `mapped` to it, else what the channel map says.
    /// Errors call it by its `role`, which the user maps. Reads no pixels.
    ///
    /// # Errors
    /// As [`Picture::read`](super::Picture::read).
    pub fn find(path: impl AsRef<Path>, role: &str, mapped: Option<&[String]>) -> Result<Self> {
        let path = path.as_ref();
        Self::found(path, role, mapped).map_err(|error| error.in_file(path))
    }

    fn found(path: &Path, role: &str, mapped: Option<&[String]>) -> Result<Self> {
        let documents = [Document::open(path)?];
        let layers = layers(&documents, None);
        let mapping = mapped.map(|channels| Mapping { name: role.to_owned(), channels: channels.to_vec() });
        let target = || Target { role: Role::Color, feature: String::new(), statistic: Statistic::Mean };
        let choice =
            mapping.map(|mapping| mapped_choice(&mapping, target(), &documents, &layers)).transpose()?;
        let casting = Casting::new(&layers, detect(&documents[0], &layers), choice.as_slice());
        let color = casting.color().ok_or_else(|| no_color(&layers, role))?;
        let beauty = casting.beauty(&color);
        let told = |channels: &[Channel]| channels.iter().map(|&c| told_name(&documents, c)).collect();
        let (channels, read) = (told(&beauty), told(&color.mean.channels));
        let ours = signature_in(documents[0].headers()).is_some();
        let noisy = if ours || read == channels { Vec::new() } else { read };
        let places = beauty.iter().map(|channel| channel.at).collect();
        let others = casting.other_colors(&color);
        let [document] = documents;
        Ok(Self { document, places, channels, others, noisy })
    }

    /// The colour's channels.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// What could have been the colour as well: the picture of the other eye, of another view layer.
    pub fn others(&self) -> &[String] {
        &self.others
    }

    /// The channels of the noisy picture that the file has besides, where the renderer may have denoised the colour
    /// itself: what [`Picture::read`](super::Picture::read) reads. None in this program's own results.
    pub fn noisy(&self) -> &[String] {
        &self.noisy
    }

    /// The colour's data window.
    pub fn window(&self) -> [i64; 4] {
        numbers(self.bounds())
    }

    /// The pixels of `window` that this file has too, which is to show the same picture as `other`.
    ///
    /// # Errors
    /// `Lacking` when it has none of them, or the files' windows are not those of one picture.
    pub fn shared(&self, other: &Self, window: [i64; 4]) -> Result<[i64; 4]> {
        let there = other.document.path().display();
        let lacking = |what: String, remedy: &str| {
            let error = Error::new(ErrorKind::Lacking, what).remedy(remedy).in_file(self.document.path());
            let part = self.document.part_name(self.places[0].part);
            Err(match part.filter(|_| self.document.headers().len() > 1) {
                Some(part) => error.in_part(part),
                None => error,
            })
        };
        let displays =
            [self, other].map(|file| numbers(file.document.headers()[0].shared_attributes.display_window));
        if displays[0] != displays[1] && self.window() != other.window() {
            let [here, display, own] = [displays[0], displays[1], self.window()].map(text);
            return lacking(
                format!(
                    "its display window is {here} with the data window {own}, where those of {there} are {display} and \
                     {}: which pixels belong together cannot be told",
                    told(other.bounds())
                ),
                "give pictures of the same frame and resolution, or set the windows right",
            );
        }
        overlap(self.window(), window).map_or_else(
            || {
                let (own, wanted) = (told(self.bounds()), text(window));
                lacking(
                    format!("its data window {own} has no pixel of {wanted}, which {there} is compared in"),
                    "give pictures of the same frame, and regions that overlap; compare those that do not one by one",
                )
            },
            Ok,
        )
    }

    /// The colour of the pixels in `window`; a single channel is all three.
    ///
    /// # Errors
    /// `Unreadable` when the file is damaged, `Usage` when there are no such pixels.
    pub fn read(&self, window: [i64; 4]) -> Result<Rgb> {
        let inside = bounds(window).filter(|_| overlap(self.window(), window) == Some(window));
        let inside = inside.ok_or_else(|| {
            let what = format!("{} is not inside its data window {}", text(window), told(self.bounds()));
            Error::new(ErrorKind::Usage, what)
                .remedy("ask for pixels that it has")
                .in_file(self.document.path())
        })?;
        let mut planes = read_planes(&self.document, &self.places, inside)?;
        while planes.len() < 3 {
            planes.push(planes[0].clone());
        }
        Ok(planes.try_into().expect("a colour has one channel or three"))
    }

    fn bounds(&self) -> IntegerBounds {
        self.document.headers()[self.places[0].part].data_window()
    }
}

/// The whole colour of the file at `path`, by the channel map.
///
/// # Errors
/// As [`Picture::read`](super::Picture::read).
pub fn read_rgb(path: impl AsRef<Path>) -> Result<Rgb> {
    let beauty = Beauty::find(path, "color", None)?;
    beauty.read(beauty.window())
}

/// The pixels of both windows, where there are any.
fn overlap(a: [i64; 4], b: [i64; 4]) -> Option<[i64; 4]> {
    let along = |i: usize| {
        let (from, to) = (a[i].max(b[i]), (a[i] + a[i + 2]).min(b[i] + b[i + 2]));
        (from < to).then_some((from, to - from))
    };
    along(0).zip(along(1)).map(|((x, width), (y, height))| [x, y, width, height])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_overlap_where_both_have_pixels() {
        assert_eq!(overlap([0, 0, 8, 6], [-3, 4, 5, 9]), Some([0, 4, 2, 2]));
        assert_eq!(overlap([0, 0, 8, 6], [2, 1, 3, 2]), Some([2, 1, 3, 2]));
        assert_eq!(overlap([0, 0, 8, 6], [8, 0, 4, 4]), None, "they only touch");
    }
}
