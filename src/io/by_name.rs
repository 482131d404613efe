//! What the names of a file's layers tell, before any pixel is read.

use std::path::Path;

use super::channels::Renderer;
use super::components::Asked;
use super::document::Document;
use super::layers::{Channel, Layer};
use super::mapping::mapped_choices;
use super::picture::ReadOptions;
use super::recognize::{detect, layers};
use super::rewrite::{is_denoised, names_results, signature_in};
use super::roles::{Candidate, Casting, Choice};
use super::source::{no_color, open_all};
use crate::error::Result;

/// The renderer, the colour, and where its result goes.
pub(super) struct Named<'a> {
    documents: &'a [Document],
    pub(super) renderer: Renderer,
    pub(super) casting: Casting<'a>,
    pub(super) color: Candidate,
    /// The channels that get the result.
    pub(super) beauty: Vec<Channel>,
}

impl<'a> Named<'a> {
    /// Of the `layers` of the `documents`, some of which are `mapped`.
    ///
    /// # Errors
    /// `Lacking` or `Unreadable` when there is no colour.
    pub(super) fn new(
        documents: &'a [Document],
        layers: &'a [Layer],
        mapped: &'a [Choice],
        profile: Option<Renderer>,
    ) -> Result<Self> {
        let renderer = profile.unwrap_or_else(|| detect(&documents[0], layers));
        let casting = Casting::new(layers, renderer, mapped);
        let color = casting.color().ok_or_else(|| no_color(layers, "color"))?;
        let beauty = casting.beauty(&color);
        Ok(Self { documents, renderer, casting, color, beauty })
    }

    /// The components that are denoised with the colour when `names` ask for them.
    ///
    /// # Errors
    /// As [`Asked::find`].
    pub(super) fn components(&self, names: &[String]) -> Result<Asked> {
        let headers = self.documents[0].headers();
        let window = headers[self.color.mean.channels[0].at.part].data_window();
        let writable = |channel: &Channel| headers[channel.at.part].data_window() == window;
        Asked::find(names, &self.casting, self.renderer, &self.color, &self.beauty, writable)
    }
}

/// The layers of these files, of a renderer that may be given.
pub(super) fn layers_of(documents: &[Document], profile: Option<Renderer>) -> Vec<Layer> {
    layers(documents, profile.filter(|renderer| renderer.writes_one_file_per_buffer()))
}

/// Whether some channel that these `options` have the result written into holds a result of this program already. The
/// file may hold others: of the other eye, say. A result that does not name its channels holds nothing else. Reads no
/// pixels.
///
/// # Errors
/// As [`Picture::read`](super::Picture::read).
pub fn holds_result(path: impl AsRef<Path>, options: &ReadOptions) -> Result<bool> {
    let path = path.as_ref();
    let find = || {
        let documents = open_all(path, options)?;
        let headers = documents[0].headers();
        if !names_results(headers) {
            return Ok(signature_in(headers).is_some());
        }
        let layers = layers_of(&documents, options.profile);
        let mapped = mapped_choices(options, &documents, &layers)?;
        let named = Named::new(&documents, &layers, &mapped, options.profile)?;
        let components = named.components(&options.aovs)?;
        let mut written = named.beauty.iter().copied().chain(components.channels());
        Ok(written.any(|channel| is_denoised(headers, channel.at)))
    };
    find().map_err(|error: crate::Error| error.in_file(path))
}
