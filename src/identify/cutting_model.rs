//! The cutting force model as a function of its parameters.

use std::ops::Range;

use num_complex::Complex64;

use super::cutting_data::{CutData, CutKind, CuttingData};
use super::off_comb::MOST_SHIFT;
use crate::campaign::Process;
use crate::cutting::waveform::{ChipLaw, DrillTerm, DrillingCut, LineForces, MillingCut, UnitForces};
use crate::cutting::{ForceAxis, coefficients_of};
use crate::effects::cutting::{CutPhysics, CuttingInstance, Mixing};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::Dual;
use crate::{Error, Result};

/// Coefficients of one material and what may be tuned.
#[derive(Debug, Clone)]
pub struct CuttingModel {
    pub process: Process,
    /// Those of the baseline (milling Ktc Krc Kac Kte Kre Kae, drilling Ktc Kte Kfc Kfe; without the edge coefficients
    /// where the baseline has none), then those of each added effect.
    pub parameters: Vec<Parameter>,
    /// Whether edge coefficients are part of the baseline.
    pub has_edge: bool,
    effects: Vec<AddedCuttingEffect>,
}

/// An effect in the model and where its parameters stand in the list.
#[derive(Debug, Clone)]
pub struct AddedCuttingEffect {
    pub instance: CuttingInstance,
    pub parameters: Range<usize>,
}

/// A coefficient's prior is this many times wider than the largest coefficient: it only keeps the fit finite where the
/// data say nothing.
const PRIOR_WIDTH: f64 = 3.0;
/// Edge coefficients are some hundredths of a millimetre times the cutting coefficients.
const EDGE_MM: f64 = 0.05;

impl CuttingModel {
    /// The baseline for `data`, its nominal values from the mean forces.
    pub fn new(data: &CuttingData, has_edge: bool) -> Result<Self> {
        let kinds = coefficients_of(data.process);
        let start = mean_force_coefficients(data, has_edge)?;
        let scale = start.iter().fold(100.0f64, |m, v| m.max(v.abs()));
        let parameters = kinds
            .iter()
            .zip(&start)
            .filter(|(kind, _)| has_edge || !kind.edge)
            .map(|(kind, nominal)| {
                let size = if kind.edge { EDGE_MM * scale } else { scale };
                Parameter {
                    name: kind.key.into(),
                    unit: kind.unit,
                    scale: Scale::Linear,
                    nominal: *nominal,
                    prior: Some(Prior {
                        mean: *nominal,
                        std: PRIOR_WIDTH * size,
                    }),
                    bounds: [nominal - 1e3 * size, nominal + 1e3 * size],
                }
            })
            .collect();
        Ok(CuttingModel {
            process: data.process,
            parameters,
            has_edge,
            effects: Vec::new(),
        })
    }

    /// What effects are asked with: the data's summary with the scale of this model's coefficients.
    pub fn summary(&self, data: &CuttingData) -> crate::effects::cutting::CuttingSummary {
        let own = self.parameters.iter().take(coefficients_of(self.process).len());
        let scale = own.filter(|p| p.unit == "N/mm²").fold(1.0f64, |m, p| m.max(p.nominal.abs()));
        crate::effects::cutting::CuttingSummary {
            has_edge: self.has_edge,
            cutting_scale_n_per_mm2: scale,
            ..data.summary.clone()
        }
    }

    /// The same model with one more effect; its parameters come last.
    pub fn with_effect(&self, instance: CuttingInstance, data: &CuttingData) -> Self {
        let mut model = self.clone();
        let first = model.parameters.len();
        for mut parameter in instance.effect.parameters(instance.variant, &self.summary(data)) {
            parameter.name = format!("{}.{}", instance.label(), parameter.name);
            model.parameters.push(parameter);
        }
        model.effects.push(AddedCuttingEffect {
            instance,
            parameters: first..model.parameters.len(),
        });
        model
    }

    pub fn effects(&self) -> &[AddedCuttingEffect] {
        &self.effects
    }

