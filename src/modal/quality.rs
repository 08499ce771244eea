//! Is an FRF, is a set of FRFs, good enough to trust its modes?

use num_complex::Complex64;
use serde::Serialize;

use crate::modal::together::reconstruction::Reconstruction;
use crate::text::figures;

/// Noise against the FRF's size up to which it is good, and from which it is bad.
const NOISE: [f64; 2] = [0.1, 0.5];
/// Part of the FRF that the common modes leave unexplained beyond its noise: good up to, bad from.
const UNEXPLAINED: [f64; 2] = [0.1, 0.4];
/// Share of what is left that is most of it.
const MOST: f64 = 0.8;
/// FRFs of a set from which on what one of them alone leaves is set apart.
const MANY: usize = 4;
/// Power-weighted coherence: good from, bad below.
const COHERENCE: [f64; 2] = [0.9, 0.6];
/// Difference of an FRF and its mirror over their size beyond noise: good up to, bad from.
const RECIPROCITY: [f64; 2] = [0.1, 0.4];

/// How far modes or an FRF may be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum QualityGrade {
    /// Nothing speaks against it.
    Good,
    /// Something does: look at the reasons.
    Doubtful,
    /// Not to be relied on.
    Bad,
}

impl QualityGrade {
    /// Of a value that is good up to the first of two limits and bad from the second; from the first and below the second, where they fall.
    fn of(value: f64, limits: [f64; 2]) -> Self {
        let sign = if limits[0] <= limits[1] { 1.0 } else { -1.0 };
        match sign * value {
            v if v <= sign * limits[0] => QualityGrade::Good,
            v if v > sign * limits[1] => QualityGrade::Bad,
            _ => QualityGrade::Doubtful,
        }
    }
}

impl std::fmt::Display for QualityGrade {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            QualityGrade::Good => "good",
            QualityGrade::Doubtful => "doubtful",
            QualityGrade::Bad => "bad",
        })
    }
}

/// What speaks for and against the modes of a set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetQuality {
    /// The grade that the shares and the scatter below come to.
    pub verdict: QualityGrade,
    /// Share 0..1 of what was measured (Σ|ωH|² over the FRFs, in the band of the modes) that is neither a common mode nor
    /// random noise.
    pub unexplained_share: f64,
    /// The part of it that goes on from line to line: systematic, not scatter.
    pub coloured_share: f64,
    /// Share of random noise.
    pub noise_share: f64,
    /// How far a mode's frequency moves from FRF to FRF beyond its uncertainty there, relative standard deviation, median
    /// over the modes that can tell; `None` where none can.
    pub frequency_scatter: Option<f64>,
    /// All fits converged.
    pub converged: bool,
    /// What is wrong, in words; empty for a good one.
    pub reasons: Vec<String>,
}

impl Default for SetQuality {
    /// Of a set without modes: nothing is explained.
    fn default() -> Self {
        SetQuality {
            verdict: QualityGrade::Bad,
            unexplained_share: 1.0,
            coloured_share: 0.0,
            noise_share: 0.0,
            frequency_scatter: None,
            converged: false,
            reasons: vec!["no modes were found".into()],
        }
    }
}

/// What speaks for and against an FRF.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// The grade that the figures below come to.
    pub verdict: QualityGrade,
    /// sqrt(Σ(ωσ)²/Σ|ωH|²) in the band.
    pub noise_nrms: Option<f64>,
    /// sqrt(Σ|ω(H − modes)|²/Σ|ωH|²).
    pub reconstruction_nrms: Option<f64>,
    /// Mean over the lines, weighted with |H|².
    pub coherence: Option<f64>,
    /// Against the mirrored FRF, where it was measured too.
    pub reciprocity_nrms: Option<f64>,
    /// What is wrong, in words; empty for a good one.
    pub reasons: Vec<String>,
}

