//! The steady waveform, averaged over tool revolutions, as sums of squares of model against record, in tool axes.

use num_complex::Complex64;

use crate::cutting::ForceAxis;
use crate::data::Process;
use crate::identify::forces::cutting_data::{CutData, CuttingData, ForceChannel};
use crate::identify::forces::cutting_problem::{ChannelFit, CutFit};

/// Mean squares over the waveform, N²; torques as [`CuttingData::force_per_torque`] times themselves.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WaveSums {
    /// Of model − record.
    pub error: f64,
    /// Of the record's noise.
    pub noise: f64,
    /// Of the record.
    pub signal: f64,
}

/// One tool axis of one cut.
#[derive(Debug, Clone)]
pub struct AxisWaves {
    /// Which tool axis.
    pub axis: ForceAxis,
    /// `[0]`: the level; then the orders of rotation (milling). They add up to the whole waveform.
    pub orders: Vec<WaveSums>,
    /// Σ |20 log10(|model| / |measured|)| over the orders that stand above the noise, and their number.
    pub decibel: (f64, usize),
}

/// An order this many times above its noise (power) has a magnitude worth comparing in dB.
const ABOVE_NOISE: f64 = 25.0;

/// The tool axes that the recorded channels of a cut determine.
pub fn axis_waves(data: &CuttingData, cut: &CutData, fit: &CutFit) -> Vec<AxisWaves> {
    ForceAxis::ALL
        .into_iter()
        .filter_map(|axis| one_axis(data, cut, fit, axis))
        .collect()
}

/// Recorded channel, the model on it, and its weight in the tool axis.
type Part<'a> = (&'a ForceChannel, &'a ChannelFit, f64);

/// The recorded channels that make up a tool axis; `None` where one is missing. Torques count `force_per_torque` times.
fn parts<'a>(
    data: &CuttingData,
    cut: &'a CutData,
    fit: &'a CutFit,
    axis: ForceAxis,
    force_per_torque: f64,
) -> Option<Vec<Part<'a>>> {
    let i = axis.index();
    let weights: Vec<(usize, f64)> = if axis == ForceAxis::Mz {
        vec![(i, force_per_torque)]
    } else {
        let row = data.tool_from_dyno[i];
        let largest = row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        (0..3)
            .filter(|j| row[*j].abs() > 1e-9 * largest)
            .map(|j| (j, row[j]))
            .collect()
    };
    weights
        .iter()
        .map(|(j, a)| Some((cut.channels[*j].as_ref()?, fit.channels[*j].as_ref()?, *a)))
        .collect()
}

fn one_axis(data: &CuttingData, cut: &CutData, fit: &CutFit, axis: ForceAxis) -> Option<AxisWaves> {
    // Force and torque in one sum: each relative to its own size.
    let parts = parts(data, cut, fit, axis, data.force_per_torque)?;
    let orders = parts.first()?.1.orders.len();
    let mut waves = AxisWaves {
        axis,
        orders: vec![level(data.process, cut, &parts)],
        decibel: (0.0, 0),
    };
    for n in 0..orders {
        let model: Complex64 = parts.iter().map(|(_, f, a)| f.orders[n] * *a).sum();
        let measured: Complex64 = parts.iter().map(|(c, _, a)| c.orders[n] * *a).sum();
        let noise: f64 = parts.iter().map(|(c, _, a)| (a * c.order_std[n]).powi(2)).sum();
        // A waveform's mean square is that of its mean plus twice those of its orders.
        waves.orders.push(WaveSums {
            error: 2.0 * (model - measured).norm_sqr(),
            noise: 2.0 * noise,
            signal: 2.0 * measured.norm_sqr(),
        });
        if measured.norm_sqr() > ABOVE_NOISE * noise && model.norm() > 0.0 {
            waves.decibel.0 += (20.0 * (model.norm() / measured.norm()).log10()).abs();
            waves.decibel.1 += 1;
        }
    }
    Some(waves)
}

