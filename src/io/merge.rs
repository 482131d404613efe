//! Regions of a picture put together: the very file that denoising the whole writes.

use std::path::{Path, PathBuf};

use exr::block::writer::ChunksWriter;
use exr::meta::Headers;
use exr::meta::header::Header;

use super::atomic::write_picture_atomically;
use super::canvas::write_in_strips;
use super::document::{Document, Reader, in_line_order};
use super::encode::{encode_error, through_encoder};
use super::limits;
use super::pixels::lines_of_block;
use super::region::{Cover, Mark};
use super::rewrite::signature_in;
use crate::error::{Error, ErrorKind, Result};

/// A file with a region.
struct Piece {
    document: Document,
    /// For each part.
    marks: Vec<Mark>,
    /// x, y, width, height.
    region: [i64; 4],
}

impl Piece {
    fn open(path: &Path) -> Result<Self> {
        let document = Document::open(path)?;
        let marks: Option<Vec<Mark>> = document.headers().iter().map(Mark::of).collect();
        let Some(marks) = marks.filter(|marks| !marks.is_empty()) else {
            return Err(Error::new(ErrorKind::Lacking, "is no region of a picture: it has no apr.region")
                .remedy("give files that were written with --region")
                .in_file(path));
        };
        Ok(Self { region: marks[0].region, document, marks })
    }

    /// The headers of the picture that this is a region of, which keep to the limits of any file.
    fn whole_headers(&self) -> Result<Headers> {
        let headers = self.document.headers().iter().zip(&self.marks);
        let whole = headers.map(|(header, mark)| mark.whole_header(header)).collect::<Result<Headers>>();
        // How many bytes the whole file will have nobody knows.
        let checked = whole.and_then(|whole| limits::check(&whole, u64::MAX).map(|()| whole));
        checked.map_err(|error| error.in_file(self.document.path()))
    }

    /// Checks that this is a region of the same picture, made by the same settings, as `first`.
    fn check_beside(&self, first: &Self) -> Result<()> {
        let refuse = |what: &str, remedy: &str| {
            let what = format!("{what} {}", first.document.path().display());
            Err(Error::new(ErrorKind::Lacking, what).remedy(remedy).in_file(self.document.path()))
        };
        let signature = |piece: &Self| signature_in(piece.document.headers());
        if self.marks[0].inputs != first.marks[0].inputs {
            return refuse("was made of another input than", "merge the regions of one picture");
        }
        if signature(self) != signature(first) {
            return refuse(
                "was made by other options or another version than",
                "denoise all regions with the same options; the attribute apr.settings tells them",
            );
        }
        if self.whole_headers()? != first.whole_headers()? {
            return refuse("is of another picture than", "merge the regions of one picture");
        }
        Ok(())
    }
}

/// Writes to `target` the picture that the regions at `paths` cover. It is the same, to the byte, as if the
/// picture had been denoised as a whole.
///
/// # Errors
/// `Lacking` when the regions overlap or do not cover the picture, or come of different inputs or settings;
/// `Unreadable` when one is damaged; `Misplaced` or `Unwritable` when the folder or the disk does not take the picture.
pub fn merge(target: impl AsRef<Path>, paths: &[PathBuf]) -> Result<()> {
    let pieces: Vec<Piece> = paths.iter().map(|path| Piece::open(path)).collect::<Result<_>>()?;
    let Some(first) = pieces.first() else {
        return Err(Error::new(ErrorKind::Usage, "no region is given").remedy("name the regions' files"));
    };
    let whole = first.whole_headers()?;
    pieces[1..].iter().try_for_each(|piece| piece.check_beside(first))?;
    check_cover(&pieces, first.marks[0].picture)?;
    check_blocks(&pieces, &whole)?;
    write_picture_atomically(target.as_ref(), |file| {
        exr::block::write(file, whole, false, |meta, writer| {
            for part in 0..meta.headers.len() {
                if first.marks[part].copied {
                    copy_blocks(&pieces, part, &meta.headers[part], writer)?;
                } else {
                    let lines = lines_of_block(&first.document.headers()[part]);
                    write_in_strips(writer, &meta.headers, part, lines, |strip| {
                        let mut pieces = pieces.iter();
                        pieces.try_for_each(|piece| strip.take_all(&piece.document, part, Some))
                    })?;
                }
            }
            Ok(())
        })
        .map_err(encode_error)
    })
}

/// Checks that the regions have as many blocks as the picture, before room is made for a table of them.
fn check_blocks(pieces: &[Piece], whole: &Headers) -> Result<()> {
    for (part, header) in whole.iter().enumerate() {
        let blocks: usize = pieces.iter().map(|piece| piece.document.headers()[part].chunk_count).sum();
        if blocks < header.chunk_count {
            let what = format!(
                "{blocks} blocks of part {part} are in the regions where the picture has {}",
                header.chunk_count
            );
            let error = Error::new(ErrorKind::Lacking, what).remedy("give all regions' files");
            return Err(error.in_file(pieces[0].document.path()));
        }
    }
    Ok(())
}

