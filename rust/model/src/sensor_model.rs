//! A stack of effects on top of the ideal readings: prediction, residual and columns of the design matrix.

use std::cell::LazyCell;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use crate::card::{ReferencePart, Stage};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::ideal::{Command, Ideal, ReferenceChange};
use crate::rest_channels;
use crate::sensor::{CHANNELS, Sensor};
use crate::triple::Triple;
use crate::vibration;
use crate::window::{Window, held};

/// Columns of a sensor's three axes, in the order of the parameters that are active on each.
pub type AxisColumns = [Vec<Vec<f64>>; 3];

/// An effect with its parameters and its place among all parameters.
#[derive(Clone)]
pub struct Slot {
    /// The effect.
    pub effect: Arc<dyn Effect>,
    /// Present values; for a candidate the values that its columns are taken for.
    pub parameters: Vec<f64>,
    /// True if the effect is part of the model; false for a candidate that is only asked for its columns.
    pub in_model: bool,
    /// Index of its first parameter among all parameters.
    pub first: usize,
    /// How many values of its inner parameters were tried before these: each could have been a chance finding.
    pub tried: usize,
}

impl Slot {
    /// What a p-value of it is multiplied by, and then by the shares of all candidates, to count every chance of a false alarm.
    pub fn chances(&self) -> f64 {
        self.tried as f64 / self.effect.card().shares
    }

    /// True where its value lies in the ideal readings: what acts on these then acts on it. The field does wherever a reference gives these.
    fn in_ideal(&self, facts: &LogFacts) -> bool {
        let card = self.effect.card();
        let field = card.traits.reference == Some(ReferencePart::Field);
        matches!(card.stage, Stage::Reference | Stage::Time) || (field && !facts.rests)
    }

    fn columns(&self, rows: &Rows, sensor: Sensor, out: &mut Columns) -> Result<(), EffectError> {
        if self.in_model {
            self.effect.columns(rows, sensor, &self.parameters, out)
        } else {
            self.effect.candidate_columns(rows, sensor, &self.parameters, out)
        }
    }

    /// Adds the effect's share of a sensor's readings to `sum`. An empty sum starts as `x`. `columns` are those of the effect on this sensor.
    fn add_to(
        &self,
        rows: &Rows,
        sensor: Sensor,
        columns: &Columns,
        sum: &mut Option<Triple>,
        x: &Triple,
    ) -> Result<(), EffectError> {
        let own = || x.clone();
        if let Some(added) = self.effect.added(rows, sensor, &self.parameters)? {
            sum.get_or_insert_with(own).add(&added, 1.0);
        } else if self.parameters.iter().any(|v| *v != 0.0) {
            columns.add_to(&self.parameters, sum.get_or_insert_with(own));
        }
        Ok(())
    }
}

/// Effects of the model and candidates, each parameter with a fixed place.
#[derive(Clone)]
pub struct SensorModel {
    slots: Vec<Slot>,
    parameters: usize,
    /// Parameters whose column can differ from zero, per sensor and axis.
    on_axes: Vec<Vec<usize>>,
    /// The same per channel of the evidence: another list where rests stand in for a reference.
    active: Vec<Vec<usize>>,
}

/// Columns and residual of one channel over the rows of a window.
#[derive(Clone, Debug, Default)]
pub struct ChannelColumns {
    /// One column per active parameter, in the order of [`SensorModel::active`].
    pub columns: Vec<Vec<f64>>,
    /// Measured less modelled; NaN where there is no sample or no reference.
    pub residual: Vec<f64>,
}

impl ChannelColumns {
    /// Residual after a step of all parameters, of which `active` are the channel's own.
    pub fn residual_after(&self, active: &[usize], step: &[f64]) -> Vec<f64> {
        let mut residual = self.residual.clone();
        for (column, parameter) in self.columns.iter().zip(active) {
            if step[*parameter] != 0.0 {
                for (r, c) in residual.iter_mut().zip(column) {
                    *r -= step[*parameter] * c;
                }
            }
        }
        residual
    }
}