    /// Nominal values on the solver's scale.
    pub fn nominal_theta(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.internal(p.nominal)).collect()
    }

    pub fn bounds(&self) -> Vec<[f64; 2]> {
        self.parameters.iter().map(Parameter::internal_bounds).collect()
    }

    /// Free amplitudes fitted to each cut and channel beyond a straight zero line.
    pub fn nuisances_per_channel(&self) -> usize {
        self.effects.iter().map(|e| e.instance.effect.nuisances_per_channel(e.instance.variant)).sum()
    }

    fn value(&self, theta: &[f64], i: usize, derivatives: bool) -> Dual {
        let natural = self.parameters[i].natural(theta[i]);
        if !derivatives {
            return Dual::constant(natural);
        }
        let variable = Dual::variable(theta[i], i, theta.len());
        match self.parameters[i].scale {
            Scale::Logarithmic => variable.chain(natural, natural),
            Scale::Linear => variable,
        }
    }

    /// What this cut's forces are made with, all effects applied.
    pub fn physics(&self, theta: &[f64], cut: &CutData, derivatives: bool) -> CutPhysics {
        let mut next = 0;
        let coefficient = coefficients_of(self.process)
            .iter()
            .map(|kind| {
                if kind.edge && !self.has_edge {
                    return Dual::constant(0.0);
                }
                next += 1;
                self.value(theta, next - 1, derivatives)
            })
            .collect();
        let mut physics = CutPhysics {
            coefficient,
            size_exponent: None,
            runout: None,
            chisel_thrust_n: None,
            margin_n_per_mm: None,
            tilt: None,
            dynamics: None,
            crosstalk: None,
            transient_s: None,
            leak_per_s: None,
            vibration: None,
        };
        let mut order: Vec<&AddedCuttingEffect> = self.effects.iter().collect();
        order.sort_by_key(|added| added.instance.effect.order());
        for added in order {
            let values: Vec<Dual> =
                added.parameters.clone().map(|i| self.value(theta, i, derivatives)).collect();
            let CuttingInstance { effect, variant } = added.instance;
            effect.apply(variant, &values, &cut.setting, &mut physics);
        }
        physics
    }
}

/// Forces on the recorded channels with their derivatives. Milling: `[mean, re 1, im 1, re 2, …]` over the orders of
/// rotation, at phase zero. Drilling: mean of each block.
#[derive(Debug, Clone)]
pub struct Forces {
    pub value: [Vec<f64>; 4],
    /// One a parameter; empty where no derivatives were asked for.
    pub slope: Vec<[Vec<f64>; 4]>,
    /// By the time of first contact (drilling), per s.
    pub contact_slope: [Vec<f64>; 4],
}

impl Forces {
    fn zero(length: usize, parameters: usize) -> Forces {
        let channels = || std::array::from_fn(|_| vec![0.0; length]);
        Forces {
            value: channels(),
            slope: (0..parameters).map(|_| channels()).collect(),
            contact_slope: channels(),
        }
    }

    fn length(&self) -> usize {
        self.value[0].len()
    }

    /// Adds `weight` times what `unit` gives for a channel and an index.
    fn add(&mut self, channel: usize, weight: &Dual, unit: &[f64]) {
        add_scaled(&mut self.value[channel], weight.value, unit);
        for (slope, g) in self.slope.iter_mut().zip(&weight.gradient) {
            add_scaled(&mut slope[channel], *g, unit);
        }
    }

