//! The attributes of a file's headers in the order of their names.
//!
//! The exr crate keeps attributes of foreign names in a map without order, so that two runs over one
//! input would differ in their headers' bytes. The OpenEXR library sorts by name, and so does this.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};

/// Sorts the attributes of all headers of the whole EXR file in place: none changes its size, so
/// nothing behind them moves.
///
/// # Errors
/// When the file cannot be read or written.
pub(super) fn sort(mut file: &File) -> io::Result<()> {
    /// Of the version field: there are several headers, and an empty one ends them.
    const MULTI_PART: u32 = 1 << 12;
    file.rewind()?;
    let mut reader = BufReader::new(file);
    let mut start = [0; 8]; // magic number and version
    reader.read_exact(&mut start)?;
    let version = u32::from_le_bytes([start[4], start[5], start[6], start[7]]);
    let mut sorted = Vec::new();
    loop {
        let mut attributes = attributes(&mut reader)?;
        let last = attributes.is_empty() || version & MULTI_PART == 0;
        attributes.sort(); // by name: it comes first, and no two are the same
        sorted.extend(attributes.into_iter().flatten());
        sorted.push(0);
        if last {
            break;
        }
    }
    file.seek(SeekFrom::Start(start.len() as u64))?;
    file.write_all(&sorted)
}

/// One header's attributes, each with its name, type, size and value as they stand in the file.
fn attributes(reader: &mut impl BufRead) -> io::Result<Vec<Vec<u8>>> {
    let mut attributes = Vec::new();
    loop {
        let mut attribute = Vec::new();
        reader.read_until(0, &mut attribute)?;
        if attribute.len() <= 1 {
            return Ok(attributes);
        }
        reader.read_until(0, &mut attribute)?;
        let mut size = [0; 4];
        reader.read_exact(&mut size)?;
        attribute.extend(size);
        reader.by_ref().take(u32::from_le_bytes(size).into()).read_to_end(&mut attribute)?;
        attributes.push(attribute);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, value: &str) -> Vec<u8> {
        let size = (value.len() as u32).to_le_bytes();
        [name.as_bytes(), b"\0string\0", &size, value.as_bytes()].concat()
    }

    fn sorted(version: u32, headers: &[u8]) -> Vec<u8> {
        let mut file = tempfile::tempfile().unwrap();
        let whole = [&[0x76, 0x2f, 0x31, 0x01][..], &version.to_le_bytes(), headers, b"pixels"].concat();
        file.write_all(&whole).unwrap();
        sort(&file).unwrap();
        file.rewind().unwrap();
        let mut after = Vec::new();
        file.read_to_end(&mut after).unwrap();
        assert_eq!(after[..8], whole[..8]);
        after[8..].strip_suffix(b"pixels").unwrap().to_vec()
    }

    #[test]
    fn each_header_is_sorted_and_nothing_else_moves() {
        let (a, b, ab) = (attribute("a", "x\0y"), attribute("b", ""), attribute("ab", "1"));
        let one = [&b[..], &ab, &a, b"\0"].concat();
        let in_order = [&a[..], &ab, &b, b"\0"].concat();
        assert_eq!(sorted(2, &one), in_order);
        let two = [&one[..], &b, b"\0\0"].concat();
        assert_eq!(sorted(2 | 1 << 12, &two), [&in_order[..], &b, b"\0\0"].concat());
    }
}
