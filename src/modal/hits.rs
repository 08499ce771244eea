//! Hits in a raw tap test: where they are, and which of them are no good.

use crate::signal::median;
use crate::statistics::quantile;

/// Samples of the force above this many standard deviations of its noise may belong to a hit …
const ABOVE_NOISE: f64 = 10.0;
/// … and above this part of the peak.
const OF_PEAK: f64 = 0.05;
/// A pulse this hard, relative to the hardest, begins a hit of its own.
const OWN_HIT: f64 = 0.3;
/// Two crossings of the threshold closer than this are one contact.
const CONTACT_S: f64 = 0.002;
/// The force of a hit is over when it has stayed this long, s, …
const QUIET_S: f64 = 0.01;
/// … and this many times as long as the contact …
const QUIET_CONTACTS: f64 = 2.0;
/// … within this many standard deviations of its noise, …
const WITHIN_NOISE: f64 = 5.0;
/// … or this part of the peak, where a record has no noise. A hammer that leaves the surface still pushes a little.
const RESOLUTION: f64 = 1e-3;
/// A tail longer than this many times the quiet that is waited for is no contact: the sensor's discharge, or its drift.
const LONGEST_TAIL: usize = 5;
/// Part of the block before the hit.
const PRE_TRIGGER: f64 = 0.02;
/// Equal samples in a row at the extreme of a channel.
const CLIPPED_SAMPLES: usize = 3;
/// A response that swells again by this factor, without a hit, was bumped.
const SWELLS: f64 = 3.0;
/// Segments of a block in which the response's size is watched.
const SEGMENTS: usize = 16;

/// One hit and what the analysis does with it.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Hit {
    /// Time of the force's peak from the beginning of the record, s.
    pub time_s: f64,
    /// Peak of the force, N.
    pub peak_n: f64,
    /// Why it is left out; `None` for a good one.
    pub left_out: Option<String>,
    /// First sample of its block.
    #[serde(skip)]
    pub from: usize,
    /// Samples of the contact: first, last (from the beginning of the record).
    #[serde(skip)]
    pub contact: [usize; 2],
    /// Last sample at which force is looked for (from the beginning of the record).
    #[serde(skip)]
    pub force_until: usize,
    /// A second pulse up to there, in words: it belongs to the force.
    #[serde(skip)]
    pub second: Option<String>,
}

/// All hits of a record.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hits {
    /// In the order of time.
    pub hits: Vec<Hit>,
    /// Samples of a block, the same for all.
    pub block: usize,
}

#[derive(Clone, Copy)]
struct Pulse {
    first: usize,
    last: usize,
    peak_at: usize,
    peak_n: f64,
}

impl Pulse {
    /// The same in a record that began so many samples earlier.
    fn later_by(self, samples: usize) -> Pulse {
        Pulse {
            first: self.first + samples,
            last: self.last + samples,
            peak_at: self.peak_at + samples,
            ..self
        }
    }
}

