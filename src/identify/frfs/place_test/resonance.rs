//! The law that stands out most where it is a resonance of something small: g(ω) = c / (1 − (ω/ω₀)² + 2iζω/ω₀), c complex. In
//! a band of lines with one g it hides, as its sign changes within; tried frequency by frequency it has two unknowns for all FRFs.

use std::f64::consts::PI;

use num_complex::Complex64;
use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal};

use super::{Cells, OfModel, Seen, TURNS, along_directions};
use crate::identify::rest::{LIKE_A_RESONANCE, RestTest};

/// Damping ratios that are tried: those between them differ little.
const DAMPING_RATIOS: [f64; 2] = [0.02, 0.06];
/// Half widths of the resonance beyond which it is left out.
const HALF_WIDTHS: f64 = 8.0;
/// Lines of a posture within the resonance's width, at least: fewer hold no shape.
const LINES_WITHIN: f64 = 3.0;
/// ln of the frequency ratio, to either side, over which what noise leaves is taken as one level.
const ONE_LEVEL: f64 = 0.7;

/// One resonance at one place.
pub(super) struct TriedResonance {
    hz: f64,
    /// Index into [`DAMPING_RATIOS`].
    damping: usize,
    /// Independent values of noise in all late turns, for each unknown: lines hold no more than they are.
    independent: f64,
    /// Energy by turn.
    at: [f64; TURNS],
}

/// What noise puts into a pattern, and in how many independent values that was seen.
#[derive(Clone, Copy)]
struct Level {
    energy: f64,
    seen_in: f64,
}

impl TriedResonance {
    /// In its own late turns.
    fn own(&self) -> Level {
        let late = &self.at[1..];
        Level {
            energy: late.iter().sum::<f64>() / late.len() as f64,
            seen_in: UNKNOWNS * self.independent,
        }
    }

    /// In those of resonances nearby, all of one place, were it the same for all of them.
    fn nearby(&self, place: &[TriedResonance]) -> Level {
        let near = |l: &&TriedResonance| l.damping == self.damping && (l.hz / self.hz).ln().abs() < ONE_LEVEL;
        let (mut energy, mut seen_in, mut count) = (0.0, 0.0, 0.0);
        let [mut low, mut high] = [self.hz; 2];
        for looked in place.iter().filter(near) {
            let own = looked.own();
            energy += own.energy;
            seen_in += own.seen_in;
            count += 1.0;
            (low, high) = (low.min(looked.hz), high.max(looked.hz));
        }
        let apart = 1.0 + (high / low).ln() / independent_step(DAMPING_RATIOS[self.damping]);
        Level {
            energy: energy / count,
            seen_in: seen_in / count * apart.min(count),
        }
    }
}

/// Of each resonance, what noise puts into it: its own late turns know it too little, and those nearby need not have the same where the
/// outputs of one hit share noise. Both together (an inverse gamma prior of the level, its width from how much the levels differ: Smyth
/// 2004, eq. 3).
fn levels(places: &[Vec<TriedResonance>]) -> Vec<Vec<Level>> {
    let nearby: Vec<Vec<Level>> = places
        .iter()
        .map(|place| place.iter().map(|looked| looked.nearby(place)).collect())
        .collect();
    let pairs = || {
        places
            .iter()
            .zip(&nearby)
            .flat_map(|(place, nearby)| place.iter().zip(nearby))
    };
    let differ: [f64; DAMPING_RATIOS.len()] = std::array::from_fn(|damping| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (looked, nearby) in pairs().filter(|(l, nearby)| l.damping == damping && nearby.energy > 0.0) {
            let own = looked.own();
            sum += (own.energy / nearby.energy - 1.0).powi(2) - 2.0 / own.seen_in;
            count += 1.0;
        }
        sum / f64::max(count, 1.0)
    });
    let both = |looked: &TriedResonance, nearby: &Level| {
        let own = looked.own();
        let weight = 2.0 / differ[looked.damping].max(2.0 / nearby.seen_in);
        let seen_in = weight + own.seen_in;
        Level {
            energy: (weight * nearby.energy + own.seen_in * own.energy) / seen_in,
            seen_in,
        }
    };
    let of_place = |(place, nearby): (&Vec<TriedResonance>, &Vec<Level>)| {
        let each = place.iter().zip(nearby);
        each.map(|(looked, nearby)| both(looked, nearby)).collect()
    };
    places.iter().zip(&nearby).map(of_place).collect()
}