    /// x, y, z become mixtures of each other.
    fn mix(&mut self, mixing: &Mixing) {
        let length = self.length();
        let before: [Vec<f64>; 3] = std::array::from_fn(|i| self.value[i].clone());
        let turned = |set: &[Vec<f64>]| -> [Vec<f64>; 3] {
            std::array::from_fn(|i| {
                let mut sum = vec![0.0; length];
                for (j, part) in set.iter().take(3).enumerate() {
                    add_scaled(&mut sum, mixing[i][j].value, part);
                }
                sum
            })
        };
        let put = |set: &mut [Vec<f64>; 4], new: [Vec<f64>; 3]| {
            for (old, new) in set.iter_mut().zip(new) {
                *old = new;
            }
        };
        for (p, slope) in self.slope.iter_mut().enumerate() {
            let mut new = turned(slope);
            for (i, row) in mixing.iter().enumerate() {
                for (weight, part) in row.iter().zip(&before) {
                    add_scaled(&mut new[i], weight.derivative(p), part);
                }
            }
            put(slope, new);
        }
        let new = turned(&self.value);
        put(&mut self.value, new);
    }

    /// Second-order dynamics G = 1 / (1 − r² + 2iζr), r = f/f₀, on the orders of each channel.
    fn filter(&mut self, dynamics: &[[Dual; 2]; 3], spindle_hz: f64) {
        for (channel, [frequency, damping]) in dynamics.iter().enumerate() {
            for n in 1..=(self.length() - 1) / 2 {
                let r = n as f64 * spindle_hz / frequency.value;
                let g = Complex64::from(1.0) / Complex64::new(1.0 - r * r, 2.0 * damping.value * r);
                // dG = −G² d(1 − r² + 2iζr), dr = −r df₀/f₀
                let by_frequency = g * g * Complex64::new(-2.0 * r, 2.0 * damping.value) * (r / frequency.value);
                let by_damping = -g * g * Complex64::new(0.0, 2.0 * r);
                let (re, im) = (2 * n - 1, 2 * n);
                let at = |set: &[Vec<f64>; 4]| Complex64::new(set[channel][re], set[channel][im]);
                let before = at(&self.value);
                for (p, slope) in self.slope.iter_mut().enumerate() {
                    let own = by_frequency * frequency.derivative(p) + by_damping * damping.derivative(p);
                    let new = g * at(slope) + own * before;
                    (slope[channel][re], slope[channel][im]) = (new.re, new.im);
                }
                let new = g * before;
                (self.value[channel][re], self.value[channel][im]) = (new.re, new.im);
            }
        }
    }
}

fn add_scaled(sum: &mut [f64], weight: f64, part: &[f64]) {
    if weight != 0.0 {
        for (s, p) in sum.iter_mut().zip(part) {
            *s += weight * p;
        }
    }
}

/// `[mean, re 1, im 1, …]` of the recorded channels for one unit force law, A⁻¹ applied.
fn recorded(unit: &[Vec<Complex64>; 3], dyno_from_tool: &[[f64; 3]; 3]) -> [Vec<f64>; 3] {
    std::array::from_fn(|i| {
        let count = unit[0].len();
        let mut flat = vec![0.0; 2 * count - 1];
        for (axis, orders) in unit.iter().enumerate() {
            let a = dyno_from_tool[i][axis];
            if a == 0.0 {
                continue;
            }
            flat[0] += a * orders[0].re;
            for (n, c) in orders.iter().enumerate().skip(1) {
                flat[2 * n - 1] += a * c.re;
                flat[2 * n] += a * c.im;
            }
        }
        flat
    })
}

/// Amplitude (N) that a vibration puts on each recorded channel at the lines shifted by −2..2 tooth-passing frequencies.
pub(super) type LineAmplitudes = Vec<[Dual; 3]>;

