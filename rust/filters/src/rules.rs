//! The settings of the rules that [`replay`](crate::replay) states.

use crate::FilterError;
use crate::filter::{Parameter, fill};

/// The settings of the rules.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "max_gap",
        default: 1.0,
        unit: "s",
        meaning: "a longer step is a gap: larger integrates across more of what was not measured",
    },
    Parameter {
        name: "free_fall",
        default: 0.2,
        unit: "1",
        meaning: "a specific force shorter than this part of gravity is not used: larger refuses more of a throw",
    },
];

/// [`PARAMETERS`] with values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rules {
    /// Longest step that is integrated, s.
    pub max_gap: f64,
    /// Least specific force that shows the vertical, in parts of gravity.
    pub free_fall: f64,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            max_gap: PARAMETERS[0].default,
            free_fall: PARAMETERS[1].default,
        }
    }
}

impl Rules {
    /// From settings by name.
    pub fn from_settings(settings: &[(String, f64)]) -> Result<Self, FilterError> {
        let values = fill("replay", PARAMETERS, settings)?;
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        Ok(Self {
            max_gap: value(0),
            free_fall: value(1),
        })
    }
}
