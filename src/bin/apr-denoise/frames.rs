//! Which frames: `1-100:2,140`, the form that farms and compositors use.

use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

/// More frames than any shot has: a slip of the keyboard, not a request.
const MOST: i64 = 1_000_000;

/// Numbers of frames, ascending, each once. They may be negative.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FrameSet(Vec<i32>);

impl FrameSet {
    /// The frames, ascending.
    pub fn iter(&self) -> impl Iterator<Item = i32> + '_ {
        self.0.iter().copied()
    }

    /// In words, that all these share what is said of one of them; nothing where there are no others.
    pub fn among_others(&self) -> String {
        if self.0.len() < 2 { String::new() } else { format!(" (and so for frames {self})") }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// So many of something, in words: `1 frame`, `3 frames`.
pub fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

impl FromIterator<i32> for FrameSet {
    fn from_iter<T: IntoIterator<Item = i32>>(frames: T) -> Self {
        Self(frames.into_iter().collect::<BTreeSet<_>>().into_iter().collect())
    }
}

/// Comma-separated frames and ranges: `7`, `1-9`, `1-9:2` (also `1-9x2`), `-3--1`.
impl FromStr for FrameSet {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut frames = BTreeSet::new();
        for item in text.split(',') {
            let (first, last, step) =
                range(item.trim()).ok_or_else(|| format!("'{item}' is no frame: write 7, 1-9 or 1-9:2"))?;
            if last < first {
                return Err(format!("'{item}' runs backwards: write {last}-{first}"));
            }
            let count = (i64::from(last) - i64::from(first)) / i64::from(step) + 1;
            if frames.len() as i64 + count > MOST {
                return Err(format!("'{item}' makes more than {MOST} frames"));
            }
            frames.extend((first..=last).step_by(step as usize));
        }
        Ok(Self(frames.into_iter().collect()))
    }
}

/// First, last and step of `7`, `1-9` or `1-9:2`.
fn range(item: &str) -> Option<(i32, i32, u32)> {
    let (first, rest) = number(item)?;
    if rest.is_empty() {
        return Some((first, first, 1));
    }
    let (last, rest) = number(rest.strip_prefix('-')?)?;
    if rest.is_empty() {
        return Some((first, last, 1));
    }
    let step = rest.strip_prefix([':', 'x'])?;
    let step = step.parse().ok().filter(|step| *step > 0 && !step_is_signed(rest))?;
    Some((first, last, step))
}

/// `parse` takes a plus sign, which no frame has.
fn step_is_signed(rest: &str) -> bool {
    rest[1..].starts_with('+')
}

/// The number that `text` begins with, and what follows it.
fn number(text: &str) -> Option<(i32, &str)> {
    let sign = usize::from(text.starts_with('-'));
    let digits = text[sign..].bytes().take_while(u8::is_ascii_digit).count();
    let (number, rest) = text.split_at(sign + digits);
    Some((number.parse().ok()?, rest))
}

/// As short as it goes, and read again as the same frames.
impl fmt::Display for FrameSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Two frames are shorter without a range.
        const SHORTEST_RUN: usize = 3;
        let step = |pair: &[i32]| i64::from(pair[1]) - i64::from(pair[0]);
        let mut rest = &self.0[..];
        let mut comma = "";
        while let [first, ..] = *rest {
            let run = match rest {
                [_, _, ..] => 1 + rest.windows(2).take_while(|pair| step(pair) == step(rest)).count(),
                _ => 1,
            };
            let length = if run >= SHORTEST_RUN { run } else { 1 };
            match (length, rest[length - 1], if length > 1 { step(rest) } else { 1 }) {
                (1, ..) => write!(f, "{comma}{first}")?,
                (_, last, 1) => write!(f, "{comma}{first}-{last}")?,
                (_, last, step) => write!(f, "{comma}{first}-{last}:{step}")?,
            }
            rest = &rest[length..];
            comma = ",";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn frames(text: &str) -> Vec<i32> {
        text.parse::<FrameSet>().unwrap().0
    }

    #[test]
    fn ranges_are_what_they_say() {
        assert_eq!(frames("7"), [7]);
        assert_eq!(frames("1-10:3"), [1, 4, 7, 10]);
        assert_eq!(frames("1-9x4"), [1, 5, 9]);
        assert_eq!(frames("1-100:2,140").len(), 51);
        assert_eq!(frames("-5--3, 0,-4"), [-5, -4, -3, 0]);
        assert_eq!(frames("-1-1"), [-1, 0, 1]);
        assert_eq!(frames("0001-0003"), [1, 2, 3]);
        assert_eq!(frames("2147483646-2147483647"), [i32::MAX - 1, i32::MAX]);
    }

    #[test]
    fn what_is_no_range_is_refused_with_the_offender() {
        for wrong in
            ["", ",", "1,", "a", "1-", "1-a", "1-9:", "1-9:0", "1-9:-2", "1-9:+2", "1 2", "--", "1-2-3"]
        {
            assert!(wrong.parse::<FrameSet>().is_err(), "{wrong}");
        }
        let complaint = |text: &str| text.parse::<FrameSet>().unwrap_err();
        assert!(complaint("1,9-5").contains("write 5-9"));
        assert!(complaint("1-2000000000").contains("more than 1000000"));
        assert!(complaint("99999999999").contains("is no frame"));
    }

    #[test]
    fn written_as_short_as_it_goes() {
        for text in ["1-100", "1-99:2,140", "-5--3", "1,2", "1,2,7", "1-3,10-30:10", "5"] {
            assert_eq!(text.parse::<FrameSet>().unwrap().to_string(), text);
        }
    }

    proptest! {
        #[test]
        fn written_and_read_again_they_are_the_same(some in prop::collection::vec(-300..300_i32, 1..60)) {
            let set: FrameSet = some.iter().copied().collect();
            prop_assert_eq!(set.to_string().parse::<FrameSet>(), Ok(set));
        }

        #[test]
        fn a_range_holds_every_step_and_nothing_else(first in -9999..9999_i32, more in 0..500_i32, step in 1..9_i32) {
            let last = first + more;
            let expected: Vec<i32> = (first..=last).filter(|frame| (frame - first) % step == 0).collect();
            prop_assert_eq!(frames(&format!("{first}-{last}:{step}")), expected);
        }

        #[test]
        fn nothing_makes_it_panic(text in "[-0-9:x, ]{0,12}") {
            let _ = text.parse::<FrameSet>();
        }
    }
}
