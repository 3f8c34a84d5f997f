//! Columns of a log thinned to the pixels of a screen: no extreme is lost, however long the log is.
//!
//! | file | holds |
//! |---|---|
//! | [`pyramid`] | smallest and largest value of blocks of rows, and of blocks of blocks; bounded memory |
//! | [`column`] | the levels of one column |
//! | [`rows`] | the same thinning of rows in memory, for a window that is narrower than the blocks resolve |
//! | [`line`](mod@line) | the points to draw, interrupted over gaps |
#![cfg_attr(test, allow(clippy::float_cmp))]

pub mod column;
pub mod line;
pub mod pyramid;
pub mod rows;

pub use line::Line;
pub use pyramid::{Pyramid, PyramidError};
pub use rows::thinned;