/// What a model says of the core rows of a window.
pub struct Evaluation {
    /// Ideal readings the model started from.
    pub ideal: Ideal,
    /// Columns and residual of each channel; `None` for a sensor that the log does not have.
    pub channels: Vec<Option<ChannelColumns>>,
    /// Covariates with slow columns held, in the order of the facts.
    pub covariates: Vec<Vec<f64>>,
    /// Temperature less its mean.
    pub temperature: Option<Vec<f64>>,
}

/// Temperature of the core rows less its mean over the log, K, slow samples held.
fn held_temperature(window: &Window, facts: &LogFacts) -> Option<Vec<f64>> {
    let core = window.begin..window.end;
    let known = |t: &[f64]| core.map(|i| held(t, i) - facts.temperature_mean).collect();
    window.temperature.map(known)
}

/// Covariates of the core rows, slow samples held.
fn held_covariates(window: &Window) -> Vec<Vec<f64>> {
    let core = window.begin..window.end;
    let known = |c: &&[f64]| core.clone().map(|i| held(c, i)).collect();
    window.covariates.iter().map(known).collect()
}

/// Everything that an effect with memory sees: the rows asked about and those before them.
struct Past<'a> {
    t: &'a [f64],
    ideal: Ideal,
    temperature: Option<Vec<f64>>,
    covariates: Vec<Vec<f64>>,
    history: usize,
}

impl<'a> Past<'a> {
    /// Core rows of a window, of which the first `history` are of the past.
    fn new(window: &Window<'a>, facts: &LogFacts, change: &ReferenceChange, sensor: Sensor, history: usize) -> Self {
        let own = Ideal::of_sensor(window, facts, change, sensor);
        Self {
            t: &window.t[window.begin..window.end],
            ideal: own.unwrap_or_else(|| Ideal::new(window, facts, change)),
            temperature: held_temperature(window, facts),
            covariates: held_covariates(window),
            history,
        }
    }

    /// The same as effects see rows, quantities without axes that hold noise alone.
    fn rows<'b>(
        &'b mut self,
        facts: &'b LogFacts,
        sensor: Sensor,
        seen: &impl Fn(&Ideal) -> Option<Ideal>,
    ) -> Rows<'b> {
        if let Some(ideal) = seen(&self.ideal) {
            self.ideal = ideal;
        }
        Rows {
            facts,
            t: self.t,
            x: self.ideal.quantity(sensor),
            ideal: &self.ideal,
            force: &self.ideal.f,
            temperature: self.temperature.as_deref(),
            vibration: None,
            covariates: &self.covariates,
            position: &[],
            history: self.history,
        }
    }
}

/// A reading that is cut off does not move with any parameter.
fn still_where_cut_off(columns: &mut AxisColumns, before: &Triple, after: &Triple) {
    for (axis, columns) in columns.iter_mut().enumerate() {
        let rows = before.axis(axis).iter().zip(after.axis(axis));
        let cut: Vec<usize> = rows
            .enumerate()
            .filter(|(_, (a, b))| (*a - *b).abs() > 0.0)
            .map(|(i, _)| i)
            .collect();
        for column in columns.iter_mut().filter(|c| !c.is_empty()) {
            for i in &cut {
                // Not known stays not known.
                column[*i] *= 0.0;
            }
        }
    }
}

