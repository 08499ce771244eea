//! FRFs from raw tap tests: hits are found and judged, windowed, averaged.
//!
//! A force window leaves only what the hammer did until the force stays within its noise; where the response has not died out at the end of the block, the same
//! exponential window on force and response ends it. Multiplying both by e^(−t/τ) shifts every pole by −1/τ
//! (McConnell & Varoto 2008, ch. 5), so the damping that it adds is known: ζ_true = ζ_fit − 1/(τ ω).

use num_complex::Complex64;
use realfft::RealFftPlanner;

use super::hits::{self, Hit};
use crate::signal::median;
use crate::statistics::quantile;
use crate::{InputError, Result};

/// The window ends the response at this part of its size …
const END_LEVEL: f64 = 0.01;
/// … where it has not fallen below this by itself.
const DIED_OUT: f64 = 0.02;
/// Force power below this part of its largest excites nothing.
const EXCITED: f64 = 0.01;
/// Where a double hit leaves less than this part of the force's power, its spectrum has a hole.
const HOLE: f64 = 0.01;
/// A hit whose misfit to the others' FRF is this many times the usual one, and this large, is inconsistent.
const INCONSISTENT: [f64; 2] = [6.0, 0.05];
/// Where the usual misfit (share of the response's power) is this large, no hit says anything about another.
const CONTRADICTORY: f64 = 0.5;

/// Estimator of the FRF from averaged spectra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Estimator {
    /// S_xf/S_ff: noise on the response averages out.
    #[default]
    H1,
    /// S_xx/S_fx: noise on the force averages out.
    H2,
    /// Geometric mean of both, with the phase of either.
    Hv,
}

/// A raw record of one hammer and several sensors.
#[derive(Debug, Clone, Copy)]
pub struct TapRecord<'a> {
    /// Sampling rate, Hz.
    pub sample_rate_hz: f64,
    /// Force of the hammer, N.
    pub force_n: &'a [f64],
    /// Same length as the force, any unit.
    pub responses: &'a [&'a [f64]],
}

/// How to make FRFs of hits.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TapSettings {
    /// How force and response are averaged over the hits.
    pub estimator: Estimator,
    /// Length of a block; from the distance of the hits where `None`.
    pub block_s: Option<f64>,
    /// What the FRFs are needed for: from, to in Hz; all that the hammer excites where `None`.
    pub band_hz: Option<[f64; 2]>,
}

/// FRFs of one record.
#[derive(Debug, Clone, PartialEq)]
pub struct TapFrfs {
    /// From 0 Hz up to where the hammer still excites.
    pub frequency_hz: Vec<f64>,
    /// By response: response unit per newton.
    pub frf: Vec<Vec<Complex64>>,
    /// By response, 0..1; `None` with a single hit, where it is one by definition.
    pub coherence: Option<Vec<Vec<f64>>>,
    /// All hits found, those left out too.
    pub hits: Vec<Hit>,
    /// Length of a block, s.
    pub block_s: f64,
    /// 1/τ of the exponential window (0 without one): what it adds to ζω of every mode.
    pub added_decay_per_s: f64,
    /// Most hits differ from what the others predict: other points or directions, or noise as large as the response.
    pub contradictory: bool,
    /// What changes the result, in words.
    pub warnings: Vec<String>,
}

struct Block {
    hit: usize,
    force: Vec<Complex64>,
    responses: Vec<Vec<Complex64>>,
}

