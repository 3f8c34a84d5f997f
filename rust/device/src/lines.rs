//! The text form of the wire protocol, `docs/wire.md`: a header that names columns, and rows of numbers, as Arduino sketches print them.
//!
//! Text has no check sum: a line counts as a row if it has as many numbers as the header has names, and as damaged if it nearly has.

use std::sync::Arc;

use crate::pieces::{Piece, Pieces};

/// Bytes that a line may have. Longer ones are damaged.
pub const LONGEST: usize = 4096;

/// Rows under one header.
#[derive(Debug, Clone)]
pub struct Batch {
    /// Names of the columns, as the header spells them.
    pub columns: Arc<Vec<String>>,
    /// Values, row by row; NaN where a cell is empty.
    pub values: Vec<f64>,
    /// Damaged lines before each row.
    pub lost: Vec<u32>,
}

/// What came over the wire.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Bytes.
    pub bytes: u64,
    /// Rows in batches.
    pub samples: u64,
    /// Lines that are neither rows nor messages.
    pub damaged: u64,
    /// Rows before any header.
    pub unexplained: u64,
}

impl Counts {
    /// Each with its name.
    pub fn named(&self) -> [(&'static str, u64); 4] {
        [
            ("bytes", self.bytes),
            ("samples", self.samples),
            ("damaged", self.damaged),
            ("unexplained", self.unexplained),
        ]
    }
}

/// What a line is.
enum Line {
    Empty,
    Header(Vec<String>),
    Row,
    Message,
    Damaged,
}

/// Decoder of lines that may begin, break off and go on anywhere.
#[derive(Default)]
pub struct Decoder {
    pieces: Pieces<b'\n', LONGEST>,
    /// Whether a whole line has come since the port was opened: the first may lack its beginning.
    begun: bool,
    columns: Option<Arc<Vec<String>>>,
    /// Numbers of the last line.
    numbers: Vec<f64>,
    lost: u32,
    batches: Vec<Batch>,
    texts: Vec<String>,
    counts: Counts,
}

/// Cells of a line: separated by commas, semicolons or tabs, whichever come first.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    let separator = line.bytes().find(|c| matches!(c, b',' | b';' | b'\t')).unwrap_or(b',');
    line.split(char::from(separator)).map(str::trim)
}

fn number(cell: &str) -> Option<f64> {
    if cell.is_empty() {
        Some(f64::NAN)
    } else {
        cell.parse().ok()
    }
}

/// A name begins with a letter or an underscore, and may have its unit behind it.
fn is_name(cell: &str) -> bool {
    let mut letters = cell.chars();
    let first = letters.next().is_some_and(|c| c.is_alphabetic() || c == '_');
    first && number(cell).is_none() && cell.len() <= 64 && !letters.any(|c| matches!(c, ':' | '=' | '!' | '?'))
}

/// What a line is; the numbers in it.
fn read(line: &[u8], numbers: &mut Vec<f64>) -> Line {
    let Ok(line) = std::str::from_utf8(line) else {
        return Line::Damaged;
    };
    let line = line.trim();
    if line.is_empty() {
        return Line::Empty;
    }
    if line.starts_with('#') || line.starts_with("//") {
        return Line::Message;
    }
    let mut all = 0;
    numbers.clear();
    numbers.extend(cells(line).inspect(|_| all += 1).filter_map(number));
    if all > 1 && numbers.len() == all && !numbers.iter().all(|v| v.is_nan()) {
        return Line::Row;
    }
    if all > 1 && cells(line).all(is_name) {
        return Line::Header(cells(line).map(str::to_string).collect());
    }
    // Mostly numbers: a row that came to harm.
    if numbers.len() * 2 > all && all > 1 {
        return Line::Damaged;
    }
    Line::Message
}