/// Forces of a milling cut on the recorded channels, phase zero, up to and with crosstalk; and the lines of a vibration
/// where the cut has one. (Runout is left out of a vibrating cut.)
pub(super) fn milling_forces(
    physics: &CutPhysics,
    cut: &CutData,
    milling: &MillingCut,
    unit: &UnitForces,
    dyno_from_tool: &[[f64; 3]; 3],
    parameters: usize,
) -> (Forces, Option<LineAmplitudes>) {
    let mut forces = Forces::zero(2 * cut.orders + 1, parameters);
    let mut lines = None;
    let add_units = |forces: &mut Forces, unit: &UnitForces| {
        for (k, unit) in unit.iter().enumerate() {
            for (channel, part) in recorded(unit, dyno_from_tool).iter().enumerate() {
                forces.add(channel, &physics.coefficient[k], part);
            }
        }
    };
    // By something that the unit forces depend on: only a slope, the value does not change with the derivative.
    let add_slopes = |forces: &mut Forces, slope: &UnitForces, by: &Dual| {
        for (k, unit) in slope.iter().enumerate() {
            let weight = Dual {
                value: 0.0,
                gradient: by.gradient.iter().map(|g| g * physics.coefficient[k].value).collect(),
            };
            for (channel, part) in recorded(unit, dyno_from_tool).iter().enumerate() {
                forces.add(channel, &weight, part);
            }
        }
    };
    if let Some(change) = chip_change(physics, cut, milling) {
        let exponent = physics.size_exponent.as_ref().map(|p| p.value);
        let vibrating =
            milling.vibrating(cut.orders, exponent, [change[0].value, change[1].value], MOST_SHIFT as usize);
        add_units(&mut forces, &vibrating.unit);
        if parameters > 0 {
            let own = [physics.size_exponent.as_ref(), Some(&change[0]), Some(&change[1])];
            for (slope, by) in vibrating.slopes.iter().zip(own) {
                if let Some(by) = by {
                    add_slopes(&mut forces, slope, by);
                }
            }
        }
        lines = Some(
            (0..vibrating.lines.len())
                .map(|r| {
                    let slopes = [&vibrating.line_slopes[0][r], &vibrating.line_slopes[1][r]];
                    line_amplitudes(physics, &vibrating.lines[r], slopes, &change, dyno_from_tool)
                })
                .collect(),
        );
    } else if physics.size_exponent.is_none() && physics.runout.is_none() {
        add_units(&mut forces, unit);
    } else {
        let law = ChipLaw {
            exponent: physics.size_exponent.as_ref().map(|p| p.value),
            runout: physics.runout.as_ref().map(|r| [r.offset_mm.value, r.angle_rad.value]),
        };
        let sampled = milling.sampled(cut.orders, law, parameters > 0);
        add_units(&mut forces, &sampled.unit);
        let own = [
            physics.size_exponent.as_ref(),
            physics.runout.as_ref().map(|r| &r.offset_mm),
            physics.runout.as_ref().map(|r| &r.angle_rad),
        ];
        for (slope, by) in sampled.slopes.iter().zip(own) {
            if let (Some(slope), Some(by)) = (slope, by) {
                add_slopes(&mut forces, slope, by);
            }
        }
    }
    if let Some(tilt) = &physics.tilt {
        forces.mix(tilt);
    }
    if let Some(dynamics) = &physics.dynamics {
        forces.filter(dynamics, cut.spindle_hz());
    }
    if let Some(crosstalk) = &physics.crosstalk {
        forces.mix(crosstalk);
    }
    (forces, lines)
}

/// Thrust and torque of each block with the first contact at `contact_s`.
pub(super) fn drilling_forces(
    physics: &CutPhysics,
    cut: &CutData,
    drill: &DrillingCut,
    contact_s: f64,
    parameters: usize,
) -> Forces {
    let mut forces = Forces::zero(cut.block_s.len(), parameters);
    let h = Dual::constant(drill.geometry.chip_thickness_mm());
    let h = match &physics.size_exponent {
        // h (h / reference)^−p
        Some(p) => {
            let log = (h.value / ChipLaw::REFERENCE_MM).ln();
            p.scale(-log).exp().scale(h.value)
        }
        None => h,
    };
    let k = &physics.coefficient;
    let (thrust, torque) = (ForceAxis::Z.index(), ForceAxis::Mz.index());
    let mut terms = vec![
        (torque, DrillTerm::Torque, &(&k[0] * &h) + &k[1]),
        (thrust, DrillTerm::Thrust, &(&k[2] * &h) + &k[3]),
    ];
    if let Some(chisel) = physics.chisel_thrust_n.as_ref().filter(|_| drill.full_hole) {
        terms.push((thrust, DrillTerm::Chisel, chisel.clone()));
    }
    if let Some(margin) = &physics.margin_n_per_mm {
        terms.push((torque, DrillTerm::Margin, margin.clone()));
    }
    for (channel, term, weight) in terms {
        // Air after the cut has no force.
        let cutting = |b: usize| b < cut.steady.end;
        let (unit, by_contact): (Vec<f64>, Vec<f64>) = cut
            .block_s
            .iter()
            .enumerate()
            .map(|(b, [from, to])| if cutting(b) { drill.mean(term, *from, *to, contact_s) } else { (0.0, 0.0) })
            .unzip();
        forces.add(channel, &weight, &unit);
        add_scaled(&mut forces.contact_slope[channel], weight.value, &by_contact);
    }
    forces
}