/// FRFs from a record of hits.
///
/// # Errors
/// Channels of different length, no hit, or no good one.
pub fn impact_test(record: &TapRecord, settings: &TapSettings) -> Result<TapFrfs> {
    let samples = record.force_n.len();
    if record.responses.iter().any(|r| r.len() != samples) || !(record.sample_rate_hz > 0.0) {
        return Err(InputError::new("the channels of a tap record are not of one length and rate").into());
    }
    let finite = record
        .responses
        .iter()
        .chain([&record.force_n])
        .all(|c| c.iter().all(|x| x.is_finite()));
    if !finite {
        return Err(InputError::new("the tap record holds values that are not numbers").into());
    }
    let mut warnings = Vec::new();
    let baseline = median(record.force_n);
    let mut force: Vec<f64> = record.force_n.iter().map(|f| f - baseline).collect();
    let (low, high) = force
        .iter()
        .fold((0.0f64, 0.0f64), |(l, h), &f| (l.min(f), h.max(f)));
    if -low > high {
        warnings.push("the hammer pushes in the negative direction: its sign is kept in the FRFs".into());
        force.iter_mut().for_each(|f| *f = -*f);
    }
    let mut found = hits::find(&force, record.responses, record.sample_rate_hz, settings.block_s);
    if found.hits.is_empty() {
        return Err(InputError::new("no hit found in the force channel")
            .remedy("check which channel is the hammer; a hit must stand ten times out of its noise")
            .into());
    }
    let sign = if -low > high { -1.0 } else { 1.0 };
    let decay_per_s = added_decay(record, &found);
    let resolution_hz = record.sample_rate_hz / found.block as f64;
    let mut blocks = spectra(record, &force, sign, &found, decay_per_s);
    blocks.retain(|block| {
        let hit = &mut found.hits[block.hit];
        let Some(second) = &hit.second else { return true };
        let hole = hole_hz(&block.force, resolution_hz, settings.band_hz);
        hit.left_out = hole.map(|f| format!("{second} leaves a hole in the force's spectrum at {f:.0} Hz"));
        hole.is_none()
    });
    let (kept, contradictory) = consistent(&blocks, &mut found.hits);
    if contradictory {
        warnings.push(
            "most hits contradict each other: other points or directions, or noise as large as the response"
                .into(),
        );
    }
    let good: Vec<&Block> = blocks.iter().filter(|b| kept.contains(&b.hit)).collect();
    let left_out: Vec<String> = found
        .hits
        .iter()
        .enumerate()
        .filter_map(|(k, h)| {
            Some(format!(
                "hit {} at {:.2} s: {}",
                k + 1,
                h.time_s,
                h.left_out.as_ref()?
            ))
        })
        .collect();
    if good.is_empty() {
        return Err(InputError::new(format!("no good hit: {}", left_out.join("; ")))
            .remedy("tap again: single, clean hits, with the response died out before the next")
            .into());
    }
    if !left_out.is_empty() {
        warnings.push(format!(
            "{} of {} hits left out: {}",
            left_out.len(),
            found.hits.len(),
            left_out.join("; ")
        ));
    }
    if good.len() == 1 {
        warnings.push("a single good hit: no coherence, noise is not averaged".into());
    }
    if decay_per_s > 0.0 {
        warnings.push(format!(
            "the responses have not died out after {:.2} s: exponential window, adds {:.2}/s to ζω, taken out of the \
             damping ratios",
            found.block as f64 / record.sample_rate_hz,
            decay_per_s
        ));
    }
    let (excited, all) = (excited_lines(&good), good[0].force.len());
    let excited_hz = excited.saturating_sub(1) as f64 * resolution_hz;
    // Who asks for more has it.
    let wanted = settings
        .band_hz
        .map_or(0, |[_, to]| (to / resolution_hz) as usize + 1);
    let lines = excited.max(wanted.min(all));
    let unused = settings
        .band_hz
        .is_none_or(|[_, to]| to > excited_hz + resolution_hz);
    if excited < all && unused {
        let above =
            format!("the hammer excites up to {excited_hz:.0} Hz: above, its force is more than 20 dB down");
        warnings.push(match settings.band_hz {
            Some([_, to]) => {
                format!("{above}, and lines to {to:.0} Hz are used as the band wants it: noise counts for more there")
            }
            None => format!("{above}, and lines are not used (a band that reaches further takes them)"),
        });
    }
    let (mut frf, mut coherence) = (Vec::new(), Vec::new());
    for response in 0..record.responses.len() {
        let (h, gamma2) = average(&good, response, lines, settings.estimator);
        frf.push(h);
        coherence.push(gamma2);
    }
    Ok(TapFrfs {
        frequency_hz: (0..lines).map(|k| k as f64 * resolution_hz).collect(),
        frf,
        coherence: (good.len() > 1).then_some(coherence),
        hits: found.hits,
        block_s: found.block as f64 / record.sample_rate_hz,
        added_decay_per_s: decay_per_s,
        contradictory,
        warnings,
    })
}

