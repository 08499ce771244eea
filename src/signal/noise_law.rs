//! The law of an FRF's noise over frequency and magnitude, from squared departures on single lines.
//!
//! σ² = (a |H|)² + (b (f₀/f)^p)²: a relative part (hammer, gain) and a floor (sensor, quantisation), even over the
//! band in what the sensor measures: displacement (p = 0), velocity (1: vibrometer) or acceleration (2). Which one
//! is read from the scatter, since files are often integrated before they are exported.

use nalgebra::SVector;
use rayon::prelude::*;

/// Noise of one FRF: standard deviation of the complex value (both parts together) at receptance magnitude |H|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrfNoise {
    /// a: share of the magnitude.
    pub relative: f64,
    /// b: floor at `reference_hz`, in the unit of the FRF.
    pub floor: f64,
    /// p: the floor falls with this power of the frequency.
    pub power: i32,
    /// f₀, Hz, > 0.
    pub reference_hz: f64,
}

impl FrfNoise {
    /// Standard deviation of the complex value where the true magnitude is `magnitude`.
    pub fn std(&self, frequency_hz: f64, magnitude: f64) -> f64 {
        (self.relative * magnitude).hypot(self.floor_at(frequency_hz))
    }

    fn floor_at(&self, frequency_hz: f64) -> f64 {
        self.floor / ratio(frequency_hz, self.reference_hz).powi(self.power)
    }
}

/// Noise of one FRF along the band: a law for each stretch of it. Hammers roll off, sensors resonate, filters alias: above what the
/// excitation reaches an FRF is another measurement, and one law for both would be wrong in both.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseAlongBand {
    /// Upper end, Hz, of each stretch, ascending and the last without end, and its law.
    stretches: Vec<(f64, FrfNoise)>,
}

impl NoiseAlongBand {
    /// Standard deviation of the complex value where the true magnitude is `magnitude`.
    pub fn std(&self, frequency_hz: f64, magnitude: f64) -> f64 {
        self.at(frequency_hz).std(frequency_hz, magnitude)
    }

    /// The law that holds at a frequency.
    pub fn at(&self, frequency_hz: f64) -> &FrfNoise {
        let beyond = self.stretches.len() - 1;
        let stretch = self.stretches[..beyond].partition_point(|(end, _)| *end <= frequency_hz);
        &self.stretches[stretch].1
    }
}

/// Departures of an FRF that a stretch of the band must hold to have a law of its own.
const LEAST_STRETCH: usize = 100;
/// Two laws in the place of one must be this much likelier (natural logarithm) an FRF. Where one law holds, the two more numbers of each
/// bring 1 on the average.
const LIKELIER_EACH: f64 = 5.0;

/// Powers of the frequency with which a floor may fall, ascending: displacement, velocity, acceleration.
pub(super) const POWERS: [i32; 3] = [0, 1, 2];
/// A floor that falls must be this much likelier (natural logarithm) than an even one.
const LIKELIER: f64 = 10.0;
/// P(square > 7 × mean) is 1e-3 for noise: what lies beyond is no noise.
const CUT: f64 = 7.0;
/// The floor is at least this part of the largest magnitude: a line of zero noise would get all the weight there is.
const LEAST_FLOOR: f64 = 1e-6;
/// A relative change of the variances that is far below what they are known to.
const SETTLED: f64 = 1e-4;

/// How alike FRFs measured together are in the relative part (one hammer, one gain): what all of them show counts in each as
/// so many lines. An FRF of which only a few lines stand above its floor, or on whose peaks the fit takes all there is, would
/// otherwise come out without a relative part, and its peaks with many times the weight that they deserve.
const COMMON_LINES: usize = 5;
/// These lines are so much larger than any other that the floor has no say in them.
const COMMON_MAGNITUDE: f64 = 100.0;
/// So many FRFs are enough to tell what all have in common.
const ENOUGH_FRFS: usize = 60;

/// f/f₀, never zero: a line at 0 Hz has no acceleration to speak of.
fn ratio(frequency_hz: f64, reference_hz: f64) -> f64 {
    (frequency_hz / reference_hz).max(1e-6)
}

