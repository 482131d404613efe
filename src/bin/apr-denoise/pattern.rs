//! Names of files that hold a frame's number: `shot.####.exr`, `shot.%04d.exr`, `shot.$F4.exr`,
//! `shot.<frame4>.exr`.

use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

use crate::frames::FrameSet;

/// A path with places for the frame's number, in its name or its folders.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern(Vec<Name>);

/// A folder's or file's name.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Name {
    /// As it is, in whatever letters.
    Literal(OsString),
    /// Put together from these, with a place for the number.
    Numbered(Vec<Piece>),
}

/// What a name with a number is put together from.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Piece {
    Text(String),
    /// The number, with zeros in front up to so many characters.
    Frame(usize),
}

impl Pattern {
    /// The pattern in `path`, if it has a place for a number. A folder that is there under that very name is that
    /// folder.
    pub fn parse(path: &Path) -> Option<Self> {
        let mut components = path.components().peekable();
        let (mut names, mut so_far) = (Vec::new(), PathBuf::new());
        while let Some(component) = components.next() {
            so_far.push(component);
            let is_last = components.peek().is_none();
            let name = component.as_os_str();
            let numbered =
                matches!(component, Component::Normal(_)).then(|| pieces(name.to_str()?)).flatten();
            names.push(match numbered.filter(|_| is_last || !so_far.is_dir()) {
                Some(pieces) => Name::Numbered(pieces),
                None => Name::Literal(name.to_owned()),
            });
        }
        names.iter().any(|name| matches!(name, Name::Numbered(_))).then_some(Self(names))
    }

    /// The path of one frame.
    pub fn path(&self, frame: i32) -> PathBuf {
        self.0.iter().map(|name| name.of(frame)).collect()
    }

    /// The same with the padding that most files have, as it would be written, and the frames of those.
    pub fn other_padding(&self) -> Option<(PathBuf, FrameSet)> {
        const MOST: usize = 9;
        let with = |width, place: fn(usize) -> Piece| {
            Self(self.0.iter().map(|name| name.with(place(width))).collect())
        };
        let written = |width| with(width, |width| Piece::Text("#".repeat(width))).path(0);
        let frames = |width| (written(width), with(width, Piece::Frame).frames_on_disk());
        let found = (1..=MOST).map(frames).filter(|(_, frames)| !frames.is_empty());
        found.max_by_key(|(_, frames)| frames.iter().count())
    }

    /// The frames that have a file.
    pub fn frames_on_disk(&self) -> FrameSet {
        let mut found = Vec::new();
        walk(PathBuf::new(), &self.0, None, &mut found);
        found.into_iter().collect()
    }
}

impl Name {
    fn of(&self, frame: i32) -> OsString {
        match self {
            Self::Literal(name) => name.clone(),
            Self::Numbered(pieces) => render(pieces, frame).into(),
        }
    }

    /// The same with `place` for the number.
    fn with(&self, place: Piece) -> Self {
        let put = |piece: &Piece| match piece {
            Piece::Frame(_) => place.clone(),
            text => text.clone(),
        };
        match self {
            Self::Literal(name) => Self::Literal(name.clone()),
            Self::Numbered(pieces) => Self::Numbered(pieces.iter().map(put).collect()),
        }
    }
}

/// Follows the names below `folder`; the first that holds a number decides the frame.
fn walk(folder: PathBuf, names: &[Name], frame: Option<i32>, found: &mut Vec<i32>) {
    let Some((name, deeper)) = names.split_first() else {
        found.extend(frame.filter(|_| folder.is_file()));
        return;
    };
    let (Name::Numbered(pieces), None) = (name, frame) else {
        return walk(folder.join(name.of(frame.unwrap_or(0))), deeper, frame, found);
    };
    let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
    for entry in std::fs::read_dir(listed).into_iter().flatten().flatten() {
        let entry = entry.file_name();
        if let Some(frame) = entry.to_str().and_then(|entry| frame_in(entry, pieces)) {
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

/// A name taken apart; none where it has no place for a number.
fn pieces(name: &str) -> Option<Vec<Piece>> {
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
    pieces.iter().any(|piece| matches!(piece, Piece::Frame(_))).then_some(pieces)
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

    #[test]
    fn a_folder_that_is_there_under_that_very_name_is_that_folder() {
        let folder = tempfile::tempdir().unwrap();
        let shot = folder.path().join("take #1 @@/%d");
        std::fs::create_dir_all(&shot).unwrap();
        for name in ["a.0001.exr", "a.0003.exr"] {
            std::fs::write(shot.join(name), "").unwrap();
        }
        let pattern = Pattern::parse(&shot.join("a.####.exr")).unwrap();
        assert_eq!(pattern.path(3), shot.join("a.0003.exr"));
        assert_eq!(pattern.frames_on_disk().to_string(), "1,3");
        assert_eq!(Pattern::parse(&shot.join("a.exr")), None);
        let (name, _) = Pattern::parse(&shot.join("a.##.exr")).unwrap().other_padding().unwrap();
        assert_eq!(name, shot.join("a.####.exr"));
    }

    #[test]
    #[cfg(unix)]
    fn folders_may_have_names_in_any_letters() {
        use std::os::unix::ffi::OsStringExt;
        let folder = Path::new("/a").join(OsString::from_vec(vec![b'f', 0xff]));
        let pattern = Pattern::parse(&folder.join("b.##.exr")).unwrap();
        assert_eq!(pattern.path(7), folder.join("b.07.exr"));
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
            let rendered = pieces(&text).map(|pieces| render(&pieces, 3));
            prop_assert!(rendered.is_none_or(|name| name.len() < 1000));
        }
    }
}
