//! Bytes that come in any portions, cut at an end byte.

/// What stood between two ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Piece<'a> {
    /// All of it.
    Whole(&'a [u8]),
    /// It was longer than a piece may be: not kept.
    Overlong,
}

/// Cuts bytes at `END` into pieces of at most `LONGEST` bytes. Keeps what has not ended yet, and never more than that.
#[derive(Default)]
pub struct Pieces<const END: u8, const LONGEST: usize> {
    begun: Vec<u8>,
    overlong: bool,
}

impl<const END: u8, const LONGEST: usize> Pieces<END, LONGEST> {
    /// Takes some bytes and hands over each piece that ends in them.
    pub fn feed(&mut self, bytes: &[u8], mut each: impl FnMut(Piece)) {
        let mut portions = bytes.split(|b| *b == END);
        let Some(last) = portions.next_back() else { return };
        for portion in portions {
            if self.begun.is_empty() && !self.overlong && portion.len() <= LONGEST {
                each(Piece::Whole(portion));
                continue;
            }
            self.keep(portion);
            let piece = if self.overlong {
                Piece::Overlong
            } else {
                Piece::Whole(&self.begun)
            };
            each(piece);
            self.begun.clear();
            self.overlong = false;
        }
        self.keep(last);
    }

    /// What has begun does not go on; whether there was any of it.
    pub fn interrupted(&mut self) -> bool {
        let had = !self.begun.is_empty() || self.overlong;
        self.begun.clear();
        self.overlong = false;
        had
    }

    fn keep(&mut self, portion: &[u8]) {
        if self.begun.len() + portion.len() > LONGEST {
            self.overlong = true;
            self.begun.clear();
        }
        if !self.overlong {
            self.begun.extend_from_slice(portion);
        }
        debug_assert!(self.begun.len() <= LONGEST);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Pieces as text; "!" for what was too long.
    fn cut(portions: &[&[u8]]) -> (Vec<Vec<u8>>, bool) {
        let mut pieces = Pieces::<b'.', 4>::default();
        let mut out = Vec::new();
        for portion in portions {
            pieces.feed(portion, |piece| {
                out.push(match piece {
                    Piece::Whole(bytes) => bytes.to_vec(),
                    Piece::Overlong => b"!".to_vec(),
                });
            });
        }
        (out, pieces.interrupted())
    }

    #[test]
    fn a_piece_ends_only_at_its_end() {
        let (out, had) = cut(&[b"ab", b"c.", b".d.e", b"", b"f"]);
        assert_eq!(out, [b"abc".as_slice(), b"", b"d"]);
        assert!(had);
    }

    #[test]
    fn what_is_too_long_is_told_once_and_the_next_is_whole() {
        let (out, had) = cut(&[b"abcd.abcde.ab", b"cdefg", b"hij.k."]);
        assert_eq!(out, [b"abcd".as_slice(), b"!", b"!", b"k"]);
        assert!(!had);
    }

    proptest! {
        #[test]
        fn portions_do_not_matter(bytes in prop::collection::vec(prop::sample::select(b"ab.".to_vec()), 0..60), n in 1usize..9) {
            let portions: Vec<&[u8]> = bytes.chunks(n).collect();
            prop_assert_eq!(cut(&portions), cut(&[&bytes]));
        }
    }
}
