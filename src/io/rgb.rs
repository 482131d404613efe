//! The colour of any file, for comparisons.

use std::path::Path;

use exr::prelude::ReadChannels;
use exr::prelude::ReadLayers;

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Plane, Rgb};

/// Reads the colour of the EXR file at `path`.
///
/// # Errors
/// When the file cannot be read or has no colour.
pub fn read_rgb(path: impl AsRef<Path>) -> Result<Rgb> {
    let path = path.as_ref();
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_file(path)
        .map_err(|error| Error::new(ErrorKind::Unreadable, error.to_string()).in_file(path))?;
    for layer in &image.layer_data {
        let plane = |name: &str| {
            let channel = layer.channel_data.list.iter().find(|channel| channel.name == *name)?;
            Plane::from_vec(layer.size.0, layer.size.1, channel.sample_data.values_as_f32().collect()).ok()
        };
        if let (Some(r), Some(g), Some(b)) = (plane("R"), plane("G"), plane("B")) {
            return Ok([r, g, b]);
        }
    }
    Err(Error::new(ErrorKind::Lacking, "has no channels R, G and B").in_file(path))
}