/// Finds the hits in the force (N, baseline taken out, hits positive) and judges each by force and responses.
/// `block_s`: length of a block; from the distance of the hits where `None`.
pub(super) fn find(force_n: &[f64], responses: &[&[f64]], sample_rate_hz: f64, block_s: Option<f64>) -> Hits {
    let hardest = force_n.iter().copied().fold(0.0, f64::max);
    let size: Vec<f64> = force_n.iter().map(|f| f.abs()).collect();
    // Most of a record is no hit: the median of the size is that of the noise.
    let noise_n = 1.4826 * median(&size);
    let threshold = |peak_n: f64| (ABOVE_NOISE * noise_n).max(OF_PEAK * peak_n);
    // A weak pulse is no hit of its own; within a block it may spoil the hit before (below).
    let strong: Vec<Pulse> = pulses(force_n, threshold(hardest), sample_rate_hz)
        .into_iter()
        .filter(|p| p.peak_n >= OWN_HIT * hardest)
        .collect();
    let Some(first) = strong.first() else {
        return Hits::default();
    };
    let block = match block_s {
        Some(s) => (s * sample_rate_hz) as usize,
        None => {
            let gaps: Vec<f64> = strong
                .windows(2)
                .map(|w| (w[1].peak_at - w[0].peak_at) as f64)
                .collect();
            let to_end = (force_n.len() - first.peak_at) as f64;
            // Rebounds make short gaps, so not the median: two thirds of the way up.
            let usual = quantile(gaps.iter().copied(), 0.67).unwrap_or(to_end);
            let shortest = gaps
                .iter()
                .copied()
                .filter(|g| *g > 0.6 * usual)
                .fold(usual, f64::min);
            (0.95 * shortest) as usize
        }
    }
    .min(force_n.len());
    if block < 64 {
        return Hits::default();
    }
    let pre = ((PRE_TRIGGER * block as f64) as usize).max(4);
    let mut hits: Vec<Hit> = Vec::new();
    let mut free_from = 0;
    for rough in &strong {
        if rough.first < free_from {
            continue;
        }
        let from = rough.first.saturating_sub(pre);
        free_from = from + block;
        let to = free_from.min(force_n.len());
        // Each hit by its own peak: what is said of it does not depend on the others.
        let own = pulses(&force_n[from..to], threshold(rough.peak_n), sample_rate_hz);
        let own: Vec<Pulse> = own.into_iter().map(|p| p.later_by(from)).collect();
        let Some(pulse) = own.iter().find(|p| p.last >= rough.peak_at) else {
            continue;
        };
        let force_until = force_until(&force_n[..to], pulse, noise_n, sample_rate_hz);
        let second = own.iter().find(|p| p.first > pulse.last);
        let within = second.filter(|p| p.first <= force_until);
        let mut hit = Hit {
            time_s: pulse.peak_at as f64 / sample_rate_hz,
            peak_n: pulse.peak_n,
            left_out: None,
            from,
            contact: [pulse.first, pulse.last],
            force_until,
            second: within.map(|second| second_hit(pulse, second, sample_rate_hz)),
        };
        let outside = own.iter().find(|p| p.first > force_until);
        hit.left_out = fault(&hit, pulse, outside, force_n, responses, block, sample_rate_hz);
        hits.push(hit);
    }
    Hits { hits, block }
}

fn fault(
    hit: &Hit,
    pulse: &Pulse,
    outside: Option<&Pulse>,
    force_n: &[f64],
    responses: &[&[f64]],
    block: usize,
    sample_rate_hz: f64,
) -> Option<String> {
    let to = hit.from + block;
    // A record cut a little short loses nothing but zeros.
    if to > force_n.len() + block / 50 {
        return Some(format!(
            "the record ends {:.2} s after it, a block is {:.2} s",
            (force_n.len() - pulse.peak_at) as f64 / sample_rate_hz,
            block as f64 / sample_rate_hz
        ));
    }
    let to = to.min(force_n.len());
    if let Some(second) = outside {
        return Some(second_hit(pulse, second, sample_rate_hz));
    }
    if clipped(&force_n[pulse.first..=pulse.last.min(force_n.len() - 1)]) {
        return Some(format!("the force is clipped at {:.0} N", pulse.peak_n));
    }
    for (k, response) in responses.iter().enumerate() {
        if clipped(&response[hit.from..to]) {
            return Some(format!("response {} is clipped", k + 1));
        }
        if let Some(after) = swells(&response[hit.from..to], pulse.last - hit.from) {
            return Some(format!(
                "late bump: response {} swells again {:.2} s after the hit",
                k + 1,
                after as f64 / sample_rate_hz
            ));
        }
    }
    None
}

fn second_hit(first: &Pulse, second: &Pulse, sample_rate_hz: f64) -> String {
    format!(
        "double hit: a second one of {:.0} % after {:.1} ms",
        100.0 * second.peak_n / first.peak_n,
        1e3 * (second.peak_at - first.peak_at) as f64 / sample_rate_hz
    )
}

/// Last sample of the quiet after the pulse. A tail of a few per cent that lasts ten contacts is a tenth of the impulse.
fn force_until(force_n: &[f64], pulse: &Pulse, noise_n: f64, sample_rate_hz: f64) -> usize {
    let contact = (pulse.last - pulse.first + 1) as f64;
    let quiet = (QUIET_S * sample_rate_hz).max(QUIET_CONTACTS * contact).ceil() as usize;
    let level = (WITHIN_NOISE * noise_n).max(RESOLUTION * pulse.peak_n);
    let mut last = pulse.last;
    let tail = force_n.iter().enumerate().skip(pulse.last + 1);
    for (k, f) in tail.take(LONGEST_TAIL * quiet) {
        if k > last + quiet {
            break;
        }
        if f.abs() > level {
            last = k;
        }
    }
    last + quiet
}