/// Change of the chip's boundary from one tooth to the next in a vibrating cut, along x and y, mm: d (1 − e^{−iωT}).
fn chip_change(physics: &CutPhysics, cut: &CutData, milling: &MillingCut) -> Option<[Dual; 2]> {
    let vibration = physics.vibration.as_ref()?;
    let tooth_hz = cut.spindle_hz() * milling.teeth as f64;
    let seen = cut.vibration.as_ref().map_or(vibration.frequency_hz.value, |v| v.frequency_hz);
    let regeneration = 2.0 * (std::f64::consts::PI * seen / tooth_hz).sin().abs();
    let angle = &vibration.direction_rad;
    let (s, c) = angle.value.sin_cos();
    let amplitude = vibration.amplitude_mm.scale(regeneration);
    Some([&amplitude * &angle.chain(c, -s), &amplitude * &angle.chain(s, c)])
}

/// Amplitudes of one line on the recorded x, y, z. `slopes`: of the unit forces by the change of the chip along x and y.
fn line_amplitudes(
    physics: &CutPhysics,
    line: &LineForces,
    slopes: [&LineForces; 2],
    change: &[Dual; 2],
    dyno_from_tool: &[[f64; 3]; 3],
) -> [Dual; 3] {
    let seen = |forces: &LineForces, k: usize, channel: usize| -> Complex64 {
        (0..3).map(|axis| forces[k][axis] * dyno_from_tool[channel][axis]).sum()
    };
    std::array::from_fn(|channel| {
        // Real and imaginary part, with derivatives by the coefficients and by the change of the chip.
        let mut parts = [Dual::constant(0.0), Dual::constant(0.0)];
        for (k, coefficient) in physics.coefficient.iter().enumerate() {
            let mut terms = vec![(coefficient.clone(), seen(line, k, channel))];
            for (slope, by) in slopes.iter().zip(change) {
                let weight = Dual {
                    value: 0.0,
                    gradient: by.gradient.iter().map(|g| g * coefficient.value).collect(),
                };
                terms.push((weight, seen(slope, k, channel)));
            }
            for (weight, unit) in terms {
                parts[0] = &parts[0] + &weight.scale(unit.re);
                parts[1] = &parts[1] + &weight.scale(unit.im);
            }
        }
        let square = &(&parts[0] * &parts[0]) + &(&parts[1] * &parts[1]);
        if square.value > 0.0 { square.sqrt() } else { Dual::constant(0.0) }
    })
}