/// One line of an FRF after a fit.
#[derive(Debug, Clone, Copy)]
pub struct Departure {
    /// Frequency of the line.
    pub frequency_hz: f64,
    /// Of the fitted value.
    pub magnitude: f64,
    /// Squared residual, corrected for the degrees of freedom that the fit took.
    pub squared: f64,
}

/// Noise laws of FRFs measured together, with the power of the floor that describes all of them best; departures that
/// are not finite are left out. `None` for too few lines.
pub fn fit<D: AsRef<[Departure]> + Sync>(frfs: &[D]) -> Vec<Option<FrfNoise>> {
    let all = || frfs.iter().flat_map(|d| d.as_ref());
    let (sum, count) = all()
        .filter(|d| d.frequency_hz > 0.0)
        .fold((0.0, 0), |(sum, n), d| (sum + d.frequency_hz.ln(), n + 1));
    let reference_hz = if count > 0 {
        (sum / f64::from(count)).exp()
    } else {
        1.0
    };
    let common = if frfs.len() > 1 {
        common_lines(frfs, reference_hz)
    } else {
        Vec::new()
    };
    let by_power: Vec<[Option<Fitted>; POWERS.len()]> = frfs
        .par_iter()
        .map(|d| fit_laws(d.as_ref(), &common, reference_hz))
        .collect();
    let mut best: Option<(f64, usize, usize)> = None;
    for (k, power) in POWERS.into_iter().enumerate() {
        let laws = || by_power.iter().filter_map(|of_frf| of_frf[k].as_ref());
        let likelihood: f64 = laws().map(|law| law.log_likelihood).sum();
        let found = laws().count();
        let better = best.is_none_or(|(before, most, _)| {
            found >= most && likelihood > before + if power > 0 { LIKELIER } else { 0.0 }
        });
        if better {
            best = Some((likelihood, found, k));
        }
    }
    let chosen = best.map_or(0, |(.., k)| k);
    by_power
        .into_iter()
        .map(|of_frf| of_frf[chosen].as_ref().map(|law| law.noise))
        .collect()
}

/// As [`fit`], with a law for each stretch of the band where one for all is not the likelier. Departures ascend in frequency.
pub fn fit_along_band<D: AsRef<[Departure]> + Sync>(frfs: &[D]) -> Vec<Option<NoiseAlongBand>> {
    let whole: Vec<&[Departure]> = frfs.iter().map(AsRef::as_ref).collect();
    let laws = fit(&whole);
    let mut stretches = Vec::new();
    split(&whole, laws, f64::INFINITY, &mut stretches);
    (0..frfs.len())
        .map(|m| {
            let of_frf = stretches.iter().map(|(end, laws)| Some((*end, laws[m]?)));
            Some(NoiseAlongBand {
                stretches: of_frf.collect::<Option<_>>()?,
            })
        })
        .collect()
}

/// Appends the stretches of a part of the band, which `laws` describe as one and which ends at `end_hz`.
fn split(
    part: &[&[Departure]],
    laws: Vec<Option<FrfNoise>>,
    end_hz: f64,
    stretches: &mut Vec<(f64, Vec<Option<FrfNoise>>)>,
) {
    let longest = part.iter().max_by_key(|d| d.len());
    let middle_hz = match longest {
        Some(d) if d.len() >= 2 * LEAST_STRETCH => d[d.len() / 2].frequency_hz,
        _ => return stretches.push((end_hz, laws)),
    };
    let at = |d: &[Departure]| d.partition_point(|d| d.frequency_hz < middle_hz);
    let halves: [Vec<&[Departure]>; 2] = [
        part.iter().map(|d| &d[..at(d)]).collect(),
        part.iter().map(|d| &d[at(d)..]).collect(),
    ];
    let own = halves.each_ref().map(|half| fit(half));
    // An FRF that a half says too little of keeps the others with the one law, too: all change at the same places.
    let known = own.iter().all(|of| {
        of.iter()
            .zip(&laws)
            .all(|(own, law)| own.is_some() == law.is_some())
    });
    let gain: f64 = halves
        .iter()
        .zip(&own)
        .map(|(half, own)| log_likelihood(half, own) - log_likelihood(half, &laws))
        .sum();
    if !known || !(gain > LIKELIER + LIKELIER_EACH * part.len() as f64) {
        return stretches.push((end_hz, laws));
    }
    let ([below, above], [below_laws, above_laws]) = (halves, own);
    split(&below, below_laws, middle_hz, stretches);
    split(&above, above_laws, end_hz, stretches);
}

