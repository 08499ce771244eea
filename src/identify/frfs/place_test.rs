//! Whether what a model leaves looks like an unknown law of force over displacement at one place of the structure, the
//! same at all postures: a score test (Rao 1948) at every place, for laws that a fit has not been tried with.
//!
//! A law at a place changes all FRFs by g(ω) b_o b_i ([`super::spot_response`]). With one complex g for each band of lines
//! that is a few unknowns for all FRFs together, against hundreds in the tests of [`crate::identify::rest_patterns`], so
//! that far less stands out from the noise. What noise puts there is measured in the same way, from the same patterns
//! turned from line to line. A law that is a resonance is a single unknown more than its frequency ([`resonance`]).

mod resonance;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use num_complex::Complex64;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::channels::Channels;
use super::frf_data::{FrfBlock, FrfData, FrfDatum};
use super::spot_response::{SpotBasis, free_spots};
use super::structure::StructureModel;
use crate::Result;
use crate::data::Axis;
use crate::effects::Spot;
use crate::identify::rest::{LIKE_A_PLACE, RestCurve, RestTest};
use crate::identify::rest_patterns::{colour, turn};

/// Bands of lines with a g of their own, and lines that each must have at every posture.
const BANDS: usize = 16;
const LINES_PER_BAND: usize = 16;
/// Turns, in sixteenths of a full one, at which patterns hold noise only.
const LATE: std::ops::RangeInclusive<usize> = 4..=12;
const TURNS: usize = 1 + (*LATE.end() - *LATE.start() + 1);
/// What the parameters explain of a pattern up to this share is no pattern of its own.
const COLLINEAR: f64 = 1e-6;

/// Unturned, then late.
fn turns() -> impl Iterator<Item = usize> {
    std::iter::once(0).chain(LATE)
}

/// One place over some lines of all FRFs: |a|², aᴴJ by parameter and aᴴr by turn.
#[derive(Clone)]
struct Seen {
    strength: f64,
    on_parameters: Vec<Complex64>,
    on_rest: [Complex64; TURNS],
}

impl Seen {
    fn nothing(parameters: usize) -> Self {
        Seen {
            strength: 0.0,
            on_parameters: vec![Complex64::ZERO; parameters],
            on_rest: [Complex64::ZERO; TURNS],
        }
    }

    /// Adds what is seen on other lines, of a law that is `g` there.
    fn add(&mut self, other: &Seen, g: Complex64) {
        self.strength += g.norm_sqr() * other.strength;
        let pairs = self.on_parameters.iter_mut().zip(&other.on_parameters);
        pairs.for_each(|(sum, x)| *sum += g.conj() * x);
        self.on_rest
            .iter_mut()
            .zip(other.on_rest)
            .for_each(|(sum, x)| *sum += g.conj() * x);
    }

    /// Adds a line of one FRF, whose pattern there is `a` and which the parameters change by `slopes`, all over σ.
    fn add_pattern(&mut self, a: Complex64, slopes: &[Complex64]) {
        self.strength += a.norm_sqr();
        let pairs = self.on_parameters.iter_mut().zip(slopes);
        pairs.for_each(|(sum, j)| *sum += a.conj() * j);
    }

    /// Adds aᴴr of a line.
    fn add_rest(&mut self, on_rest: Complex64, line: usize) {
        for (sum, turned) in self.on_rest.iter_mut().zip(turns()) {
            *sum += on_rest * turn(turned, line);
        }
    }

    fn sum<'a>(all: impl Iterator<Item = (&'a Seen, Complex64)>, parameters: usize) -> Self {
        let mut sum = Seen::nothing(parameters);
        all.for_each(|(seen, g)| sum.add(seen, g));
        sum
    }
}

/// Where laws are sought.
struct Places {
    spots: Vec<Spot>,
    /// Response and reference, at one point, of what may give way besides the structure: the ground under a sensor or a table, the skin under
    /// the hammer. It adds the same to the FRFs at all postures.
    beside: Vec<[(usize, Axis); 2]>,
}

impl Places {
    fn new(model: &StructureModel, data: &FrfData) -> Self {
        let mut beside: Vec<_> = data.frfs().map(|(_, frf)| pair_of(frf)).collect();
        beside.retain(|[response, reference]| response.0 == reference.0);
        beside.sort_unstable();
        beside.dedup();
        let spots = free_spots(model);
        Places { spots, beside }
    }

    fn count(&self) -> usize {
        self.spots.len() + self.beside.len()
    }
}

