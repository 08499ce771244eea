//! Model against measured FRFs: totals, and by posture, direction, point and band.

use num_complex::Complex64;
use serde::Serialize;

use crate::data::Point;
use crate::discrepancy::comparison::error_sums::{BANDS, Groups, Sums, band_edges_hz, band_of};
pub use crate::discrepancy::comparison::error_sums::{ErrorTotals, GroupError};
use crate::discrepancy::comparison::place::{Amounts, DominantRegion, above_noise, excess};
use crate::identify::FrfData;

/// Error within a frequency band.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// Lower edge, Hz.
    pub from_hz: f64,
    /// Upper edge, Hz.
    pub to_hz: f64,
    /// Error over the signal in the band.
    pub nrms: f64,
    /// nrms of a perfect model.
    pub noise_floor_nrms: f64,
}

/// Error of one FRF.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrfError {
    /// Posture and degrees of freedom, `p1 1X/1X`.
    pub name: String,
    /// Its id.
    pub posture: String,
    /// Response axis, reference axis.
    pub direction: String,
    /// Error over the signal.
    pub nrms: f64,
    /// nrms of a perfect model.
    pub noise_floor_nrms: f64,
    /// Frequency response assurance criterion, 0..1; `None` where model or measurement is zero.
    pub frac: Option<f64>,
    /// One a band of the error map; `None` where nothing was measured.
    #[serde(skip)]
    pub band_nrms: Vec<Option<f64>>,
    /// The same, error over noise: 1 where only noise is left.
    #[serde(skip)]
    pub band_times_noise: Vec<Option<f64>>,
    /// The line on which the error stands highest above the noise.
    pub worst_line: Option<WorstLine>,
}

/// The line of an FRF on which model and measurement differ most against the noise; magnitudes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorstLine {
    /// Hz.
    pub frequency_hz: f64,
    /// |measured|, m/N.
    pub measured_m_per_n: f64,
    /// |model|, m/N.
    pub model_m_per_n: f64,
    /// Standard deviation of the complex value there.
    pub noise_m_per_n: f64,
    /// |model − measured| / noise.
    pub times_noise: f64,
}

impl FrfError {
    /// Error over noise: 1 where only noise is left. A small FRF that drowns in noise has a large nrms, which says
    /// nothing of the model; this does.
    pub fn times_noise(&self) -> f64 {
        if self.noise_floor_nrms > 0.0 {
            self.nrms / self.noise_floor_nrms
        } else {
            f64::INFINITY
        }
    }
}

/// The error map: postures × directions × bands, nrms; `None` where nothing was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorMap {
    /// Their ids, in order of first appearance in the data.
    pub postures: Vec<String>,
    /// Response axis, reference axis: `XX`, `XY`, …
    pub directions: Vec<String>,
    /// Edges, Hz: one more than there are bands.
    pub band_edges_hz: Vec<f64>,
    /// `[posture][direction][band]`.
    pub nrms: Vec<Vec<Vec<Option<f64>>>>,
    /// All bands together: `[posture][direction]`.
    pub posture_direction: Vec<Vec<Option<f64>>>,
    /// The same, error over noise: 1 where only noise is left.
    pub posture_direction_times_noise: Vec<Vec<Option<f64>>>,
    /// Error over noise, `[posture][direction][band]`.
    pub times_noise: Vec<Vec<Vec<Option<f64>>>>,
    /// All directions together: `[posture][band]`.
    pub posture_band: Vec<Vec<Option<f64>>>,
    /// All postures together: `[direction][band]`.
    pub direction_band: Vec<Vec<Option<f64>>>,
    /// Both, error over noise: 1 where only noise is left.
    pub posture_band_times_noise: Vec<Vec<Option<f64>>>,
    /// `[direction][band]`, error over noise.
    pub direction_band_times_noise: Vec<Vec<Option<f64>>>,
}

/// Model against measurement, FRFs as receptance on the measured lines.
#[derive(Debug, Clone)]
pub struct FrfComparison {
    /// Over everything.
    pub totals: ErrorTotals,
    /// One a posture, in order of first appearance.
    pub by_posture: Vec<GroupError>,
    /// Response axis, reference axis: `XX`, `XY`, …
    pub by_direction: Vec<GroupError>,
    /// Node number of the response.
    pub by_point: Vec<GroupError>,
    /// One a band in which something was measured.
    pub by_band: Vec<Band>,
    /// By posture, direction and band.
    pub map: ErrorMap,
    /// Where most of what stands above the noise sits; `None` where nothing does.
    pub mostly: Option<DominantRegion>,
    /// In the order of the data.
    pub frf_errors: Vec<FrfError>,
}

