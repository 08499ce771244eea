//! What is left of force records against what was different: order of the cuts, speed, feed, depth, the angle of the tooth and the
//! time in the record, with a test for each.

use num_complex::Complex64;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::cutting::ForceAxis;
use crate::discrepancy::trend::{SIGNIFICANT, TrendPoint, test};
use crate::identify::CutFit;
use crate::identify::CuttingData;
use crate::identify::forces::cutting_data::{CutData, CutKind};
use crate::text::figures;

/// What the rest is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// Place in the sequence of cuts.
    Order,
    /// Cutting speed.
    Speed,
    /// Feed per tooth or revolution.
    Feed,
    /// Depth of cut along the tool's axis.
    Depth,
    /// Angle from one tooth to the next.
    ToothAngle,
    /// Time since the cut is at full engagement.
    TimeInRecord,
}

impl Against {
    /// For people.
    pub fn words(self) -> &'static str {
        match self {
            Against::Order => "the order of the cuts",
            Against::Speed => "the cutting speed",
            Against::Feed => "the feed",
            Against::Depth => "the depth",
            Against::ToothAngle => "the angle of the tooth",
            Against::TimeInRecord => "the time in the record",
        }
    }

    /// Unit of the abscissa.
    pub fn unit(self) -> &'static str {
        match self {
            Against::Order => "",
            Against::Speed => "m/min",
            Against::Feed | Against::Depth => "mm",
            Against::ToothAngle => "°",
            Against::TimeInRecord => "s",
        }
    }

    /// What a rest that follows it usually comes from.
    pub fn usual_cause(self) -> &'static str {
        match self {
            Against::Order => "wear, built-up edge, warming up, or cuts listed in a wrong order",
            Against::Speed => {
                "coefficients that depend on the speed, a spindle that does not reach the stated one, a resonance"
            }
            Against::Feed => {
                "a law of the force other than the model's (size effect), a tool that is pushed off, a feed that the robot does not reach"
            }
            Against::Depth => {
                "a depth other than stated, a tool that is pushed off, teeth of more than one helix"
            }
            Against::ToothAngle => {
                "a law of the force other than the model's, wrong immersion or helix, a channel that distorts"
            }
            Against::TimeInRecord => {
                "drift of the amplifier, a force that settles, chips that clog, a depth that changes along the way"
            }
        }
    }
}

/// The rest against one quantity.
#[derive(Debug, Clone, Serialize)]
pub struct Trend {
    /// Against what.
    pub against: Against,
    /// Unit of x.
    pub x_unit: &'static str,
    /// Unit of the rest: "1" is a share of the model's force, "N" a force.
    pub unit: &'static str,
    /// Probability that noise follows it as much, times the number of tests made.
    pub p_value: f64,
    /// χ² of the rest that goes where it is taken out.
    #[serde(skip)]
    pub explained: f64,
    /// Number of tests made.
    pub tests: usize,
    /// What it usually comes from.
    pub usual_cause: &'static str,
    /// Means at a few abscissae, ascending.
    pub points: Vec<TrendPoint>,
    /// The recorded axis that the points are of; `None`: all channels together.
    pub axis: Option<ForceAxis>,
}

/// Points that are shown of many.
const SHOWN: usize = 8;
/// Points over the pitch of the teeth.
const ANGLES: usize = 36;
/// Relative standard deviation of the noise variance.
const NOISE_KNOWN_TO: f64 = 0.02;

impl Trend {
    /// Whether the rest follows it by more than chance.
    pub fn is_significant(&self) -> bool {
        self.p_value < SIGNIFICANT
    }

