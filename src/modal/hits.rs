//! Hits in a raw tap test: where they are, and which of them are no good.

use crate::signal::median;
use crate::statistics::quantile;

/// Samples of the force above this many standard deviations of its noise may belong to a hit …
const ABOVE_NOISE: f64 = 10.0;
/// … and above this part of the hardest hit.
const OF_HARDEST: f64 = 0.05;
/// A pulse this hard, relative to the hardest, begins a hit of its own.
const OWN_HIT: f64 = 0.3;
/// Two crossings of the threshold closer than this are one contact.
const CONTACT_S: f64 = 0.002;
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

/// Finds the hits in the force (N, baseline taken out, hits positive) and judges each by force and responses.
/// `block_s`: length of a block; from the distance of the hits where `None`.
pub(super) fn find(force_n: &[f64], responses: &[&[f64]], sample_rate_hz: f64, block_s: Option<f64>) -> Hits {
    let pulses = pulses(force_n, sample_rate_hz);
    let hardest = pulses.iter().map(|p| p.peak_n).fold(0.0, f64::max);
    let strong: Vec<&Pulse> = pulses.iter().filter(|p| p.peak_n >= OWN_HIT * hardest).collect();
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
    for pulse in &pulses {
        // A weak pulse is no hit of its own; within a block it spoils the hit before (below).
        if pulse.first < free_from || pulse.peak_n < OWN_HIT * hardest {
            continue;
        }
        let from = pulse.first.saturating_sub(pre);
        free_from = from + block;
        let mut hit = Hit {
            time_s: pulse.peak_at as f64 / sample_rate_hz,
            peak_n: pulse.peak_n,
            left_out: None,
            from,
            contact: [pulse.first, pulse.last],
        };
        hit.left_out = fault(&hit, pulse, &pulses, force_n, responses, block, sample_rate_hz);
        hits.push(hit);
    }
    Hits { hits, block }
}

fn fault(
    hit: &Hit,
    pulse: &Pulse,
    pulses: &[Pulse],
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
    if let Some(second) = pulses.iter().find(|p| p.first > pulse.last && p.first < to) {
        return Some(format!(
            "double hit: a second one of {:.0} % after {:.1} ms",
            100.0 * second.peak_n / pulse.peak_n,
            1e3 * (second.peak_at - pulse.peak_at) as f64 / sample_rate_hz
        ));
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

fn pulses(force_n: &[f64], sample_rate_hz: f64) -> Vec<Pulse> {
    let hardest = force_n.iter().copied().fold(0.0, f64::max);
    let size: Vec<f64> = force_n.iter().map(|f| f.abs()).collect();
    // Most of a record is no hit: the median of the size is that of the noise.
    let noise = 1.4826 * median(&size);
    let threshold = (ABOVE_NOISE * noise).max(OF_HARDEST * hardest);
    if !(hardest > threshold) {
        return Vec::new();
    }
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