impl FrfComparison {
    /// Numbers of the FRFs in the data, most error against noise first.
    pub fn worst_first(&self) -> Vec<usize> {
        let errors = &self.frf_errors;
        let mut order: Vec<usize> = (0..errors.len()).collect();
        order.sort_by(|&a, &b| errors[b].times_noise().total_cmp(&errors[a].times_noise()));
        order
    }

    /// `predicted`: in the order of `data.frfs()`, on the same lines.
    pub fn new(data: &FrfData, points: &[Point], predicted: &[Vec<Complex64>]) -> Self {
        let edges = band_edges_hz(data);
        let mut total = Sums::default();
        let (mut decibel, mut decibel_count) = (0.0, 0usize);
        let (mut by_posture, mut by_direction, mut by_point) =
            (Groups::default(), Groups::default(), Groups::default());
        let mut bands = vec![Sums::default(); BANDS];
        let mut frf_errors = Vec::new();
        let mut by_frf = Vec::new();
        let mut cells: Vec<(String, String, usize, Sums)> = Vec::new();
        for ((block, frf), model) in data.frfs().zip(predicted) {
            let posture = &data.posture_ids[frf.posture];
            let direction = format!("{}{}", frf.response.axis.letter(), frf.reference.axis.letter());
            let mut own = Sums::default();
            let mut worst_line: Option<WorstLine> = None;
            let mut own_bands = vec![Sums::default(); BANDS];
            for (k, (h, m)) in frf.receptance.iter().zip(model).enumerate() {
                let line = Sums::of_line(*m, *h, frf.noise_std[k]);
                let times_noise = (line.error / line.noise).sqrt();
                if worst_line.is_none_or(|w| times_noise > w.times_noise) {
                    worst_line = Some(WorstLine {
                        frequency_hz: block.frequency_hz[k],
                        measured_m_per_n: h.norm(),
                        model_m_per_n: m.norm(),
                        noise_m_per_n: frf.noise_std[k],
                        times_noise,
                    });
                }
                own.add(line);
                own_bands[band_of(&edges, block.frequency_hz[k])].add(line);
                if h.norm() > 0.0 && m.norm() > 0.0 {
                    decibel += (20.0 * (m.norm() / h.norm()).log10()).abs();
                    decibel_count += 1;
                }
            }
            total.add(own);
            by_posture.add(posture, own);
            by_direction.add(&direction, own);
            let node = points[frf.response.point].node.to_string();
            by_point.add(&node, own);
            by_frf.push((posture.clone(), direction.clone(), node, own));
            frf_errors.push(FrfError {
                name: frf.name.clone(),
                posture: posture.clone(),
                direction: direction.clone(),
                nrms: own.nrms(),
                noise_floor_nrms: own.floor(),
                frac: frac(model, &frf.receptance),
                band_nrms: own_bands.iter().map(Sums::measured_nrms).collect(),
                band_times_noise: own_bands.iter().map(Sums::times_noise).collect(),
                worst_line,
            });
            for (band, sums) in own_bands.iter().enumerate() {
                bands[band].add(*sums);
                cells.push((posture.clone(), direction.clone(), band, *sums));
            }
        }
        let by_posture = by_posture.finish();
        let by_direction = by_direction.finish();
        let map = error_map(&by_posture, &by_direction, &edges, &cells);
        let [mut postures, mut directions, mut nodes] =
            [Amounts::default(), Amounts::default(), Amounts::default()];
        for (posture, direction, node, own) in &by_frf {
            postures.add(posture, excess(own));
            directions.add(direction, excess(own));
            nodes.add(node, excess(own));
        }
        let above: Vec<f64> = bands.iter().map(excess).collect();
        let mostly =
            above_noise(&total).then(|| DominantRegion::new(&edges, &above, &directions, &postures, &nodes));
        FrfComparison {
            totals: ErrorTotals {
                nrms: total.nrms(),
                mean_abs_db: if decibel_count > 0 {
                    decibel / decibel_count as f64
                } else {
                    0.0
                },
                noise_floor_nrms: total.floor(),
            },
            by_posture,
            by_direction,
            by_point: by_point.finish(),
            by_band: bands
                .iter()
                .enumerate()
                .filter(|(_, s)| s.signal > 0.0)
                .map(|(i, s)| Band {
                    from_hz: edges[i],
                    to_hz: edges[i + 1],
                    nrms: s.nrms(),
                    noise_floor_nrms: s.floor(),
                })
                .collect(),
            map,
            mostly,
            frf_errors,
        }
    }
}