/// Point and axis of response and reference.
fn pair_of(frf: &FrfDatum) -> [(usize, Axis); 2] {
    [frf.response, frf.reference].map(|dof| (dof.point, dof.axis))
}

/// Lines side by side, so few that a resonance is the same on all of them.
struct Cells {
    lowest_hz: f64,
    /// ln of the ratio of two cells' frequencies.
    ln_ratio: f64,
    /// Lines of all postures together, by cell.
    lines: Vec<usize>,
}

impl Cells {
    /// ln of the ratio of two cells' frequencies, at least, and cells, at most.
    const LN_RATIO: f64 = 0.01;
    const MOST: f64 = 512.0;

    fn new(data: &FrfData) -> Self {
        let lines = || data.blocks.iter().flat_map(|b| &b.frequency_hz);
        let lowest_hz = lines().copied().fold(f64::INFINITY, f64::min);
        let highest_hz = lines().copied().fold(lowest_hz, f64::max);
        let width = (highest_hz / lowest_hz).ln();
        let mut cells = Cells {
            lowest_hz,
            ln_ratio: Self::LN_RATIO.max(width / Self::MOST),
            lines: Vec::new(),
        };
        cells.lines = vec![0; cells.of(highest_hz) + 1];
        for hz in lines() {
            let cell = cells.of(*hz);
            cells.lines[cell] += 1;
        }
        cells
    }

    fn of(&self, hz: f64) -> usize {
        ((hz / self.lowest_hz).ln() / self.ln_ratio).round() as usize
    }

    /// Frequency of a cell, Hz.
    fn hz(&self, cell: usize) -> f64 {
        self.lowest_hz * (cell as f64 * self.ln_ratio).exp()
    }

    fn count(&self) -> usize {
        self.lines.len()
    }

    /// The first cell of each band, and where the last one ends: about as many lines in each.
    fn bands(&self, bands: usize) -> Vec<usize> {
        let all: usize = self.lines.iter().sum();
        let mut ends = vec![0];
        let mut lines = 0;
        for (cell, own) in self.lines.iter().enumerate() {
            lines += own;
            if lines * bands >= ends.len() * all {
                ends.push(cell + 1);
            }
        }
        ends
    }
}

/// Information on the model's parameters and their scores by turn.
struct OfModel {
    information: Cholesky<f64, Dyn>,
    /// A column a turn.
    scores: DMatrix<f64>,
}

/// The most telling place of a robot in what `model` at `theta`, its optimum on `data`, leaves in `curves`, and the most telling
/// resonance at one. Empty where there are too few lines.
///
/// # Errors
/// A model without a response.
pub(super) fn test(
    model: &StructureModel,
    theta: &[f64],
    data: &FrfData,
    curves: &[RestCurve],
) -> Result<Vec<RestTest>> {
    let fewest = data.blocks.iter().map(|b| b.frequency_hz.len()).min();
    let bands = (fewest.unwrap_or(0) / LINES_PER_BAND).min(BANDS);
    let (Some(colour), true) = (colour(curves), bands > 1) else {
        return Ok(Vec::new());
    };
    let Some(of_model) = of_model(model, theta, curves) else {
        return Ok(Vec::new());
    };
    let places = Places::new(model, data);
    let cells = Cells::new(data);
    let mut first = 0;
    let mut blocks = Vec::new();
    for block in &data.blocks {
        let own = &curves[first..first + block.frfs.len()];
        blocks.push((&**block, own));
        first += block.frfs.len();
    }
    let mut all = vec![Seen::nothing(theta.len()); places.count() * cells.count()];
    // A few blocks at a time: what one holds is large.
    for some in blocks.chunks(rayon::current_num_threads()) {
        let parts: Vec<Vec<Seen>> = some
            .par_iter()
            .map(|(block, curves)| of_block(model, theta, block, curves, &places, &cells))
            .collect::<Result<_>>()?;
        for part in parts {
            let pairs = all.iter_mut().zip(&part);
            pairs.for_each(|(sum, x)| sum.add(x, Complex64::ONE));
        }
    }
    let ends = cells.bands(bands);
    let laws: Vec<Energy> = all
        .par_chunks(cells.count())
        .filter_map(|place| {
            let band = |ends: &[usize]| {
                let own = place[ends[0]..ends[1]].iter().map(|seen| (seen, Complex64::ONE));
                Seen::sum(own, theta.len())
            };
            let bands: Vec<Seen> = ends.windows(2).map(band).collect();
            Energy::of(&bands, &of_model)
        })
        .collect();
    let resonances: Vec<Vec<resonance::TriedResonance>> = all
        .par_chunks(cells.count())
        .map(|place| resonance::look(place, &cells, data.blocks.len(), &of_model))
        .collect();
    let tests = [
        most_telling(&laws, colour),
        resonance::most_telling(&resonances, &cells, colour),
    ];
    Ok(tests.into_iter().flatten().collect())
}

