//! Decoded blocks that are kept for the next look at their file, as many as there is room for.
//!
//! A picture that is denoised in parts is looked through several times; every block that is kept is read and decoded
//! once. The first ones that come stay: to give up the oldest for the newest would leave nothing of a file that is
//! larger than the room by the time it is looked through again.

use std::collections::BTreeMap;
use std::sync::Arc;

use exr::block::{BlockIndex, UncompressedBlock};
use exr::prelude::Vec2;

/// A block by its part and its index in increasing rows.
type At = (usize, usize);

/// What is kept of a file.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// The only part of it, if there is one.
    only: Option<usize>,
    /// Most bytes of it.
    room: usize,
    bytes: usize,
    blocks: BTreeMap<At, Arc<UncompressedBlock>>,
}

impl Kept {
    /// Has room for so many bytes from now on, of `only` one part or all; the last blocks of what is beyond are given
    /// up.
    pub(super) fn keep(&mut self, only: Option<usize>, room: usize) {
        (self.only, self.room) = (only, room);
        while self.bytes > room
            && let Some((_, block)) = self.blocks.pop_last()
        {
            self.bytes -= block.data.len();
        }
    }

    pub(super) fn get(&self, at: At) -> Option<Arc<UncompressedBlock>> {
        self.blocks.get(&at).cloned()
    }

    /// Takes a block that was decoded, where there is room for it.
    pub(super) fn offer(&mut self, at: At, block: &mut UncompressedBlock) {
        let bytes = block.data.len();
        let wanted = self.only.is_none_or(|part| part == at.0) && !self.blocks.contains_key(&at);
        if wanted && bytes <= self.room - self.bytes {
            self.bytes += bytes;
            self.blocks.insert(at, Arc::new(std::mem::replace(block, no_block())));
        }
    }
}

/// Stands for a block until there is one.
pub(super) fn no_block() -> UncompressedBlock {
    let zero = Vec2(0, 0);
    let index = BlockIndex { layer: 0, pixel_position: zero, pixel_size: zero, level: zero };
    UncompressedBlock { index, data: vec![] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_room_stays_and_the_last_goes_first() {
        let mut kept = Kept::default();
        let offer = |kept: &mut Kept, index: usize| {
            let mut block = UncompressedBlock { data: vec![index as u8; 10], ..no_block() };
            kept.offer((0, index), &mut block);
            block.data.is_empty()
        };
        assert!(!offer(&mut kept, 0), "there is no room at first");
        kept.keep(Some(0), 25);
        assert_eq!([2, 2, 1, 0].map(|index| offer(&mut kept, index)), [true, false, true, false]);
        assert_eq!(kept.get((0, 1)).map(|block| block.data.clone()), Some(vec![1; 10]));
        kept.keep(None, 19);
        assert_eq!([0, 1, 2].map(|index| kept.get((0, index)).is_some()), [false, true, false]);
        kept.keep(None, 0);
        assert!(kept.get((0, 1)).is_none());
    }
}