/// |Σ a* b|² / (Σ|a|² Σ|b|²): 1 where two FRFs differ by a factor only (Heylen & Lammens 1996). `None` where one is zero.
pub fn frac(a: &[Complex64], b: &[Complex64]) -> Option<f64> {
    let square = |z: &[Complex64]| z.iter().map(|v| v.norm_sqr()).sum::<f64>();
    let product: Complex64 = a.iter().zip(b).map(|(x, y)| x.conj() * y).sum();
    let frac = product.norm_sqr() / (square(a) * square(b));
    frac.is_finite().then_some(frac)
}

fn error_map(
    postures: &[GroupError],
    directions: &[GroupError],
    edges: &[f64],
    cells: &[(String, String, usize, Sums)],
) -> ErrorMap {
    let mut sums = vec![vec![vec![Sums::default(); BANDS]; directions.len()]; postures.len()];
    for (posture, direction, band, cell) in cells {
        let p = postures.iter().position(|g| g.name == *posture);
        let d = directions.iter().position(|g| g.name == *direction);
        if let (Some(p), Some(d)) = (p, d) {
            sums[p][d][*band].add(*cell);
        }
    }
    let (np, nd) = (postures.len(), directions.len());
    let of_posture = |p: usize, b: usize| sums[p].iter().map(|d| d[b]).collect::<Vec<Sums>>();
    let of_direction = |d: usize, b: usize| sums.iter().map(|p| p[d][b]).collect::<Vec<Sums>>();
    ErrorMap {
        posture_direction: together(np, nd, Sums::measured_nrms, |p, d| sums[p][d].clone()),
        posture_direction_times_noise: together(np, nd, Sums::times_noise, |p, d| sums[p][d].clone()),
        posture_band: together(np, BANDS, Sums::measured_nrms, of_posture),
        direction_band: together(nd, BANDS, Sums::measured_nrms, of_direction),
        posture_band_times_noise: together(np, BANDS, Sums::times_noise, of_posture),
        direction_band_times_noise: together(nd, BANDS, Sums::times_noise, of_direction),
        postures: postures.iter().map(|g| g.name.clone()).collect(),
        directions: directions.iter().map(|g| g.name.clone()).collect(),
        band_edges_hz: edges.to_vec(),
        nrms: cell_values(&sums, Sums::measured_nrms),
        times_noise: cell_values(&sums, Sums::times_noise),
    }
}

fn cell_values(sums: &[Vec<Vec<Sums>>], value: fn(&Sums) -> Option<f64>) -> Vec<Vec<Vec<Option<f64>>>> {
    let of_direction = |bands: &Vec<Sums>| bands.iter().map(value).collect();
    sums.iter()
        .map(|p| p.iter().map(of_direction).collect())
        .collect()
}

/// A table of `value` over the sums of each cell.
fn together(
    rows: usize,
    columns: usize,
    value: fn(&Sums) -> Option<f64>,
    cell: impl Fn(usize, usize) -> Vec<Sums>,
) -> Vec<Vec<Option<f64>>> {
    let of_cell = |row, column| {
        let mut total = Sums::default();
        cell(row, column).into_iter().for_each(|s| total.add(s));
        value(&total)
    };
    (0..rows)
        .map(|r| (0..columns).map(|c| of_cell(r, c)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frac_is_one_for_a_factor_and_a_third_for_two_of_three_lines() {
        let line = |re, im| Complex64::new(re, im);
        let a = [line(1.0, 2.0), line(0.0, -1.0), line(3.0, 0.5)];
        let factor = line(-0.3, 2.0);
        let scaled = a.map(|h| h * factor);
        assert!((frac(&a, &scaled).unwrap() - 1.0).abs() < 1e-12);
        let (one, zero) = (line(1.0, 0.0), Complex64::ZERO);
        // |1|² / (3 · 1)
        let third = frac(&[one, one, one], &[zero, line(0.0, 1.0), zero]).unwrap();
        assert!((third - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(frac(&[zero; 3], &a), None);
    }

    #[test]
    fn bands_cover_the_range_without_gaps() {
        let edges = [3.0, 6.0, 12.0, 24.0];
        assert_eq!(band_of(&edges, 3.0), 0);
        assert_eq!(band_of(&edges, 5.99), 0);
        assert_eq!(band_of(&edges, 6.0), 1);
        assert_eq!(band_of(&edges, 24.0), 2);
    }
}
