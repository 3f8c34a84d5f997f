//! The numbers that all questions about a problem share: its whitened equations, the block means of its channels, the strengths of its noise.

use imufit_fit::normal_equations::NormalEquations;
use imufit_model::card::ReferencePart;
use imufit_model::sensor_model::Slot;

use crate::problem::{Problem, parameters_of};
use crate::zeros::{self, Modes, Strength};

/// By so many times its part of the mean square a gain or an offset may seem off where the reference is noisy (attenuation, see [`Problem::attenuated`]).
const ATTENUATION: f64 = 1.5;
/// Less of it no log shows.
const ATTENUATION_SEEN: f64 = 1e-5;

/// What all questions of a problem share.
pub struct Criterion<'a> {
    /// The problem.
    pub problem: &'a Problem,
    /// Whitened equations of all blocks over all parameters.
    pub total: NormalEquations,
    /// Block means of every channel.
    pub modes: Vec<Modes>,
    /// Every strength of the noise.
    pub strengths: Vec<Strength>,
    /// Gains and offsets that the noise of the reference makes uncertain, and angles that its steps do: parameter and deviation.
    pub(crate) uncertain: Vec<(usize, f64)>,
    /// Parameters of a heading of the reference that wanders by one radian.
    pub heading: Vec<usize>,
    /// Number of samples of a channel, on average.
    pub samples: f64,
}

/// Part of a quantity that a reference of limited bandwidth has lost to first order: what it has lost beyond that is of the second order, and
/// with a coefficient that nobody knows may be as much of the part again.
fn lost(problem: &Problem, total: &NormalEquations, gain: usize) -> f64 {
    let known = total.gram[(gain, gain)];
    let of = |slot: &Slot| {
        let first = slot.parameters.first().copied().unwrap_or(0.0);
        (first * total.gram[(slot.first, gain)] / known).abs()
    };
    let bandwidth =
        |slot: &&Slot| slot.in_model && slot.effect.card().traits.reference == Some(ReferencePart::Bandwidth);
    if known > 0.0 {
        problem.slots.iter().filter(bandwidth).map(of).sum()
    } else {
        0.0
    }
}

impl<'a> Criterion<'a> {
    /// Of a problem.
    pub fn new(problem: &'a Problem) -> Self {
        let all: Vec<usize> = (0..problem.plausible.len()).collect();
        let total = problem.total(&all);
        let gains = problem.attenuated().into_iter().flat_map(|(slot, shares)| {
            let first = problem.slots[slot].first;
            (0..3).map(move |axis| (first + axis, shares[axis]))
        });
        let deviation = |(j, share): (usize, f64)| (j, (ATTENUATION * share).hypot(lost(problem, &total, j)));
        let hides = |s: &&Slot| s.effect.card().traits.reference == Some(ReferencePart::Noise);
        let hidden = parameters_of(problem.slots.iter().filter(hides)).into_iter();
        let uncertain: Vec<(usize, f64)> = gains
            .map(deviation)
            .filter(|(_, deviation)| *deviation > ATTENUATION_SEEN)
            .chain(problem.rounded())
            .chain(hidden.map(|j| (j, ATTENUATION)))
            .collect();
        let wanders = |s: &&Slot| s.effect.card().traits.reference == Some(ReferencePart::Heading);
        let heading = parameters_of(problem.slots.iter().filter(wanders));
        let channels: usize = problem
            .parts
            .iter()
            .map(|part| part.weights().iter().filter(|w| **w > 0.0).count())
            .sum();
        Self {
            problem,
            samples: total.n / channels.max(1) as f64 * problem.parts.len().max(1) as f64,
            total,
            modes: zeros::modes(problem),
            strengths: zeros::strengths(),
            uncertain,
            heading,
        }
    }

    /// Prior deviation of a parameter of a candidate: three times what is typical; where nobody can tell what that is, as much as makes a
    /// signal as large as the noise of a sample (unit information, Kass and Wasserman 1995).
    pub fn deviation(&self, parameter: usize) -> f64 {
        if self.problem.typical[parameter] {
            self.problem.plausible[parameter]
        } else {
            let information = self.total.gram[(parameter, parameter)];
            if information > 0.0 {
                (self.samples / information).sqrt()
            } else {
                0.0
            }
        }
    }
}
