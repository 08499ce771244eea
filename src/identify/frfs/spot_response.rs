//! What an unknown law at a place of the structure can change in the FRFs, line by line, and what the parameters of the
//! model can: the linear algebra of "which place explains the residual".
//!
//! A law of force over displacement at one displacement of the structure changes the receptance matrix by a matrix of rank
//! one, ΔH_oi = b_o g b_i (Sherman and Morrison 1950; the added-part form of frequency-based substructuring, de Klerk,
//! Rixen and Voormeeren 2008). For a dynamic stiffness z in parallel with a displacement d that the model has, b = Y_d· and
//! g = −z/(1 + z Y_dd). For a displacement q that the model takes for stiff, with dynamic stiffness κ,
//! b_o = r_qo + ω² Y(m_q, o) and g = 1/(κ + Z_qq), Z_qq = −ω² m_qq − ω⁴ Y(m_q, m_q), where m_q is the mass that couples q
//! with the model's coordinates.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;

use crate::Result;
use crate::effects::Spot;
use crate::identify::frfs::channels::Channels;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData};
use crate::identify::frfs::structure::StructureModel;
use crate::robot::frf::Response;
use crate::robot::{Dual, Element, FrfBasis, Role};

/// Spots that are not taken by a drawn part of the model.
pub fn free_spots(model: &StructureModel) -> Vec<Spot> {
    let spec = &model.robot.spec;
    let taken: Vec<Option<String>> = model.effects().iter().map(|e| e.instance.site.label()).collect();
    Spot::parallel(spec)
        .into_iter()
        .chain(Spot::series(spec))
        .filter(|spot| !taken.contains(&Some(spot.label())))
        .collect()
}

/// One line of one block seen from one spot, FRFs whitened by their noise.
#[derive(Debug, Clone, Copy)]
pub struct SpotLine {
    /// |a|² of the pattern a = b_o b_i over the FRFs.
    pub strength: f64,
    /// aᴴ r, r measured less model.
    pub on_residual: Complex64,
    /// Y_dd of a parallel spot, Z_qq of a series spot.
    pub own: Complex64,
}

/// Lines of all blocks.
#[derive(Debug, Clone)]
pub struct SpotResponses {
    /// In the order of [`at`](Self::at) within a line.
    pub spots: Vec<Spot>,
    /// Number of the model's parameters.
    pub parameters: usize,
    /// Frequency (Hz) and block of each line.
    pub lines: Vec<(f64, usize)>,
    /// Spot after spot within a line.
    pub at: Vec<SpotLine>,
    /// aᴴ J: parameters of a spot after each other, spot after spot within a line.
    pub on_parameters: Vec<Complex64>,
    /// Re Jᴴ J and Re Jᴴ r over everything.
    pub information: DMatrix<f64>,
    /// Re Jᴴ r over everything.
    pub score: DVector<f64>,
    /// Σ|r|².
    pub square: f64,
    /// Complex values.
    pub values: usize,
}

/// A displacement's row in the model's coordinates; for a series spot the mass coupling, with what stands in parallel with it.
struct SpotRow {
    row: DVector<f64>,
    /// Series: mass of the displacement itself and displacement of each output per unit of it.
    series: Option<(f64, Vec<f64>)>,
}

impl SpotResponses {
    /// `theta` on the solver's scale.
    ///
    /// # Errors
    /// A model that cannot be set up at `theta`.
    pub fn new(model: &StructureModel, theta: &[f64], data: &FrfData, spots: &[Spot]) -> Result<Self> {
        let parts: Vec<Self> = data
            .blocks
            .par_iter()
            .enumerate()
            .map(|(b, block)| Self::of_block(model, theta, (b, block), spots))
            .collect::<Result<_>>()?;
        let count = theta.len();
        let mut all = Self::empty(spots, count);
        for part in parts {
            all.lines.extend(part.lines);
            all.at.extend(part.at);
            all.on_parameters.extend(part.on_parameters);
            all.information += part.information;
            all.score += part.score;
            all.square += part.square;
            all.values += part.values;
        }
        Ok(all)
    }

    fn empty(spots: &[Spot], count: usize) -> Self {
        SpotResponses {
            spots: spots.to_vec(),
            parameters: count,
            lines: Vec::new(),
            at: Vec::new(),
            on_parameters: Vec::new(),
            information: DMatrix::zeros(count, count),
            score: DVector::zeros(count),
            square: 0.0,
            values: 0,
        }
    }

