//! Frames with right check sums among anything else, in any portions: each is delivered once and in order, the counts say what
//! came, and no more is kept than a frame.
#![no_main]

use arbitrary::Arbitrary;
use imufit_device::wire::decoder::{Batch, Decoder};
use imufit_device::wire::frame::{self, ANNOUNCEMENT, Frame, LONGEST, SAMPLE, TEXT};
use libfuzzer_sys::fuzz_target;

/// What comes over the line next.
#[derive(Arbitrary, Debug)]
enum Event {
    /// A sample of the stream that is announced: six numbers of 16 bits.
    Sample { stamp: u32, numbers: [i16; 6] },
    /// The announcement again.
    Announcement,
    /// A frame of any kind with a right check sum.
    Frame { kind: u8, payload: Vec<u8> },
    /// Any bytes, and an end.
    Garbage(Vec<u8>),
    /// Bytes without an end, this many times: the next frame is damaged with them.
    Endless(u8, u8),
    /// A sample of which a byte is turned.
    Damaged { at: u8, bits: u8 },
    /// A sample that is lost.
    Lost,
    /// The device starts anew, and announces itself.
    Reset,
    /// The port is closed and opened anew.
    Interruption,
}

#[derive(Arbitrary, Debug)]
struct Input {
    events: Vec<Event>,
    /// Bytes of a portion, less one.
    portions: Vec<u8>,
}

/// A device that counts its frames.
#[derive(Default)]
struct Device {
    start: u8,
    sequence: u16,
}

/// An announcement of one stream of six channels of 16 bits, as the protocol describes it.
fn announcement() -> Vec<u8> {
    let mut out = vec![1, 0xE8, 3, 0, 0, 1, b'f', 1, 0, 0, 0, 0, 0, 0, 6];
    for name in b'a'..=b'f' {
        out.extend([1, name]);
        for value in [1f32, 0.0, 0.0] {
            out.extend(value.to_le_bytes());
        }
    }
    out
}

impl Device {
    fn frame(&mut self, kind: u8, payload: &[u8]) -> Vec<u8> {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        frame::encode(&Frame {
            kind,
            start: self.start,
            sequence,
            payload,
        })
    }

    fn sample(&mut self, stamp: u32, numbers: [i16; 6]) -> Vec<u8> {
        let mut payload = stamp.to_le_bytes().to_vec();
        payload.push(1);
        payload.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        self.frame(SAMPLE, &payload)
    }
}

/// Stamps, starts, sequences and values in batches.
fn delivered(batches: &[Batch]) -> Vec<(u32, u8, u16, Vec<f64>)> {
    let of_one = |batch: &Batch| {
        let rows = batch.values.chunks(6).map(<[f64]>::to_vec);
        let marks = batch.stamps.iter().zip(&batch.sequence);
        marks
            .zip(rows)
            .map(|((t, n), row)| (*t, batch.start, *n, row))
            .collect::<Vec<_>>()
    };
    batches.iter().flat_map(of_one).collect()
}

/// Whether any piece of the bytes is a frame by chance.
fn holds_frame(wire: &[u8]) -> bool {
    wire.split(|b| *b == 0)
        .any(|piece| frame::decode(piece, &mut Vec::new()).is_some())
}

fuzz_target!(|input: Input| {
    let mut device = Device::default();
    let mut decoder = Decoder::default();
    let mut portions = input.portions.iter().cycle();
    let mut fed = 0;
    // What must arrive, and what does.
    let (mut want, mut texts, mut lost) = (Vec::new(), 0, 0);
    let (mut got, mut told_texts) = (Vec::new(), 0);
    // Bytes since the last end: the next frame is damaged with them.
    let mut begun: Vec<u8> = Vec::new();
    // Frames since the last one that arrives; and since the last sample, which says so.
    let (mut missing, mut untold) = (0, 0);
    let (mut want_told, mut told) = (0, 0);
    // A frame that the fuzzer made up by chance, or an announcement or sample of its own, makes the account another one.
    let mut foreign = false;
    let mut feed = |decoder: &mut Decoder, mut wire: &[u8]| {
        fed += wire.len() as u64;
        while !wire.is_empty() {
            let n = 1 + usize::from(*portions.next().unwrap_or(&255));
            let (now, after) = wire.split_at(n.min(wire.len()));
            decoder.feed(now);
            wire = after;
        }
    };
    feed(&mut decoder, &device.frame(ANNOUNCEMENT, &announcement()));
    for event in &input.events {
        let sequence = device.sequence;
        let is_read = begun.is_empty();
        let mut arrives = false;
        let wire = match event {
            Event::Sample { stamp, numbers } => {
                arrives = is_read;
                if is_read {
                    let row: Vec<f64> = numbers.iter().map(|n| f64::from(*n)).collect();
                    want.push((*stamp, device.start, sequence, row));
                }
                device.sample(*stamp, *numbers)
            }
            Event::Announcement => {
                arrives = is_read;
                device.frame(ANNOUNCEMENT, &announcement())
            }
            Event::Frame { kind, payload } => {
                let wire = device.frame(*kind, payload);
                arrives = is_read && wire.len() - 1 <= LONGEST;
                foreign |= arrives && matches!(*kind, ANNOUNCEMENT | SAMPLE);
                texts += usize::from(arrives && *kind == TEXT);
                wire
            }
            Event::Garbage(bytes) => {
                foreign |= holds_frame(bytes);
                [bytes.as_slice(), &[0]].concat()
            }
            Event::Endless(byte, times) => vec![(*byte).max(1); usize::from(*times) * 20],
            Event::Damaged { at, bits } => {
                let mut wire = device.sample(7, [7; 6]);
                let at = usize::from(*at) % (wire.len() - 1);
                wire[at] ^= (*bits).max(1);
                foreign |= holds_frame(&wire);
                wire
            }
            Event::Lost => {
                device.sample(8, [8; 6]);
                Vec::new()
            }
            Event::Reset => {
                device.start = device.start.wrapping_add(1);
                device.sequence = 0;
                // The frame of the old start breaks off; what it lost is not known.
                arrives = true;
                missing = 0;
                untold = 0;
                [vec![0], device.frame(ANNOUNCEMENT, &announcement())].concat()
            }
            Event::Interruption => {
                decoder.interrupted();
                begun.clear();
                Vec::new()
            }
        };
        feed(&mut decoder, &wire);
        match wire.iter().position(|b| *b == 0) {
            Some(end) => {
                foreign |= !begun.is_empty() && holds_frame(&[&begun, &wire[..end]].concat());
                begun.clear();
            }
            None => begun.extend(&wire),
        }
        if arrives {
            lost += missing;
            untold += std::mem::take(&mut missing);
            if matches!(event, Event::Sample { .. }) {
                want_told += std::mem::take(&mut untold);
            }
        } else if !matches!(event, Event::Garbage(_) | Event::Endless(..) | Event::Interruption) {
            missing += 1;
        }
        let batches = decoder.take();
        told += batches.iter().flat_map(|b| &b.lost).map(|n| u64::from(*n)).sum::<u64>();
        got.extend(delivered(&batches));
        told_texts += decoder.take_texts().len();
    }
    decoder.finish();
    got.extend(delivered(&decoder.take()));
    let counts = decoder.counts();
    assert_eq!(counts.bytes, fed);
    if !foreign {
        assert_eq!(got, want);
        assert_eq!(counts.samples as usize, want.len());
        assert_eq!(told_texts, texts);
        assert_eq!((counts.lost, told), (lost, want_told));
    }
});
