//! Misfit of the cutting model to force records. What belongs to one cut alone is fitted to that cut at every evaluation
//! and does not stand among the parameters: the phase of the tool (drilling: the moment of first contact), and each
//! channel's zero line with the amplitude of its transient (variable projection, Golub & Pereyra 1973).

use std::f64::consts::{SQRT_2, TAU};

use nalgebra::DVector;
use num_complex::Complex64;
use rayon::prelude::*;
use realfft::RealFftPlanner;

use crate::effects::cutting::CutPhysics;
use crate::identify::forces::baseline_drift::{BaselineDrift, dot};
use crate::identify::forces::cutting_data::{CutData, CutKind, CuttingData, ForceChannel};
use crate::identify::forces::cutting_forces::{
    Forces, LineAmplitudes, drilling_forces, milling_forces, turning_forces,
};
use crate::identify::forces::cutting_model::CuttingModel;
use crate::identify::levenberg_marquardt::{LeastSquares, Linearisation};
use crate::{Result, stop};

/// A limit cycle's amplitude repeats this well (standard deviation of its logarithm).
const VIBRATION_LOG_STD: f64 = 0.25;
/// Standard deviation of the logarithm of its frequency from cut to cut.
const FREQUENCY_LOG_STD: f64 = 0.05;

/// Misfit of a model to the records plus the priors on its parameters.
pub struct CuttingProblem<'a> {
    /// The model.
    pub model: &'a CuttingModel,
    /// The records that it is fitted to.
    pub data: &'a CuttingData,
}

/// The model in one cut after what belongs to the cut alone is fitted.
#[derive(Debug, Clone)]
pub struct CutFit {
    /// Phase, rad (milling), or first contact, s from the middle of the record (drilling); 0 (turning).
    pub placement: f64,
    /// Σ r² of the cut.
    pub chi2: f64,
    /// Recorded x, y, z, torque; `None` where the cut has no such channel.
    pub channels: [Option<ChannelFit>; 4],
}

/// The model on one recorded channel.
#[derive(Debug, Clone)]
pub struct ChannelFit {
    /// Orders 1..=K at the cut's phase, N.
    pub orders: Vec<Complex64>,
    /// Force by block, N (N·m).
    pub level: Vec<f64>,
    /// Zero line by block fitted along with the force, what a leak takes away included.
    pub zero: Vec<f64>,
    /// Zero line to judge the force model by: through the air alone where that can be said, else `zero`.
    pub reference: Vec<f64>,
}

/// Sums over residuals.
struct Sums {
    /// Of the Hessian the lower triangle.
    at: Linearisation,
    /// Of the placement with itself and with each parameter.
    placement: f64,
    coupling: DVector<f64>,
}

impl Sums {
    fn zero(count: usize) -> Self {
        Sums {
            at: Linearisation::zero(count),
            placement: 0.0,
            coupling: DVector::zeros(count),
        }
    }

    /// Adds residuals with their derivatives (one row a parameter) and that by the placement.
    fn push(&mut self, residual: &[f64], slopes: &[Vec<f64>], placement: &[f64]) {
        self.at.cost += 0.5 * dot(residual, residual);
        if slopes.is_empty() {
            return;
        }
        self.placement += dot(placement, placement);
        for (i, a) in slopes.iter().enumerate() {
            self.at.gradient[i] += dot(a, residual);
            self.coupling[i] += dot(a, placement);
            for (j, b) in slopes.iter().enumerate().take(i + 1) {
                self.at.hessian[(i, j)] += dot(a, b);
            }
        }
    }

    /// Takes the placement out: it is at its optimum, so only the curvature changes (Schur complement).
    fn eliminate_placement(&mut self) {
        if self.placement > 0.0 {
            let n = self.at.gradient.len();
            for i in 0..n {
                for j in 0..=i {
                    self.at.hessian[(i, j)] -= self.coupling[i] * self.coupling[j] / self.placement;
                }
            }
        }
    }
}