/// Of exponentially distributed squares under a law for each FRF; one far beyond its mean counts as if it were at the cut.
fn log_likelihood(frfs: &[&[Departure]], laws: &[Option<FrfNoise>]) -> f64 {
    let of_frf = |(departures, law): (&&[Departure], &Option<FrfNoise>)| -> f64 {
        let Some(law) = law else { return 0.0 };
        let finite = departures
            .iter()
            .filter(|d| d.magnitude.is_finite() && d.squared.is_finite());
        finite
            .map(|d| {
                let mean = law.std(d.frequency_hz, d.magnitude).powi(2);
                -mean.ln() - (d.squared / mean).min(CUT)
            })
            .sum()
    };
    frfs.iter().zip(laws).map(of_frf).sum()
}

/// What FRFs measured together say of the relative part, as lines to be added to those of each FRF: the median of their own
/// laws, each counting by its lines in which the relative part is the larger one.
fn common_lines<D: AsRef<[Departure]> + Sync>(frfs: &[D], reference_hz: f64) -> Vec<Departure> {
    let asked: Vec<&[Departure]> = frfs
        .iter()
        .step_by(frfs.len().div_ceil(ENOUGH_FRFS).max(1))
        .map(AsRef::as_ref)
        .collect();
    let by_frf = asked.par_iter().map(|departures| {
        let laws = fit_laws(departures, &[], reference_hz).into_iter().flatten();
        let likeliest = laws.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
        let law = likeliest.noise;
        let telling = |d: &&Departure| {
            law.std(d.frequency_hz, d.magnitude) > 2f64.sqrt() * law.floor_at(d.frequency_hz)
        };
        Some((law.relative, departures.iter().filter(telling).count()))
    });
    let mut relative: Vec<(f64, usize)> = by_frf.flatten().collect();
    relative.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = relative.iter().map(|(_, lines)| lines).sum::<usize>().div_ceil(2);
    let mut below = 0;
    let median = relative.iter().find(|(_, lines)| {
        below += lines;
        below >= half
    });
    let magnitudes = asked.iter().flat_map(|d| d.iter()).map(|d| d.magnitude);
    let magnitude = COMMON_MAGNITUDE * magnitudes.filter(|m| m.is_finite()).fold(0.0, f64::max);
    let line = |(relative, _): &(f64, usize)| Departure {
        frequency_hz: reference_hz,
        magnitude,
        squared: (relative * magnitude).powi(2),
    };
    match median.filter(|(relative, _)| *relative > 0.0) {
        Some(median) => vec![line(median); COMMON_LINES],
        None => Vec::new(),
    }
}

struct Fitted {
    noise: FrfNoise,
    /// Of exponentially distributed squares; one far beyond its mean counts as if it were at the cut.
    log_likelihood: f64,
}

/// The law of one FRF for each power of its floor: of f^p H, whose floor is even. `common`: [`common_lines`].
fn fit_laws(
    departures: &[Departure],
    common: &[Departure],
    reference_hz: f64,
) -> [Option<Fitted>; POWERS.len()] {
    let finite = |d: &&Departure| d.magnitude.is_finite() && d.squared.is_finite();
    let own = departures.iter().filter(finite).count();
    let finite = || departures.iter().filter(finite).chain(common);
    let scales: Vec<f64> = finite()
        .map(|d| ratio(d.frequency_hz, reference_hz).powi(2))
        .collect();
    let log_scale: f64 = scales.iter().map(|x| x.ln()).sum();
    let mut powers: Vec<f64> = finite().map(|d| d.magnitude * d.magnitude).collect();
    let mut squares: Vec<f64> = finite().map(|d| d.squared).collect();
    let mut last_power = 0;
    POWERS.map(|power| {
        for _ in last_power..power {
            for ((power, square), x) in powers.iter_mut().zip(&mut squares).zip(&scales) {
                *power *= x;
                *square *= x;
            }
        }
        last_power = power;
        let [a2, b2] = fit_even_law(&powers, &squares, own)?;
        let expected = powers.iter().map(|power| a2 * power + b2);
        let likelihood: f64 = expected
            .zip(&squares)
            .map(|(mean, square)| -mean.ln() - (square / mean).min(CUT))
            .sum();
        Some(Fitted {
            noise: FrfNoise {
                relative: a2.sqrt(),
                floor: b2.sqrt(),
                power,
                reference_hz,
            },
            log_likelihood: likelihood + f64::from(power) * log_scale,
        })
    })
}