impl Decoder {
    /// Takes some bytes.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.counts.bytes += bytes.len() as u64;
        let mut pieces = std::mem::take(&mut self.pieces);
        pieces.feed(bytes, |piece| {
            match piece {
                Piece::Whole(line) => self.line(line),
                Piece::Overlong => self.damaged(),
            }
            self.begun = true;
        });
        self.pieces = pieces;
    }

    /// The port was closed and opened anew: half a line from before does not go on, and the next may lack its beginning.
    pub fn interrupted(&mut self) {
        if self.pieces.interrupted() {
            self.damaged();
        }
        self.begun = false;
    }

    /// Nothing more comes.
    pub fn finish(&mut self) {
        self.interrupted();
    }

    /// Rows since this was last asked.
    pub fn take(&mut self) -> Vec<Batch> {
        std::mem::take(&mut self.batches)
    }

    /// Other lines since this was last asked.
    pub fn take_texts(&mut self) -> Vec<String> {
        std::mem::take(&mut self.texts)
    }

    /// What came so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    fn damaged(&mut self) {
        self.counts.damaged += 1;
        self.lost += 1;
    }

    fn line(&mut self, line: &[u8]) {
        let mut numbers = std::mem::take(&mut self.numbers);
        match read(line, &mut numbers) {
            Line::Empty => {}
            Line::Header(names) => {
                if self.columns.as_deref() != Some(&names) {
                    self.columns = Some(Arc::new(names));
                }
            }
            // A number that lacks its first digits is a number all the same.
            Line::Row if !self.begun => self.damaged(),
            Line::Row => self.row(&numbers),
            Line::Message => self.texts.push(String::from_utf8_lossy(line).trim().to_string()),
            Line::Damaged => self.damaged(),
        }
        self.numbers = numbers;
    }

    fn row(&mut self, values: &[f64]) {
        let Some(columns) = self.columns.clone() else {
            self.counts.unexplained += 1;
            return;
        };
        if values.len() != columns.len() {
            self.damaged();
            return;
        }
        if !self.batches.last().is_some_and(|b| Arc::ptr_eq(&b.columns, &columns)) {
            self.batches.push(Batch {
                columns,
                values: Vec::new(),
                lost: Vec::new(),
            });
        }
        if let Some(batch) = self.batches.last_mut() {
            batch.values.extend_from_slice(values);
            batch.lost.push(std::mem::take(&mut self.lost));
            self.counts.samples += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn decoded(pieces: &[&str]) -> Decoder {
        let mut decoder = Decoder::default();
        for piece in pieces {
            decoder.feed(piece.as_bytes());
        }
        decoder
    }

    #[test]
    fn a_header_and_rows_in_pieces() {
        let mut decoder = decoded(&["booting...\r\nt_ms,acc_x,ac", "c_y\r\n10,0.1,-2e-1\r\n2", "0,,0.3\n"]);
        let batches = decoder.take();
        assert_eq!(*batches[0].columns, ["t_ms", "acc_x", "acc_y"]);
        assert_eq!(batches[0].values[..4], [10.0, 0.1, -0.2, 20.0]);
        assert!(batches[0].values[4].is_nan());
        assert_eq!(decoder.take_texts(), ["booting..."]);
    }

    #[test]
    fn what_is_cut_or_run_together_is_damaged() {
        let mut decoder = decoded(&["a;b;c\n1;2;3\n1;2\n1;2;31;2;3\n1;2;x\n\u{1}\u{fffd},1,2\n4;5;6\n"]);
        let batches = decoder.take();
        assert_eq!(batches[0].values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(batches[0].lost, [0, 4]);
        assert_eq!(decoder.counts().damaged, 4);
    }

    #[test]
    fn the_first_row_after_opening_the_port_may_lack_digits() {
        let mut decoder = decoded(&["a,b\n1,2\n3,"]);
        decoder.interrupted();
        decoder.feed(b"23,4\n5,6\n");
        assert_eq!(decoder.take()[0].values, [1.0, 2.0, 5.0, 6.0]);
        assert_eq!(decoder.counts().damaged, 2);
    }

    #[test]
    fn another_header_begins_another_batch_and_the_same_one_does_not() {
        let mut decoder = decoded(&["a,b\n1,2\na,b\n3,4\nb,a\n5,6\n"]);
        assert_eq!(decoder.take().iter().map(|b| b.lost.len()).collect::<Vec<_>>(), [2, 1]);
    }

    #[test]
    fn rows_without_a_header_are_counted() {
        let mut decoder = decoded(&["x\n1,2\n3,4\n"]);
        assert!(decoder.take().is_empty());
        assert_eq!(decoder.counts().unexplained, 2);
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), text in "\\PC{0,80}") {
            let mut decoder = Decoder::default();
            decoder.feed(&bytes);
            decoder.feed(text.as_bytes());
            decoder.finish();
        }

        #[test]
        fn pieces_do_not_matter(rows in prop::collection::vec((-1e9f64..1e9, -1e9f64..1e9), 1..30), cut in 1usize..40) {
            let lines: Vec<String> = rows.iter().map(|(a, b)| format!("{a},{b}\n")).collect();
            let text = format!("a,b\n{}", lines.concat());
            let mut decoder = Decoder::default();
            for piece in text.as_bytes().chunks(cut) {
                decoder.feed(piece);
            }
            let want: Vec<f64> = rows.iter().flat_map(|(a, b)| [*a, *b]).collect();
            prop_assert_eq!(&decoder.take()[0].values, &want);
        }
    }
}