impl CuttingProblem<'_> {
    /// The model in every cut.
    pub fn fits(&self, theta: &[f64]) -> Result<Vec<CutFit>> {
        self.data
            .cuts
            .par_iter()
            .map(|cut| Ok(self.evaluate(cut, theta, false)?.1))
            .collect()
    }

    fn evaluate(&self, cut: &CutData, theta: &[f64], derivatives: bool) -> Result<(Sums, CutFit)> {
        stop::point();
        let count = if derivatives { theta.len() } else { 0 };
        let physics = self.model.physics(theta, cut, derivatives);
        let lines: [Option<BaselineDrift>; 4] = std::array::from_fn(|i| {
            cut.channels[i]
                .as_ref()
                .map(|channel| BaselineDrift::new(cut, &physics, channel, i))
        });
        let mut sums = Sums::zero(count);
        let (forces, lines_off_comb, placement) = match &cut.kind {
            CutKind::Milling { cut: milling, unit } => {
                let (forces, lines) =
                    milling_forces(&physics, cut, milling, unit, &self.data.dyno_from_tool, count);
                // Teeth that are alike leave multiples of their number; which of them is which shows in the others alone.
                let differ =
                    physics.runout.is_some() || physics.own_teeth.is_some() || !milling.places.is_empty();
                let step = if differ { 1 } else { milling.teeth };
                let phase = best_phase(cut, &forces, step);
                (forces, lines, phase)
            }
            CutKind::Drilling {
                cut: drill,
                contact_s,
            } => {
                let at = |contact: f64| drilling_forces(&physics, cut, drill, contact, 0);
                let contact = best_contact(&lines, *contact_s, at);
                (
                    drilling_forces(&physics, cut, drill, contact, count),
                    None,
                    contact,
                )
            }
            CutKind::Turning { edge } => (
                turning_forces(&physics, edge, &self.data.dyno_from_tool, count),
                None,
                0.0,
            ),
        };
        let mut fit = CutFit {
            placement,
            chi2: 0.0,
            channels: [None, None, None, None],
        };
        let is_air = |b: usize| match cut.kind {
            CutKind::Milling { .. } | CutKind::Turning { .. } => !cut.steady.contains(&b),
            CutKind::Drilling { .. } => cut.block_s[b][1] < placement || b >= cut.steady.end,
        };
        for (i, (channel, line)) in cut.channels.iter().zip(&lines).enumerate() {
            let (Some(channel), Some(line)) = (channel, line) else {
                continue;
            };
            let orders = push_orders(&mut sums, channel, &forces, i, placement, count);
            let level = levels(cut, &forces.value[i]);
            let residual = line.residual(&level);
            let slopes = line.slopes(&level, count, |p| levels(cut, &forces.slope[p][i]));
            let by_placement = match cut.kind {
                CutKind::Drilling { .. } if derivatives => {
                    let slope = || std::borrow::Cow::Borrowed(forces.contact_slope[i].as_slice());
                    let mut own: Vec<f64> = slope().iter().zip(&line.weight).map(|(s, w)| s * w).collect();
                    line.project(&mut own);
                    own
                }
                _ => vec![0.0; residual.len()],
            };
            sums.push(&residual, &slopes, &by_placement);
            if physics.transient_s.is_some() {
                // A free amplitude fits noise too: it costs what a parameter costs in BIC, over the levels it is fitted to.
                sums.at.cost += 0.5 * (level.len().max(1) as f64).ln();
            }
            fit.channels[i] = Some(ChannelFit {
                orders,
                reference: line.through_air(cut, is_air).unwrap_or_else(|| line.zero(&level)),
                zero: line.zero(&level),
                level: level.into_owned(),
            });
        }
        push_vibration(&mut sums, cut, &physics, lines_off_comb.as_ref(), count);
        fit.chi2 = 2.0 * sums.at.cost;
        if derivatives {
            sums.eliminate_placement();
        }
        Ok((sums, fit))
    }

    /// Each cut's part of the misfit, without priors; what belongs to the cut alone is taken out.
    pub fn by_cut(&self, theta: &[f64]) -> Result<Vec<Linearisation>> {
        self.data
            .cuts
            .par_iter()
            .map(|cut| {
                let mut at = self.evaluate(cut, theta, true)?.0.at;
                at.hessian.fill_upper_triangle_with_lower_triangle();
                Ok(at)
            })
            .collect()
    }

    fn total(&self, theta: &[f64], derivatives: bool) -> Result<Linearisation> {
        let parts: Vec<Sums> = self
            .data
            .cuts
            .par_iter()
            .map(|cut| Ok(self.evaluate(cut, theta, derivatives)?.0))
            .collect::<Result<_>>()?;
        let mut total = Linearisation::zero(if derivatives { theta.len() } else { 0 });
        for part in &parts {
            total.add(&part.at);
        }
        for (i, (parameter, t)) in self.model.parameters.iter().zip(theta).enumerate() {
            if let Some(prior) = parameter.prior {
                total.add_half_square(i, prior.half_square(*t));
            }
        }
        total.hessian.fill_upper_triangle_with_lower_triangle();
        Ok(total)
    }
}