/// Judges one FRF. `coherence` is on the FRF's own lines; `mirror` the FRF with response and reference exchanged.
pub fn judge(
    frequency_hz: &[f64],
    receptance_m_per_n: &[Complex64],
    coherence: Option<&[f64]>,
    fit: Option<&Reconstruction>,
    mirror: Option<&Reconstruction>,
) -> Quality {
    let mut quality = Quality {
        verdict: QualityGrade::Good,
        noise_nrms: fit.map(|f| f.noise_nrms),
        reconstruction_nrms: fit.map(|f| f.error_nrms),
        coherence: coherence.and_then(|c| weighted(c, frequency_hz, receptance_m_per_n, fit)),
        reciprocity_nrms: None,
        reasons: Vec::new(),
    };
    let mut note = |value: f64, limits: [f64; 2], what: String| {
        let grade = QualityGrade::of(value, limits);
        if grade != QualityGrade::Good {
            quality.verdict = quality.verdict.max(grade);
            quality.reasons.push(what);
        }
    };
    if let Some(noise) = quality.noise_nrms {
        note(noise, NOISE, format!("noise of {:.0} %", 100.0 * noise));
    }
    if let Some(fit) = fit {
        let beyond = (fit.error_nrms.powi(2) - fit.noise_nrms.powi(2)).max(0.0).sqrt();
        note(
            beyond,
            UNEXPLAINED,
            format!("{:.0} % is no common mode and no noise", 100.0 * beyond),
        );
    } else {
        quality.verdict = QualityGrade::Bad;
        quality.reasons.push("no common fit, or too few lines".into());
        return quality;
    }
    if let Some(mean) = quality.coherence {
        note(mean, COHERENCE, format!("coherence of {mean:.2}"));
    }
    if let (Some(fit), Some(mirror)) = (fit, mirror)
        && fit.frequency_hz == mirror.frequency_hz
    {
        let (mut difference, mut size) = (0.0, 0.0);
        let both = fit.measured_m_per_n.iter().zip(&mirror.measured_m_per_n);
        for (f, (a, b)) in fit.frequency_hz.iter().zip(both) {
            difference += f * f * (a - b).norm_sqr();
            size += 0.5 * f * f * (a.norm_sqr() + b.norm_sqr());
        }
        let noise = fit.noise_nrms.powi(2) + mirror.noise_nrms.powi(2);
        let beyond = (difference / size - noise).max(0.0).sqrt();
        if beyond.is_finite() {
            quality.reciprocity_nrms = Some((difference / size).sqrt());
            note(
                beyond,
                RECIPROCITY,
                format!("reciprocity fails by {:.0} %", 100.0 * beyond),
            );
        }
    }
    quality
}

fn weighted(coherence: &[f64], f: &[f64], h: &[Complex64], fit: Option<&Reconstruction>) -> Option<f64> {
    let band = fit.map_or([0.0, f64::INFINITY], |r| {
        [
            r.frequency_hz[0],
            r.frequency_hz.last().copied().unwrap_or(f64::INFINITY),
        ]
    });
    let (mut sum, mut total) = (0.0, 0.0);
    for ((c, f), h) in coherence.iter().zip(f).zip(h) {
        if *f >= band[0] && *f <= band[1] && *f > 0.0 && h.norm_sqr().is_finite() {
            sum += c * h.norm_sqr();
            total += h.norm_sqr();
        }
    }
    (total > 0.0).then(|| sum / total)
}

/// Power of what was measured in a set and of what its modes leave of it, as mobility, any unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Power {
    pub measured: f64,
    pub left: f64,
    /// Expected of the random noise.
    pub noise: f64,
    /// Covariance of what is left on neighbouring lines: random noise has none, what a model lacks goes on.
    pub coloured: f64,
    /// Lines of the first FRF, Hz, and what is left beyond the noise from each of them to the next.
    beyond_noise: Vec<(f64, f64)>,
    /// Of each FRF its number, what was measured, and what is left beyond the noise.
    of_frfs: Vec<(usize, [f64; 2])>,
}