/// a² and b²: maximum likelihood of E square = a² power + b² for exponentially distributed squares (complex Gaussian
/// noise), by iteratively reweighted least squares; squares beyond `CUT` times their mean are taken for misfit and
/// trimmed with the bias that this brings taken back out. The first `own` samples are the FRF's; what follows speaks for the
/// relative part only.
fn fit_even_law(powers: &[f64], squares: &[f64], own: usize) -> Option<[f64; 2]> {
    if own < 20 {
        return None;
    }
    let largest = powers[..own].iter().copied().fold(0.0, f64::max);
    // Start: all floor, from the median of an exponential distribution.
    let mut law = [0.0, middle(&mut squares[..own].to_vec()) / std::f64::consts::LN_2];
    if !(largest > 0.0) || !law[1].is_finite() || law[1] <= 0.0 {
        return None;
    }
    let low = lowest(&powers[..own], &squares[..own]);
    // Mean of an exponential variable given that it is below CUT times its mean.
    let kept_mean = 1.0 - CUT / (CUT.exp() - 1.0);
    for pass in 0..60 {
        // The first passes know only a crude law: do not trim by it.
        let (cut, share) = if pass > 4 {
            (CUT, kept_mean)
        } else {
            (f64::INFINITY, 1.0)
        };
        let (s, mut r) = weighted_sums(powers, squares, law, cut);
        r = r.map(|sum| sum / share);
        let determinant = s[0][0] * s[1][1] - s[0][1] * s[1][0];
        let mut a2 = (r[0] * s[1][1] - r[1] * s[0][1]) / determinant;
        let mut b2 = (r[1] * s[0][0] - r[0] * s[1][0]) / determinant;
        // Neither part may be negative: then the other one alone carries the noise.
        if !(a2 > 0.0) {
            a2 = 0.0;
            b2 = r[1] / s[1][1];
        } else if !(b2 > 0.0) {
            b2 = 0.0;
            a2 = r[0] / s[0][0];
        }
        b2 = b2.max(0.5 * (low.square - a2 * low.power));
        if !a2.is_finite() || !b2.is_finite() || a2 + b2 <= 0.0 {
            return None;
        }
        let next = [a2, b2.max(LEAST_FLOOR * LEAST_FLOOR * largest)];
        let settled = (next[0] - law[0]).abs() <= SETTLED * next[0].max(1e-18)
            && (next[1] - law[1]).abs() <= SETTLED * next[1];
        law = next;
        if settled && pass > 6 {
            break;
        }
    }
    Some(law)
}

/// Where the FRF is smallest.
struct Lowest {
    power: f64,
    /// Expected square there.
    square: f64,
}

/// Where the FRF is smallest the median says what the floor is, whatever the reweighting makes of it: a floor that has
/// come out far too low would trim all that speaks against it.
fn lowest(powers: &[f64], squares: &[f64]) -> Lowest {
    let mut order: Vec<(f64, f64)> = powers.iter().copied().zip(squares.iter().copied()).collect();
    let count = (order.len() / 5).max(10);
    order.select_nth_unstable_by(count - 1, |a, b| {
        a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal)
    });
    order.truncate(count);
    let (mut powers, mut squares): (Vec<f64>, Vec<f64>) = order.into_iter().unzip();
    Lowest {
        power: middle(&mut powers),
        square: middle(&mut squares) / std::f64::consts::LN_2,
    }
}

