//! What a replay remembers from row to row.

use nalgebra::Vector3;

use crate::bridge::Bridge;
use crate::usual::Usual;

/// Times are NaN where there is none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Memory {
    pub started: bool,
    /// First good row, for the limits of [`Start::Vectors`](crate::Start::Vectors).
    pub first: f64,
    /// Last good row.
    pub last: f64,
    pub t_acc: f64,
    pub t_gyr: f64,
    pub t_mag: f64,
    /// The rate at `t_gyr`.
    pub omega: Vector3<f64>,
    /// Angular acceleration there, where a lever arm asks for it.
    pub alpha: Vector3<f64>,
    /// Single bad rates.
    pub bridge: Bridge,
}

impl Memory {
    /// Numbers of a memory that is written down.
    pub const LENGTH: usize = 25;

    pub const EMPTY: Self = Self {
        started: false,
        first: f64::NAN,
        last: f64::NAN,
        t_acc: f64::NAN,
        t_gyr: f64::NAN,
        t_mag: f64::NAN,
        omega: Vector3::new(0.0, 0.0, 0.0),
        alpha: Vector3::new(0.0, 0.0, 0.0),
        bridge: Bridge::NONE,
    };

    /// After a gap: nothing is bridged.
    pub fn forget_readings(&mut self) {
        let Self { started, first, .. } = *self;
        *self = Self {
            started,
            first,
            ..Self::EMPTY
        };
    }

    pub fn to_array(self) -> [f64; Self::LENGTH] {
        let Bridge {
            usual: Usual(usual),
            span,
            doubted,
            from,
            farthest,
            turned,
            since,
        } = self.bridge;
        let started = if self.started { 1.0 } else { 0.0 };
        let times = [started, self.first, self.last, self.t_acc, self.t_gyr, self.t_mag];
        let vectors = [self.omega, self.alpha, doubted, from, turned].map(<[f64; 3]>::from);
        let mut numbers = times
            .into_iter()
            .chain([usual, span, since, farthest])
            .chain(vectors.into_iter().flatten());
        std::array::from_fn(|_| numbers.next().unwrap_or_default())
    }

    /// `None` where the numbers are no memory.
    pub fn from_slice(numbers: &[f64]) -> Option<Self> {
        let (&[started, first, last, t_acc, t_gyr, t_mag], own) = numbers.split_first_chunk()?;
        let (&[usual, span, since, farthest], vectors) = own.split_first_chunk()?;
        let (vectors, rest) = vectors.as_chunks::<3>();
        let &[omega, alpha, doubted, from, turned] = vectors else {
            return None;
        };
        let sound = rest.is_empty() && own.iter().all(|x| x.is_finite());
        sound.then(|| Self {
            started: started > 0.5,
            first,
            last,
            t_acc,
            t_gyr,
            t_mag,
            omega: omega.into(),
            alpha: alpha.into(),
            bridge: Bridge {
                usual: Usual(usual),
                span,
                doubted: doubted.into(),
                from: from.into(),
                farthest,
                turned: turned.into(),
                since,
            },
        })
    }
}