impl Power {
    /// Adds the FRF of that number: its lines in ascending order, each frequency, measured, left over (both any motion per force), σ of
    /// the random noise.
    pub fn add(&mut self, number: usize, lines: impl Iterator<Item = (f64, Complex64, Complex64, f64)>) {
        let (was_measured, was_beyond) = (self.measured, self.left - self.noise);
        let mut before: Option<Complex64> = None;
        let first = self.beyond_noise.is_empty();
        for (f, measured, left, sigma) in lines {
            let beyond = f * f * (left.norm_sqr() - sigma * sigma);
            if first {
                self.beyond_noise.push((f, beyond));
            } else {
                let line = self.beyond_noise.partition_point(|(of, _)| *of <= f);
                self.beyond_noise[line.saturating_sub(1)].1 += beyond;
            }
            self.measured += f * f * measured.norm_sqr();
            self.left += f * f * left.norm_sqr();
            self.noise += (f * sigma).powi(2);
            let left = left * f;
            if let Some(before) = before {
                self.coloured += (before.conj() * left).re;
            }
            before = Some(left);
        }
        let beyond = self.left - self.noise - was_beyond;
        self.of_frfs
            .push((number, [self.measured - was_measured, beyond]));
    }

    /// The number of the FRF that alone holds [`MOST`] of what is left beyond the noise, of many of them, and what the others have
    /// unexplained, as a share of what was measured there: a spike in one FRF says nothing of the modes of all.
    fn of_one_alone(&self) -> Option<(usize, f64)> {
        let by_rest = |a: &&(usize, [f64; 2]), b: &&(usize, [f64; 2])| a.1[1].total_cmp(&b.1[1]);
        let (number, [measured, beyond]) = self.of_frfs.iter().max_by(by_rest)?;
        let all = self.left - self.noise;
        (self.of_frfs.len() >= MANY && *beyond > MOST * all && all > 0.0).then(|| {
            let others = ((all - beyond) / (self.measured - measured)).max(0.0);
            (*number, if others.is_finite() { others } else { 0.0 })
        })
    }

    /// The shortest stretch of the band that holds [`MOST`] of what is left beyond the noise, Hz; `None` where that is spread over the band.
    fn most_of_the_rest(&self) -> Option<[f64; 2]> {
        let rest: Vec<f64> = self.beyond_noise.iter().map(|(_, rest)| rest.max(0.0)).collect();
        let wanted = MOST * rest.iter().sum::<f64>();
        let (mut from, mut held) = (0, 0.0);
        let mut shortest: Option<[usize; 2]> = None;
        for to in 0..rest.len() {
            held += rest[to];
            while held - rest[from] >= wanted && from < to {
                held -= rest[from];
                from += 1;
            }
            if held >= wanted && shortest.is_none_or(|[a, b]| to - from < b - a) {
                shortest = Some([from, to]);
            }
        }
        let [from, to] = shortest?;
        (wanted > 0.0 && 2 * (to - from) < rest.len())
            .then(|| [self.beyond_noise[from].0, self.beyond_noise[to].0])
    }
}

/// What a set's modes are judged by.
pub(super) struct SetFindings {
    pub power: Power,
    pub frequency_scatter: Option<f64>,
    /// Most modes move from FRF to FRF.
    pub moving: bool,
    /// Poles that were left out where the modes leave much unexplained, Hz.
    pub left_out_hz: Vec<f64>,
    /// Modes that are far broader than the others, where too few FRFs tell a mode from what the others' model lacks, Hz.
    pub broad_hz: Vec<f64>,
    /// Modes that there may be besides.
    pub doubts: usize,
    /// Modes that the FRFs by themselves put elsewhere than the common fit, Hz.
    pub elsewhere_hz: Vec<f64>,
    /// Modes that are those of the FRFs by themselves, Hz.
    pub own_hz: Vec<f64>,
    /// Clear peaks of most FRFs that are not among the modes, Hz.
    pub missed_hz: Vec<f64>,
    pub converged: bool,
}