/// Stretches of the force above `threshold`, N.
fn pulses(force_n: &[f64], threshold: f64, sample_rate_hz: f64) -> Vec<Pulse> {
    let contact = (CONTACT_S * sample_rate_hz).ceil() as usize;
    let mut found: Vec<Pulse> = Vec::new();
    for (k, &f) in force_n.iter().enumerate().filter(|(_, f)| **f > threshold) {
        match found.last_mut() {
            // A rebound is separated by a dip below the threshold.
            Some(p) if k - p.last <= 1.max(contact / 4) => {
                p.last = k;
                if f > p.peak_n {
                    (p.peak_at, p.peak_n) = (k, f);
                }
            }
            _ => found.push(Pulse {
                first: k,
                last: k,
                peak_at: k,
                peak_n: f,
            }),
        }
    }
    found
}

/// Several samples in a row at exactly the extreme value.
fn clipped(samples: &[f64]) -> bool {
    let (low, high) = samples
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| {
            (l.min(x), h.max(x))
        });
    if !(high > low) {
        return false;
    }
    let run = |extreme: f64| {
        let mut longest = 0;
        let mut now = 0;
        for &x in samples {
            now = if x == extreme { now + 1 } else { 0 };
            longest = longest.max(now);
        }
        longest
    };
    // Quantised signals rest at small values, but not at their extremes in both size and row.
    run(high) >= CLIPPED_SAMPLES && high >= -low * 0.5 || run(low) >= CLIPPED_SAMPLES && -low >= high * 0.5
}

/// Samples after the hit at which the response grows again, if it does.
fn swells(response: &[f64], hit: usize) -> Option<usize> {
    let after = &response[hit.min(response.len())..];
    let length = after.len() / SEGMENTS;
    if length < 8 {
        return None;
    }
    let mean = after.iter().sum::<f64>() / after.len() as f64;
    let size: Vec<f64> = after
        .chunks_exact(length)
        .map(|s| (s.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / length as f64).sqrt())
        .collect();
    let mut least = size[0];
    for (k, &now) in size.iter().enumerate().skip(1) {
        // Beats of close modes come back too, but not to more than they lost: watch the later half for what is
        // clearly above the quietest moment and not small against the hit.
        if now > SWELLS * least && now > 0.1 * size[0] && k >= 3 {
            return Some(k * length);
        }
        least = least.min(now);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1600 samples after the hit, a sine about an offset whose size is given by the segment of a hundred samples.
    fn after_a_hit(size: impl Fn(usize) -> f64) -> Vec<f64> {
        let quiet = vec![5.0; 40];
        let ringing = (0..1600).map(|i| 5.0 + size(i / 100) * (i as f64).sin());
        quiet.into_iter().chain(ringing).collect()
    }

    /// What dies out and comes back in the later part of a record was not the hit: another machine, a hand on the robot.
    #[test]
    fn a_response_that_comes_back_is_told_with_its_moment() {
        let decaying = |k: usize| 0.5f64.powi(k as i32);
        assert_eq!(swells(&after_a_hit(decaying), 40), None);
        let comes_back = |size: f64| move |k: usize| if k >= 9 { size } else { decaying(k) };
        assert_eq!(swells(&after_a_hit(comes_back(0.5)), 40), Some(900));
        // A tenth of the hit, or what is not three times the quietest, is nothing.
        assert_eq!(swells(&after_a_hit(comes_back(0.09)), 40), None);
        assert_eq!(
            swells(
                &after_a_hit(|k| if k < 6 { 1.0 - 0.1 * k as f64 } else { 1.1 }),
                40
            ),
            None
        );
        // Beats of close modes come back early.
        let beats = |k: usize| [1.0, 0.05, 0.6, 0.1][k.min(3)];
        assert_eq!(swells(&after_a_hit(beats), 40), None);
        assert_eq!(swells(&[1.0; 100], 0), None);
    }

    #[test]
    fn a_pulse_of_a_later_stretch_is_counted_from_the_beginning() {
        let pulse = Pulse {
            first: 10,
            last: 14,
            peak_at: 12,
            peak_n: 300.0,
        };
        let later = pulse.later_by(100);
        assert_eq!(
            (later.first, later.last, later.peak_at, later.peak_n),
            (110, 114, 112, 300.0)
        );
    }
}
