//! `rust/device`: the wire protocol, bytes to samples and samples to bytes.

use imufit_device::lines;
use imufit_device::wire::announcement::{Announcement, Channel, Form, Number, STREAMS, Stream};
use imufit_device::wire::decoder;
use imufit_device::wire::encoder::Encoder;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

/// Adds arrays of a batch to a dictionary: values (n, columns), lost (n,).
fn add_rows(out: &Bound<'_, PyDict>, values: Vec<f64>, columns: usize, lost: Vec<u32>) -> PyResult<()> {
    let py = out.py();
    let n = lost.len();
    out.set_item("values", PyArray1::from_vec(py, values).reshape([n, columns])?)?;
    out.set_item("lost", PyArray1::from_vec(py, lost))
}

/// Adds what an announcement says to a dictionary.
fn add_announcement(out: &Bound<'_, PyDict>, announcement: &Announcement) -> PyResult<()> {
    out.set_item("name", &announcement.name)?;
    out.set_item("tick", f64::from(announcement.tick) * 1e-9)?;
    out.set_item("columns", announcement.columns())?;
    out.set_item("ranges", announcement.ranges())?;
    let rate = |s: &Stream| vec![f64::from(s.rate); s.form.columns().len()];
    out.set_item(
        "rates",
        announcement.streams.iter().flat_map(rate).collect::<Vec<f64>>(),
    )
}

/// The Python class of a decoder: what both forms have in common, and what is a form's own.
macro_rules! decoder_class {
    ($class:ident { $($own:item)* }) => {
        #[pymethods]
        impl $class {
            /// A decoder that has seen nothing.
            #[new]
            fn new() -> Self {
                Self::default()
            }

            /// Takes some bytes, which may begin and end anywhere.
            fn feed(&mut self, py: Python<'_>, data: &[u8]) {
                #[allow(clippy::disallowed_methods)] // a few bytes, hundreds of times a second: on this thread
                py.detach(|| self.0.feed(data));
            }

            /// The port was closed and opened anew.
            fn interrupted(&mut self) {
                self.0.interrupted();
            }

            /// Nothing more comes.
            fn finish(&mut self) {
                self.0.finish();
            }

            /// Messages since this was last asked.
            fn take_texts(&mut self) -> Vec<String> {
                self.0.take_texts()
            }

            /// What came so far, by name.
            fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
                let out = PyDict::new(py);
                for (name, count) in self.0.counts().named() {
                    out.set_item(name, count)?;
                }
                Ok(out)
            }

            $($own)*
        }
    };
}

/// Decoder of the binary form.
#[pyclass(name = "WireDecoder", module = "imufit._imufit")]
#[derive(Default)]
struct PyWireDecoder(decoder::Decoder);

decoder_class!(PyWireDecoder {
    /// Samples since this was last asked: for each start of the device and each announcement a dictionary with what was announced,
    /// `start`, and arrays `stamps` (n,) ticks, `sequence` (n,), `lost` (n,) frames missing before each, `feed` (n,) the call of feed,
    /// from 1, that brought each, and `values` (n, columns) SI units.
    fn take<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let out = PyList::empty(py);
        for batch in self.0.take() {
            let item = PyDict::new(py);
            add_announcement(&item, &batch.announcement)?;
            item.set_item("start", batch.start)?;
            item.set_item("stamps", PyArray1::from_vec(py, batch.stamps))?;
            item.set_item("sequence", PyArray1::from_vec(py, batch.sequence))?;
            item.set_item("feed", PyArray1::from_vec(py, batch.feed))?;
            let columns = batch.announcement.columns().len();
            add_rows(&item, batch.values, columns, batch.lost)?;
            out.append(item)?;
        }
        Ok(out)
    }

    /// The last announcement; None before the first.
    fn announcement<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(announcement) = self.0.announcement() else {
            return Ok(None);
        };
        let out = PyDict::new(py);
        add_announcement(&out, announcement)?;
        Ok(Some(out))
    }
});

/// Decoder of the text form.
#[pyclass(name = "LineDecoder", module = "imufit._imufit")]
#[derive(Default)]
struct PyLineDecoder(lines::Decoder);