impl LeastSquares for CuttingProblem<'_> {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        Ok(self.total(theta, false)?.cost)
    }

    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        self.total(theta, true)
    }
}

/// Lines off the comb: logarithms of their amplitudes against the model's, noise included on both sides.
fn push_vibration(
    sums: &mut Sums,
    cut: &CutData,
    physics: &CutPhysics,
    model: Option<&LineAmplitudes>,
    count: usize,
) {
    let Some(seen) = &cut.vibration else { return };
    let mut push = |residual: f64, slope: &dyn Fn(usize) -> f64| {
        let slopes: Vec<Vec<f64>> = (0..count).map(|p| vec![slope(p)]).collect();
        sums.push(&[residual], &slopes, &[0.0]);
    };
    if let Some(vibration) = &physics.vibration {
        let f = &vibration.frequency_hz;
        push((f.value / seen.frequency_hz).ln() / FREQUENCY_LOG_STD, &|p| {
            f.derivative(p) / f.value / FREQUENCY_LOG_STD
        });
    }
    for line in &seen.lines {
        for (channel, amplitude, noise) in &line.channels {
            let predicted = model.map(|m| {
                &m[(line.shift + crate::identify::forces::asynchronous_lines::MOST_SHIFT) as usize][*channel]
            });
            let value = predicted.map_or(0.0, |p| p.value);
            let square = value * value + noise * noise;
            let seen = amplitude.max(1e-3 * noise).max(f64::MIN_POSITIVE);
            let square = square.max(f64::MIN_POSITIVE);
            let residual = (0.5 * square.ln() - seen.ln()) / VIBRATION_LOG_STD;
            push(residual, &|p| {
                predicted.map_or(0.0, |d| value * d.derivative(p) / square / VIBRATION_LOG_STD)
            });
        }
    }
}

/// Force level of each block: the mean over a turn (milling, turning) during the cut, or as it stands (drilling).
fn levels<'a>(cut: &CutData, forces: &'a [f64]) -> std::borrow::Cow<'a, [f64]> {
    match cut.kind {
        CutKind::Drilling { .. } => forces.into(),
        CutKind::Milling { .. } | CutKind::Turning { .. } => {
            let mean = forces.first().copied().unwrap_or(0.0);
            (0..cut.block_s.len())
                .map(|b| if cut.steady.contains(&b) { mean } else { 0.0 })
                .collect::<Vec<f64>>()
                .into()
        }
    }
}

/// Adds the orders of a channel; gives the model's orders at the phase.
fn push_orders(
    sums: &mut Sums,
    channel: &ForceChannel,
    forces: &Forces,
    index: usize,
    phase: f64,
    count: usize,
) -> Vec<Complex64> {
    let orders = channel.orders.len();
    if orders == 0 {
        return Vec::new();
    }
    let turn: Vec<Complex64> = (1..=orders)
        .map(|n| Complex64::from_polar(1.0, -(n as f64) * phase))
        .collect();
    let at = |set: &[Vec<f64>; 4], n: usize| {
        Complex64::new(set[index][2 * n + 1], set[index][2 * n + 2]) * turn[n]
    };
    let model: Vec<Complex64> = (0..orders).map(|n| at(&forces.value, n)).collect();
    // Real and imaginary part have half the variance each.
    let weighted = |value: &dyn Fn(usize) -> Complex64| -> Vec<f64> {
        let mut flat = Vec::with_capacity(2 * orders);
        for n in 0..orders {
            let v = value(n) * (SQRT_2 / channel.order_std[n]);
            flat.extend([v.re, v.im]);
        }
        flat
    };
    let residual = weighted(&|n| model[n] - channel.orders[n]);
    let slopes: Vec<Vec<f64>> = (0..count)
        .map(|p| weighted(&|n| at(&forces.slope[p], n)))
        .collect();
    let by_phase = if count > 0 {
        weighted(&|n| model[n] * Complex64::new(0.0, -((n + 1) as f64)))
    } else {
        Vec::new()
    };
    sums.push(&residual, &slopes, &by_phase);
    model
}