    fn of_block(
        model: &StructureModel,
        theta: &[f64],
        (index, block): (usize, &FrfBlock),
        spots: &[Spot],
    ) -> Result<Self> {
        let count = theta.len();
        let with_slopes = model.basis(theta, block, true)?;
        let places = SpotBasis::new(model, theta, block, spots)?;
        let channels = Channels::new(&model.filter(theta, true));

        let mut reach = Vec::new();
        let mut slope = vec![Complex64::ZERO; count];
        let frfs = block.frfs.len();
        let mut residual = vec![Complex64::ZERO; frfs];
        let mut jacobian = vec![Complex64::ZERO; frfs * count];
        let mut part = Self::empty(spots, count);
        with_slopes.solve_lines_with_slopes(&block.rates(), &block.inputs(), |line, sloped, slopes| {
            let omega = sloped.omega();
            let response = places.basis.solve(omega)?;
            for (k, frf) in block.frfs.iter().enumerate() {
                let weight = 1.0 / frf.noise_std[line];
                let modelled = channels.measured(frf, &with_slopes, sloped);
                residual[k] = (frf.receptance[line] - modelled) * weight;
                channels.slopes(
                    frf,
                    modelled,
                    (&with_slopes, sloped),
                    slopes.along(frf.input),
                    &mut slope,
                );
                for (p, s) in slope.iter().enumerate() {
                    jacobian[k * count + p] = s * weight;
                }
            }
            for k in 0..frfs {
                let own = &jacobian[k * count..(k + 1) * count];
                part.square += residual[k].norm_sqr();
                for p in 0..count {
                    part.score[p] += (own[p].conj() * residual[k]).re;
                    for q in 0..=p {
                        part.information[(p, q)] += (own[p].conj() * own[q]).re;
                    }
                }
            }
            part.values += frfs;
            part.lines.push((block.frequency_hz[line], index));
            for s in 0..spots.len() {
                let own = places.reach(omega, &response, s, &mut reach);
                let mut at = SpotLine {
                    strength: 0.0,
                    on_residual: Complex64::ZERO,
                    own,
                };
                let start = part.on_parameters.len();
                part.on_parameters.resize(start + count, Complex64::ZERO);
                for (k, frf) in block.frfs.iter().enumerate() {
                    let a =
                        channels.mixed(omega, frf, |out| reach[out]) * reach[frf.input] / frf.noise_std[line];
                    at.strength += a.norm_sqr();
                    at.on_residual += a.conj() * residual[k];
                    let own = &jacobian[k * count..(k + 1) * count];
                    for (sum, j) in part.on_parameters[start..].iter_mut().zip(own) {
                        *sum += a.conj() * j;
                    }
                }
                part.at.push(at);
            }
            Ok(())
        })?;
        part.information.fill_upper_triangle_with_lower_triangle();
        Ok(part)
    }

    /// What is seen from spot `s` on line `l`.
    pub fn line(&self, l: usize, s: usize) -> (&SpotLine, &[Complex64]) {
        let i = l * self.spots.len() + s;
        (
            &self.at[i],
            &self.on_parameters[i * self.parameters..(i + 1) * self.parameters],
        )
    }
}

/// What a block's outputs see of the spots.
pub(super) struct SpotBasis {
    rows: Vec<SpotRow>,
    /// The block's outputs, then the rows of the spots.
    pub basis: FrfBasis,
    outputs: usize,
}

impl SpotBasis {
    pub fn new(model: &StructureModel, theta: &[f64], block: &FrfBlock, spots: &[Spot]) -> Result<Self> {
        let (rows, mut all_rows) = spot_rows(model, theta, block, spots);
        let chain = model.chain(theta, &block.kinematics, block.conditions, false);
        let outputs = all_rows.len();
        all_rows.extend(rows.iter().map(|r| r.row.clone()));
        let basis = FrfBasis::new(&chain.system(0), &all_rows)?;
        Ok(SpotBasis { rows, basis, outputs })
    }

    /// b of spot `s` at each output, into `reach`; Y_dd of a parallel spot, Z_qq of a series spot. `response`: of
    /// [`basis`](Self::basis) at `omega`.
    pub fn reach(&self, omega: f64, response: &Response, s: usize, reach: &mut Vec<Complex64>) -> Complex64 {
        let row = self.outputs + s;
        let series = self.rows[s].series.as_ref();
        reach.clear();
        reach.extend((0..self.outputs).map(|output| {
            let along = self.basis.receptance(response, row, output);
            match series {
                Some((_, moves)) => moves[output] + omega * omega * along,
                None => along,
            }
        }));
        let inner = self.basis.receptance(response, row, row);
        match series {
            Some((mass, _)) => -omega * omega * mass - omega.powi(4) * inner,
            None => inner,
        }
    }
}

/// Rows of the spots in the model's coordinates, and the rows of the block's outputs.
fn spot_rows(
    model: &StructureModel,
    theta: &[f64],
    block: &FrfBlock,
    spots: &[Spot],
) -> (Vec<SpotRow>, Vec<DVector<f64>>) {
    let kinematics = &*model.kinematics_at(theta, &block.kinematics);
    let chain = model.chain(theta, &block.kinematics, block.conditions, false);
    let output_rows = |chain: &crate::robot::Chain| model.output_rows(theta, chain, block);
    let outputs = output_rows(&chain);
    // All series spots at once, behind the model's own elements.
    let mut extended = chain.clone();
    let mut added = Vec::new();
    for spot in spots {
        added.push(spot.twist(kinematics).map(|(place, at, twist)| {
            extended.elements.push(Element {
                role: Role::Bearing,
                place,
                at,
                directions: vec![twist],
                shape: DMatrix::identity(1, 1),
                stiffness: Dual::constant(1.0),
                damping: None,
            });
            extended.elements.len() - 1
        }));
    }
    let own_elements: usize = chain.elements.iter().map(|e| e.directions.len()).sum();
    let new = extended.elements.len() - chain.elements.len();
    let total = chain.coordinate_count();
    let system = extended.system(0);
    let extended_outputs = output_rows(&extended);
    // The branches' coordinates stand behind those of the elements.
    let moved = |i: usize| if i < own_elements { i } else { i + new };
    let rows = spots
        .iter()
        .zip(added)
        .map(|(spot, added)| match added {
            Some(element) => {
                let q = own_elements + (element - chain.elements.len());
                SpotRow {
                    row: DVector::from_fn(total, |i, _| system.mass[(moved(i), q)]),
                    series: Some((
                        system.mass[(q, q)],
                        extended_outputs.iter().map(|r| r[q]).collect(),
                    )),
                }
            }
            None => {
                let grip = spot.grip(kinematics, &chain.elements);
                SpotRow {
                    row: grip.map_or_else(|| DVector::zeros(total), |grip| chain.grip_row(&grip)),
                    series: None,
                }
            }
        })
        .collect();
    (rows, outputs)
}