    /// What it is like, for people: `record 4.1 % above the model at 0.04 mm, 2 % below at 0.16 mm`.
    pub fn course(&self) -> String {
        let ends = match self.against {
            Against::ToothAngle => {
                let by = |a: &&TrendPoint, b: &&TrendPoint| a.rest.total_cmp(&b.rest);
                [self.points.iter().max_by(by), self.points.iter().min_by(by)]
            }
            _ => [self.points.first(), self.points.last()],
        };
        let middle = match self.against {
            Against::ToothAngle => None,
            _ if self.points.len() > 2 => self.points.get(self.points.len() / 2),
            _ => None,
        };
        let [first, last] = ends;
        let words = [first, middle, last].into_iter().flatten().map(|p| {
            let size = match self.unit {
                "1" => format!("{} %", figures(100.0 * p.rest.abs(), 2)),
                unit => format!("{} {unit}", figures(p.rest.abs(), 2)),
            };
            let side = if p.rest < 0.0 { "below" } else { "above" };
            let at = format!("{} {}", figures(p.x, 2), self.x_unit);
            format!("{size} {side} the model at {}", at.trim_end())
        });
        format!("the record is {}", words.collect::<Vec<_>>().join(", "))
    }
}

/// What the model, fitted as `fits` (in the order of the cuts), leaves of the records, against all that the data can tell: what is no chance
/// first, of that what explains most (probabilities far below any doubt rank nothing), then the least probable.
pub fn cutting_trends(data: &CuttingData, fits: &[CutFit]) -> Vec<Trend> {
    let pairs = || data.cuts.iter().map(|c| &**c).zip(fits);
    let excess: Vec<Option<(f64, f64)>> = pairs().map(|(cut, fit)| excess_share(cut, fit)).collect();
    let by_cut = |x: &dyn Fn(&CutData) -> Option<f64>| -> Vec<TrendPoint> {
        let cuts = data.cuts.iter().zip(&excess);
        cuts.filter_map(|(cut, excess)| {
            let (x, (rest, std)) = (x(cut)?, (*excess)?);
            Some(TrendPoint { x, rest, std })
        })
        .collect()
    };
    let depth = |cut: &CutData| match &cut.kind {
        CutKind::Milling { cut, .. } => Some(cut.axial_depth_mm),
        CutKind::Drilling { .. } | CutKind::Turning { .. } => None,
    };
    let mut all: Vec<Trend> = [
        (Against::Order, by_cut(&|c| c.order.map(|o| o as f64))),
        (Against::Speed, by_cut(&|c| Some(c.cutting_speed_m_per_min))),
        (Against::Feed, by_cut(&|c| Some(c.feed_mm))),
        (Against::Depth, by_cut(&depth)),
        (Against::TimeInRecord, in_time(data, fits)),
    ]
    .into_iter()
    .filter_map(|(against, points)| along(against, points))
    .chain(over_the_tooth(data, fits))
    .collect();
    let tests = all.len();
    for trend in &mut all {
        trend.tests = tests;
        trend.p_value = (trend.p_value * tests as f64).min(1.0);
    }
    all.sort_by(|a, b| match (a.is_significant(), b.is_significant()) {
        (true, true) => b.explained.total_cmp(&a.explained),
        _ => a.p_value.total_cmp(&b.p_value),
    });
    all
}

/// By which share the forces of a cut are larger than the model's, with its standard deviation.
fn excess_share(cut: &CutData, fit: &CutFit) -> Option<(f64, f64)> {
    let (mut product, mut square) = (0.0, 0.0);
    for (channel, model) in cut.channels.iter().zip(&fit.channels) {
        let (Some(channel), Some(model)) = (channel, model) else {
            continue;
        };
        let orders = channel.orders.iter().zip(&model.orders).zip(&channel.order_std);
        for ((seen, made), std) in orders {
            let weight = 2.0 / (std * std);
            product += (made.conj() * (seen - made)).re * weight;
            square += made.norm_sqr() * weight;
        }
        for b in cut.steady.clone() {
            let (made, weight) = (model.level[b], channel.level_std[b].powi(-2));
            product += made * (channel.level[b] - made - model.zero[b]) * weight;
            square += made * made * weight;
        }
    }
    (square > 0.0 && product.is_finite()).then(|| (product / square, square.sqrt().recip()))
}