impl SensorModel {
    /// A model of the given effects (with parameters) and candidates (with trial values).
    pub fn new(
        effects: Vec<(Arc<dyn Effect>, Vec<f64>)>,
        candidates: Vec<(Arc<dyn Effect>, Vec<f64>)>,
        facts: &LogFacts,
    ) -> Result<Self, EffectError> {
        let mut slots = Vec::new();
        let mut first = 0;
        let asked = effects.into_iter().map(|e| (e, true));
        for ((effect, parameters), in_model) in asked.chain(candidates.into_iter().map(|e| (e, false))) {
            let count = effect.card().parameters.len();
            if parameters.len() != count {
                let message = format!("takes {count} parameters, got {}", parameters.len());
                return Err(EffectError::Contract {
                    effect: effect.card().id.clone(),
                    message,
                });
            }
            slots.push(Slot {
                // From any trial of what is tried at full size steps lead on, unless it jumps.
                tried: if effect.tried_at_full_size() && !effect.jumps() {
                    1
                } else {
                    effect.search(facts, None).len().max(1)
                },
                effect,
                parameters,
                in_model,
                first,
            });
            first += count;
        }
        let mut model = Self {
            slots,
            parameters: first,
            on_axes: vec![Vec::new(); CHANNELS],
            active: Vec::new(),
        };
        model.find_active(facts)?;
        model.active = if facts.rests {
            rest_channels::active(&model.on_axes)
        } else {
            model.on_axes.clone()
        };
        Ok(model)
    }

