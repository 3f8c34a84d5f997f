//! What a replay remembers from row to row.

use nalgebra::Vector3;

use crate::bridge::Bridge;

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
    pub const LENGTH: usize = 17;

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
        let Self {
            started,
            first,
            last,
            t_acc,
            t_gyr,
            t_mag,
            omega,
            alpha,
            bridge: Bridge {
                usual,
                span,
                doubted: d,
            },
        } = self;
        let started = if started { 1.0 } else { 0.0 };
        [
            started, first, last, t_acc, t_gyr, t_mag, omega.x, omega.y, omega.z, alpha.x, alpha.y, alpha.z, usual,
            span, d.x, d.y, d.z,
        ]
    }

    /// `None` where the numbers are no memory.
    pub fn from_slice(numbers: &[f64]) -> Option<Self> {
        let &[
            started,
            first,
            last,
            t_acc,
            t_gyr,
            t_mag,
            x,
            y,
            z,
            a,
            b,
            c,
            usual,
            span,
            d,
            e,
            f,
        ] = numbers
        else {
            return None;
        };
        (x + y + z + a + b + c + usual + span + d + e + f)
            .is_finite()
            .then(|| Self {
                started: started > 0.5,
                first,
                last,
                t_acc,
                t_gyr,
                t_mag,
                omega: Vector3::new(x, y, z),
                alpha: Vector3::new(a, b, c),
                bridge: Bridge {
                    usual,
                    span,
                    doubted: Vector3::new(d, e, f),
                },
            })
    }
}
