//! The attributes of a file's headers as they stand in it, beside what the exr crate makes of them.
//!
//! The crate would leave out an attribute whose value it does not understand, would not write a time code of
//! more than 29 frames a second, writes another key code than it has read, and does not see
//! that the name of a type is long. [`keep`] and [`finish`] make good for it, so that every attribute of an
//! input comes out as it was.
//!
//! The crate also keeps attributes of foreign names in a map without order, so that two runs over one
//! input would differ in their headers' bytes. The OpenEXR library sorts by name, and so does [`finish`].

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::mem::take;

use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::{Header, ImageAttributes};

/// Of the version field: names, of attributes and of their types, may have more than [`SHORT`] letters.
const LONG_NAMES: u32 = 1 << 10;

/// Of the version field: there are several headers, and an empty one ends them.
const MULTI_PART: u32 = 1 << 12;

/// The most letters of a name without [`LONG_NAMES`].
const SHORT: usize = 31;

/// Magic number and version.
const START: usize = 8;

/// One attribute, not interpreted. By name first: no two of a header's names are the same.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Attribute {
    name: Vec<u8>,
    kind: Vec<u8>,
    value: Vec<u8>,
}

/// What the crate makes a header's other fields of, and writes again from them; and a view's name.
const UNDERSTOOD: [&[u8]; 15] = [
    b"channels",
    b"chunkCount",
    b"compression",
    b"dataWindow",
    b"displayWindow",
    b"lineOrder",
    b"maxSamplesPerPixel",
    b"name",
    b"pixelAspectRatio",
    b"screenWindowCenter",
    b"screenWindowWidth",
    b"tiles",
    b"type",
    b"version",
    b"view",
];

/// Turns all attributes that are none of this program's business into bytes, as they stand in `file`, which the
/// `headers` were read from. What may mean something here, texts and numbers, stays.
///
/// # Errors
/// When the file cannot be read, or its headers are no longer those.
pub(super) fn keep(headers: &mut [Header], file: &mut (impl BufRead + Seek)) -> exr::error::UnitResult {
    file.rewind()?;
    let (_, stored) = read(file)?;
    if stored.len() != headers.len() {
        return Err(exr::error::Error::Invalid("number of headers".into()));
    }
    for (header, stored) in headers.iter_mut().zip(stored) {
        let (shared, own) = (&mut header.shared_attributes, &mut header.own_attributes);
        let parsed = take(own);
        own.layer_name = parsed.layer_name;
        own.layer_position = parsed.layer_position;
        own.screen_window_center = parsed.screen_window_center;
        own.screen_window_width = parsed.screen_window_width;
        own.view_name = parsed.view_name;
        *shared = ImageAttributes {
            pixel_aspect: shared.pixel_aspect,
            ..ImageAttributes::new(shared.display_window)
        };
        for Attribute { name, kind, value } in stored {
            if !UNDERSTOOD.contains(&&*name) {
                let name = Text::from_slice_unchecked(&name);
                let readable = parsed.other.get(&name).filter(|parsed| match parsed {
                    AttributeValue::Text(_) => true,
                    AttributeValue::I32(_) | AttributeValue::F32(_) => value.len() == 4,
                    AttributeValue::F64(_) => value.len() == 8,
                    _ => false,
                });
                let bytes = || AttributeValue::Custom {
                    kind: Text::from_slice_unchecked(&kind),
                    bytes: value.as_slice().into(),
                };
                let kept = readable.cloned().unwrap_or_else(bytes);
                own.other.insert(name, kept);
            }
        }
    }
    Ok(())
}