/// Real and imaginary part of c.
const UNKNOWNS: f64 = 2.0;

/// ln of the ratio of two frequencies at which resonances have little in common: the equivalent width of |g|².
fn independent_step(damping_ratio: f64) -> f64 {
    PI * damping_ratio
}

/// Looks at every other cell for a resonance at one place, `cells` being what is seen there, over so many `postures`.
pub(super) fn look(place: &[Seen], cells: &Cells, postures: usize, model: &OfModel) -> Vec<TriedResonance> {
    let parameters = model.scores.nrows();
    let mut all = Vec::new();
    for (damping, damping_ratio) in DAMPING_RATIOS.into_iter().enumerate() {
        let within = |width: f64| (width / cells.ln_ratio).round() as usize;
        let (half, far) = (within(damping_ratio), within(HALF_WIDTHS * damping_ratio));
        let around = |cell: usize, by: usize| cell.saturating_sub(by)..(cell + by + 1).min(cells.count());
        for cell in (0..cells.count()).step_by(2) {
            let lines = cells.lines[around(cell, half)].iter().sum::<usize>() as f64 / postures as f64;
            if lines < LINES_WITHIN {
                continue;
            }
            let hz = cells.hz(cell);
            let law = |other: usize| {
                let ratio = cells.hz(other) / hz;
                Complex64::new(1.0 - ratio * ratio, 2.0 * damping_ratio * ratio).inv()
            };
            let own = around(cell, far).map(|other| (&place[other], law(other)));
            let along = along_directions(&[Seen::sum(own, parameters)], model);
            let mut at = [0.0; TURNS];
            at.iter_mut()
                .zip(&along)
                .for_each(|(energy, along)| *energy = along.norm_squared());
            if along.iter().all(|along| along.len() as f64 == UNKNOWNS) {
                all.push(TriedResonance {
                    hz,
                    damping,
                    independent: lines.min((TURNS - 1) as f64),
                    at,
                });
            }
        }
    }
    all
}

/// The resonance whose energy is least likely to be noise, as one of all that were looked at; `colour`: noise unturned over
/// noise at the late turns, and its relative standard deviation.
pub(super) fn most_telling(
    places: &[Vec<TriedResonance>],
    cells: &Cells,
    [factor, unsure]: [f64; 2],
) -> Option<RestTest> {
    let law = |seen_in: f64| {
        let known = seen_in.recip() + 0.5 * unsure * unsure;
        FisherSnedecor::new(UNKNOWNS, known.recip()).ok()
    };
    let mut best: Option<(&TriedResonance, f64, f64, FisherSnedecor)> = None;
    for (place, levels) in places.iter().zip(levels(places)) {
        for (looked, level) in place.iter().zip(levels) {
            let expected = factor * level.energy;
            let Some(law) = law(level.seen_in).filter(|_| expected > 0.0) else {
                continue;
            };
            let p = law.sf(looked.at[0] / expected);
            if best.as_ref().is_none_or(|(_, least, ..)| p < *least) {
                best = Some((looked, p, expected, law));
            }
        }
    }
    let (looked, p, expected, law) = best?;
    let width = cells.count() as f64 * cells.ln_ratio;
    let apart: f64 = DAMPING_RATIOS
        .iter()
        .map(|ratio| width / independent_step(*ratio))
        .sum();
    // Between two that have little in common the highest of noise is higher than at either.
    const BETWEEN: f64 = 2.0;
    let looked_at = places.len() as f64 * (BETWEEN * apart).max(1.0);
    // The luckiest of so many finds as much as this in noise, as often as not.
    let luck = law.inverse_cdf(0.5f64.powf(looked_at.recip()));
    let excess = looked.at[0] - luck * expected;
    let p_value = -(looked_at * (-p).ln_1p()).exp_m1();
    // The largest of many with two unknowns each has a long tail: an excess is as many standard deviations as chance makes it.
    let sigmas = -Normal::standard().inverse_cdf(p_value.clamp(f64::MIN_POSITIVE, 0.5));
    Some(RestTest {
        looks_like: LIKE_A_RESONANCE,
        excess,
        std: (excess / sigmas.max(1.0)).max(expected),
        p_value,
        noise_factor: expected / UNKNOWNS,
        frequency_hz: Some(looked.hz),
    })
}
