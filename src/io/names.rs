//! What the channels of several files are called.

use super::document::Document;
use super::layers::Channel;

/// The names by which a channel may be called: its own, and with its part's in front.
pub(super) fn full_names(documents: &[Document], channel: Channel) -> Vec<String> {
    let document = &documents[channel.file];
    let own = document.headers()[channel.at.part].channels.list[channel.at.channel].name.to_string();
    let with_part = document.part_name(channel.at.part).map(|part| format!("{part}.{own}"));
    std::iter::once(own).chain(with_part).collect()
}

/// The name that tells a channel from all others of its file: where it has several parts, with its part's.
pub(super) fn told_name(documents: &[Document], channel: Channel) -> String {
    let parts = documents[channel.file].headers().len();
    let mut names = full_names(documents, channel);
    let part = documents[channel.file].part_name(channel.at.part).unwrap_or_default();
    let has_it = names[0].strip_prefix(part.as_str()).is_some_and(|rest| rest.starts_with('.'));
    if parts > 1 && !has_it { names.pop().unwrap_or_default() } else { names.swap_remove(0) }
}
