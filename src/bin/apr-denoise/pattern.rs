//! Names of files that hold a frame's number: `shot.####.exr`, `shot.%04d.exr`, `shot.$F4.exr`,
//! `shot.<frame4>.exr`.

use std::path::{Component, Path, PathBuf};

use crate::frames::FrameSet;

/// A path with places for the frame's number, in its name or its folders.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern(Vec<Vec<Piece>>);

/// What a folder's or file's name is put together from.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Piece {
    Text(String),
    /// The number, with zeros in front up to so many characters.
    Frame(usize),
}

impl Pattern {
    /// The pattern in `path`, if it has a place for a number.
    pub fn parse(path: &Path) -> Option<Self> {
        let component = |component: Component| match component {
            Component::Normal(name) => Some(pieces(name.to_str()?)),
            other => Some(vec![Piece::Text(other.as_os_str().to_str()?.to_owned())]),
        };
        let components = path.components().map(component).collect::<Option<Vec<_>>>()?;
        let numbered = components.iter().flatten().any(|piece| matches!(piece, Piece::Frame(_)));
        numbered.then_some(Self(components))
    }

    /// The path of one frame.
    pub fn path(&self, frame: i32) -> PathBuf {
        self.0.iter().map(|name| render(name, frame)).collect()
    }

    /// The same with the padding that most files have, as it would be written, and the frames of those.
    pub fn other_padding(&self) -> Option<(PathBuf, FrameSet)> {
        const MOST: usize = 9;
        let padded = |width| Self(self.0.iter().map(|name| with_width(name, width)).collect());
        let frames = |width| (self.written(width), padded(width).frames_on_disk());
        let found = (1..=MOST).map(frames).filter(|(_, frames)| !frames.is_empty());
        found.max_by_key(|(_, frames)| frames.iter().count())
    }

    /// With so many # for the number.
    fn written(&self, width: usize) -> PathBuf {
        let text = |piece: &Piece| match piece {
            Piece::Text(text) => text.clone(),
            Piece::Frame(_) => "#".repeat(width),
        };
        self.0.iter().map(|name| name.iter().map(text).collect::<String>()).collect()
    }

    /// The frames that have a file.
    pub fn frames_on_disk(&self) -> FrameSet {
        let mut found = Vec::new();
        walk(PathBuf::new(), &self.0, None, &mut found);
        found.into_iter().collect()
    }
}

/// Follows the names below `folder`; the first that holds a number decides the frame.
fn walk(folder: PathBuf, names: &[Vec<Piece>], frame: Option<i32>, found: &mut Vec<i32>) {
    let Some((name, deeper)) = names.split_first() else {
        found.extend(frame.filter(|_| folder.is_file()));
        return;
    };
    let numbered = name.iter().any(|piece| matches!(piece, Piece::Frame(_)));
    if frame.is_some() || !numbered {
        return walk(folder.join(render(name, frame.unwrap_or(0))), deeper, frame, found);
    }
    let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
    for entry in std::fs::read_dir(listed).into_iter().flatten().flatten() {
        let entry = entry.file_name();
        if let Some(frame) = entry.to_str().and_then(|entry| frame_in(entry, name)) {
            walk(folder.join(&entry), deeper, Some(frame), found);
        }
    }
}

/// The frame for which `pieces` make `name`.
fn frame_in(name: &str, pieces: &[Piece]) -> Option<i32> {
    let place = pieces.iter().position(|piece| matches!(piece, Piece::Frame(_)))?;
    let number = name.strip_prefix(&render(&pieces[..place], 0))?;
    let sign = usize::from(number.starts_with('-'));
    let digits = number[sign..].bytes().take_while(u8::is_ascii_digit).count();
    let frames = (1..=digits).filter_map(|length| number[..sign + length].parse().ok());
    frames.into_iter().find(|&frame| render(pieces, frame) == name)
}

fn render(pieces: &[Piece], frame: i32) -> String {
    let text = |piece: &Piece| match piece {
        Piece::Text(text) => text.clone(),
        Piece::Frame(width) => format!("{frame:0width$}"),
    };
    pieces.iter().map(text).collect()
}

fn with_width(name: &[Piece], width: usize) -> Vec<Piece> {
    let wide = |piece: &Piece| match piece {
        Piece::Frame(_) => Piece::Frame(width),
        text => text.clone(),
    };
    name.iter().map(wide).collect()
}

/// A name taken apart.
fn pieces(name: &str) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut text = String::new();
    let mut rest = name;
    while let Some(next) = rest.chars().next() {
        if let Some((width, length)) = token(rest) {
            if !text.is_empty() {
                pieces.push(Piece::Text(std::mem::take(&mut text)));
            }
            pieces.push(Piece::Frame(width));
            rest = &rest[length..];
        } else {
            text.push(next);
            rest = &rest[next.len_utf8()..];
        }
    }
    if !text.is_empty() {
        pieces.push(Piece::Text(text));
    }
    pieces
}