/// Coefficients that the mean steady forces suggest, zero lines through the air; pulled towards an edge coefficient of
/// 0.02 mm times the cutting coefficient where the data do not tell the two apart.
fn mean_force_coefficients(data: &CuttingData, has_edge: bool) -> Result<Vec<f64>> {
    use nalgebra::{DMatrix, DVector};
    let kinds = coefficients_of(data.process);
    let n = kinds.len();
    let (mut rows, mut values) = (Vec::<Vec<f64>>::new(), Vec::new());
    for cut in &data.cuts {
        let means = steady_means(cut);
        let units: Vec<[f64; 4]> = match &cut.kind {
            CutKind::Milling { unit, .. } => (0..n)
                .map(|k| {
                    let mut all = [0.0; 4];
                    for (i, row) in data.dyno_from_tool.iter().enumerate() {
                        all[i] = (0..3).map(|axis| row[axis] * unit[k][axis][0].re).sum();
                    }
                    all
                })
                .collect(),
            CutKind::Drilling { cut: drill, .. } => {
                let full = drill.geometry.entry_travel_mm() * 1.0000001;
                let (thrust, torque) = (drill.at(DrillTerm::Thrust, full), drill.at(DrillTerm::Torque, full));
                let h = drill.geometry.chip_thickness_mm();
                vec![
                    [0.0, 0.0, 0.0, torque * h],
                    [0.0, 0.0, 0.0, torque],
                    [0.0, 0.0, thrust * h, 0.0],
                    [0.0, 0.0, thrust, 0.0],
                ]
            }
        };
        for channel in 0..4 {
            if let Some(mean) = means[channel] {
                let row: Vec<f64> = units.iter().map(|u| u[channel]).collect();
                // Forces and torque of very different size count alike.
                let size = row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                if size > 0.0 {
                    rows.push(row.iter().map(|v| v / size).collect());
                    values.push(mean / size);
                }
            }
        }
    }
    // Columns scaled to the size a coefficient has; a faint pull to the usual ratio of edge to cutting coefficient.
    let unit = |k: usize| if kinds[k].edge { EDGE_MM } else { 1.0 };
    let partner = |edge: usize| if data.process == Process::Milling { edge - 3 } else { edge - 1 };
    let matrix = DMatrix::from_fn(rows.len(), n, |i, k| {
        if kinds[k].edge && !has_edge { 0.0 } else { rows[i][k] * unit(k) }
    });
    let mut normal = matrix.transpose() * &matrix;
    let scale = normal.diagonal().max().max(f64::MIN_POSITIVE);
    for k in 0..n {
        if kinds[k].edge {
            let (c, pull) = (partner(k), 1e-6 * scale);
            let ratio = 0.02 / EDGE_MM;
            normal[(k, k)] += pull;
            normal[(c, c)] += pull * ratio * ratio;
            normal[(k, c)] -= pull * ratio;
            normal[(c, k)] -= pull * ratio;
        }
        normal[(k, k)] += 1e-12 * scale;
    }
    let right = matrix.transpose() * DVector::from_vec(values);
    let solution = normal
        .cholesky()
        .ok_or_else(|| Error::computation("the mean forces determine no coefficients"))?
        .solve(&right);
    Ok((0..n).map(|k| if kinds[k].edge && !has_edge { 0.0 } else { solution[k] * unit(k) }).collect())
}

/// Mean of the steady blocks above the line through the air, by channel; without air the blocks as they are.
fn steady_means(cut: &CutData) -> [Option<f64>; 4] {
    let middle = |b: usize| 0.5 * (cut.block_s[b][0] + cut.block_s[b][1]);
    let first = cut.block_s.len().min(cut.steady.start);
    let entering = match &cut.kind {
        // Blocks between air and steady cut: all that begin after the earliest contact may hold force.
        CutKind::Drilling { cut: drill, .. } => {
            let start = cut.block_s.get(cut.steady.start).map_or(0.0, |b| b[0]) - 1.2 * drill.entry_s() - 0.2;
            (0..first).take_while(|b| cut.block_s[*b][1] < start).count()
        }
        CutKind::Milling { .. } => first,
    };
    let air: Vec<usize> = (0..entering).chain(cut.steady.end..cut.block_s.len()).collect();
    std::array::from_fn(|i| {
        let level = &cut.channels[i].as_ref()?.level;
        let (offset, slope, at) =
            crate::signal::line(air.iter().map(|b| middle(*b)), air.iter().map(|b| level[*b]));
        let n = cut.steady.len().max(1) as f64;
        Some(cut.steady.clone().map(|b| level[b] - offset - slope * (middle(b) - at)).sum::<f64>() / n)
    })
}
