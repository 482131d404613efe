//! Files: the only module that opens pictures, and the only one that knows OpenEXR.

mod atomic;
mod encode;
mod own;
mod rgb;

pub use own::{FrameHeader, write_frame};
pub use rgb::read_rgb;