/// The value that half of the others are not above.
fn middle(values: &mut [f64]) -> f64 {
    let half = values.len() / 2;
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

/// Normal equations of square = a² power + b², each sample weighted by the square of its expected square under `law`
/// (a², b²) and left out where it lies `cut` times above that.
fn weighted_sums(powers: &[f64], squares: &[f64], [a2, b2]: [f64; 2], cut: f64) -> ([[f64; 2]; 2], [f64; 2]) {
    // Sums in several lanes, which the processor can add side by side; what fills the last lanes up counts nothing.
    let (power_chunks, power_rest) = powers.as_chunks();
    let (square_chunks, square_rest) = squares.as_chunks();
    let filled = |rest: &[f64]| std::array::from_fn(|lane| rest.get(lane).copied().unwrap_or(0.0));
    let counts = std::array::from_fn(|lane| if lane < power_rest.len() { 1.0 } else { 0.0 });
    let mut sums = [Lanes::zeros(); 5];
    let all = power_chunks.iter().zip(square_chunks);
    for (powers, squares) in all {
        sums = add(sums, *powers, *squares, [1.0; LANES], [a2, b2, cut]);
    }
    sums = add(
        sums,
        filled(power_rest),
        filled(square_rest),
        counts,
        [a2, b2, cut],
    );
    let [uu, u, one, uv, v] = sums.map(|lanes| lanes.sum());
    ([[uu, u], [u, one]], [uv, v])
}

const LANES: usize = 4;
type Lanes = SVector<f64, LANES>;

/// One step of [`weighted_sums`].
#[inline(always)]
fn add(
    [uu, u, one, uv, v]: [Lanes; 5],
    powers: [f64; LANES],
    squares: [f64; LANES],
    counts: [f64; LANES],
    [a2, b2, cut]: [f64; 3],
) -> [Lanes; 5] {
    let (powers, squares) = (Lanes::from(powers), Lanes::from(squares));
    let mean = (powers * a2).add_scalar(b2);
    let kept =
        Lanes::from(counts).zip_zip_map(
            &squares,
            &(mean * cut),
            |count, square, most| {
                if square > most { 0.0 } else { count }
            },
        );
    let w = kept.component_div(&mean.component_mul(&mean));
    let weighted = w.component_mul(&powers);
    [
        uu + weighted.component_mul(&powers),
        u + weighted,
        one + w,
        uv + weighted.component_mul(&squares),
        v + w.component_mul(&squares),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares of exponential noise at its quantiles, in an order that has nothing to do with the magnitudes.
    fn departures(law: FrfNoise, lines: usize) -> Vec<Departure> {
        (0..lines)
            .map(|k| {
                let frequency_hz = 5.0 + 0.2 * k as f64;
                let magnitude = 1e-6 * (1.0 + (0.1 * k as f64).sin().powi(2) * 20.0);
                let quantile = (((k * 61) % lines) as f64 + 0.5) / lines as f64;
                let std = law.std(frequency_hz, magnitude);
                Departure {
                    frequency_hz,
                    magnitude,
                    squared: -std * std * (1.0 - quantile).ln(),
                }
            })
            .collect()
    }

    fn law(relative: f64, floor: f64, power: i32) -> FrfNoise {
        FrfNoise {
            relative,
            floor,
            power,
            reference_hz: 30.0,
        }
    }

    #[test]
    fn both_parts_and_the_power_of_the_floor_come_back() {
        for power in POWERS {
            let wanted = law(0.02, 1e-7, power);
            let found = fit(&vec![departures(wanted, 300); 4])[0].unwrap();
            assert_eq!(found.power, power);
            assert!((found.relative / 0.02 - 1.0).abs() < 0.15, "{found:?}");
            let floor = found.std(30.0, 0.0);
            assert!((floor / 1e-7 - 1.0).abs() < 0.15, "power {power}: {floor}");
        }
    }

    /// Without a floor a line on which the FRF is small would decide everything.
    #[test]
    fn noise_in_proportion_to_the_magnitude_keeps_a_trace_of_a_floor() {
        let found = fit(&[departures(law(0.02, 0.0, 0), 300)])[0].unwrap();
        let largest = 2.1e-5;
        assert!(found.floor >= 0.9 * LEAST_FLOOR * largest, "{found:?}");
        assert!(found.floor < 1e-3 * largest, "{found:?}");
    }

    #[test]
    fn what_lies_far_beyond_the_noise_is_left_out() {
        let mut disturbed = departures(law(0.02, 1e-7, 0), 300);
        for k in [40, 41, 42, 180] {
            disturbed[k].squared *= 1e4;
        }
        disturbed[7].squared = f64::INFINITY;
        let found = fit(&[disturbed])[0].unwrap();
        assert!((found.relative / 0.02 - 1.0).abs() < 0.2, "{found:?}");
    }

    /// Coarse lines: of one FRF all but a few lines lie below the floor, and the fit took its peaks whole. What the others
    /// show of the relative part holds for it; an FRF that has enough to say keeps its own.
    #[test]
    fn frfs_measured_together_share_what_one_of_them_cannot_tell() {
        let (common, noisy) = (law(0.03, 1e-8, 0), law(0.09, 1e-8, 0));
        let mut quiet = departures(common, 60);
        for (k, line) in quiet.iter_mut().enumerate() {
            line.magnitude *= 1e-3;
            let quantile = (((k * 37) % 60) as f64 + 0.5) / 60.0;
            line.squared = -common.std(line.frequency_hz, line.magnitude).powi(2) * (1.0 - quantile).ln();
        }
        let mut together = vec![departures(common, 60); 6];
        together.push(quiet.clone());
        together.push(departures(noisy, 60));
        let found: Vec<FrfNoise> = fit(&together).into_iter().flatten().collect();
        assert!((found[6].relative / 0.03 - 1.0).abs() < 0.3, "{:?}", found[6]);
        assert!((found[6].floor / 1e-8 - 1.0).abs() < 0.2, "{:?}", found[6]);
        assert!((found[7].relative / 0.09 - 1.0).abs() < 0.2, "{:?}", found[7]);
        // Alone it has no relative part, or one that is far off.
        let alone = fit(&[quiet])[0].unwrap().relative;
        assert!((alone / 0.03 - 1.0).abs() > 0.5, "{alone}");
    }

    #[test]
    fn one_law_stays_one_along_the_band() {
        for power in POWERS {
            let frfs = vec![departures(law(0.02, 1e-7, power), 900); 4];
            let (along, one) = (fit_along_band(&frfs), fit(&frfs));
            for (along, one) in along.iter().zip(one) {
                assert_eq!(
                    along.as_ref().unwrap().stretches,
                    vec![(f64::INFINITY, one.unwrap())]
                );
            }
        }
    }

    /// Two thirds of the band lie beyond what the hammer excites.
    #[test]
    fn beyond_the_excitation_another_law_holds_and_leaves_the_first_alone() {
        let (sound, beyond) = (law(0.01, 1e-8, 0), law(0.5, 1e-6, 0));
        let mut frf = departures(sound, 900);
        frf.truncate(300);
        frf.extend_from_slice(&departures(beyond, 900)[300..]);
        let frfs = vec![frf; 4];
        let one = fit(&frfs)[0].unwrap();
        assert!(
            one.relative > 0.03,
            "one law for all is wrong where it matters: {one:?}"
        );
        let along = fit_along_band(&frfs)[0].clone().unwrap();
        // Lines of 5 Hz to 184.8 Hz, of which those from 65 Hz on are beyond.
        for f in [10.0, 40.0] {
            assert!(
                (along.at(f).relative / 0.01 - 1.0).abs() < 0.25,
                "{f} Hz: {:?}",
                along.at(f)
            );
        }
        for f in [100.0, 170.0] {
            assert!(
                (along.at(f).relative / 0.5 - 1.0).abs() < 0.25,
                "{f} Hz: {:?}",
                along.at(f)
            );
        }
    }

    #[test]
    fn too_few_lines_give_no_law() {
        assert_eq!(fit(&[departures(law(0.02, 1e-7, 0), 19)]), [None]);
    }
}