/// 1/τ that ends the slowest response, 0 where all die out.
fn added_decay(record: &TapRecord, found: &hits::Hits) -> f64 {
    let mut worst: f64 = 0.0;
    for hit in found.hits.iter().filter(|h| h.left_out.is_none()) {
        for response in record.responses {
            let to = (hit.from + found.block).min(response.len());
            let after = &response[hit.contact[1].min(to)..to];
            let quarter = after.len() / 8;
            if quarter < 4 {
                continue;
            }
            let size = |s: &[f64]| {
                let mean = s.iter().sum::<f64>() / s.len() as f64;
                (s.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / s.len() as f64).sqrt()
            };
            // What was there before the hit is noise and does not die out.
            let noise = size(&response[hit.from..hit.contact[0].max(hit.from + 2)]);
            let (first, last) = (size(&after[..quarter]), size(&after[after.len() - quarter..]));
            let left = (last * last - noise * noise).max(0.0).sqrt();
            if first > 0.0 {
                worst = worst.max(left / first);
            }
        }
    }
    if worst < DIED_OUT {
        return 0.0;
    }
    let length_s = found.block as f64 / record.sample_rate_hz;
    (worst / END_LEVEL).ln() / length_s
}

fn spectra(record: &TapRecord, force: &[f64], sign: f64, found: &hits::Hits, decay_per_s: f64) -> Vec<Block> {
    let mut planner = RealFftPlanner::<f64>::new();
    let plan = planner.plan_fft_forward(found.block);
    let rate = record.sample_rate_hz;
    let transform = |mut samples: Vec<f64>| {
        let mut out = plan.make_output_vec();
        // Lengths are those of the plan.
        let done = plan.process(&mut samples, &mut out);
        debug_assert!(done.is_ok());
        out
    };
    found
        .hits
        .iter()
        .enumerate()
        .filter(|(_, hit)| hit.left_out.is_none())
        .map(|(index, hit)| {
            let origin = hit.contact[0] - hit.from;
            let fade = |k: usize| (-decay_per_s * (k as f64 - origin as f64).max(0.0) / rate).exp();
            // As much again as the contact before it, and after it until the force is over; with raised-cosine edges.
            let margin = (hit.contact[1] - hit.contact[0] + 1).max(4);
            let (open, close) = (hit.contact[0].saturating_sub(margin), hit.force_until);
            let fall = (0.5 * (close - hit.contact[1]) as f64).max(1.0);
            let windowed = (0..found.block).map(|k| {
                let at = hit.from + k;
                let before = open.saturating_sub(at) as f64 / margin as f64;
                let after = at.saturating_sub(close) as f64 / fall;
                let window = 0.5 * (1.0 + (std::f64::consts::PI * before.max(after).min(1.0)).cos());
                force.get(at).map_or(0.0, |f| sign * f * window * fade(k))
            });
            let force = transform(windowed.collect());
            let responses = record
                .responses
                .iter()
                .map(|r| {
                    // Offset of the sensor: what it shows before the hit.
                    let before = &r[hit.from..hit.contact[0].max(hit.from + 1)];
                    let offset = before.iter().sum::<f64>() / before.len() as f64;
                    let block =
                        (0..found.block).map(|k| r.get(hit.from + k).map_or(0.0, |x| (x - offset) * fade(k)));
                    transform(block.collect())
                })
                .collect();
            Block {
                hit: index,
                force,
                responses,
            }
        })
        .collect()
}

