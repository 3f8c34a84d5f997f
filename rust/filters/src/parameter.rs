//! One setting of a filter or of the rules: what it is, and its value from a choice by name.

use crate::FilterError;

/// One setting of a filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name, as printed in the paper where there is one.
    pub name: &'static str,
    /// Value without a choice.
    pub default: f64,
    /// Unit; `1` for a number.
    pub unit: &'static str,
    /// What it is, and what a smaller and a larger value do.
    pub meaning: &'static str,
}

impl Parameter {
    /// Whether it is a coordinate of a place, which may be negative.
    pub fn is_coordinate(&self) -> bool {
        self.unit == "m"
    }
}

/// Beyond any use, and its square times that of a reading is still a number of the machine.
const LARGEST: f64 = 1e50;

/// The values of `parameters` in their order, from settings by name.
pub(crate) fn fill(
    filter: &'static str,
    parameters: &'static [Parameter],
    settings: &[(String, f64)],
) -> Result<Vec<f64>, FilterError> {
    let mut values: Vec<f64> = parameters.iter().map(|parameter| parameter.default).collect();
    for (name, value) in settings {
        let Some(at) = parameters.iter().position(|parameter| parameter.name == name) else {
            let names: Vec<&str> = parameters.iter().map(|parameter| parameter.name).collect();
            let known = if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            };
            return Err(FilterError::UnknownSetting {
                filter,
                name: name.clone(),
                known,
            });
        };
        let (name, signed) = (parameters[at].name, parameters[at].is_coordinate());
        let (size, range) = if signed {
            (value.abs(), "a number from -1e50 to 1e50")
        } else {
            (*value, "a number from 0 to 1e50")
        };
        if !(0.0..=LARGEST).contains(&size) {
            return Err(FilterError::Setting {
                filter,
                name,
                value: *value,
                range,
            });
        }
        values[at] = *value;
    }
    Ok(values)
}