/// The same, block by block of the steady cut.
fn in_time(data: &CuttingData, fits: &[CutFit]) -> Vec<TrendPoint> {
    let mut points = Vec::new();
    for (cut, fit) in data.cuts.iter().zip(fits) {
        let Some(start) = cut.block_s.get(cut.steady.start).map(|b| b[0]) else {
            continue;
        };
        for b in cut.steady.clone() {
            let (mut product, mut square) = (0.0, 0.0);
            for (channel, model) in cut.channels.iter().zip(&fit.channels) {
                if let (Some(channel), Some(model)) = (channel, model) {
                    let (made, weight) = (model.level[b], channel.level_std[b].powi(-2));
                    product += made * (channel.level[b] - made - model.zero[b]) * weight;
                    square += made * made * weight;
                }
            }
            if square > 0.0 {
                points.push(TrendPoint {
                    x: 0.5 * (cut.block_s[b][0] + cut.block_s[b][1]) - start,
                    rest: product / square,
                    std: square.sqrt().recip(),
                });
            }
        }
    }
    points
}

/// The points against one quantity: whether a parabola (a line, where there are two abscissae) explains more of them than chance.
/// `None` where there are too few.
fn along(against: Against, points: Vec<TrendPoint>) -> Option<Trend> {
    let found = test(points, 2)?;
    Some(Trend {
        against,
        x_unit: against.unit(),
        unit: "1",
        p_value: found.p_value,
        explained: found.explained,
        tests: 1,
        usual_cause: against.usual_cause(),
        points: means(&found.points, found.low, found.span),
        axis: None,
    })
}

/// Weighted means at the abscissae, or over stretches of them where there are many.
fn means(points: &[TrendPoint], low: f64, span: f64) -> Vec<TrendPoint> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x));
    let mut distinct: Vec<f64> = sorted.iter().map(|p| p.x).collect();
    distinct.dedup_by(|b, a| (*b - *a).abs() <= 1e-3 * span);
    let group = |x: f64| match distinct.len() > 2 * SHOWN {
        true => (((x - low) / span * SHOWN as f64) as usize).min(SHOWN - 1),
        false => distinct.partition_point(|d| *d <= x + 1e-3 * span),
    };
    sorted
        .chunk_by(|a, b| group(a.x) == group(b.x))
        .map(|chunk| {
            let weight: f64 = chunk.iter().map(|p| p.std.powi(-2)).sum();
            let mean = |of: fn(&TrendPoint) -> f64| {
                chunk.iter().map(|p| of(p) * p.std.powi(-2)).sum::<f64>() / weight
            };
            TrendPoint {
                x: mean(|p| p.x),
                rest: mean(|p| p.rest),
                std: weight.sqrt().recip(),
            }
        })
        .collect()
}

