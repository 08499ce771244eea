//! Cuts that do not fit the others: each is predicted from the rest.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::average_force::ForceAxis;
use super::regression::{Observation, fit};

/// A cut whose average on one axis the other cuts do not predict.
#[derive(Debug, Clone, PartialEq)]
pub struct Misfit {
    pub cut: usize,
    pub axis: ForceAxis,
    pub measured: f64,
    /// From the fit to all other cuts.
    pub predicted: f64,
    /// All averages of the cut: axis, measured, predicted.
    pub averages: Vec<(ForceAxis, f64, f64)>,
}

impl Misfit {
    /// Two force axes whose averages are those predicted for each other, signs aside: swapped plugs.
    pub fn swapped(&self) -> Option<[ForceAxis; 2]> {
        let forces: Vec<_> = self.averages.iter().filter(|a| a.0 != ForceAxis::Mz).collect();
        let largest = forces.iter().map(|a| a.2.abs()).fold(0.0, f64::max);
        let is = |measured: f64, predicted: f64| (measured.abs() - predicted.abs()).abs() < ALIKE * largest;
        forces.iter().enumerate().find_map(|(i, a)| {
            let crossed = forces[i + 1..]
                .iter()
                .find(|b| is(a.1, b.2) && is(b.1, a.2) && !is(a.2, b.2));
            crossed.map(|b| [a.0, b.0])
        })
    }
}

/// Averages nearer than this part of the largest are alike.
const ALIKE: f64 = 0.08;

/// Chance, over all cuts and axes together, of calling a good cut a misfit.
const FALSE_ALARM: f64 = 0.01;
/// A deviation below this part of the axis' largest average is nobody's concern.
const SMALLEST: f64 = 0.03;

/// Leaves out one cut at a time and compares it with the prediction from the rest (externally studentised
/// residual against Student's t, Bonferroni over all averages). The worst axis of each misfit is reported.
pub fn misfits(observations: &[Observation]) -> Vec<Misfit> {
    let mut cuts: Vec<usize> = observations.iter().map(|o| o.cut).collect();
    cuts.dedup();
    let unknowns = observations.first().map_or(0, |o| o.row.len());
    let mut found = Vec::new();
    for &cut in &cuts {
        let (out, rest): (Vec<Observation>, Vec<Observation>) =
            observations.iter().cloned().partition(|o| o.cut == cut);
        let Some(others) = fit(&rest) else { continue };
        if !others.inseparable.is_empty() {
            continue;
        }
        let predict =
            |o: &Observation| -> f64 { o.row.iter().zip(&others.solution).map(|(r, x)| r * x).sum() };
        let averages: Vec<(ForceAxis, f64, f64)> =
            out.iter().map(|o| (o.axis, o.value, predict(o))).collect();
        let worst = out
            .iter()
            .filter_map(|o| {
                let a = o.axis.index();
                let predicted = predict(o);
                let on_axis = rest.iter().filter(|r| r.axis == o.axis).count() as f64;
                // Unknowns shared over the axes that carry them.
                let axes = 1.0
                    + ForceAxis::ALL
                        .iter()
                        .filter(|x| **x != o.axis && rest.iter().any(|r| r.axis == **x))
                        .count() as f64;
                let dof = on_axis - unknowns as f64 / axes;
                if dof < 2.0 {
                    return None;
                }
                // Error of the prediction is bounded by that of the fit's worst point: leverage below one.
                let scale = (o.std_error.powi(2) + others.extra_scatter[a].powi(2)).sqrt() * 2f64.sqrt();
                let largest = observations
                    .iter()
                    .filter(|x| x.axis == o.axis)
                    .map(|x| x.value.abs())
                    .fold(0.0, f64::max);
                let off = (o.value - predicted).abs();
                let level = 1.0 - 0.5 * FALSE_ALARM / observations.len() as f64;
                let limit = StudentsT::new(0.0, 1.0, dof).ok()?.inverse_cdf(level);
                (off > limit * scale && off > SMALLEST * largest).then(|| {
                    let misfit = Misfit {
                        cut,
                        axis: o.axis,
                        measured: o.value,
                        predicted,
                        averages: averages.clone(),
                    };
                    (off / largest, misfit)
                })
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        found.extend(worst.map(|(_, misfit)| misfit));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(spoilt: Option<usize>) -> Vec<Observation> {
        (0..8)
            .map(|cut| {
                let x = 0.05 * (1 + cut % 4) as f64;
                // A fixed, harmless scatter.
                let scatter = [0.3, -0.2, 0.1, -0.4, 0.2, 0.05, -0.1, 0.25][cut];
                Observation {
                    cut,
                    axis: ForceAxis::Z,
                    row: vec![x, 1.0],
                    value: 1000.0 * x + 20.0 + scatter + if spoilt == Some(cut) { 30.0 } else { 0.0 },
                    std_error: 0.3,
                }
            })
            .collect()
    }

    #[test]
    fn the_spoilt_cut_is_named_and_the_good_ones_are_not() {
        assert_eq!(misfits(&series(None)), []);
        let found = misfits(&series(Some(5)));
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].cut, 5);
        assert!((found[0].measured - found[0].predicted - 30.0).abs() < 1.0);
    }

    #[test]
    fn too_few_cuts_accuse_nobody() {
        assert_eq!(misfits(&series(Some(1))[..3]), []);
        assert_eq!(misfits(&[]), []);
    }
}