/// The steady level: its mean (milling, where the rest is in the orders) or its course over the hole or the turned length, block by
/// block, as the misfit has it (of one turned cut every mean is fitted to the last digit).
fn level(process: Process, cut: &CutData, parts: &[Part]) -> WaveSums {
    let n = cut.steady.len().max(1) as f64;
    let (mut error, mut signal, mut noise) = (Vec::new(), Vec::new(), 0.0);
    for b in cut.steady.clone() {
        error.push(
            parts
                .iter()
                .map(|(c, f, a)| a * (f.level[b] + f.reference[b] - c.level[b]))
                .sum::<f64>(),
        );
        signal.push(
            parts
                .iter()
                .map(|(c, f, a)| a * (c.level[b] - f.reference[b]))
                .sum::<f64>(),
        );
        noise += parts
            .iter()
            .map(|(c, _, a)| (a * c.level_std[b]).powi(2))
            .sum::<f64>()
            / n;
    }
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let square = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>() / n;
    match process {
        Process::Milling => WaveSums {
            error: mean(&error).powi(2),
            signal: mean(&signal).powi(2),
            noise: noise / n,
        },
        Process::Drilling | Process::Turning => WaveSums {
            error: square(&error),
            signal: square(&signal),
            noise,
        },
    }
}

/// The course of one tool axis in one cut, measured and modelled, both above the zero line.
#[derive(Debug, Clone)]
pub struct Course {
    /// Which tool axis.
    pub axis: ForceAxis,
    /// Milling: rotation of the tool from its position at phase 0, degrees; drilling and turning: time from the first block, s.
    pub x: Vec<f64>,
    /// N (N·m), as long as `x`; NaN where a stretch of the hole (the tip breaking through) is left out of the fit.
    pub measured: Vec<f64>,
    /// N (N·m), as long as `x`.
    pub model: Vec<f64>,
}

/// Points drawn over a revolution.
const POINTS_PER_TURN: usize = 360;

/// The mean revolution (milling) or the course over time (drilling, turning) of every tool axis that the recorded channels
/// determine.
pub fn courses(data: &CuttingData, cut: &CutData, fit: &CutFit) -> Vec<Course> {
    ForceAxis::ALL
        .into_iter()
        .filter_map(|axis| {
            let parts = parts(data, cut, fit, axis, 1.0)?;
            Some(match data.process {
                Process::Milling => revolution(axis, cut, &parts),
                Process::Drilling | Process::Turning => over_time(axis, cut, &parts),
            })
        })
        .collect()
}

fn revolution(axis: ForceAxis, cut: &CutData, parts: &[Part]) -> Course {
    let steady = cut.steady.clone();
    let n = steady.len().max(1) as f64;
    let mean = |value: &dyn Fn(&Part, usize) -> f64| -> f64 {
        let sum = |part: &Part| steady.clone().map(|b| value(part, b)).sum::<f64>() / n;
        parts.iter().map(|part| part.2 * sum(part)).sum()
    };
    let orders = parts.first().map_or(0, |p| p.1.orders.len());
    let turn = |level: f64, order: &dyn Fn(&Part, usize) -> Complex64| -> Vec<f64> {
        let sums: Vec<Complex64> = (0..orders)
            .map(|k| parts.iter().map(|part| order(part, k) * part.2).sum())
            .collect();
        (0..POINTS_PER_TURN)
            .map(|i| {
                let angle = std::f64::consts::TAU * i as f64 / POINTS_PER_TURN as f64;
                let waves = sums.iter().enumerate();
                level
                    + waves
                        .map(|(k, c)| 2.0 * (c * Complex64::from_polar(1.0, (k + 1) as f64 * angle)).re)
                        .sum::<f64>()
            })
            .collect()
    };
    Course {
        axis,
        x: (0..POINTS_PER_TURN)
            .map(|i| 360.0 * i as f64 / POINTS_PER_TURN as f64)
            .collect(),
        measured: turn(
            mean(&|(channel, fit, _), b| channel.level[b] - fit.reference[b]),
            &|(channel, ..), k| channel.orders[k],
        ),
        model: turn(mean(&|(_, fit, _), b| fit.level[b]), &|(_, fit, _), k| {
            fit.orders[k]
        }),
    }
}

fn over_time(axis: ForceAxis, cut: &CutData, parts: &[Part]) -> Course {
    let start = cut.block_s.first().map_or(0.0, |b| b[0]);
    let mut course = Course {
        axis,
        x: Vec::new(),
        measured: Vec::new(),
        model: Vec::new(),
    };
    for (b, [from, to]) in cut.block_s.iter().enumerate() {
        let next = cut.block_s.get(b + 1);
        let sum = |value: &dyn Fn(&Part) -> f64| parts.iter().map(|part| part.2 * value(part)).sum::<f64>();
        course.x.push(0.5 * (from + to) - start);
        course
            .measured
            .push(sum(&|(channel, fit, _)| channel.level[b] - fit.reference[b]));
        course.model.push(sum(&|(_, fit, _)| fit.level[b]));
        if let Some(middle) = next.and_then(|next| left_out([*from, *to], *next)) {
            course.x.push(middle - start);
            course.measured.push(f64::NAN);
            course.model.push(f64::NAN);
        }
    }
    course
}

