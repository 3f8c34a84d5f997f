//! Lines of any bytes among rows, in any portions: portions do not matter, and after an intact line a row that is whole is
//! delivered.
#![no_main]

use arbitrary::Arbitrary;
use imufit_device::lines::{Batch, Decoder, LONGEST};
use libfuzzer_sys::fuzz_target;

#[derive(Arbitrary, Debug)]
enum Event {
    /// A row of the two columns.
    Row(i32, i16),
    /// Any bytes and an end of a line.
    Garbage(Vec<u8>),
    /// A byte many times, without an end.
    Endless(u8, u16),
    /// The port is closed and opened anew.
    Interruption,
}

#[derive(Arbitrary, Debug)]
struct Input {
    events: Vec<Event>,
    portions: Vec<u8>,
}

/// What a decoder found: columns and values of each batch; rows; and what it told.
#[derive(Default, PartialEq, Debug)]
struct Found {
    batches: Vec<(Vec<String>, Vec<f64>)>,
    texts: Vec<String>,
    damaged: u64,
    lost: u64,
}

fn decoded(input: &Input, portion: impl Fn(usize) -> usize) -> Found {
    let mut decoder = Decoder::default();
    let mut found = Found::default();
    let mut fed = 0;
    let mut k = 0;
    decoder.feed(b"a,b\n");
    let mut batches: Vec<Batch> = Vec::new();
    for event in &input.events {
        let wire = match event {
            Event::Row(a, b) => format!("{a},{b}\n").into_bytes(),
            Event::Garbage(bytes) => [bytes.as_slice(), b"\n"].concat(),
            Event::Endless(byte, n) => vec![*byte; usize::from(*n)],
            Event::Interruption => {
                decoder.interrupted();
                continue;
            }
        };
        fed += wire.len() as u64;
        let mut rest = wire.as_slice();
        while !rest.is_empty() {
            let (now, after) = rest.split_at(portion(k).clamp(1, rest.len()));
            decoder.feed(now);
            rest = after;
            k += 1;
        }
    }
    decoder.finish();
    batches.extend(decoder.take());
    for batch in batches {
        assert_eq!(batch.values.len(), batch.columns.len() * batch.lost.len());
        found.lost += batch.lost.iter().map(|n| u64::from(*n)).sum::<u64>();
        let values = batch
            .values
            .iter()
            .map(|v| if v.is_nan() { f64::MAX } else { *v })
            .collect();
        found.batches.push((batch.columns.to_vec(), values));
    }
    let counts = decoder.counts();
    assert_eq!(counts.bytes, fed + 4);
    assert_eq!(
        counts.samples as usize,
        found
            .batches
            .iter()
            .map(|(names, v)| v.len() / names.len())
            .sum::<usize>()
    );
    assert!(found.lost <= counts.damaged);
    found.damaged = counts.damaged;
    found.texts = decoder.take_texts();
    assert!(found.texts.iter().all(|text| text.len() <= 3 * LONGEST));
    found
}

fuzz_target!(|input: Input| {
    let n = input.portions.len().max(1);
    let found = decoded(&input, |k| {
        usize::from(input.portions.get(k % n).copied().unwrap_or(255))
    });
    assert_eq!(found, decoded(&input, |_| usize::MAX));
    // Rows after each other, without anything between them, arrive as they are.
    if input.events.iter().all(|event| matches!(event, Event::Row(..))) {
        let rows = input.events.iter().flat_map(|event| match event {
            Event::Row(a, b) => vec![f64::from(*a), f64::from(*b)],
            _ => Vec::new(),
        });
        let values: Vec<f64> = found.batches.into_iter().flat_map(|(_, values)| values).collect();
        assert_eq!(values, rows.collect::<Vec<f64>>());
    }
});