/// Phase at which model and record agree best; the model has orders at multiples of `step` only.
fn best_phase(cut: &CutData, forces: &Forces, step: usize) -> f64 {
    let most = cut.orders / step;
    // Σ |C e^{−inx} − D|²/σ² is least where Re Σ C* D/σ² e^{inx} is largest.
    let mut product = vec![Complex64::ZERO; most];
    for (i, channel) in cut.channels.iter().enumerate() {
        let Some(channel) = channel else { continue };
        for (k, p) in product.iter_mut().enumerate() {
            let n = (k + 1) * step;
            let Some(recorded) = channel.orders.get(n - 1) else {
                continue;
            };
            let model = Complex64::new(forces.value[i][2 * n - 1], forces.value[i][2 * n]);
            *p += model.conj() * recorded / channel.order_std[n - 1].powi(2);
        }
    }
    // In units of the step's period; the whole grid by one transform.
    let grid = 6 * most.max(8);
    let spacing = TAU / grid as f64;
    let transform = RealFftPlanner::<f64>::new().plan_fft_inverse(grid);
    let (mut spectrum, mut agreement) = (transform.make_input_vec(), transform.make_output_vec());
    spectrum[1..=most].copy_from_slice(&product);
    let best = match transform.process(&mut spectrum, &mut agreement) {
        Ok(()) => argmax(&agreement),
        Err(_) => 0,
    };
    let mut x = best as f64 * spacing;
    for _ in 0..20 {
        let (mut first, mut second) = (0.0, 0.0);
        for (k, p) in product.iter().enumerate() {
            let n = (k + 1) as f64;
            let turned = p * Complex64::from_polar(1.0, n * x);
            first -= n * turned.im;
            second -= n * n * turned.re;
        }
        let move_by = if second < 0.0 {
            -first / second
        } else {
            spacing * first.signum() * 0.25
        };
        let move_by = move_by.clamp(-0.5 * spacing, 0.5 * spacing);
        x += move_by;
        if move_by.abs() < 1e-13 {
            break;
        }
    }
    x / step as f64
}

/// Where the largest value stands, the first of several.
fn argmax(values: &[f64]) -> usize {
    let larger = |best: usize, i: usize| if values[i] > values[best] { i } else { best };
    (1..values.len()).fold(0, larger)
}