/// Indices of the hits that agree with the others; the rest is marked. Where most disagree nobody can say which are
/// right: then it is all of them, and true.
fn consistent(blocks: &[Block], hits: &mut [Hit]) -> (Vec<usize>, bool) {
    let all: Vec<usize> = blocks.iter().map(|b| b.hit).collect();
    if blocks.len() < 2 {
        return (all, false);
    }
    let everything: Vec<&Block> = blocks.iter().collect();
    let lines = excited_lines(&everything);
    let misfit: Vec<f64> = blocks
        .iter()
        .map(|block| {
            let others: Vec<&Block> = blocks.iter().filter(|b| b.hit != block.hit).collect();
            (0..block.responses.len())
                .map(|r| {
                    // The median over the others, line by line: one bad hit among them does not count.
                    let (mut error, mut total) = (0.0, 0.0);
                    for k in 1..lines {
                        let part = |of: fn(Complex64) -> f64| {
                            let values: Vec<f64> = others
                                .iter()
                                .map(|b| of(b.responses[r][k] / b.force[k]))
                                .collect();
                            median(&values)
                        };
                        let usual = Complex64::new(part(|z| z.re), part(|z| z.im));
                        error += (block.responses[r][k] - usual * block.force[k]).norm_sqr();
                        total += block.responses[r][k].norm_sqr();
                    }
                    if total > 0.0 { error / total } else { 0.0 }
                })
                .fold(0.0, f64::max)
        })
        .collect();
    let usual = quantile(misfit.iter().copied(), 0.4).unwrap_or(f64::INFINITY);
    // Of two nobody can say which is right.
    if blocks.len() == 2 {
        return (all, usual > CONTRADICTORY);
    }
    let mut kept = Vec::new();
    for (block, misfit) in blocks.iter().zip(&misfit) {
        if *misfit > (INCONSISTENT[0] * usual).max(INCONSISTENT[1]) {
            hits[block.hit].left_out = Some(format!(
                "inconsistent: its response differs from what the other hits predict by {:.0} %",
                100.0 * misfit.sqrt().min(9.99)
            ));
        } else {
            kept.push(block.hit);
        }
    }
    if 2 * kept.len() <= blocks.len() || usual > CONTRADICTORY {
        for block in blocks {
            hits[block.hit].left_out = None;
        }
        return (all, true);
    }
    (kept, false)
}

/// The lowest line within the band where the force has much less power than above, between lines that it excites.
fn hole_hz(force: &[Complex64], resolution_hz: f64, band_hz: Option<[f64; 2]>) -> Option<f64> {
    let [from, to] = band_hz.unwrap_or([0.0, f64::INFINITY]);
    let power: Vec<f64> = force.iter().map(|f| f.norm_sqr()).collect();
    let excited = EXCITED * power.iter().copied().fold(0.0, f64::max);
    let lowest = power.iter().position(|p| *p >= excited)?;
    let (mut level, mut hole) = (0.0, None);
    for (k, &power) in power.iter().enumerate().skip(lowest).rev() {
        let line_hz = k as f64 * resolution_hz;
        if power < HOLE * level && (from..=to).contains(&line_hz) {
            hole = Some(line_hz);
        }
        if power >= excited {
            level = power.max(level);
        }
    }
    hole
}

/// Lines from 0 Hz that the hammer excites.
fn excited_lines(blocks: &[&Block]) -> usize {
    let count = blocks.first().map_or(0, |b| b.force.len());
    let power: Vec<f64> = (0..count)
        .map(|k| blocks.iter().map(|b| b.force[k].norm_sqr()).sum())
        .collect();
    let largest = power.iter().copied().fold(0.0, f64::max);
    // The first line at which the smoothed force has fallen: beyond it only side lobes.
    let reach = (count / 200).max(2);
    for k in 0..count {
        let near = &power[k.saturating_sub(reach)..(k + reach + 1).min(count)];
        if near.iter().sum::<f64>() < EXCITED * largest * near.len() as f64 {
            return k.max(8).min(count);
        }
    }
    count
}