decoder_class!(PyLineDecoder {
    /// Rows since this was last asked: for each header a dictionary with `columns` as it spells them, and arrays `values` (n, columns) as
    /// they stand there and `lost` (n,) damaged lines before each.
    fn take<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let out = PyList::empty(py);
        for batch in self.0.take() {
            let item = PyDict::new(py);
            item.set_item("columns", batch.columns.as_slice())?;
            add_rows(&item, batch.values, batch.columns.len(), batch.lost)?;
            out.append(item)?;
        }
        Ok(out)
    }
});

/// A stream as Python gives it: rate, form, registers, channels (name, scale, offset, range).
type StreamArguments = (f32, String, Vec<u8>, Vec<(String, f32, f32, f32)>);

fn stream((rate, form, registers, channels): StreamArguments) -> PyResult<Stream> {
    let channel = |(name, scale, offset, range)| Channel {
        name,
        scale,
        offset,
        range,
    };
    let counts = |number| Form::Counts(number, channels.into_iter().map(channel).collect());
    let wrong = |n: usize| PyValueError::new_err(format!("{form} has {n} registers, {} came", registers.len()));
    let form = match form.as_str() {
        "i16" => counts(Number::I16),
        "i32" => counts(Number::I32),
        "f32" => counts(Number::F32),
        "mpu6050" => Form::Mpu6050(registers.as_slice().try_into().map_err(|_| wrong(4))?),
        "hmc5883l" => Form::Hmc5883l(registers.as_slice().try_into().map_err(|_| wrong(3))?),
        other => {
            return Err(PyValueError::new_err(format!(
                "form {other:?} is none of i16, i32, f32, mpu6050, hmc5883l"
            )));
        }
    };
    Ok(Stream { rate, form })
}

/// Encoder of the binary form: a device without hardware.
#[pyclass(name = "WireEncoder", module = "imufit._imufit")]
struct PyWireEncoder(Encoder);

#[pymethods]
impl PyWireEncoder {
    /// A device at its start: its name, tick (ns), streams (rate Hz, form, registers, channels), and the number of the start.
    #[new]
    fn new(name: String, tick: u32, streams: Vec<StreamArguments>, start: u8) -> PyResult<Self> {
        if streams.is_empty() || streams.len() > STREAMS {
            return Err(PyValueError::new_err(format!(
                "a device has 1 to {STREAMS} streams, not {}",
                streams.len()
            )));
        }
        let streams: PyResult<Vec<Stream>> = streams.into_iter().map(stream).collect();
        let announcement = Announcement {
            name,
            tick,
            streams: streams?,
        };
        if Announcement::decode(&announcement.encode()).as_ref() != Some(&announcement) {
            return Err(PyValueError::new_err(
                "no device can be announced like this: tick 0, two columns of one name, a stream without channels, or a text over 255 bytes",
            ));
        }
        Ok(Self(Encoder::new(announcement, start)))
    }

    /// Columns of its samples.
    fn columns(&self) -> Vec<String> {
        self.0
            .announcement()
            .columns()
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    /// The announcement as a frame.
    fn announce<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.0.announce())
    }

    /// A message as a frame.
    fn text<'py>(&mut self, py: Python<'py>, text: &str) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.0.text(text))
    }

    /// Samples as frames: stamps (n,) ticks and values (n, columns) SI units, NaN where a stream has none; and where each frame ends.
    fn samples<'py>(
        &mut self,
        py: Python<'py>,
        stamps: PyReadonlyArray1<'py, u32>,
        values: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyArray1<u64>>)> {
        let (stamps, values) = (stamps.as_array(), values.as_array());
        let columns = self.0.announcement().columns().len();
        if values.dim() != (stamps.len(), columns) {
            return Err(PyValueError::new_err(format!(
                "values are {:?}, not ({}, {columns})",
                values.dim(),
                stamps.len()
            )));
        }
        let mut out = Vec::new();
        let mut ends = Vec::with_capacity(stamps.len());
        for (stamp, row) in stamps.iter().zip(values.outer_iter()) {
            out.extend(self.0.sample(*stamp, &row.to_vec()));
            ends.push(out.len() as u64);
        }
        Ok((PyBytes::new(py, &out), PyArray1::from_vec(py, ends)))
    }
}

/// Adds this file's classes to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyWireDecoder>()?;
    m.add_class::<PyLineDecoder>()?;
    m.add_class::<PyWireEncoder>()
}