/// First contact at which model and record agree best, within `range` (s).
fn best_contact(lines: &[Option<BaselineDrift>; 4], range: [f64; 2], forces: impl Fn(f64) -> Forces) -> f64 {
    // Cost, its slope and its Gauss–Newton curvature.
    let at = |contact: f64| {
        let f = forces(contact);
        let (mut cost, mut slope, mut curvature) = (0.0, 0.0, 0.0);
        for (i, line) in lines.iter().enumerate() {
            let Some(line) = line else { continue };
            let residual = line.residual(&f.value[i]);
            let mut by: Vec<f64> = f.contact_slope[i]
                .iter()
                .zip(&line.weight)
                .map(|(s, w)| s * w)
                .collect();
            line.project(&mut by);
            cost += 0.5 * dot(&residual, &residual);
            slope += dot(&residual, &by);
            curvature += dot(&by, &by);
        }
        (cost, slope, curvature)
    };
    const GRID: usize = 12;
    let spacing = (range[1] - range[0]).max(1e-6) / GRID as f64;
    let mut best = (f64::INFINITY, range[0]);
    for k in 0..=GRID {
        let contact = range[0] + k as f64 * spacing;
        let cost = at(contact).0;
        if cost < best.0 {
            best = (cost, contact);
        }
    }
    let (mut low, mut high) = (best.1 - spacing, best.1 + spacing);
    let mut x = best.1;
    for _ in 0..60 {
        let (_, slope, curvature) = at(x);
        if slope > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let newton = x - slope / curvature.max(f64::MIN_POSITIVE);
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        let moved = (next - x).abs();
        x = next;
        if moved < 1e-10 {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Registry;
    use crate::identify::forces::asynchronous_lines::{AsynchronousLines, VibrationLine};
    use crate::identify::forces::made_cuts::{
        CONTACT_S, METAL, MILLED, changed, drilled, milled, turned, zero,
    };
    use approx::assert_relative_eq;

    const HOLES: [f64; 4] = [900.0, 30.0, 700.0, 45.0];

    /// The baseline at the coefficients that the cuts were made with.
    fn at_truth(data: &CuttingData, truth: &[f64]) -> (CuttingModel, Vec<f64>) {
        (CuttingModel::new(data, true).unwrap(), truth.to_vec())
    }

    /// Teeth added up in time and the closed form of their orders: the same waveform at the angle that the tool stood at.
    #[test]
    fn milled_waveforms_are_those_of_the_teeth_and_tell_the_tools_angle() {
        let data = milled(METAL, &MILLED);
        let (model, theta) = at_truth(&data, &METAL);
        let fits = CuttingProblem {
            model: &model,
            data: &data,
        }
        .fits(&theta)
        .unwrap();
        for ((cut, fit), way) in data.cuts.iter().zip(&fits).zip(MILLED) {
            // Two teeth: the same after half a turn.
            let off = (fit.placement - way[4]) / (0.5 * TAU);
            assert!((off - off.round()).abs() < 1e-3, "{off}");
            for (channel, fit) in cut.channels.iter().flatten().zip(fit.channels.iter().flatten()) {
                for (recorded, model) in channel.orders.iter().zip(&fit.orders) {
                    assert!((recorded - model).norm() < 0.2, "{recorded} {model} N");
                }
            }
            // Some hundred values of 1 N error: what is left is the sum over slices.
            assert!(fit.chi2 < 2.0, "{}", fit.chi2);
        }
    }

    /// A force a hundredth too large stands at its share of the force over the noise; real and imaginary parts have half of it each.
    #[test]
    fn the_misfit_of_an_order_counts_twice_its_power_over_its_noise() {
        let data = milled(METAL, &MILLED[..1]);
        let (model, theta) = at_truth(&data, &METAL);
        let larger: Vec<f64> = theta.iter().map(|t| 1.01 * t).collect();
        let fit = &CuttingProblem {
            model: &model,
            data: &data,
        }
        .fits(&larger)
        .unwrap()[0];
        let channels = || data.cuts[0].channels.iter().flatten();
        let orders: f64 = channels()
            .flat_map(|c| &c.orders)
            .map(|c| 2.0 * c.norm_sqr())
            .sum();
        // Six of fourteen blocks hold the force; a line through all takes away its mean: 6 · 8 / 14 is left of the square.
        let levels: f64 = channels()
            .map(|c| (c.level[5] - zero(5)).powi(2) * 48.0 / 14.0)
            .sum();
        assert_relative_eq!(fit.chi2, 1e-4 * (orders + levels), max_relative = 0.05);
    }

    #[test]
    fn the_first_contact_of_a_drill_is_found() {
        let data = drilled(HOLES, &[[0.2, 0.0], [0.3, 3.0]]);
        let (model, theta) = at_truth(&data, &HOLES);
        let problem = CuttingProblem {
            model: &model,
            data: &data,
        };
        for fit in problem.fits(&theta).unwrap() {
            assert_relative_eq!(fit.placement, CONTACT_S, epsilon = 1e-6);
            assert!(fit.chi2 < 1e-6);
            assert_relative_eq!(
                fit.channels[2].as_ref().unwrap().reference[0],
                zero(0),
                max_relative = 1e-6
            );
        }
    }

    /// Without noise the misfit is a parabola about the truth, whose curvature is the slope of its slope: the angle of the tool and
    /// the moment of contact follow the parameters, so that what they could explain is out of it.
    #[test]
    fn the_curvature_is_what_the_placement_leaves() {
        let cases = [
            (turned(METAL, &[0.1, 0.2]), METAL.to_vec()),
            (milled(METAL, &MILLED[1..]), METAL.to_vec()),
            (drilled(HOLES, &[[0.2, 0.0], [0.3, 3.0]]), HOLES.to_vec()),
        ];
        for (data, truth) in cases {
            let (model, theta) = at_truth(&data, &truth);
            let problem = CuttingProblem {
                model: &model,
                data: &data,
            };
            let hessian = problem.linearise(&theta).unwrap().hessian;
            for p in 0..theta.len() {
                let h = 1e-4 * theta[p];
                let slope = |sign: f64| {
                    let mut moved = theta.clone();
                    moved[p] += sign * h;
                    problem.linearise(&moved).unwrap().gradient
                };
                let difference = (slope(1.0) - slope(-1.0)) / (2.0 * h);
                for q in 0..theta.len() {
                    let size = (hessian[(p, p)] * hessian[(q, q)]).sqrt();
                    let off = (hessian[(p, q)] - difference[q]).abs() / size;
                    assert!(
                        off < 2e-3,
                        "{:?} {p} {q}: {} {}",
                        data.process,
                        hessian[(p, q)],
                        difference[q]
                    );
                }
            }
        }
    }

    /// Every effect on cutting forces, where nothing is special about the parameters.
    #[test]
    fn gradients_of_all_effects_are_the_slopes_of_the_misfit() {
        let sets = [
            turned(METAL, &[0.1, 0.3]),
            milled(METAL, &MILLED[1..2]),
            drilled(HOLES, &[[0.2, 0.0], [0.3, 3.0]]),
        ];
        for data in sets {
            let base = CuttingModel::new(&data, true).unwrap();
            for instance in Registry::cutting().instances(&()) {
                let data = match instance.label().as_str() {
                    "chatter" if data.process == crate::data::Process::Milling => vibrating(&data),
                    "chatter" => continue,
                    _ => data.clone(),
                };
                let model = base.with_effect(instance, &base.known(&data));
                let mut theta = model.nominal_theta();
                for (i, t) in theta.iter_mut().enumerate() {
                    *t += 0.02 * t.abs().max(0.02) * (1.0 + 0.3 * i as f64);
                }
                let problem = CuttingProblem {
                    model: &model,
                    data: &data,
                };
                let here = problem.linearise(&theta).unwrap();
                for (i, parameter) in model.parameters.iter().enumerate() {
                    let h = 1e-6 * theta[i].abs().max(1e-2);
                    let at = |sign: f64| {
                        let mut moved = theta.clone();
                        moved[i] += sign * h;
                        problem.cost(&moved).unwrap()
                    };
                    let difference = (at(1.0) - at(-1.0)) / (2.0 * h);
                    let scale = here.gradient[i]
                        .abs()
                        .max(difference.abs())
                        .max(1e-9 * here.cost / h);
                    assert!(
                        (here.gradient[i] - difference).abs() < 5e-3 * scale.max(1e-9),
                        "{:?} {} {}: {} {difference}",
                        data.process,
                        instance.label(),
                        parameter.name,
                        here.gradient[i]
                    );
                }
            }
        }
    }

    /// Lines at 431 Hz and two tooth passings to either side, N.
    fn vibrating(data: &CuttingData) -> CuttingData {
        let mut data = changed(data, |cut| {
            let lines = (-2..=2).map(|shift: i64| VibrationLine {
                shift,
                channels: (0..3)
                    .map(|c| (c, 20.0 / (1.0 + shift.abs() as f64), 0.5))
                    .collect(),
            });
            cut.vibration = Some(AsynchronousLines {
                frequency_hz: 431.0,
                lines: lines.collect(),
            });
            cut.setting.has_vibration = true;
        });
        data.summary.vibration_hz = Some(431.0);
        data
    }

    /// A limit cycle repeats to a quarter: lines that no model explains stand e times above their noise at four standard deviations.
    #[test]
    fn lines_without_a_model_count_by_their_height_above_the_noise() {
        let plain = milled(METAL, &MILLED[..1]);
        let seen = changed(&plain, |cut| {
            cut.vibration = Some(AsynchronousLines {
                frequency_hz: 431.0,
                lines: vec![VibrationLine {
                    shift: 1,
                    channels: vec![(0, 0.5 * std::f64::consts::E, 0.5), (1, 0.5, 0.5)],
                }],
            });
        });
        let (model, theta) = at_truth(&plain, &METAL);
        let chi2 = |data: &CuttingData| CuttingProblem { model: &model, data }.fits(&theta).unwrap()[0].chi2;
        assert_relative_eq!(chi2(&seen) - chi2(&plain), 16.0, max_relative = 1e-6);
        // Two values of amplitude and one of frequency more.
        assert_eq!(seen.value_count(), plain.value_count() + 3);
    }
}