fn average(
    blocks: &[&Block],
    response: usize,
    lines: usize,
    estimator: Estimator,
) -> (Vec<Complex64>, Vec<f64>) {
    (0..lines)
        .map(|k| {
            let (mut sff, mut sxx, mut sxf) = (0.0, 0.0, Complex64::ZERO);
            for block in blocks {
                let (f, x) = (block.force[k], block.responses[response][k]);
                sff += f.norm_sqr();
                sxx += x.norm_sqr();
                sxf += x * f.conj();
            }
            let h1 = sxf / sff;
            // S_xx/S_fx with S_fx = conj(S_xf).
            let h2 = if sxf.norm_sqr() > 0.0 {
                sxx / sxf.conj()
            } else {
                Complex64::ZERO
            };
            let h = match estimator {
                Estimator::H1 => h1,
                Estimator::H2 => h2,
                Estimator::Hv => Complex64::from_polar((h1.norm() * h2.norm()).sqrt(), h1.arg()),
            };
            let gamma2 = if sff * sxx > 0.0 {
                (sxf.norm_sqr() / (sff * sxx)).min(1.0)
            } else {
                0.0
            };
            (
                if h.re.is_finite() && h.im.is_finite() {
                    h
                } else {
                    Complex64::ZERO
                },
                gamma2,
            )
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::modal::{Settings, analyse_frf};

    const RATE_HZ: f64 = 2000.0;
    const F0_HZ: f64 = 12.0;
    const MASS_KG: f64 = 50.0;

    struct Bench {
        force: Vec<f64>,
        acceleration: Vec<f64>,
    }

    /// Half-sine hits of 4 ms on a mass on a spring, and noise.
    fn bench(zeta: f64, hits: &[(f64, f64)], length_s: f64) -> Bench {
        answer(zeta, struck(hits, length_s))
    }

    /// Force of hits (time in s, peak in N).
    fn struck(hits: &[(f64, f64)], length_s: f64) -> Vec<f64> {
        let n = (length_s * RATE_HZ) as usize;
        let mut force = vec![0.0; n];
        for &(at_s, peak_n) in hits {
            let from = (at_s * RATE_HZ) as usize;
            for k in 0..8 {
                force[from + k] += peak_n * (std::f64::consts::PI * (k as f64 + 0.5) / 8.0).sin();
            }
        }
        force
    }

    /// Exact acceleration by the impulse response, and noise.
    fn answer(zeta: f64, mut force: Vec<f64>) -> Bench {
        let (w0, dt) = (std::f64::consts::TAU * F0_HZ, 1.0 / RATE_HZ);
        let (mut x, mut v) = (0.0f64, 0.0f64);
        let mut acceleration = Vec::with_capacity(force.len());
        // Many small steps: the error of the integration is far below the marks.
        const STEPS: usize = 40;
        for f in &force {
            let a = |x: f64, v: f64| f / MASS_KG - 2.0 * zeta * w0 * v - w0 * w0 * x;
            acceleration.push(a(x, v));
            for _ in 0..STEPS {
                let h = dt / STEPS as f64;
                let middle = (x + 0.5 * h * v, v + 0.5 * h * a(x, v));
                (x, v) = (x + h * middle.1, v + h * a(middle.0, middle.1));
            }
        }
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for (f, a) in force.iter_mut().zip(&mut acceleration) {
            *f += random.random_range(-0.2..0.2);
            *a += random.random_range(-0.002..0.002);
        }
        Bench { force, acceleration }
    }

    fn frfs(bench: &Bench) -> Result<TapFrfs> {
        frfs_in(bench, None)
    }

    fn frfs_in(bench: &Bench, band_hz: Option<[f64; 2]>) -> Result<TapFrfs> {
        let record = TapRecord {
            sample_rate_hz: RATE_HZ,
            force_n: &bench.force,
            responses: &[&bench.acceleration],
        };
        let settings = TapSettings {
            band_hz,
            ..TapSettings::default()
        };
        impact_test(&record, &settings)
    }

    /// Largest relative error of the accelerance's size between `from` and `to` Hz. (The force is held over a sample, which
    /// is half a sample's delay.)
    fn error(found: &TapFrfs, zeta: f64, from: f64, to: f64) -> f64 {
        let lines = found.frequency_hz.iter().zip(&found.frf[0]);
        let inside = lines.filter(|(f, _)| (from..=to).contains(*f));
        let errors = inside.map(|(f, h)| {
            let (r, m) = (f / F0_HZ, MASS_KG);
            let exact = -r * r / (m * Complex64::new(1.0 - r * r, 2.0 * zeta * r));
            (h.norm() / exact.norm() - 1.0).abs()
        });
        errors.fold(0.0, f64::max)
    }

    fn left_out(found: &TapFrfs) -> Vec<String> {
        found.hits.iter().filter_map(|h| h.left_out.clone()).collect()
    }

    #[test]
    fn force_after_the_contact_counts() {
        // The hammer still pushes with 4 % for 20 ms: an eighth of the impulse.
        let mut force = struck(&[(1.0, 300.0), (5.0, 250.0), (9.0, 320.0)], 13.0);
        for (at_s, peak_n) in [(1.0, 300.0), (5.0, 250.0), (9.0, 320.0)] {
            let from = (at_s * RATE_HZ) as usize + 8;
            force[from..from + 40]
                .iter_mut()
                .for_each(|f| *f += 0.04 * peak_n);
        }
        let found = frfs(&answer(0.03, force)).unwrap();
        assert_eq!(left_out(&found), [""; 0]);
        let error = error(&found, 0.03, 8.0, 40.0);
        assert!(error < 0.02, "{error}");
    }

    #[test]
    fn a_second_touch_is_a_part_of_the_force_unless_it_leaves_holes() {
        let hits = |second: f64| [(1.0, 300.0), (1.012, second), (5.0, 300.0), (9.0, 280.0)];
        let soft = frfs(&bench(0.03, &hits(60.0), 13.0)).unwrap();
        assert_eq!(left_out(&soft), [""; 0]);
        assert!(error(&soft, 0.03, 8.0, 40.0) < 0.02);
        // As hard, 12 ms later: no force around 1/(2·12 ms) = 41.7 Hz.
        let hard = bench(0.03, &hits(300.0), 13.0);
        let told = left_out(&frfs(&hard).unwrap());
        assert_eq!(told.len(), 1, "{told:?}");
        // The peak lies between two samples.
        assert!(
            told[0].starts_with("double hit: a second one of 100 % after 12."),
            "{told:?}"
        );
        let (_, at) = told[0].split_once("a hole in the force's spectrum at ").unwrap();
        let at_hz: f64 = at.trim_end_matches(" Hz").parse().unwrap();
        assert!((37.0..42.0).contains(&at_hz), "{told:?}");
        // Where nobody looks a hole does no harm.
        assert_eq!(left_out(&frfs_in(&hard, Some([5.0, 30.0])).unwrap()), [""; 0]);
    }

    #[test]
    fn a_hit_is_judged_by_its_own_peak() {
        // 10 % of the soft hit, 3 % of the hard one.
        let alone = frfs(&bench(
            0.03,
            &[(1.0, 100.0), (1.06, 10.0), (5.0, 100.0), (9.0, 100.0)],
            13.0,
        ));
        let beside_hard = frfs(&bench(
            0.03,
            &[(1.0, 100.0), (1.06, 10.0), (5.0, 300.0), (9.0, 300.0)],
            13.0,
        ));
        for found in [alone, beside_hard] {
            let found = found.unwrap();
            let told = found.hits[0].left_out.clone().unwrap_or_default();
            assert!(told.contains("double hit: a second one of 10 %"), "{told:?}");
            assert_eq!(left_out(&found).len(), 1);
        }
    }

    #[test]
    fn a_band_beyond_the_hammer_is_told() {
        let bench = bench(0.03, &[(1.0, 300.0), (5.0, 250.0), (9.1, 320.0)], 13.0);
        let told = |band| {
            let found = frfs_in(&bench, band).unwrap();
            let warnings = found.warnings.into_iter();
            (
                *found.frequency_hz.last().unwrap(),
                warnings
                    .filter(|w| w.contains("excites up to"))
                    .collect::<Vec<_>>(),
            )
        };
        let (last_hz, beyond) = told(Some([5.0, 900.0]));
        assert!((last_hz - 900.0).abs() < 1.0, "{last_hz}");
        assert!(
            beyond.len() == 1 && beyond[0].contains("lines to 900 Hz are used"),
            "{beyond:?}"
        );
        let (last_hz, beyond) = told(None);
        assert!(last_hz < 500.0, "{last_hz}");
        assert!(
            beyond.len() == 1 && beyond[0].contains(&format!("up to {last_hz:.0} Hz")),
            "{beyond:?}"
        );
        assert!(told(Some([5.0, 100.0])).1.is_empty());
    }

    /// Frequency and damping of the mode, window taken out.
    fn mode(found: &TapFrfs) -> (f64, f64) {
        let receptance: Vec<Complex64> = found
            .frequency_hz
            .iter()
            .zip(&found.frf[0])
            .map(|(f, h)| -h / (std::f64::consts::TAU * f).powi(2))
            .collect();
        let settings = Settings {
            band_hz: Some([3.0, 60.0]),
            ..Settings::default()
        };
        let modes = analyse_frf(&found.frequency_hz, &receptance, &settings)
            .unwrap()
            .modes;
        assert_eq!(modes.len(), 1, "{modes:?}");
        let best = modes[0].best();
        let added = found.added_decay_per_s / (std::f64::consts::TAU * best.frequency_hz);
        (best.frequency_hz, best.damping_ratio - added)
    }

    #[test]
    fn clean_hits_give_the_mode_and_full_coherence() {
        let found = frfs(&bench(
            0.03,
            &[(1.0, 300.0), (5.0, 250.0), (9.1, 320.0), (13.0, 280.0)],
            17.0,
        ))
        .unwrap();
        assert_eq!(
            found.hits.iter().filter(|h| h.left_out.is_none()).count(),
            4,
            "{:?}",
            found.hits
        );
        let (f, zeta) = mode(&found);
        assert!(
            (f / F0_HZ - 1.0).abs() < 2e-3 && (zeta / 0.03 - 1.0).abs() < 0.02,
            "{f} {zeta}"
        );
        let gamma2 = &found.coherence.as_ref().unwrap()[0];
        let at = found.frequency_hz.iter().position(|f| *f > F0_HZ).unwrap();
        assert!(gamma2[at] > 0.99);
        // Inertia line of accelerance far above the mode.
        let high = found.frequency_hz.iter().position(|f| *f > 90.0).unwrap();
        assert!((found.frf[0][high].norm() * MASS_KG - 1.0).abs() < 0.05);
    }

    #[test]
    fn the_damping_of_the_exponential_window_is_taken_back_out() {
        // Blocks of two seconds: at ζ = 0.5 % the response is still at half its size.
        let found = frfs(&bench(0.005, &[(1.0, 300.0), (3.1, 300.0), (5.2, 300.0)], 7.4)).unwrap();
        assert!(found.added_decay_per_s > 0.5, "{}", found.added_decay_per_s);
        assert!(found.warnings.iter().any(|w| w.contains("exponential window")));
        let (f, zeta) = mode(&found);
        // What one hit left moving when the next came cannot be taken out; it is a few per cent here.
        assert!(
            (f / F0_HZ - 1.0).abs() < 3e-3 && (zeta / 0.005 - 1.0).abs() < 0.25,
            "{f} {zeta}"
        );
    }

    #[test]
    fn bad_hits_are_named_and_left_out() {
        let clean = [
            (1.0, 300.0),
            (5.0, 250.0),
            (9.0, 480.0),
            (13.0, 280.0),
            (17.0, 290.0),
        ];
        let faulty = |change: &dyn Fn(&mut Bench), extra: &[(f64, f64)]| {
            let hits: Vec<(f64, f64)> = clean.iter().chain(extra).copied().collect();
            let mut bench = bench(0.03, &hits, 21.0);
            change(&mut bench);
            let found = frfs(&bench).unwrap();
            let faults: Vec<(usize, String)> = found
                .hits
                .iter()
                .enumerate()
                .filter_map(|(k, h)| Some((k, h.left_out.clone()?)))
                .collect();
            let (f, zeta) = mode(&found);
            assert!(
                (f / F0_HZ - 1.0).abs() < 3e-3 && (zeta / 0.03 - 1.0).abs() < 0.03,
                "{f} {zeta}"
            );
            faults
        };
        let nothing = |_: &mut Bench| {};
        assert!(faulty(&nothing, &[]).is_empty());
        let cases: [(&str, Vec<(usize, String)>); 4] = [
            ("double hit", faulty(&nothing, &[(5.03, 100.0)])),
            (
                "force is clipped",
                faulty(&|b| b.force.iter_mut().for_each(|f| *f = f.min(330.0)), &[]),
            ),
            (
                "late bump",
                faulty(
                    &|b| {
                        for k in 0..600 {
                            let t = k as f64 / RATE_HZ;
                            b.acceleration[(11.5 * RATE_HZ) as usize + k] +=
                                4.0 * (t * 200.0).sin() * (-t * 8.0).exp();
                        }
                    },
                    &[],
                ),
            ),
            (
                "inconsistent",
                faulty(
                    &|b| {
                        let from = (13.0 * RATE_HZ) as usize;
                        b.acceleration[from - 10..from + 7000]
                            .iter_mut()
                            .for_each(|a| *a *= -0.6);
                    },
                    &[],
                ),
            ),
        ];
        for ((expected, faults), index) in cases.iter().zip([1, 2, 2, 3]) {
            assert_eq!(faults.len(), 1, "{expected}: {faults:?}");
            assert_eq!(faults[0].0, index, "{expected}: {faults:?}");
            assert!(faults[0].1.contains(expected), "{expected}: {faults:?}");
        }
    }

    #[test]
    fn silence_is_an_error_and_not_an_frf() {
        let silent = Bench {
            force: vec![0.0; 1000],
            acceleration: vec![0.0; 1000],
        };
        assert!(frfs(&silent).unwrap_err().to_string().contains("no hit"));
    }

    /// Two hits of 2 N and answers H F ± e: the mean of H₁ forgets e, H₂ is larger by 1 + |e|²/|H F|², the coherence is the inverse of
    /// that, and H_v lies between (Bendat and Piersol 2010, §6.1).
    #[test]
    fn estimators_take_noise_of_the_response_as_the_textbook_has_it() {
        let h = Complex64::new(0.3, -0.4);
        let noise = Complex64::new(-0.4, -0.3);
        let block = |sign: f64| Block {
            hit: 0,
            force: vec![Complex64::from(2.0)],
            responses: vec![vec![h * 2.0 + noise * sign]],
        };
        let blocks = [block(1.0), block(-1.0)];
        let blocks: Vec<&Block> = blocks.iter().collect();
        // |e|² = 0.25 N² of |H F|² = 1.
        for (estimator, factor) in [
            (Estimator::H1, 1.0),
            (Estimator::H2, 1.25),
            (Estimator::Hv, 1.25f64.sqrt()),
        ] {
            let (found, coherence) = average(&blocks, 0, 1, estimator);
            assert!((found[0] - h * factor).norm() < 1e-12, "{found:?}");
            approx::assert_relative_eq!(coherence[0], 0.8, max_relative = 1e-12);
        }
        let silent = Block {
            hit: 0,
            force: vec![Complex64::ZERO],
            responses: vec![vec![Complex64::ZERO]],
        };
        assert_eq!(
            average(&[&silent], 0, 1, Estimator::H2),
            (vec![Complex64::ZERO], vec![0.0])
        );
    }
}