/// Width and length of the number's place that `text` begins with.
fn token(text: &str) -> Option<(usize, usize)> {
    let run = |sign: char| text.chars().take_while(|c| *c == sign).count();
    match text.chars().next()? {
        '#' => Some((run('#'), run('#'))),
        // One alone is part of names such as user@host.
        '@' if run('@') > 1 => Some((run('@'), run('@'))),
        '%' => {
            let (width, rest) = width(&text[1..]);
            let zeros = text[1..].starts_with('0') || width == 0;
            (zeros && rest.starts_with('d')).then(|| (width, text.len() - rest.len() + 1))
        }
        '$' => {
            let (width, rest) = width(text[1..].strip_prefix('F')?);
            let ends = !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
            ends.then(|| (width, text.len() - rest.len()))
        }
        '<' => {
            const NAME: &str = "frame";
            let name = text.get(1..=NAME.len()).filter(|name| name.eq_ignore_ascii_case(NAME))?;
            let (width, rest) = width(&text[1 + name.len()..]);
            rest.starts_with('>').then(|| (width, text.len() - rest.len() + 1))
        }
        _ => None,
    }
}

/// The one or two digits that `text` begins with, 0 where there are none, and what follows them.
fn width(text: &str) -> (usize, &str) {
    let digits = text.bytes().take_while(u8::is_ascii_digit).take(2).count();
    (text[..digits].parse().unwrap_or(0), &text[digits..])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn name(pattern: &str, frame: i32) -> String {
        Pattern::parse(Path::new(pattern)).unwrap().path(frame).to_str().unwrap().to_owned()
    }

    #[test]
    fn every_way_of_writing_makes_the_name() {
        for (pattern, expected) in [
            ("shot.####.exr", "shot.0007.exr"),
            ("shot.#.exr", "shot.7.exr"),
            ("shot.@@@@.exr", "shot.0007.exr"),
            ("shot.%04d.exr", "shot.0007.exr"),
            ("shot.%d.exr", "shot.7.exr"),
            ("shot_$F4.exr", "shot_0007.exr"),
            ("shot_$F.exr", "shot_7.exr"),
            ("shot.<frame>.exr", "shot.7.exr"),
            ("shot.<Frame04>.exr", "shot.0007.exr"),
            ("/a/f##/b.####.exr", "/a/f07/b.0007.exr"),
            ("../####/beauty.exr", "../0007/beauty.exr"),
        ] {
            assert_eq!(name(pattern, 7), expected, "{pattern}");
        }
        assert_eq!(name("a.####.exr", 123_456), "a.123456.exr");
        assert_eq!(name("a.####.exr", -5), "a.-005.exr");
    }

    #[test]
    fn other_names_are_no_patterns() {
        for path in [
            "shot.exr",
            "me@host.exr",
            "100%.exr",
            "%s.exr",
            "%4d.exr",
            "$FF.exr",
            "$Foo.exr",
            "<f>.exr",
            "<frame",
        ] {
            assert_eq!(Pattern::parse(Path::new(path)), None, "{path}");
        }
    }

    #[test]
    fn frames_are_found_by_their_whole_name() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        };
        for name in ["a.0001.exr", "a.0003.exr", "a.-002.exr", "a.12345.exr", "a.7.exr", "a.0004.exr.bak"] {
            make(name);
        }
        for name in ["f1/b.01.exr", "f2/b.02.exr", "f3/b.04.exr", "f4/c.exr"] {
            make(name);
        }
        let found = |pattern: &str| {
            Pattern::parse(&folder.path().join(pattern)).unwrap().frames_on_disk().to_string()
        };
        assert_eq!(found("a.####.exr"), "-2,1,3,12345");
        assert_eq!(found("a.%d.exr"), "7,12345");
        assert_eq!(found("f#/b.##.exr"), "1,2", "both numbers are the frame's");
        assert_eq!(found("b.####.exr"), "");
        let other = |pattern: &str| {
            let (name, frames) = Pattern::parse(&folder.path().join(pattern)).unwrap().other_padding()?;
            Some(format!("{} {frames}", name.file_name().unwrap().display()))
        };
        assert_eq!(other("b.####.exr"), None);
        assert_eq!(other("a.######.exr").unwrap(), "a.####.exr -2,1,3,12345");
    }

    proptest! {
        #[test]
        fn a_name_that_was_made_is_recognised(
            before in "[a-z0-9_.]{0,4}", after in "[a-z_.][a-z0-9_.]{0,3}", width in 0..6_usize, frame in -99_999..99_999,
        ) {
            let pieces = [Piece::Text(before), Piece::Frame(width), Piece::Text(after)];
            prop_assert_eq!(frame_in(&render(&pieces, frame), &pieces), Some(frame));
        }

        #[test]
        fn nothing_makes_it_panic(text in "[a#@%$F<>frame0-9é]{0,12}") {
            let rendered = pieces(&text);
            prop_assert!(render(&rendered, 3).len() < 1000);
        }
    }
}