/// Checks that every pixel of the picture is in one region and no pixel in two.
fn check_cover(pieces: &[Piece], picture: [i64; 4]) -> Result<()> {
    let span = |[x, y, width, height]: [i64; 4]| (x..x + width, y..y + height);
    let text = |region: [i64; 4]| region.map(|n| n.to_string()).join(",");
    for (i, a) in pieces.iter().enumerate() {
        for b in &pieces[i + 1..] {
            let ((ax, ay), (bx, by)) = (span(a.region), span(b.region));
            if ax.start < bx.end && bx.start < ax.end && ay.start < by.end && by.start < ay.end {
                let other = a.document.path().display();
                let what = format!("its region {} overlaps {} of {other}", text(b.region), text(a.region));
                let error = Error::new(ErrorKind::Lacking, what).remedy("give every pixel once");
                return Err(error.in_file(b.document.path()));
            }
        }
    }
    // Without an overlap the regions cover the picture when they have as many pixels.
    let (columns, rows) = span(picture);
    if let Some(piece) = pieces.iter().find(|piece| {
        let (x, y) = span(piece.region);
        x.start < columns.start || x.end > columns.end || y.start < rows.start || y.end > rows.end
    }) {
        let what = format!("its region {} is not inside the picture {}", text(piece.region), text(picture));
        let error = Error::new(ErrorKind::Unreadable, what).remedy("denoise the region again");
        return Err(error.in_file(piece.document.path()));
    }
    let area = |[_, _, width, height]: [i64; 4]| width * height;
    let (covered, all) = (pieces.iter().map(|piece| area(piece.region)).sum::<i64>(), area(picture));
    if covered < all {
        let hole = first_hole(pieces, picture);
        let what = format!("{} pixels of the picture {} are in no region", all - covered, text(picture));
        let at = hole.map_or_else(String::new, |(x, y)| format!(", the first at {x},{y}"));
        let error = Error::new(ErrorKind::Lacking, what + &at).remedy("give all regions' files");
        return Err(error.in_file(pieces[0].document.path()));
    }
    Ok(())
}

/// The first pixel, row by row, that no region holds: it is at the picture's corner or beside and under the
/// ends of regions.
fn first_hole(pieces: &[Piece], [x, y, width, height]: [i64; 4]) -> Option<(i64, i64)> {
    let ends = |from: i64, at: usize| {
        let mut ends: Vec<i64> = pieces.iter().map(|p| p.region[at] + p.region[at + 2]).collect();
        ends.push(from);
        ends.sort_unstable();
        ends
    };
    let inside = |piece: &Piece, px: i64, py: i64| {
        let [x, y, width, height] = piece.region;
        (x..x + width).contains(&px) && (y..y + height).contains(&py)
    };
    let columns = ends(x, 0);
    let rows = ends(y, 1).into_iter().filter(|py| *py < y + height);
    rows.flat_map(|py| columns.iter().map(move |px| (*px, py)))
        .filter(|(px, _)| *px < x + width)
        .find(|&(px, py)| !pieces.iter().any(|piece| inside(piece, px, py)))
}

/// Copies the blocks of a part that passed through, in its line order, each from the first region that has it.
fn copy_blocks(
    pieces: &[Piece],
    part: usize,
    header: &Header,
    writer: &mut impl ChunksWriter,
) -> exr::error::UnitResult {
    let covers: Vec<Option<Cover>> = pieces
        .iter()
        .map(|piece| Cover::of_part(header, piece.document.headers()[part].data_window()))
        .collect();
    let holder = |index: usize| {
        covers.iter().enumerate().find_map(|(n, cover)| {
            let cover = cover.as_ref()?;
            Some((n, cover, cover.index_within(index)?))
        })
    };
    // One file is open at a time: there may be more regions than a process may open files.
    let (mut open, mut reader) = (0, Reader::default());
    let order = in_line_order(header, (0..header.chunk_count).collect());
    for index in order {
        let Some((n, cover, within)) = holder(index) else {
            let what = format!("block {index} of part {part} is in no region");
            let error = Error::new(ErrorKind::Unreadable, what).remedy("denoise the regions again");
            return Err(through_encoder(error));
        };
        if n != open {
            (open, reader) = (n, Reader::default());
        }
        let chunk = reader.chunk(&pieces[n].document, part, within).map_err(through_encoder)?;
        let (index, chunk) = cover.put_back(within, chunk);
        writer.write_chunk(index, chunk)?;
    }
    Ok(())
}