    /// The effects in order.
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }

    /// Number of parameters of all effects.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// Parameters whose column can differ from zero, per channel of the evidence.
    pub fn active(&self) -> &[Vec<usize>] {
        &self.active
    }

    /// The same per sensor and axis, as [`SensorModel::modelled`] has its columns.
    pub fn active_on_axes(&self) -> &[Vec<usize>] {
        &self.on_axes
    }

    /// Modelled readings of one sensor and the columns of its three axes for ideal readings that are known otherwise than from a
    /// reference: `rows.x` counts for nothing.
    pub fn modelled(&self, rows: Rows, sensor: Sensor) -> Result<(Triple, AxisColumns), EffectError> {
        let ideal = rows.ideal.quantity(sensor);
        self.predict(rows, None, ideal.clone(), None, &vec![None; self.slots.len()], sensor)
    }

    /// Sets the parameters of the model's effects from a vector over all parameters.
    pub fn set_parameters(&mut self, values: &[f64]) {
        for slot in self.slots.iter_mut().filter(|s| s.in_model) {
            let n = slot.parameters.len();
            slot.parameters.copy_from_slice(&values[slot.first..slot.first + n]);
        }
    }

    /// Which columns can be non-zero at all is asked once, on four made-up rows.
    fn find_active(&mut self, facts: &LogFacts) -> Result<(), EffectError> {
        let mut ideal = Ideal::default();
        for i in 0..4 {
            let v = Vector3::new(0.3, -0.7, 1.1) * (1.0 + f64::from(i));
            for triple in [
                &mut ideal.omega,
                &mut ideal.alpha,
                &mut ideal.alpha_rate,
                &mut ideal.snap,
                &mut ideal.f,
                &mut ideal.f_rate,
                &mut ideal.m,
                &mut ideal.m_rate,
            ] {
                triple.push(&v);
            }
            ideal.attitude.push(UnitQuaternion::from_scaled_axis(v * 0.1));
            ideal.command.push(Command {
                t: facts.t_start + facts.dt * f64::from(i),
                angle: 0.3 * f64::from(i),
                rate: 0.2,
            });
        }
        ideal.rig_axis = facts.rig.as_ref().map_or_else(Vector3::zeros, |rig| rig.axis);
        let t: Vec<f64> = (0..4).map(|i| facts.t_start + facts.dt * f64::from(i)).collect();
        let ones = vec![1.0, 2.0, -1.0, 0.5];
        let covariates = vec![ones.clone(); facts.covariates.len()];
        let mut columns = Columns::default();
        for sensor in Sensor::ALL.into_iter().filter(|s| facts.sensors[s.index()]) {
            let rows = Rows {
                facts,
                t: &t,
                ideal: &ideal,
                force: &ideal.f,
                x: &ideal.f,
                temperature: Some(&ones),
                vibration: Some(&ones),
                covariates: &covariates,
                position: &[],
                history: 0,
            };
            for slot in self.slots.iter().filter(|s| s.effect.sensors().contains(&sensor)) {
                columns.reset(4, slot.parameters.len());
                slot.columns(&rows, sensor, &mut columns)?;
                for axis in 0..3 {
                    let list = &mut self.on_axes[3 * sensor.index() + axis];
                    list.extend(
                        (0..slot.parameters.len())
                            .filter(|p| columns.get(*p, axis).is_some())
                            .map(|p| slot.first + p),
                    );
                }
            }
        }
        Ok(())
    }

    /// What the model's effects on the ideal readings do to the reference.
    pub fn reference_change(&self, facts: &LogFacts) -> ReferenceChange {
        self.slots
            .iter()
            .filter(|s| s.in_model && s.in_ideal(facts))
            .fold(ReferenceChange::default(), |change, s| {
                change.and(s.effect.reference_change(&s.parameters))
            })
    }

    /// Longest memory of its effects on one sensor, s.
    fn memory(&self, sensor: Sensor) -> f64 {
        let on_sensor = self.slots.iter().filter(|s| s.effect.sensors().contains(&sensor));
        on_sensor.map(|s| s.effect.memory()).fold(0.0, f64::max)
    }

    /// Rows around a part of a window that its evaluation may look at: all there are where an effect looks far back.
    pub fn margin(&self, window: &Window, facts: &LogFacts) -> usize {
        if Sensor::ALL.iter().any(|s| self.memory(*s) > 0.0) {
            window.len()
        } else {
            facts.margin()
        }
    }

    /// The window with core rows that begin where the past of the first one does, whatever the window is part of.
    fn with_past<'a>(&self, window: &Window<'a>, facts: &LogFacts, sensor: Sensor) -> Option<Window<'a>> {
        let longest = self.memory(sensor);
        let first = *window.t.get(window.begin)?;
        if longest == 0.0 {
            return None;
        }
        let begins = |memory: f64| {
            // Whole multiples as the effect itself counts them, and a row more rather than one less.
            let stretches = ((first - facts.t_start) / memory).floor() - 1.0 - 1e-6;
            facts.t_start + stretches * memory
        };
        let memories = self.slots.iter().filter(|s| s.effect.sensors().contains(&sensor));
        let earliest = memories
            .map(|s| s.effect.memory())
            .filter(|m| *m > 0.0)
            .map(|m| if m.is_finite() { begins(m) } else { f64::NEG_INFINITY })
            .fold(first, f64::min);
        let begin = window.t[..window.begin].partition_point(|t| *t < earliest);
        Some(window.with_core(begin, window.end))
    }

    /// Residual and columns over the core rows of a window.
    pub fn evaluate(&self, whole: &Window, facts: &LogFacts) -> Result<Evaluation, EffectError> {
        // What looks back no further than the margin gets no more, whoever else is asked beside it.
        let near = whole.part(whole.begin, whole.end, self.margin(whole, facts).min(facts.margin()));
        let window = &near;
        let change = self.reference_change(facts);
        let ideal = Ideal::new(window, facts, &change);
        let core = window.begin..window.end;
        let temperature = held_temperature(window, facts);
        let covariates = held_covariates(window);
        let position: Vec<Vector3<f64>> = window.position.map_or_else(Vec::new, |p| {
            // A reference in rows of its own has none in those of the readings.
            let axes: [Vec<f64>; 3] = std::array::from_fn(|axis| p.iter().skip(axis).step_by(3).copied().collect());
            let at = |i: usize| Vector3::from_fn(|axis, _| held(&axes[axis], i));
            core.clone().map(at).collect()
        });
        let vibration = window.reading(Sensor::Acc).map(|_| vibration::power(window, facts.dt));
        // Readings are modelled from the quantities as they are; columns of silent axes would be noise.
        let [acc, gyr, mag] = facts.silent_axes;
        let seen_of = |ideal: &Ideal| {
            facts.silent_axes.iter().any(|s| s.contains(&true)).then(|| Ideal {
                omega: ideal.omega.without(gyr),
                alpha: ideal.alpha.without(gyr),
                alpha_rate: ideal.alpha_rate.without(gyr),
                snap: ideal.snap.without(acc),
                f: ideal.f.without(acc),
                m: ideal.m.without(mag),
                ..ideal.clone()
            })
        };
        let seen = seen_of(&ideal);
        let mut channels: Vec<Option<ChannelColumns>> = vec![None; CHANNELS];
        for sensor in Sensor::ALL {
            let Some(reading) = window.reading(sensor) else {
                continue;
            };
            let own = Ideal::of_sensor(window, facts, &change, sensor);
            let own_seen = own.as_ref().and_then(seen_of);
            let ideal = own.as_ref().unwrap_or(&ideal);
            let seen_ideal = if own.is_some() {
                own_seen.as_ref()
            } else {
                seen.as_ref()
            }
            .unwrap_or(ideal);
            let mut rows = Rows {
                facts,
                t: &window.t[core.clone()],
                ideal: seen_ideal,
                force: &seen_ideal.f,
                x: &ideal.f,
                temperature: temperature.as_deref(),
                vibration: vibration.as_deref(),
                covariates: &covariates,
                position: &position,
                history: 0,
            };
            let force = if sensor == Sensor::Acc {
                None
            } else {
                self.force(&rows)?
            };
            if let Some(force) = &force {
                rows.force = force;
            }
            let mut past = self
                .with_past(whole, facts, sensor)
                .map(|long| Past::new(&long, facts, &change, sensor, whole.begin - long.begin));
            let past = past.as_mut().map(|p| p.rows(facts, sensor, &seen_of));
            let reading_of = ideal.quantity(sensor);
            let secants = self.secants(window, facts, sensor);
            let (modelled, columns) = self.predict(
                rows,
                past.as_ref(),
                reading_of.clone(),
                ideal.detail(sensor),
                &secants,
                sensor,
            )?;
            for (axis, columns) in columns.into_iter().enumerate() {
                let residual = core
                    .clone()
                    .zip(modelled.axis(axis))
                    .map(|(i, value)| reading[3 * i + axis] - value)
                    .collect();
                channels[3 * sensor.index() + axis] = Some(ChannelColumns { columns, residual });
            }
        }
        Ok(Evaluation {
            ideal,
            channels,
            covariates,
            temperature,
        })
    }

    /// For each candidate that is tried at full size, and whose value lies in the ideal readings, what these change by per unit of the
    /// size tried.
    fn secants(&self, window: &Window, facts: &LogFacts, sensor: Sensor) -> Vec<Option<Triple>> {
        let change = self.reference_change(facts);
        let reading = |change: &ReferenceChange| Ideal::smooth_reading(window, facts, change, sensor);
        let now: LazyCell<Triple, _> = LazyCell::new(|| reading(&change));
        let of = |slot: &Slot| {
            let effect = &slot.effect;
            let size = slot.parameters[0];
            let asked = !slot.in_model && effect.tried_at_full_size() && slot.in_ideal(facts);
            if !asked || size == 0.0 || !effect.sensors().contains(&sensor) {
                return None;
            }
            let mut secant = reading(&change.and(effect.reference_change(&slot.parameters)));
            secant.add(&now, -1.0);
            secant.scale(1.0 / size);
            Some(secant.without(facts.silent_axes[sensor.index()]))
        };
        self.slots.iter().map(of).collect()
    }

    /// Residual of each channel over the core rows of a window after a step of all parameters.
    pub fn residuals(
        &self,
        window: &Window,
        facts: &LogFacts,
        step: &[f64],
    ) -> Result<Vec<Option<Vec<f64>>>, EffectError> {
        let evaluation = self.evaluate(window, facts)?;
        Ok(evaluation
            .channels
            .into_iter()
            .zip(&self.on_axes)
            .map(|(channel, active)| channel.map(|c| c.residual_after(active, step)))
            .collect())
    }

    /// Specific force at the sensing elements; `None` where the model adds nothing to the ideal one.
    fn force(&self, rows: &Rows) -> Result<Option<Triple>, EffectError> {
        let mut columns = Columns::default();
        let mut force: Option<Triple> = None;
        for slot in self.slots.iter().filter(|s| s.in_model) {
            let effect = &slot.effect;
            // What lies in the past of the accelerometer is not at hand for other sensors.
            if effect.card().stage == Stage::Input && effect.sensors().contains(&Sensor::Acc) && effect.memory() == 0.0
            {
                columns.reset(rows.len(), slot.parameters.len());
                slot.columns(rows, Sensor::Acc, &mut columns)?;
                slot.add_to(rows, Sensor::Acc, &columns, &mut force, &rows.ideal.f)?;
            }
        }
        Ok(force)
    }

    /// Modelled readings of one sensor and the columns of its three channels, stage after stage. Columns are made of the smooth
    /// quantity; `detail` joins it before readings are rounded and cut off. A candidate with a secant has this for its column.
    fn predict(
        &self,
        rows: Rows,
        past: Option<&Rows>,
        mut x: Triple,
        detail: Option<&Triple>,
        secants: &[Option<Triple>],
        sensor: Sensor,
    ) -> Result<(Triple, AxisColumns), EffectError> {
        let n = rows.len();
        let silent = rows.facts.silent_axes[sensor.index()];
        let mut out: AxisColumns =
            std::array::from_fn(|axis| vec![Vec::new(); self.on_axes[3 * sensor.index() + axis].len()]);
        let mut columns = Columns::default();
        for stage in [
            Stage::Reference,
            Stage::Time,
            Stage::Input,
            Stage::Gain,
            Stage::Offset,
            Stage::Rounding,
            Stage::Range,
        ] {
            if let (Stage::Rounding, Some(detail)) = (stage, detail) {
                x.add(detail, 1.0);
            }
            let mut after: Option<Triple> = None;
            let seen = silent.contains(&true).then(|| x.without(silent));
            for (slot, secant) in self.slots.iter().zip(secants) {
                if slot.effect.card().stage != stage || !slot.effect.sensors().contains(&sensor) {
                    continue;
                }
                columns.reset(n, slot.parameters.len());
                let rows = match past.filter(|_| slot.effect.memory() > 0.0) {
                    Some(past) => *past,
                    None => Rows {
                        x: seen.as_ref().unwrap_or(&x),
                        ..rows
                    },
                };
                slot.columns(&rows, sensor, &mut columns)?;
                if let Some(secant) = secant {
                    // Where the smooth motion is not known, the slope has to do.
                    for axis in 0..3 {
                        let known = columns.column(0, axis).iter_mut().zip(secant.axis(axis));
                        known.filter(|(_, v)| v.is_finite()).for_each(|(own, v)| *own = *v);
                    }
                }
                // The value of a reference effect is in the ideal readings already.
                if slot.in_model && !slot.in_ideal(rows.facts) {
                    slot.add_to(&rows, sensor, &columns, &mut after, &x)?;
                }
                for axis in 0..3 {
                    let list = &self.on_axes[3 * sensor.index() + axis];
                    let from = list.partition_point(|p| *p < slot.first);
                    for (k, p) in list
                        .iter()
                        .enumerate()
                        .skip(from)
                        .take_while(|(_, p)| **p < slot.first + slot.parameters.len())
                    {
                        out[axis][k] = columns
                            .get(p - slot.first, axis)
                            .map_or_else(|| vec![0.0; n], <[f64]>::to_vec);
                    }
                }
            }
            if let Some(after) = after {
                if stage == Stage::Range {
                    still_where_cut_off(&mut out, &x, &after);
                }
                x = after;
            }
        }
        Ok((x, out))
    }
}
