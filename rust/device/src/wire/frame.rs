//! One frame: head, payload, check sum, and how it is told from the next.

use crc::{CRC_16_IBM_3740, Crc, Table};

/// The check sum: polynomial 0x1021, from 0xFFFF on, not reflected ("CCITT-FALSE"); sixteen bytes at a time.
static CHECK: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_IBM_3740);

/// Bytes of head and check sum.
const AROUND: usize = 6;
/// Bytes that a frame may have on the wire, its end not counted. Longer ones are damaged, whatever they say of themselves.
pub const LONGEST: usize = 1024;

/// Kind of a frame that announces what the samples hold.
pub const ANNOUNCEMENT: u8 = 1;
/// Kind of a frame with a sample.
pub const SAMPLE: u8 = 2;
/// Kind of a frame with a message for people.
pub const TEXT: u8 = 3;

/// A frame whose check sum is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// What the payload holds.
    pub kind: u8,
    /// Number of the device's start: another one after each reset.
    pub start: u8,
    /// Number of the frame since that start.
    pub sequence: u16,
    /// What it carries.
    pub payload: &'a [u8],
}

/// What stands on the wire for a frame, its end included.
pub fn encode(frame: &Frame) -> Vec<u8> {
    let [low, high] = frame.sequence.to_le_bytes();
    let mut body = vec![frame.kind, frame.start, low, high];
    body.extend_from_slice(frame.payload);
    body.extend_from_slice(&CHECK.checksum(&body).to_le_bytes());
    let mut out = cobs::encode_vec(&body);
    out.push(0);
    out
}

/// Takes the stuffing out: each byte that tells a run's length stands for the 0 behind the run. Run by run, which is several times as
/// fast as byte by byte (`cobs::decode`).
fn unstuff(stuffed: &[u8], body: &mut Vec<u8>) -> Option<()> {
    body.clear();
    let mut rest = stuffed;
    while let Some((length, after)) = rest.split_first() {
        let (run, next) = after.split_at_checked(usize::from(length.checked_sub(1)?))?;
        body.extend_from_slice(run);
        if *length < u8::MAX && !next.is_empty() {
            body.push(0);
        }
        rest = next;
    }
    Some(())
}

/// The frame in what stood between two ends, unpacked into `body`; `None` if it is damaged.
pub fn decode<'a>(stuffed: &[u8], body: &'a mut Vec<u8>) -> Option<Frame<'a>> {
    unstuff(stuffed, body)?;
    let (checked, check) = body.split_at_checked(body.len().checked_sub(2)?)?;
    if body.len() < AROUND || CHECK.checksum(checked).to_le_bytes() != *check {
        return None;
    }
    let (head, payload) = checked.split_at_checked(AROUND - 2)?;
    let &[kind, start, low, high] = head else { return None };
    Some(Frame {
        kind,
        start,
        sequence: u16::from_le_bytes([low, high]),
        payload,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_check_sum_of_the_catalogue() {
        // The check value of CRC-16/IBM-3740 for "123456789" in the catalogue of parametrised CRC algorithms.
        assert_eq!(CHECK.checksum(b"123456789"), 0x29B1);
    }

    proptest! {
        #[test]
        fn a_frame_comes_back_and_holds_no_end(
            kind: u8, start: u8, sequence: u16, payload in prop::collection::vec(any::<u8>(), 0..600),
        ) {
            let frame = Frame { kind, start, sequence, payload: &payload };
            let wire = encode(&frame);
            let (end, stuffed) = wire.split_last().unwrap();
            prop_assert_eq!(*end, 0);
            prop_assert!(!stuffed.contains(&0));
            let mut body = Vec::new();
            prop_assert_eq!(decode(stuffed, &mut body), Some(frame));
        }

        #[test]
        fn stuffing_is_taken_out_as_by_the_package(
            stuffed in prop::collection::vec(prop_oneof![1u8..6, 250u8.., 1u8..], 1..600),
        ) {
            let mut body = Vec::new();
            let ours = unstuff(&stuffed, &mut body).map(|()| body);
            let mut theirs = vec![0; stuffed.len()];
            let report = cobs::decode(&stuffed, &mut theirs);
            prop_assert_eq!(ours, report.ok().map(|r| theirs[..r.frame_size()].to_vec()));
        }

        #[test]
        fn nothing_panics(stuffed in prop::collection::vec(any::<u8>(), 0..80)) {
            decode(&stuffed, &mut Vec::new());
        }

        #[test]
        fn a_turned_bit_is_seen(payload in prop::collection::vec(any::<u8>(), 0..60), at: prop::sample::Index, bit in 0u8..8) {
            let frame = Frame { kind: SAMPLE, start: 1, sequence: 7, payload: &payload };
            let mut wire = encode(&frame);
            wire.pop();
            let at = at.index(wire.len());
            wire[at] ^= 1 << bit;
            prop_assert_eq!(decode(&wire, &mut Vec::new()).map(|f| f.payload.to_vec()), None);
        }
    }
}