/// Frequencies in a row, Hz; `None` where there are none.
fn listed(hz: &[f64]) -> Option<String> {
    let each: Vec<String> = hz.iter().map(|f| format!("{f:.2}")).collect();
    (!each.is_empty()).then(|| each.join(", "))
}

/// Judges the modes of a set.
pub(super) fn judge_set(found: &SetFindings) -> SetQuality {
    let power = &found.power;
    let share = |part: f64| {
        let share = part / power.measured;
        if share.is_finite() {
            share.clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let noise_share = share(power.noise.min(power.left));
    let unexplained_share = share(power.left - power.noise);
    let mut quality = SetQuality {
        verdict: QualityGrade::Good,
        unexplained_share,
        coloured_share: share(power.coloured).min(share(power.left)),
        noise_share,
        frequency_scatter: found.frequency_scatter,
        converged: found.converged,
        reasons: Vec::new(),
    };
    let mut note = |verdict: QualityGrade, why: String| {
        quality.verdict = quality.verdict.max(verdict);
        quality.reasons.push(why);
    };
    let alone = power.of_one_alone();
    let rest = alone.map_or(unexplained_share, |(_, others)| others).sqrt();
    let grade = QualityGrade::of(rest, UNEXPLAINED);
    let one = |(number, others): (usize, f64)| {
        format!(
            "; nearly all of it is in FRF {number} of {} alone, the others have {:.1} %",
            power.of_frfs.len(),
            100.0 * others
        )
    };
    if unexplained_share.sqrt() > UNEXPLAINED[0] {
        let most = power.most_of_the_rest();
        note(
            grade.max(QualityGrade::Doubtful),
            format!(
                "{:.1} % of what was measured is no common mode and no noise{}{}",
                100.0 * unexplained_share,
                most.map_or_else(String::new, |[from, to]| {
                    format!(", most of that at {from:.1} to {to:.1} Hz")
                }),
                alone.map_or_else(String::new, one)
            ),
        );
    }
    if found.moving {
        note(
            QualityGrade::Doubtful,
            format!(
                "your frequencies move from FRF to FRF by {} %: mass loading or temperature",
                figures(100.0 * found.frequency_scatter.unwrap_or(0.0), 2)
            ),
        );
    }
    if let Some(places) = listed(&found.left_out_hz) {
        note(
            QualityGrade::Doubtful,
            format!(
                "what was left out at {places} Hz may be a mode: the others do not explain what was measured there (why it was left out: \
                 --json)"
            ),
        );
    }
    if let Some(places) = listed(&found.broad_hz) {
        note(
            QualityGrade::Doubtful,
            format!(
                "far broader than the other modes, in too few FRFs to tell a mode from an error of the measurement: {places} Hz (more response \
                 points would tell)"
            ),
        );
    }
    if found.doubts > 0 {
        note(
            QualityGrade::Doubtful,
            "there may be one more mode close to another".into(),
        );
    }
    if let Some(places) = listed(&found.elsewhere_hz) {
        note(
            QualityGrade::Doubtful,
            format!(
                "the common fit has {places} Hz elsewhere than the FRFs by themselves, which were taken: it lacks something there (a \
                 narrower --band may help)"
            ),
        );
    }
    if let Some(places) = listed(&found.own_hz) {
        note(
            QualityGrade::Doubtful,
            format!(
                "the common fit has no mode at {places} Hz, where the FRFs have one by themselves, which was taken (a narrower --band may \
                 help)"
            ),
        );
    }
    if let Some(places) = listed(&found.missed_hz) {
        note(
            QualityGrade::Doubtful,
            format!(
                "clear peaks that the FRFs have by themselves are not among the common modes: {places} Hz (a narrower --band may help)"
            ),
        );
    }
    if !found.converged {
        note(QualityGrade::Doubtful, "a common fit did not converge".into());
    }
    quality
}

/// One sentence about a set.
pub fn of_set(qualities: &[&Quality]) -> (QualityGrade, String) {
    let count = |v: QualityGrade| qualities.iter().filter(|q| q.verdict == v).count();
    let (good, doubtful, bad) = (
        count(QualityGrade::Good),
        count(QualityGrade::Doubtful),
        count(QualityGrade::Bad),
    );
    let all = qualities.len();
    let verdict = if 2 * bad > all || all == 0 {
        QualityGrade::Bad
    } else if bad > 0 || 2 * doubtful > all {
        QualityGrade::Doubtful
    } else {
        QualityGrade::Good
    };
    (
        verdict,
        format!("{good} of {all} FRFs good, {doubtful} doubtful, {bad} bad"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(error: f64, noise: f64, factor: f64) -> Reconstruction {
        let h = vec![Complex64::from(factor); 4];
        Reconstruction {
            error_nrms: error,
            noise_nrms: noise,
            frequency_hz: vec![1.0, 2.0, 3.0, 4.0],
            measured_m_per_n: h.clone(),
            fitted_m_per_n: h,
        }
    }

    #[test]
    fn where_most_is_left_is_told() {
        let left_at = |bad: std::ops::Range<usize>| {
            let mut power = Power::default();
            for number in 1..=3 {
                let lines = (0..100).map(|k| {
                    let left = if bad.contains(&k) { 0.5 } else { 0.01 };
                    // As mobility every line counts the same.
                    let f = 10.0 + k as f64;
                    (f, Complex64::ONE / f, Complex64::from(left / f), 0.01 / f)
                });
                power.add(number, lines);
            }
            power.most_of_the_rest()
        };
        let [from, to] = left_at(80..100).unwrap();
        assert!(
            (90.0..=94.0).contains(&from) && (105.0..=109.0).contains(&to),
            "{from} {to}"
        );
        assert_eq!(left_at(0..100), None);
        assert_eq!(left_at(0..0), None);
        assert_eq!(Power::default().most_of_the_rest(), None);
    }

    #[test]
    fn every_fault_is_named() {
        let f = [1.0, 2.0, 3.0, 4.0];
        let h = [Complex64::ONE; 4];
        let of = |coherence: Option<&[f64]>, r: Option<&Reconstruction>, m: Option<&Reconstruction>| {
            judge(&f, &h, coherence, r, m)
        };
        let good = fit(0.03, 0.03, 1.0);
        assert_eq!(
            of(Some(&[0.99; 4]), Some(&good), Some(&good)).verdict,
            QualityGrade::Good
        );
        let cases = [
            (of(None, Some(&fit(0.6, 0.6, 1.0)), None), "noise"),
            (of(None, Some(&fit(0.6, 0.03, 1.0)), None), "no common mode"),
            (of(Some(&[0.3; 4]), Some(&good), None), "coherence"),
            (of(None, Some(&good), Some(&fit(0.03, 0.03, 2.0))), "reciprocity"),
            (of(None, None, None), "too few lines"),
        ];
        for (quality, expected) in cases {
            assert_eq!(quality.verdict, QualityGrade::Bad, "{quality:?}");
            assert!(quality.reasons[0].contains(expected), "{quality:?}");
        }
    }

    /// As mobility a line at 4 Hz counts sixteen times that at 1 Hz: off by 0.2 there, of 1 and 1.2, the mirrored FRF is off by
    /// √(16 · 0.04 / (14 + 8 · 2.44)).
    #[test]
    fn reciprocity_is_judged_as_mobility_and_coherence_by_the_size_of_the_line() {
        let good = fit(0.03, 0.03, 1.0);
        let mut mirror = good.clone();
        mirror.measured_m_per_n[3] = Complex64::new(1.0, 0.0) * 1.2;
        let h = [1.0, 2.0, 2.0, 0.0].map(Complex64::from);
        let quality = judge(
            &[1.0, 2.0, 3.0, 4.0],
            &h,
            Some(&[1.0, 0.5, 0.0, 0.9]),
            Some(&good),
            Some(&mirror),
        );
        approx::assert_relative_eq!(
            quality.reciprocity_nrms.unwrap(),
            (0.64f64 / 33.52).sqrt(),
            max_relative = 1e-12
        );
        // (1 · 1 + 4 · ½ + 4 · 0) / 9
        approx::assert_relative_eq!(quality.coherence.unwrap(), 1.0 / 3.0, max_relative = 1e-12);
        let beyond = (0.64f64 / 33.52 - 2.0 * 0.0009).sqrt();
        let said = format!("reciprocity fails by {:.0} %", 100.0 * beyond);
        assert!(quality.reasons.contains(&said), "{quality:?}");
    }

    /// A spike in one FRF that is larger than all else: it is told, and the set is judged by the others.
    #[test]
    fn what_one_frf_alone_leaves_is_set_apart() {
        let judged = |spike: f64, frfs: usize, of_others: f64| {
            let mut power = Power::default();
            for number in 1..=frfs {
                let off = if number == 2 { spike } else { of_others };
                power.add(
                    number,
                    (0..50).map(|k| {
                        let left = if k == 30 { off } else { 0.0 };
                        (1.0, Complex64::from(1.0 + left), Complex64::from(left), 0.0)
                    }),
                );
            }
            let found = SetFindings {
                power,
                frequency_scatter: None,
                moving: false,
                left_out_hz: Vec::new(),
                broad_hz: Vec::new(),
                doubts: 0,
                elsewhere_hz: Vec::new(),
                own_hz: Vec::new(),
                missed_hz: Vec::new(),
                converged: true,
            };
            judge_set(&found)
        };
        let set_apart = judged(60.0, 6, 0.1);
        assert_eq!(set_apart.verdict, QualityGrade::Doubtful);
        assert!(
            set_apart.reasons[0].contains("in FRF 2 of 6 alone, the others have 0.0 %"),
            "{set_apart:?}"
        );
        // Where the others are no better, and where there are too few others.
        assert_eq!(judged(60.0, 6, 6.0).verdict, QualityGrade::Bad);
        assert_eq!(judged(60.0, 3, 0.1).verdict, QualityGrade::Bad);
    }

    #[test]
    fn powers_are_those_of_mobility() {
        let mut power = Power::default();
        let left = [
            Complex64::new(1.0, 0.0),
            Complex64::new(0.0, 1.0),
            Complex64::new(0.0, -2.0),
        ];
        for number in 1..=2 {
            power.add(
                number,
                (0..3).map(|k| (1.0 + k as f64, Complex64::from(3.0), left[k], 0.5)),
            );
        }
        // Twice: Σ f² |H|², Σ f² |left|², Σ f² σ², and 2i · (−6i)* of the second line with the third.
        let expected = [
            2.0 * 9.0 * 14.0,
            2.0 * (1.0 + 4.0 + 36.0),
            2.0 * 0.25 * 14.0,
            2.0 * -12.0,
        ];
        let found = [power.measured, power.left, power.noise, power.coloured];
        for (found, expected) in found.iter().zip(expected) {
            approx::assert_relative_eq!(*found, expected, max_relative = 1e-12);
        }
        assert_eq!(power.of_frfs, [1, 2].map(|number| (number, [126.0, 37.5])));
        let beyond: Vec<(f64, f64)> = [(1.0, 0.75), (2.0, 3.0), (3.0, 9.0 * 3.75)]
            .map(|(f, b)| (f, 2.0 * b))
            .into();
        assert_eq!(power.beyond_noise, beyond);
    }
}
