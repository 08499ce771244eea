//! The cutting force model as a function of its parameters.

use crate::cutting::waveform::DrillTerm;
use crate::cutting::{ForceAxis, coefficients_of, edge_row};
use crate::data::Process;
use crate::effects::cutting::{CutPhysics, CuttingSummary};
use crate::effects::{Cutting, Known};
use crate::identify::forces::cutting_data::{CutData, CutKind, CuttingData};
use crate::identify::model::{Model, Modelled};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::Dual;
use crate::{Error, Result};

/// Coefficients of one material and what may be tuned: milling and turning Ktc Krc Kac Kte Kre Kae, drilling Ktc Kte Kfc Kfe
/// (without the edge coefficients where the baseline has none), then the parameters of each added effect.
pub type CuttingModel = Model<Cutting>;

/// What of a cutting model is not tuned.
#[derive(Debug, Clone)]
pub struct CuttingParts {
    /// What the coefficients are of.
    pub process: Process,
    /// Whether edge coefficients are part of the baseline.
    pub has_edge: bool,
}

impl Modelled for Cutting {
    type Fixed = CuttingParts;
    type Data = CuttingData;
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
        let parts = CuttingParts {
            process: data.process,
            has_edge,
        };
        Ok(Model::of(parts, parameters))
    }

    /// What effects are told of the cuts.
    pub fn known(&self, data: &CuttingData) -> Known<'static, Cutting> {
        Known::cuts(self.summary(data))
    }

    /// The data's summary with the scale of this model's coefficients.
    pub fn summary(&self, data: &CuttingData) -> CuttingSummary {
        let own = self.parameters.iter().take(coefficients_of(self.process).len());
        let scale = own
            .filter(|p| p.unit == "N/mm²")
            .fold(1.0f64, |m, p| m.max(p.nominal.abs()));
        CuttingSummary {
            has_edge: self.has_edge,
            teeth_in_doubt: data.slips.common_passing.is_some(),
            cutting_scale_n_per_mm2: scale,
            ..data.summary.clone()
        }
    }

    /// Free amplitudes fitted to each cut and channel beyond a straight zero line.
    pub fn nuisances_per_channel(&self) -> usize {
        self.effects()
            .iter()
            .map(|e| e.instance.effect.nuisances_per_channel(e.instance.at()))
            .sum()
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
        let mut physics = CutPhysics::of(coefficient);
        for added in self.effects_in_order() {
            let values = self.values(theta, added, derivatives);
            let instance = added.instance;
            instance
                .effect
                .apply(instance.at(), &values, &cut.setting, &mut physics);
        }
        physics
    }
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
            CutKind::Turning { edge } => {
                let rows = [ForceAxis::X, ForceAxis::Y, ForceAxis::Z].map(|axis| edge_row(edge, axis));
                (0..n)
                    .map(|k| {
                        let mut all = [0.0; 4];
                        for (i, row) in data.dyno_from_tool.iter().enumerate() {
                            all[i] = (0..3).map(|axis| row[axis] * rows[axis][k]).sum();
                        }
                        all
                    })
                    .collect()
            }
            CutKind::Drilling { cut: drill, .. } => {
                let full = drill.geometry.entry_travel_mm() * 1.0000001;
                let (thrust, torque) = (
                    drill.at(DrillTerm::Thrust, full),
                    drill.at(DrillTerm::Torque, full),
                );
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
    let partner = |edge: usize| {
        if data.process == Process::Drilling {
            edge - 1
        } else {
            edge - 3
        }
    };
    let matrix = DMatrix::from_fn(rows.len(), n, |i, k| {
        if kinds[k].edge && !has_edge {
            0.0
        } else {
            rows[i][k] * unit(k)
        }
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
    Ok((0..n)
        .map(|k| {
            if kinds[k].edge && !has_edge {
                0.0
            } else {
                solution[k] * unit(k)
            }
        })
        .collect())
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
        CutKind::Milling { .. } | CutKind::Turning { .. } => first,
    };
    let air: Vec<usize> = (0..entering).chain(cut.steady.end..cut.block_s.len()).collect();
    std::array::from_fn(|i| {
        let level = &cut.channels[i].as_ref()?.level;
        let (offset, slope, at) =
            crate::signal::line(air.iter().map(|b| middle(*b)), air.iter().map(|b| level[*b]));
        let n = cut.steady.len().max(1) as f64;
        Some(
            cut.steady
                .clone()
                .map(|b| level[b] - offset - slope * (middle(b) - at))
                .sum::<f64>()
                / n,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::forces::made_cuts::{
        AS_IT_IS, METAL, MILLED, changed, drilled, in_the_cut, milled, turned,
    };
    use approx::assert_relative_eq;

    fn nominal(data: &CuttingData, has_edge: bool) -> Vec<f64> {
        let model = CuttingModel::new(data, has_edge).unwrap();
        model.parameters.iter().map(|p| p.nominal).collect()
    }

    fn are(found: &[f64], truth: &[f64], tolerance: f64) {
        assert_eq!(found.len(), truth.len());
        for (found, truth) in found.iter().zip(truth) {
            assert_relative_eq!(*found, *truth, max_relative = tolerance);
        }
    }

    /// Two feeds tell cutting from edge force: the level above a zero that drifts is b (K h + K_e) in each process, and for a slot
    /// and its quarters what the forces of the single teeth add up to.
    #[test]
    fn mean_forces_give_back_the_coefficients_that_made_them() {
        are(&nominal(&turned(METAL, &[0.1, 0.2, 0.3]), true), &METAL, 2e-3);
        are(&nominal(&milled(METAL, &MILLED), true), &METAL, 1e-2);
        let holes = [900.0, 30.0, 700.0, 45.0];
        let data = drilled(holes, &[[0.2, 0.0], [0.35, 3.0], [0.5, 3.0]]);
        are(&nominal(&data, true), &holes, 2e-3);
    }

    /// One feed does not tell them apart: the edge counts as 0.02 mm of chip then, and the force is all explained.
    #[test]
    fn one_feed_leaves_the_usual_share_to_the_edge() {
        let found = nominal(&turned(METAL, &[0.1]), true);
        for k in 0..3 {
            let force = 0.1 * METAL[k] + METAL[k + 3];
            assert_relative_eq!(found[k], force / (0.1 + 0.02), max_relative = 1e-4);
            assert_relative_eq!(found[k + 3], 0.02 * found[k], max_relative = 1e-4);
        }
        // Half of the feed, in mm, goes to the chip of each of the two lips.
        let found = nominal(&drilled([900.0, 30.0, 700.0, 45.0], &[[0.2, 3.0]]), true);
        let chip = 0.1 * f64::to_radians(67.5).sin();
        for (k, force) in [(0, 900.0 * chip + 30.0), (2, 700.0 * chip + 45.0)] {
            assert_relative_eq!(found[k], force / (chip + 0.02), max_relative = 1e-4);
            assert_relative_eq!(found[k + 1], 0.02 * found[k], max_relative = 1e-4);
        }
    }

    #[test]
    fn without_edge_coefficients_the_chip_takes_it_all() {
        let found = nominal(&turned(METAL, &[0.1]), false);
        let all: Vec<f64> = (0..3).map(|k| METAL[k] + METAL[k + 3] / 0.1).collect();
        are(&found, &all, 1e-6);
    }

    /// A dynamometer clamped on turned by 90°: its x shows the tool's y, its y the tool's −x. The coefficients are the tool's.
    #[test]
    fn a_turned_dynamometer_changes_no_coefficient() {
        let plain = turned(METAL, &[0.1, 0.2, 0.3]);
        let cuts = changed(&plain, |cut| {
            let [x, y, z, _] = &cut.channels;
            let (mut minus_x, y, z) = (x.clone().unwrap(), y.clone(), z.clone());
            minus_x.level.iter_mut().for_each(|v| *v = -*v);
            cut.channels = [y, Some(minus_x), z, None];
        });
        let cuts = cuts.cuts.iter().map(|c| (**c).clone()).collect();
        let tool_from_dyno = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], AS_IT_IS[2]];
        let data = CuttingData::new(Process::Turning, 1, tool_from_dyno, cuts).unwrap();
        are(&nominal(&data, true), &METAL, 2e-3);
    }

    /// Without air the blocks are taken as they are: a zero of 3 N counts as force.
    #[test]
    fn the_zero_is_taken_from_the_air_where_there_is_some() {
        let with_air = turned(METAL, &[0.1]);
        let force = 1.5 * (0.1 * METAL[0] + METAL[3]);
        assert_relative_eq!(
            steady_means(&with_air.cuts[0])[2].unwrap(),
            force,
            max_relative = 1e-12
        );
        let without = changed(&with_air, |cut| {
            let all = 0..cut.block_s.len();
            cut.block_s = all
                .clone()
                .filter(|b| in_the_cut(*b))
                .map(|b| cut.block_s[b])
                .collect();
            for channel in cut.channels.iter_mut().flatten() {
                channel.level = all
                    .clone()
                    .filter(|b| in_the_cut(*b))
                    .map(|b| channel.level[b])
                    .collect();
            }
            cut.steady = 0..cut.block_s.len();
        });
        let [.., z, torque] = steady_means(&without.cuts[0]);
        // The steady blocks lie about the middle of the record, where the zero is 3 N.
        assert_relative_eq!(z.unwrap(), force + 3.0, max_relative = 1e-12);
        assert_eq!(torque, None);
    }

    /// The force of a drill that enters is no zero: a hole whose entry takes 0.2 s leaves the air before it alone.
    #[test]
    fn blocks_of_an_entering_drill_are_no_air() {
        let holes = [900.0, 30.0, 700.0, 45.0];
        let data = drilled(holes, &[[0.2, 3.0]]);
        let cut = &data.cuts[0];
        let chip = 0.1 * f64::to_radians(67.5).sin();
        // Two lips from the pilot's radius of 1.5 mm to 4.75 mm.
        let thrust = 2.0 * (4.75 - 1.5) * (700.0 * chip + 45.0);
        assert_relative_eq!(steady_means(cut)[2].unwrap(), thrust, max_relative = 1e-9);
    }
}