/// The waveform that all calm cuts leave over the pitch of the teeth, each turned to the same angle of the tool; the points are
/// those of the axis that it is strongest on.
fn over_the_tooth(data: &CuttingData, fits: &[CutFit]) -> Option<Trend> {
    let teeth = data.summary.teeth.max(1);
    let most = data.cuts.iter().map(|c| c.orders).max()?;
    // Harmonic of the teeth by axis: Σ w (seen − made), Σ w.
    let mut sums = vec![[(Complex64::ZERO, 0.0f64); 4]; most / teeth];
    for (cut, fit) in data.cuts.iter().zip(fits).filter(|(c, _)| c.vibration.is_none()) {
        for (axis, (channel, made)) in cut.channels.iter().zip(&fit.channels).enumerate() {
            let (Some(channel), Some(made)) = (channel, made) else {
                continue;
            };
            let harmonics = sums.iter_mut().enumerate();
            for (k, sum) in harmonics {
                let n = (k + 1) * teeth;
                let (Some(seen), Some(model), Some(std)) = (
                    channel.orders.get(n - 1),
                    made.orders.get(n - 1),
                    channel.order_std.get(n - 1),
                ) else {
                    break;
                };
                let weight = std.powi(-2);
                sum[axis].0 += (seen - model) * Complex64::from_polar(weight, n as f64 * fit.placement);
                sum[axis].1 += weight;
            }
        }
    }
    let energy = |axis: usize| -> (f64, usize) {
        let used = || sums.iter().map(|s| s[axis]).filter(|s| s.1 > 0.0);
        (
            used().map(|(sum, weight)| 2.0 * sum.norm_sqr() / weight).sum(),
            2 * used().count(),
        )
    };
    let (total, count) = (0..4)
        .map(energy)
        .fold((0.0, 0), |(e, n), (de, dn)| (e + de, n + dn));
    if count == 0 {
        return None;
    }
    let freedom = count as f64;
    let expected = total / (1.0 + 2.0 * NOISE_KNOWN_TO);
    let p_value = ChiSquared::new(freedom).ok()?.sf(expected);
    let axis = (0..4).max_by(|a, b| energy(*a).0.total_cmp(&energy(*b).0))?;
    let used: Vec<(usize, Complex64, f64)> = sums
        .iter()
        .enumerate()
        .filter(|(_, s)| s[axis].1 > 0.0)
        .map(|(k, s)| (k + 1, s[axis].0 / s[axis].1, s[axis].1.recip()))
        .collect();
    let std = used.iter().map(|u| 2.0 * u.2).sum::<f64>().sqrt();
    let points = (0..ANGLES).map(|step| {
        let share = step as f64 / ANGLES as f64;
        let wave = |(k, mean, _): &(usize, Complex64, f64)| {
            2.0 * (mean * Complex64::from_polar(1.0, *k as f64 * share * std::f64::consts::TAU)).re
        };
        TrendPoint {
            x: share * 360.0 / teeth as f64,
            rest: used.iter().map(wave).sum(),
            std,
        }
    });
    Some(Trend {
        against: Against::ToothAngle,
        x_unit: Against::ToothAngle.unit(),
        unit: ForceAxis::ALL[axis].unit(),
        p_value,
        explained: (total - freedom).max(0.0),
        tests: 1,
        usual_cause: Against::ToothAngle.usual_cause(),
        points: points.collect(),
        axis: Some(ForceAxis::ALL[axis]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::forces::made_force_records::{MadeCut, write_campaign};
    use crate::identify::CuttingCase;
    use crate::identify::forces::cutting_problem::CuttingProblem;
    use crate::identify::forces::cutting_study::calibrate_cutting;
    use std::f64::consts::TAU;

    const RPM: [f64; 4] = [1150.0, 1390.0, 1640.0, 1930.0];
    const FEEDS_MM: [f64; 4] = [0.05, 0.08, 0.11, 0.15];

    /// Sixteen cuts, to whose forces `more` (cut, axis, time, angle, in the cut) is added.
    fn trends(more: &dyn Fn(usize, usize, f64, f64, bool) -> f64) -> Vec<Trend> {
        let dir = tempfile::tempdir().unwrap();
        let pairs = RPM
            .into_iter()
            .flat_map(|rpm| FEEDS_MM.map(|feed_mm| (rpm, feed_mm)));
        let cuts: Vec<MadeCut> = pairs
            .map(|(rpm, feed_mm)| MadeCut {
                rpm,
                feed_mm,
                speed: &|_| 1.0,
            })
            .collect();
        let campaign = write_campaign(dir.path(), &cuts, more);
        let case = CuttingCase::load(&campaign).unwrap();
        let (model, data) = (&case.model, &case.data);
        let theta = calibrate_cutting(model, data).unwrap().theta;
        let fits = CuttingProblem { model, data }.fits(&theta).unwrap();
        cutting_trends(data, &fits)
    }

    /// A force that the speed, or the time, adds to all of its axis.
    fn first(more: &dyn Fn(usize, usize, f64, f64, bool) -> f64) -> Trend {
        let all = trends(more);
        assert!(all[0].is_significant(), "{all:#?}");
        all.into_iter().next().unwrap()
    }

    #[test]
    fn a_right_model_leaves_nothing_that_follows_anything() {
        let all = trends(&|_, _, _, _, _| 0.0);
        assert!(all.len() >= 4);
        assert!(all.iter().all(|t| !t.is_significant()), "{all:#?}");
    }

    #[test]
    fn what_follows_the_speed_is_named_so() {
        let found = first(&|cut, axis, _, _, cutting| match (axis, cutting) {
            (1, true) => 8.0 * (cut / 4) as f64,
            _ => 0.0,
        });
        assert_eq!(found.against, Against::Speed, "{found:?}");
        assert!(found.points.last().unwrap().rest > found.points[0].rest);
    }

    #[test]
    fn what_follows_the_feed_beyond_a_line_is_named_so() {
        let found = first(&|cut, axis, _, _, cutting| match (axis, cutting) {
            (1, true) => 25.0 * f64::from(u8::from(cut % 4 == 1 || cut % 4 == 2)),
            _ => 0.0,
        });
        assert_eq!(found.against, Against::Feed, "{found:?}");
    }

    #[test]
    fn what_follows_the_angle_of_the_tooth_is_named_so() {
        let found = first(&|_, axis, _, angle, cutting| match (axis, cutting) {
            (2, true) => 12.0 * (12.0 * angle).cos(),
            _ => 0.0,
        });
        assert_eq!(
            (found.against, found.axis),
            (Against::ToothAngle, Some(ForceAxis::Z))
        );
        let highest = found.points.iter().map(|p| p.rest).fold(0.0, f64::max);
        assert!((highest - 12.0).abs() < 2.0, "{highest}");
    }

    #[test]
    fn what_swells_in_the_record_is_named_so() {
        let found = first(&|_, axis, t, _, cutting| match (axis, cutting) {
            (1, true) => 20.0 * (TAU * 0.5 * t).sin(),
            _ => 0.0,
        });
        assert_eq!(found.against, Against::TimeInRecord, "{found:?}");
    }

    use crate::identify::CuttingModel;
    use crate::identify::forces::made_cuts::{METAL, MILLED, changed, milled, turned, with_orders_of};
    use approx::assert_relative_eq;

    /// Forces 3 % larger than the model's, known to the noise over the force: of F N in n values of 1 N error each to 1/(F √n).
    #[test]
    fn the_excess_of_a_cut_is_a_share_of_its_force() {
        let truth = turned(METAL, &[0.1]);
        let model = CuttingModel::new(&truth, true).unwrap();
        let fit = |data: &CuttingData| CuttingProblem { model: &model, data }.fits(&METAL).unwrap();
        let larger = turned(METAL.map(|k| 1.03 * k), &[0.1]);
        let fits = fit(&truth);
        let (share, std) = excess_share(&larger.cuts[0], &fits[0]).unwrap();
        assert_relative_eq!(share, 0.03, max_relative = 1e-6);
        let force = |k: usize| 1.5 * (METAL[k] * 0.1 + METAL[k + 3]);
        let square: f64 = (0..3).map(|k| force(k).powi(2)).sum();
        assert_relative_eq!(std, 1.0 / (6.0 * square).sqrt(), max_relative = 1e-6);
        let in_time = in_time(&larger, &fits);
        assert_eq!(in_time.len(), 6);
        for (k, point) in in_time.iter().enumerate() {
            assert_relative_eq!(point.x, 0.1 * k as f64 + 0.05, epsilon = 1e-9);
            assert_relative_eq!(point.rest, 0.03, max_relative = 1e-6);
            assert_relative_eq!(point.std, 1.0 / square.sqrt(), max_relative = 1e-6);
        }
    }

    /// Waves count by their noise: order 2 of x is larger by a tenth and known to 1 N, order 2 of y is right and known to 3 N.
    #[test]
    fn a_wave_counts_twice_its_power_over_its_noise() {
        let data = milled(METAL, &MILLED[..1]);
        let model = CuttingModel::new(&data, true).unwrap();
        let mut fit = CuttingProblem {
            model: &model,
            data: &data,
        }
        .fits(&METAL)
        .unwrap()
        .remove(0);
        let alone = changed(&data, |cut| {
            cut.channels[2] = None;
            for (channel, (size, std)) in cut.channels.iter_mut().flatten().zip([(11.0, 1.0), (30.0, 3.0)]) {
                channel.level.fill(0.0);
                channel.orders = vec![Complex64::ZERO, Complex64::from_polar(size, 0.4)];
                channel.order_std = vec![1.0, std];
            }
        });
        for (made, size) in fit.channels.iter_mut().flatten().zip([10.0, 30.0]) {
            made.level.fill(0.0);
            made.zero.fill(0.0);
            made.orders = vec![Complex64::ZERO, Complex64::from_polar(size, 0.4)];
        }
        // Σ 2 |C|²/σ² = 200 + 200, of which the first is a tenth too large.
        let (share, std) = excess_share(&alone.cuts[0], &fit).unwrap();
        assert_relative_eq!(share, 0.05, max_relative = 1e-9);
        assert_relative_eq!(std, 0.05, max_relative = 1e-9);
    }

    /// A wave of 8 N over the pitch of two teeth, in cuts that began at different angles; drawn over the half turn of a tooth.
    #[test]
    fn a_ripple_of_the_teeth_is_drawn_over_their_pitch() {
        let data = milled(METAL, &MILLED[..2]);
        let model = CuttingModel::new(&data, true).unwrap();
        let fits = CuttingProblem {
            model: &model,
            data: &data,
        }
        .fits(&METAL)
        .unwrap();
        let mut rippled = data.clone();
        for (cut, fit) in rippled.cuts.iter_mut().zip(&fits) {
            let cut = std::sync::Arc::make_mut(cut);
            with_orders_of(cut, fit);
            let y = cut.channels[1].as_mut().unwrap();
            y.orders[1] += Complex64::from_polar(4.0, 0.5 - 2.0 * fit.placement);
        }
        let found = over_the_tooth(&rippled, &fits).unwrap();
        assert_eq!(found.axis, Some(ForceAxis::Y));
        // χ² of two cuts, 2 · (4 N / 1 N)² each, less one for each of 3 · 6 complex harmonics' parts.
        assert_relative_eq!(found.explained, 64.0 - 36.0, max_relative = 1e-9);
        // Noise known to 2 % may be 4 % of χ² larger.
        let by_chance = ChiSquared::new(36.0).unwrap();
        assert!(found.p_value > by_chance.sf(64.0) && found.p_value < by_chance.sf(60.0));
        assert_eq!(found.points.len(), 36);
        for (step, point) in found.points.iter().enumerate() {
            let angle = 5.0 * step as f64;
            assert_relative_eq!(point.x, angle, epsilon = 1e-9);
            assert_relative_eq!(
                point.rest,
                8.0 * (2.0 * angle.to_radians() + 0.5).cos(),
                epsilon = 1e-9
            );
            // Six harmonics of 1 N, each the mean of two cuts: 2 · 1 / 2 N² of the wave's variance.
            assert_relative_eq!(point.std, 6f64.sqrt(), max_relative = 1e-9);
        }
    }

    #[test]
    fn points_at_one_abscissa_are_drawn_as_their_weighted_mean() {
        let point = |x: f64, rest: f64, std: f64| TrendPoint { x, rest, std };
        let drawn = means(
            &[
                point(2.0, 5.0, 1.0),
                point(1.0, 1.0, 1.0),
                point(1.0, 4.0, 2f64.sqrt()),
                point(3.0, 0.0, 1.0),
            ],
            1.0,
            2.0,
        );
        assert_eq!(drawn.len(), 3);
        // Weights of 1 and ½.
        assert_relative_eq!(drawn[0].rest, 2.0, max_relative = 1e-12);
        assert_relative_eq!(drawn[0].std, 1.5f64.sqrt().recip(), max_relative = 1e-12);
        assert_relative_eq!(drawn[1].rest, 5.0, max_relative = 1e-12);
        // Many abscissae are drawn in eight stretches.
        let many: Vec<TrendPoint> = (0..160).map(|i| point(f64::from(i), 1.0, 1.0)).collect();
        let drawn = means(&many, 0.0, 159.0);
        assert_eq!(drawn.len(), 8);
        assert_relative_eq!(drawn[0].std, 20f64.sqrt().recip(), max_relative = 0.05);
    }
}