fn of_model(model: &StructureModel, theta: &[f64], curves: &[RestCurve]) -> Option<OfModel> {
    let count = theta.len();
    let each: Vec<(DMatrix<f64>, DMatrix<f64>)> = curves
        .par_iter()
        .map(|curve| {
            let information = DMatrix::from_fn(count, count, |i, j| match j <= i {
                true => product(&curve.slopes[i], &curve.slopes[j]),
                false => 0.0,
            });
            let mut scores = DMatrix::zeros(count, TURNS);
            for (t, turned) in turns().enumerate() {
                let lines = curve.rest.iter().enumerate();
                let rest: Vec<Complex64> = lines.map(|(k, r)| r * turn(turned, k)).collect();
                for (i, slope) in curve.slopes.iter().enumerate() {
                    scores[(i, t)] = product(slope, &rest);
                }
            }
            (information, scores)
        })
        .collect();
    let mut information = DMatrix::<f64>::zeros(count, count);
    let mut scores = DMatrix::zeros(count, TURNS);
    for (own, of_rest) in each {
        information += own;
        scores += of_rest;
    }
    information.fill_upper_triangle_with_lower_triangle();
    for (i, parameter) in model.parameters.iter().enumerate() {
        // Halves, as noise has E|r|² = 1 over both parts of a complex value.
        if let Some(prior) = parameter.prior {
            let [_, slope, curvature] = prior.half_square(theta[i]);
            information[(i, i)] += 0.5 * curvature;
            scores[(i, 0)] += 0.5 * slope;
        }
        information[(i, i)] += 1e-9 * (1.0 + information[(i, i)]);
    }
    let information = information.cholesky()?;
    Some(OfModel { information, scores })
}