/// Sorts the attributes of all headers of the whole EXR file in place, and says in its version whether any name
/// is long: nothing changes its size, so nothing behind moves.
///
/// # Errors
/// When the file cannot be read or written.
pub(super) fn finish(mut file: &File) -> io::Result<()> {
    file.rewind()?;
    let (mut version, mut headers) = read(&mut BufReader::new(file))?;
    let is_long = |attribute: &Attribute| attribute.name.len().max(attribute.kind.len()) > SHORT;
    if headers.iter().flatten().any(is_long) {
        version |= LONG_NAMES;
    }
    let mut sorted = version.to_le_bytes().to_vec();
    for attributes in &mut headers {
        attributes.sort();
        for Attribute { name, kind, value } in attributes {
            let size = (value.len() as u32).to_le_bytes();
            sorted.extend([&name[..], b"\0", kind, b"\0", &size, value].concat());
        }
        sorted.push(0);
    }
    file.seek(SeekFrom::Start((START - size_of_val(&version)) as u64))?;
    file.write_all(&sorted)
}

/// The version and all headers of a file.
fn read(file: &mut impl BufRead) -> io::Result<(u32, Vec<Vec<Attribute>>)> {
    let mut start = [0; START];
    file.read_exact(&mut start)?;
    let [.., a, b, c, d] = start;
    let version = u32::from_le_bytes([a, b, c, d]);
    let mut headers = vec![attributes(file)?];
    if version & MULTI_PART != 0 {
        while file.fill_buf()?.first().is_some_and(|&byte| byte != 0) {
            headers.push(attributes(file)?);
        }
    }
    Ok((version, headers))
}

/// One header's attributes, up to the empty name behind the last.
fn attributes(file: &mut impl BufRead) -> io::Result<Vec<Attribute>> {
    let mut attributes = Vec::new();
    loop {
        let name = text(file)?;
        if name.is_empty() {
            return Ok(attributes);
        }
        let kind = text(file)?;
        let mut size = [0; 4];
        file.read_exact(&mut size)?;
        let mut value = Vec::new();
        file.by_ref().take(u32::from_le_bytes(size).into()).read_to_end(&mut value)?;
        attributes.push(Attribute { name, kind, value });
    }
}

/// What stands before the next zero.
fn text(file: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    file.read_until(0, &mut text)?;
    text.pop();
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, value: &str) -> Vec<u8> {
        let size = (value.len() as u32).to_le_bytes();
        [name.as_bytes(), b"\0string\0", &size, value.as_bytes()].concat()
    }

    /// The version and the headers of the finished file.
    fn finished(version: u32, headers: &[u8]) -> (u32, Vec<u8>) {
        let mut file = tempfile::tempfile().unwrap();
        let whole = [&[0x76, 0x2f, 0x31, 0x01][..], &version.to_le_bytes(), headers, b"pixels"].concat();
        file.write_all(&whole).unwrap();
        finish(&file).unwrap();
        file.rewind().unwrap();
        let mut after = Vec::new();
        file.read_to_end(&mut after).unwrap();
        assert_eq!(after[..4], whole[..4]);
        let version = u32::from_le_bytes(after[4..8].try_into().unwrap());
        (version, after[8..].strip_suffix(b"pixels").unwrap().to_vec())
    }

    #[test]
    fn each_header_is_sorted_and_nothing_else_moves() {
        let (a, b, ab) = (attribute("a", "x\0y"), attribute("b", ""), attribute("ab", "1"));
        let one = [&b[..], &ab, &a, b"\0"].concat();
        let in_order = [&a[..], &ab, &b, b"\0"].concat();
        assert_eq!(finished(2, &one), (2, in_order.clone()));
        let two = [&one[..], &b, b"\0\0"].concat();
        let version = 2 | MULTI_PART;
        assert_eq!(finished(version, &two), (version, [&in_order[..], &b, b"\0\0"].concat()));
    }

    #[test]
    fn a_long_name_is_announced() {
        let headers = |length| [attribute(&"x".repeat(length), ""), vec![0]].concat();
        assert_eq!(finished(2, &headers(SHORT)), (2, headers(SHORT)));
        assert_eq!(finished(2, &headers(SHORT + 1)), (2 | LONG_NAMES, headers(SHORT + 1)));
    }
}