/// The middle of what lies between two blocks that are not neighbours (a block's length apart at least), s.
fn left_out([from, to]: [f64; 2], next: [f64; 2]) -> Option<f64> {
    let apart = next[0] - to;
    (apart > (to - from).max(next[1] - next[0])).then_some(to + 0.5 * apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_stretch_without_blocks_is_a_gap() {
        assert_eq!(left_out([0.0, 1.0], [1.0, 2.0]), None);
        // Blocks are whole revolutions: what is left at the end of a range is shorter than one.
        assert_eq!(left_out([0.0, 1.0], [1.9, 2.2]), None);
        assert_eq!(left_out([0.0, 1.0], [3.0, 3.5]), Some(2.0));
    }

    use crate::identify::forces::cutting_model::CuttingModel;
    use crate::identify::forces::cutting_problem::CuttingProblem;
    use crate::identify::forces::made_cuts::{METAL, MILLED, changed, drilled, middle_s, milled, turned};
    use approx::assert_relative_eq;

    fn fitted(data: &CuttingData, theta: &[f64]) -> Vec<CutFit> {
        let model = CuttingModel::new(data, true).unwrap();
        CuttingProblem { model: &model, data }.fits(theta).unwrap()
    }

    /// A model whose forces are 3 % too large is wrong by 3 % of the waveform's mean square, and by 20 log10 1.03 dB at each order.
    #[test]
    fn a_waveform_too_large_by_a_part_is_wrong_by_that_part() {
        let larger = METAL.map(|k| 1.03 * k);
        let data = milled(METAL, &MILLED[..2]);
        for (cut, fit) in data.cuts.iter().zip(fitted(&data, &larger)) {
            for axis in axis_waves(&data, cut, &fit) {
                let sum = |f: fn(&WaveSums) -> f64| axis.orders.iter().map(f).sum::<f64>();
                let (error, signal) = (sum(|s| s.error), sum(|s| s.signal));
                assert_relative_eq!((error / signal).sqrt(), 0.03, max_relative = 0.03);
                // The mean square of the drawn revolution, by adding it up.
                let course = courses(&data, cut, &fit)
                    .into_iter()
                    .find(|c| c.axis == axis.axis)
                    .unwrap();
                let square = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64;
                assert_relative_eq!(signal, square(&course.measured), max_relative = 1e-9);
                let off: Vec<f64> = course
                    .model
                    .iter()
                    .zip(&course.measured)
                    .map(|(a, b)| a - b)
                    .collect();
                assert_relative_eq!(error, square(&off), max_relative = 1e-9);
                // 1 N at each of twelve orders, twice, and in the mean of six blocks.
                assert_relative_eq!(sum(|s| s.noise), 2.0 * 12.0 + 1.0 / 6.0, max_relative = 1e-12);
                // Orders above five times their noise of 1 N are compared.
                let loud = cut.channels[axis.axis.index()].as_ref().unwrap();
                let loud = loud.orders.iter().filter(|c| c.norm() > 5.0).count();
                assert_eq!(axis.decibel.1, loud);
                assert!(loud >= 1 || axis.axis == ForceAxis::Z);
                let expected = loud as f64 * 20.0 * 1.03f64.log10();
                assert_relative_eq!(axis.decibel.0, expected, max_relative = 0.05);
            }
        }
    }

    /// What the tooth does to a drawn revolution: x and y are those of the tool, whatever way the dynamometer lies.
    #[test]
    fn recorded_channels_are_drawn_in_the_axes_of_the_tool() {
        let plain = milled(METAL, &MILLED[..1]);
        let fits = fitted(&plain, &METAL);
        let expected = courses(&plain, &plain.cuts[0], &fits[0]);
        // The dynamometer's x shows the tool's y, its y the tool's −x.
        let minus = |channel: &ForceChannel, fit: &ChannelFit| {
            let (mut channel, mut fit) = (channel.clone(), fit.clone());
            for values in [&mut channel.level, &mut fit.level, &mut fit.reference] {
                values.iter_mut().for_each(|v| *v = -*v);
            }
            channel
                .orders
                .iter_mut()
                .chain(&mut fit.orders)
                .for_each(|c| *c = -*c);
            (channel, fit)
        };
        let mut fit = fits[0].clone();
        let [x, y, ..] = &plain.cuts[0].channels;
        let (minus_x, fit_minus_x) = minus(x.as_ref().unwrap(), fit.channels[0].as_ref().unwrap());
        fit.channels[0] = fit.channels[1].take();
        fit.channels[1] = Some(fit_minus_x);
        let mut turned = changed(&plain, |cut| {
            cut.channels[0] = y.clone();
            cut.channels[1] = Some(minus_x.clone());
        });
        turned.tool_from_dyno = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        for (a, b) in courses(&turned, &turned.cuts[0], &fit).iter().zip(&expected) {
            for (a, b) in a
                .measured
                .iter()
                .chain(&a.model)
                .zip(b.measured.iter().chain(&b.model))
            {
                assert_relative_eq!(*a, *b, epsilon = 1e-9);
            }
        }
        // A missing channel is missing in the axes that need it alone.
        let without = changed(&plain, |cut| cut.channels[0] = None);
        let axes: Vec<ForceAxis> = axis_waves(&without, &without.cuts[0], &fits[0])
            .iter()
            .map(|a| a.axis)
            .collect();
        assert_eq!(axes, [ForceAxis::Y, ForceAxis::Z]);
    }

    /// Drilling: thrust and torque count alike, each block for itself. A torque is as large as the thrust when they are added up.
    #[test]
    fn torques_count_as_much_as_thrusts() {
        let truth = [900.0, 30.0, 700.0, 45.0];
        let data = drilled(truth, &[[0.2, 3.0], [0.3, 3.0]]);
        let larger = truth.map(|k| 1.03 * k);
        for (cut, fit) in data.cuts.iter().zip(fitted(&data, &larger)) {
            let waves = axis_waves(&data, cut, &fit);
            assert_eq!(
                waves.iter().map(|w| w.axis).collect::<Vec<_>>(),
                [ForceAxis::Z, ForceAxis::Mz]
            );
            let [thrust, torque] = [&waves[0], &waves[1]];
            assert_eq!((thrust.orders.len(), torque.orders.len()), (1, 1));
            assert!((0.3..3.0).contains(&(torque.orders[0].signal / thrust.orders[0].signal)));
            assert_relative_eq!(thrust.orders[0].noise, 1.0, max_relative = 1e-12);
            let factor = data.force_per_torque;
            assert_relative_eq!(torque.orders[0].noise, factor * factor, max_relative = 1e-12);
            let course = &courses(&data, cut, &fit)[1];
            assert_eq!(course.x.len(), 14);
            assert_relative_eq!(course.x[3], middle_s(3) - middle_s(0) + 0.05, max_relative = 1e-9);
            let radius = f64::powi(4.75, 2) - f64::powi(1.5, 2);
            let lever = radius / f64::to_radians(67.5).sin() / 1000.0;
            let chip = 0.5 * cut.feed_mm * f64::to_radians(67.5).sin();
            assert_relative_eq!(
                course.measured[8],
                lever * (900.0 * chip + 30.0),
                max_relative = 0.02
            );
        }
    }

    #[test]
    fn a_gap_in_the_hole_is_drawn_as_a_gap() {
        let data = turned(METAL, &[0.1]);
        let with_gap = changed(&data, |cut| {
            for block in &mut cut.block_s[10..] {
                block.iter_mut().for_each(|t| *t += 0.4);
            }
        });
        let course = &courses(&with_gap, &with_gap.cuts[0], &fitted(&data, &METAL)[0])[0];
        assert_eq!(course.x.len(), 15);
        // Block 9 ends 1 s after the first begins, block 10 begins 0.4 s later.
        assert_relative_eq!(course.x[10], 1.2, max_relative = 1e-9);
        assert!(course.measured[10].is_nan() && course.model[10].is_nan());
        assert_relative_eq!(
            course.measured[5],
            1.5 * (0.1 * METAL[1] + METAL[4]),
            max_relative = 1e-6
        );
        assert_relative_eq!(course.model[5], course.measured[5], max_relative = 1e-6);
    }
}
