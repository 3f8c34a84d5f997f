//! What an effect says of itself: ids, units and the words that help text, documents and explanations are made of.

/// One parameter of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name within the effect: `x`, `xy`, `tau`, ...
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Size that low-cost sensors typically show; `None` if nobody can tell.
    pub typical: Option<f64>,
    /// How its value is found.
    pub found: Found,
}

/// How the value of a parameter is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// By steps along its column.
    Steps,
    /// By a search, then by steps along its column: without a search there is nothing to start from.
    SearchThenSteps,
    /// By a search alone: no step moves it.
    Search,
}

/// Where in the chain from truth to reading an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// The reference itself is changed before ideal readings are taken.
    Reference,
    /// The sensor shows what was: late, or smoothed.
    Time,
    /// Changes the quantity that reaches the sensing element.
    Input,
    /// Turns the quantity into a reading: acts on what the stages before left.
    Gain,
    /// Adds to the reading whatever the quantity is.
    Offset,
    /// Leaves only whole steps of the converter.
    Rounding,
    /// Cuts off the reading at the end of the sensor's range.
    Range,
}

/// Whose property the parameters of an effect are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scope {
    /// The sensor's: the same in all of its logs.
    #[default]
    Sensor,
    /// One log's: switching on makes a zero, setting up makes a mount, a level and a field.
    Log,
}

/// Which rows decide what an effect adds to the reading of one row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reach {
    /// The row itself: readings of all sensors, temperature and covariates.
    Row,
    /// The row itself and the reference there.
    Reference,
    /// The rows around it besides: derivatives, delays, means over a while. Every effect may be left at this.
    #[default]
    Neighbours,
    /// All rows from the start of the log on.
    History,
}

/// Part of `reading = (I + M) x + b` that an effect is, for each unit of [`crate::effect::Effect::column`] if it has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Affine {
    /// The vector b: parameters x, y, z.
    Offset,
    /// The diagonal of M: parameters x, y, z.
    Scale,
    /// Elements of M, each a parameter with the name of its place: xx, xy, ...
    Matrix,
}

/// Part of the reference that an effect says is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferencePart {
    /// How the sensor is turned on the body that the reference describes: a rotation vector x, y, z.
    Mount,
    /// The vertical of its frame.
    Level,
    /// Its time: tau, and k times the time since the log began.
    Time,
    /// How fast a motion it follows.
    Bandwidth,
    /// The field in its frame: what x, y, z lack.
    Field,
    /// The angle that the drive of a rig is at.
    Drive,
    /// Its heading, which wanders.
    Heading,
    /// Its noise, where this hides something.
    Noise,
}

/// Properties of an effect that others ask about instead of its name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traits {
    /// Whose property its parameters are.
    pub scope: Scope,
    /// Which rows decide what it adds to one.
    pub reach: Reach,
    /// Part of a gain and an offset that it is, if it is one.
    pub affine: Option<Affine>,
    /// Part of the reference that it says is wrong; `None` if it acts on the readings.
    pub reference: Option<ReferencePart>,
}

/// Description of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Card {
    /// Fixed id such as `gyr.g_sensitivity`.
    pub id: String,
    /// What it is called in a sentence.
    pub name: String,
    /// Where it acts.
    pub stage: Stage,
    /// What it is like, for those who would ask for its name otherwise.
    pub traits: Traits,
    /// Its parameters in order.
    pub parameters: Vec<Parameter>,
    /// The physical cause in a sentence.
    pub physics: String,
    /// What it adds to the ideal reading.
    pub formula: String,
    /// What it looks like in the residual.
    pub signature: String,
    /// What it is mistaken for.
    pub mistaken_for: String,
    /// The experiment that confirms it.
    pub confirm: String,
    /// How much of the chance of a false alarm it may use up, where most effects use one share: what a wandering zero imitates cannot become
    /// as certain as others can, whatever the log (Genovese, Roeder and Wasserman 2006, False discovery control with p-value weighting).
    pub shares: f64,
}

impl Card {
    /// The same card of an effect with other traits.
    #[must_use]
    pub fn with(self, traits: Traits) -> Self {
        Self { traits, ..self }
    }
}

/// Parameter names of a 3-vector.
pub const VECTOR: [&str; 3] = ["x", "y", "z"];
/// Parameter names of a 3x3 matrix without its diagonal, row by row.
pub const OFF_DIAGONAL: [&str; 6] = ["xy", "xz", "yx", "yz", "zx", "zy"];
/// Parameter names of a full 3x3 matrix, row by row.
pub const MATRIX: [&str; 9] = ["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"];

/// Parameters of equal unit and size.
pub fn parameters(names: &[&str], unit: &str, typical: f64) -> Vec<Parameter> {
    names
        .iter()
        .map(|name| Parameter {
            name: (*name).to_string(),
            unit: unit.to_string(),
            typical: Some(typical),
            found: Found::Steps,
        })
        .collect()
}
