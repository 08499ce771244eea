//! A channel's zero line, fitted to each cut along with the force and taken out of the residual (variable projection, Golub
//! & Pereyra 1973): a straight line, the transient of a warming amplifier, what a leaking one loses.

use crate::effects::cutting::CutPhysics;
use crate::identify::forces::cutting_data::{CutData, ForceChannel};

/// A column that the others explain up to this share of its length is left out.
const COLLINEAR: f64 = 1e-7;

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// A channel's zero line: an orthonormal basis of what it may be, in weighted levels.
pub(crate) struct BaselineDrift {
    basis: Vec<Vec<f64>>,
    pub(crate) weight: Vec<f64>,
    /// Weighted recorded level.
    recorded: Vec<f64>,
    /// Loss of a leaking amplifier, weighted, per unit of its rate; empty without.
    loss: Vec<f64>,
    rate: f64,
    rate_gradient: Vec<f64>,
    /// Transient: derivative of its weighted column by τ, the gradient of τ, and 1/length of its orthogonal rest.
    transient: Option<(Vec<f64>, Vec<f64>, f64)>,
}

impl BaselineDrift {
    pub(crate) fn new(
        cut: &CutData,
        physics: &CutPhysics,
        channel: &ForceChannel,
        index: usize,
    ) -> BaselineDrift {
        let weight: Vec<f64> = channel.level_std.iter().map(|s| 1.0 / s).collect();
        let time: Vec<f64> = cut.block_s.iter().map(|b| 0.5 * (b[0] + b[1])).collect();
        let weighted = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
            weight.iter().enumerate().map(|(b, w)| w * f(b)).collect()
        };
        let mut line = BaselineDrift {
            basis: Vec::new(),
            recorded: weighted(&|b| channel.level[b]),
            loss: Vec::new(),
            rate: 0.0,
            rate_gradient: Vec::new(),
            transient: None,
            weight: weight.clone(),
        };
        line.add_column(weighted(&|_| 1.0));
        line.add_column(weighted(&|b| time[b]));
        if let Some(rates) = &physics.leak_per_s {
            // What leaks of a straight zero line is a parabola.
            line.add_column(weighted(&|b| time[b] * time[b]));
            line.loss = weighted(&|b| channel.integral[b]);
            line.rate = rates[index].value;
            line.rate_gradient.clone_from(&rates[index].gradient);
        }
        if let Some(taus) = &physics.transient_s {
            let tau = &taus[index];
            let start = time.first().copied().unwrap_or(0.0);
            let since = |b: usize| (time[b] - start) / tau.value;
            if let Some(rest) = line.add_column(weighted(&|b| (-since(b)).exp())) {
                let slope = weighted(&|b| (-since(b)).exp() * since(b) / tau.value);
                line.transient = Some((slope, tau.gradient.clone(), 1.0 / rest));
            }
        }
        line
    }

    /// Length of what is new in the column; `None` where there is nothing new.
    fn add_column(&mut self, mut column: Vec<f64>) -> Option<f64> {
        let before = dot(&column, &column).sqrt();
        for _ in 0..2 {
            self.project(&mut column);
        }
        let rest = dot(&column, &column).sqrt();
        if !(rest > COLLINEAR * before) {
            return None;
        }
        column.iter_mut().for_each(|v| *v /= rest);
        self.basis.push(column);
        Some(rest)
    }

    /// Takes out of a weighted vector what the zero line can be.
    pub(crate) fn project(&self, vector: &mut [f64]) {
        for q in &self.basis {
            let share = dot(q, vector);
            for (v, q) in vector.iter_mut().zip(q) {
                *v -= share * q;
            }
        }
    }

    /// Weighted model − recorded for force levels `level`, zero line fitted.
    pub(crate) fn residual(&self, level: &[f64]) -> Vec<f64> {
        let mut residual = self.raw(level);
        self.project(&mut residual);
        residual
    }

    fn raw(&self, level: &[f64]) -> Vec<f64> {
        let mut raw: Vec<f64> = level
            .iter()
            .zip(&self.weight)
            .zip(&self.recorded)
            .map(|((l, w), r)| l * w - r)
            .collect();
        for (v, loss) in raw.iter_mut().zip(&self.loss) {
            *v -= self.rate * loss;
        }
        raw
    }

    /// Derivatives of the residual by the parameters; `slope(p)`: those of the force levels.
    pub(crate) fn slopes<'a>(
        &self,
        level: &[f64],
        count: usize,
        slope: impl Fn(usize) -> std::borrow::Cow<'a, [f64]>,
    ) -> Vec<Vec<f64>> {
        // Amplitude of the transient: its orthogonal rest is the last of the basis.
        let transient =
            self.transient
                .as_ref()
                .zip(self.basis.last())
                .map(|((column, gradient, per_length), q)| {
                    let raw = self.raw(level);
                    (column, gradient, -dot(q, &raw) * per_length)
                });
        (0..count)
            .map(|p| {
                let mut own: Vec<f64> = slope(p).iter().zip(&self.weight).map(|(s, w)| s * w).collect();
                let rate = self.rate_gradient.get(p).copied().unwrap_or(0.0);
                for (v, loss) in own.iter_mut().zip(&self.loss) {
                    *v -= rate * loss;
                }
                if let Some((column, gradient, amplitude)) = &transient {
                    let g = gradient.get(p).copied().unwrap_or(0.0) * amplitude;
                    for (v, c) in own.iter_mut().zip(*column) {
                        *v += g * c;
                    }
                }
                self.project(&mut own);
                own
            })
            .collect()
    }

    /// The straight line through the blocks of air alone, in the channel's unit: what a model without drift effects says the
    /// zero is. Fitted along with the force, a line hides part of what the force model lacks. `None` where a drift effect
    /// is in the model, whose size takes all levels to tell, or where a side has no air.
    pub(crate) fn through_air(&self, cut: &CutData, is_air: impl Fn(usize) -> bool) -> Option<Vec<f64>> {
        if self.transient.is_some() || !self.loss.is_empty() {
            return None;
        }
        let middle = |b: usize| 0.5 * (cut.block_s[b][0] + cut.block_s[b][1]);
        let air: Vec<usize> = (0..cut.block_s.len()).filter(|b| is_air(*b)).collect();
        let sides = [
            air.iter().any(|b| *b < cut.steady.start),
            air.iter().any(|b| *b >= cut.steady.end),
        ];
        if air.len() < 4 || sides != [true, true] {
            return None;
        }
        let (offset, slope, at) = crate::signal::line(
            air.iter().map(|b| middle(*b)),
            air.iter().map(|b| self.recorded[*b] / self.weight[*b]),
        );
        Some(
            (0..cut.block_s.len())
                .map(|b| offset + slope * (middle(b) - at))
                .collect(),
        )
    }

    /// Fitted zero line by block, in the channel's unit.
    pub(crate) fn zero(&self, level: &[f64]) -> Vec<f64> {
        let raw = self.raw(level);
        let mut rest = raw.clone();
        self.project(&mut rest);
        raw.iter()
            .zip(&rest)
            .zip(&self.weight)
            .enumerate()
            .map(|(b, ((raw, rest), w))| {
                let lost = self.loss.get(b).map_or(0.0, |l| self.rate * l);
                (rest - raw - lost) / w
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Process;
    use crate::identify::forces::made_cuts::{METAL, changed, in_the_cut, middle_s, turned, zero};
    use crate::robot::Dual;
    use approx::assert_relative_eq;

    const FORCE: f64 = 200.0;

    fn physics() -> CutPhysics {
        CutPhysics::of(vec![Dual::constant(0.0); 6])
    }

    /// A cut of 200 N on the x channel, whose zero is bent by `bend`; later blocks are less certain than earlier ones.
    fn cut(bend: impl Fn(usize) -> f64) -> CutData {
        let data = changed(&turned(METAL, &[0.1]), |cut| {
            let x = cut.channels[0].as_mut().unwrap();
            x.level = level()
                .iter()
                .enumerate()
                .map(|(b, l)| l + zero(b) + bend(b))
                .collect();
            x.level_std = (0..x.level.len()).map(|b| 0.5 + 0.1 * b as f64).collect();
            x.integral = (0..x.level.len()).map(lost).collect();
        });
        assert_eq!(data.process, Process::Turning);
        (*data.cuts[0]).clone()
    }

    fn level() -> Vec<f64> {
        (0..14).map(|b| if in_the_cut(b) { FORCE } else { 0.0 }).collect()
    }

    /// ∫ F dt of the 200 N up to the middle of a block, N·s.
    fn lost(block: usize) -> f64 {
        let cut_from = middle_s(4) - 0.05;
        FORCE * (middle_s(block) - cut_from).clamp(0.0, 0.6)
    }

    fn drift(cut: &CutData, physics: &CutPhysics) -> BaselineDrift {
        BaselineDrift::new(cut, physics, cut.channels[0].as_ref().unwrap(), 0)
    }

    fn largest(values: &[f64]) -> f64 {
        values.iter().fold(0.0, |m, v| m.max(v.abs()))
    }

    #[test]
    fn a_zero_that_drifts_evenly_leaves_nothing_and_is_told() {
        let cut = cut(|_| 0.0);
        let line = drift(&cut, &physics());
        assert!(largest(&line.residual(&level())) < 1e-9);
        for (b, told) in line.zero(&level()).iter().enumerate() {
            assert_relative_eq!(*told, zero(b), max_relative = 1e-9);
        }
        // A force that is 1 N too large leaves what no line explains, in standard deviations.
        let more: Vec<f64> = level()
            .iter()
            .map(|l| if *l > 0.0 { l + 1.0 } else { 0.0 })
            .collect();
        let rest = line.residual(&more);
        assert!(dot(&rest, &rest) > 1.0, "{rest:?}");
        let by_line: Vec<f64> = (0..14).map(|b| middle_s(b) * line.weight[b]).collect();
        assert_relative_eq!(dot(&rest, &by_line), 0.0, epsilon = 1e-9);
    }

    /// A charge amplifier of time constant τ = 8 s loses ∫ F dt / τ.
    #[test]
    fn what_a_leak_takes_of_the_force_is_told_with_the_zero() {
        let rate = 1.0 / 8.0;
        let cut = cut(|b| -rate * lost(b));
        let mut leaky = physics();
        leaky.leak_per_s = Some([(); 4].map(|()| Dual::constant(rate)));
        let line = drift(&cut, &leaky);
        assert!(largest(&line.residual(&level())) < 1e-9);
        for (b, told) in line.zero(&level()).iter().enumerate() {
            assert_relative_eq!(*told, zero(b) - rate * lost(b), max_relative = 1e-9);
        }
        // The straight line alone leaves it.
        let straight = drift(&cut, &physics());
        assert!(largest(&straight.residual(&level())) > 0.5);
        assert!(line.through_air(&cut, |b| !in_the_cut(b)).is_none());
    }

    #[test]
    fn a_transient_of_any_size_leaves_nothing() {
        let tau = 0.4;
        let mut warming = physics();
        warming.transient_s = Some([(); 4].map(|()| Dual::constant(tau)));
        for size in [-30.0, 7.0] {
            let cut = cut(|b| size * (-middle_s(b) / tau).exp());
            let line = drift(&cut, &warming);
            assert!(largest(&line.residual(&level())) < 1e-9);
            let ends = line.zero(&level());
            assert_relative_eq!(
                ends[0],
                zero(0) + size * (0.65f64 / tau).exp(),
                max_relative = 1e-9
            );
        }
    }

    /// Slopes by time constants and leak rates: times the residual they are the slope of half its square, where a zero line and a
    /// transient are fitted anew at every step.
    #[test]
    fn slopes_are_those_of_the_misfit() {
        let cut = cut(|b| 3.0 * (middle_s(b) * 4.0).sin() - 0.05 * lost(b));
        let half_square = |tau: f64, rate: f64, force: f64| {
            let line = drift(&cut, &with(tau, rate));
            let rest = line.residual(&level().iter().map(|l| l * force).collect::<Vec<f64>>());
            0.5 * dot(&rest, &rest)
        };
        let (tau, rate, force) = (0.5, 0.03, 1.02);
        let here = drift(&cut, &with(tau, rate));
        let scaled: Vec<f64> = level().iter().map(|l| l * force).collect();
        let by_parameter = [vec![0.0; 14], vec![0.0; 14], level()];
        let slopes = here.slopes(&scaled, 3, |p| by_parameter[p].as_slice().into());
        let rest = here.residual(&scaled);
        let h = 1e-5;
        let differences = [
            half_square(tau + h, rate, force) - half_square(tau - h, rate, force),
            half_square(tau, rate + h, force) - half_square(tau, rate - h, force),
            half_square(tau, rate, force + h) - half_square(tau, rate, force - h),
        ];
        for (slope, difference) in slopes.iter().zip(differences) {
            assert_relative_eq!(dot(slope, &rest), difference / (2.0 * h), max_relative = 1e-5);
        }
    }

    /// The parameters: time constant of a transient, rate of a leak, size of the force.
    fn with(tau: f64, rate: f64) -> CutPhysics {
        let mut physics = physics();
        physics.transient_s = Some([(); 4].map(|()| Dual::variable(tau, 0, 3)));
        physics.leak_per_s = Some([(); 4].map(|()| Dual::variable(rate, 1, 3)));
        physics
    }

    /// A force model is judged above the line through the air, which no force bends.
    #[test]
    fn the_line_through_the_air_does_not_see_the_cut() {
        let cut = cut(|b| if in_the_cut(b) { 50.0 } else { 0.0 });
        let line = drift(&cut, &physics());
        let through = line.through_air(&cut, |b| !in_the_cut(b)).unwrap();
        for (b, told) in through.iter().enumerate() {
            assert_relative_eq!(*told, zero(b), max_relative = 1e-9);
        }
        // Air on one side, or three blocks of it, are too little for a line.
        assert!(line.through_air(&cut, |b| b < 4).is_none());
        assert!(line.through_air(&cut, |b| b > 9).is_none());
        assert!(line.through_air(&cut, |b| [0, 1, 13].contains(&b)).is_none());
        assert!(line.through_air(&cut, |b| [0, 1, 12, 13].contains(&b)).is_some());
    }
}