fn product(a: &[Complex64], b: &[Complex64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

/// Place after place, cell after cell within.
fn of_block(
    model: &StructureModel,
    theta: &[f64],
    block: &FrfBlock,
    curves: &[RestCurve],
    Places { spots, beside }: &Places,
    cells: &Cells,
) -> Result<Vec<Seen>> {
    let count = theta.len();
    let places = SpotBasis::new(model, theta, block, spots)?;
    let channels = Channels::new(&model.filter(theta, true));
    let mut all = vec![Seen::nothing(count); (spots.len() + beside.len()) * cells.count()];
    let place_beside = |frf: &FrfDatum| beside.iter().position(|pair| *pair == pair_of(frf));
    let places_beside: Vec<Option<usize>> = block.frfs.iter().map(place_beside).collect();
    let mut reach = Vec::new();
    // The slopes of one line together.
    let mut slopes = vec![Complex64::ZERO; block.frfs.len() * count];
    let basis = &places.basis;
    basis.solve_lines(&block.rates(), &basis.outputs(), |line, response| {
        let omega = response.omega();
        let cell = cells.of(block.frequency_hz[line]);
        for (own, curve) in slopes.chunks_exact_mut(count).zip(curves) {
            own.iter_mut()
                .zip(&curve.slopes)
                .for_each(|(s, column)| *s = column[line]);
        }
        for s in 0..spots.len() {
            places.reach(omega, response, s, &mut reach);
            let sums = &mut all[s * cells.count() + cell];
            let mut on_rest = Complex64::ZERO;
            let frfs = block.frfs.iter().zip(curves).zip(slopes.chunks_exact(count));
            for ((frf, curve), slopes) in frfs {
                let pattern = channels.mixed(omega, frf, |out| reach[out]) * reach[frf.input];
                let a = pattern / frf.noise_std[line];
                sums.add_pattern(a, slopes);
                on_rest += a.conj() * curve.rest[line];
            }
            sums.add_rest(on_rest, line);
        }
        let frfs = block.frfs.iter().zip(curves).zip(slopes.chunks_exact(count));
        for (((frf, curve), slopes), beside) in frfs.zip(&places_beside) {
            let Some(beside) = beside else { continue };
            let sums = &mut all[(spots.len() + beside) * cells.count() + cell];
            let a = frf.sign / frf.noise_std[line];
            sums.add_pattern(a.into(), slopes);
            sums.add_rest(a * curve.rest[line], line);
        }
        Ok(())
    })?;
    Ok(all)
}

/// What one place finds.
struct Energy {
    /// Energy in its patterns, unturned.
    found: f64,
    /// Mean of the energies at the late turns.
    expected: f64,
    /// Independent values that noise has there: E²/tr Σ² for energies of mean E and values with the covariance Σ
    /// (Satterthwaite 1946).
    freedom: f64,
    /// Directions.
    values: f64,
}

impl Energy {
    /// `bands`: of one place.
    fn of(bands: &[Seen], model: &OfModel) -> Option<Self> {
        let seen = along_directions(bands, model);
        let (now, late) = seen.split_first()?;
        let expected = late.iter().map(DVector::norm_squared).sum::<f64>() / late.len() as f64;
        let pairs = late
            .iter()
            .enumerate()
            .flat_map(|(i, a)| late[..i].iter().map(move |b| a.dot(b).powi(2)));
        let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
        let values = now.len() as f64;
        let freedom = (expected * expected * count / sum).min(values);
        (freedom > 1.0 && expected > 0.0).then_some(Energy {
            found: now.norm_squared(),
            expected,
            freedom,
            values,
        })
    }
}

/// What is left by turn of laws with a complex size for each of `bands`, where the model's parameters have followed them: along
/// independent directions, of unit variance for white noise of the known level.
fn along_directions(bands: &[Seen], model: &OfModel) -> Vec<DVector<f64>> {
    let unknowns = 2 * bands.len();
    let parameters = model.scores.nrows();
    // Real and imaginary part of each band's g in units of its own information.
    let scale = |i: usize| match bands[i / 2].strength {
        s if s > 0.0 => s.sqrt().recip(),
        _ => 0.0,
    };
    let part = |value: Complex64, i: usize| match i % 2 {
        0 => value.re,
        _ => value.im,
    };
    let cross = DMatrix::from_fn(parameters, unknowns, |p, i| {
        scale(i) * part(bands[i / 2].on_parameters[p], i)
    });
    let scores = DMatrix::from_fn(unknowns, TURNS, |i, t| {
        scale(i) * part(bands[i / 2].on_rest[t], i)
    });
    let follow = model.information.solve(&cross);
    let information = DMatrix::identity(unknowns, unknowns) - cross.tr_mul(&follow);
    let scores = scores - follow.tr_mul(&model.scores);
    let eigen = information.symmetric_eigen();
    let told: Vec<usize> = (0..unknowns)
        .filter(|i| scale(*i) > 0.0 && eigen.eigenvalues[*i] > COLLINEAR)
        .collect();
    let along = eigen.eigenvectors.tr_mul(&scores);
    // Unit variance in each direction for white noise of the known level.
    (0..TURNS)
        .map(|t| {
            DVector::from_iterator(
                told.len(),
                told.iter()
                    .map(|i| along[(*i, t)] * (2.0 / eigen.eigenvalues[*i]).sqrt()),
            )
        })
        .collect()
}

/// The place whose energy is least likely to be noise, as one of all that were looked at; `colour`: noise unturned over
/// noise at the late turns, and its relative standard deviation.
fn most_telling(places: &[Energy], [factor, unsure]: [f64; 2]) -> Option<RestTest> {
    let looked = places.len() as f64;
    let law = |place: &Energy| {
        let known = (place.freedom * (TURNS - 1) as f64).recip() + 0.5 * unsure * unsure;
        FisherSnedecor::new(place.freedom, known.recip()).ok()
    };
    let chance = |place: &Energy| law(place).map(|law| law.sf(place.found / (factor * place.expected)));
    let (place, p) = places
        .iter()
        .filter_map(|place| Some((place, chance(place)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    // The luckiest of so many places finds as much as this in noise, as often as not.
    let luck = law(place)?.inverse_cdf(0.5f64.powf(looked.recip()));
    let expected = factor * place.expected;
    Some(RestTest {
        looks_like: LIKE_A_PLACE,
        excess: place.found - luck * expected,
        std: expected * (2.0 / place.freedom).sqrt().hypot(unsure),
        p_value: -(looked * (-p).ln_1p()).exp_m1(),
        noise_factor: expected / place.values,
        frequency_hz: None,
    })
}
