//! Limits over spindle speed, whatever the method that finds them: curves, their tips, and where they are best.

use rayon::prelude::*;
use serde::Serialize;

use crate::{Error, Result, stop};

/// Where chatter starts at one spindle speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limit {
    /// Width of cut b: axial depth in milling, (diameter − pilot diameter)/2 in drilling.
    pub depth_mm: f64,
    /// Frequency of the chatter, Hz.
    pub chatter_hz: f64,
    /// Whole waves between two teeth, k in ωT = 2πk + ε.
    pub lobe: u32,
}

/// A method that knows the limit at a spindle speed.
pub trait SpeedLimit: Sync {
    /// The smallest b at which chatter starts at a speed (> 0, rpm); `None` where nothing limits the cut.
    fn limit_at(&self, spindle_rpm: f64) -> Option<Limit>;

    /// The depth below which no speed chatters, where the method knows it without trying speeds.
    fn absolute_limit(&self) -> Option<AbsoluteLimit> {
        None
    }

    /// Speeds that one thread takes at once.
    fn speeds_per_task(&self) -> usize {
        1
    }

    /// The limit at each speed, in parallel.
    fn curve(&self, spindle_rpm: &[f64]) -> LobeCurve {
        let limits: Vec<Option<Limit>> = spindle_rpm
            .par_iter()
            .with_min_len(self.speeds_per_task())
            .map(|n| {
                stop::point();
                self.limit_at(*n)
            })
            .collect();
        LobeCurve {
            spindle_rpm: spindle_rpm.to_vec(),
            depth_limit_mm: limits.iter().map(|l| l.map(|l| l.depth_mm)).collect(),
            chatter_hz: limits.iter().map(|l| l.map(|l| l.chatter_hz)).collect(),
        }
    }

    /// The `count` deepest peaks of a curve of this method, deepest first, each moved to the true tip between its
    /// neighbouring speeds. An end of the curve counts where it is deeper than every tip.
    fn best(&self, curve: &LobeCurve, count: usize) -> Vec<Peak> {
        let mut found = peaks(curve);
        let inside = found
            .iter()
            .map(|p| depth_order(p.depth_mm))
            .fold(f64::NEG_INFINITY, f64::max);
        if let Some(deepest) = peak_near(curve, [f64::NEG_INFINITY, f64::INFINITY])
            && depth_order(deepest.depth_mm) > inside
        {
            found.push(deepest);
        }
        found.sort_by(|a, b| depth_order(b.depth_mm).total_cmp(&depth_order(a.depth_mm)));
        found.truncate(count);
        found
            .into_iter()
            .map(|peak| {
                if peak.at_range_end {
                    peak
                } else {
                    self.refined(curve, peak)
                }
            })
            .collect()
    }

    /// A peak of a curve of this method, moved to the true tip between the neighbouring speeds.
    fn refined(&self, curve: &LobeCurve, peak: Peak) -> Peak {
        let at = curve.spindle_rpm.partition_point(|n| *n < peak.spindle_rpm);
        let neighbour = |i: usize| curve.spindle_rpm.get(i).copied().unwrap_or(peak.spindle_rpm);
        let (low, high) = (neighbour(at.saturating_sub(1)), neighbour(at + 1));
        if peak.depth_mm.is_none() {
            return peak;
        }
        let depth = |n: f64| self.limit_at(n).map_or(f64::INFINITY, |l| l.depth_mm);
        let (spindle_rpm, depth_mm) = golden_maximum(low, high, self.golden_steps(), depth);
        if depth_mm.is_finite() && Some(depth_mm) >= peak.depth_mm {
            Peak {
                spindle_rpm,
                depth_mm: Some(depth_mm),
                ..peak
            }
        } else {
            peak
        }
    }

    /// Steps of the golden section when a tip is refined: 0.618^48 < 1e-10 of the interval.
    fn golden_steps(&self) -> usize {
        48
    }
}

/// The limit over spindle speeds; all three as long. `None` (JSON `null`): nothing limits the cut at that speed
/// within the band of the FRF.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LobeCurve {
    /// Spindle speeds, rpm.
    pub spindle_rpm: Vec<f64>,
    /// Limit of the width of cut at each speed, mm.
    pub depth_limit_mm: Vec<Option<f64>>,
    /// Frequency of the chatter at that limit, Hz.
    pub chatter_hz: Vec<Option<f64>>,
}

impl LobeCurve {
    /// The least limit over the speeds of this curve; `None` where nothing is limited.
    pub fn least(&self) -> Option<AbsoluteLimit> {
        self.depth_limit_mm
            .iter()
            .zip(&self.chatter_hz)
            .filter_map(|(depth, chatter)| {
                Some(AbsoluteLimit {
                    depth_mm: (*depth)?,
                    chatter_hz: (*chatter)?,
                })
            })
            .min_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
    }
}

/// The depth below which no speed whatever chatters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AbsoluteLimit {
    /// Width of cut, mm.
    pub depth_mm: f64,
    /// Frequency of the chatter there, Hz.
    pub chatter_hz: f64,
}

/// A local maximum of the limit over speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Peak {
    /// Spindle speed, rpm.
    pub spindle_rpm: f64,
    /// `None`: unlimited around this speed.
    pub depth_mm: Option<f64>,
    /// The deepest point is an end of the range of speeds: it may be deeper still beyond.
    pub at_range_end: bool,
    /// The 5 % quantile of the limit at this speed over the model's uncertainty, where it is known: the depth to use.
    pub lower_quantile_mm: Option<f64>,
}

impl Peak {
    /// A peak inside the range of speeds, without a quantile.
    pub fn new(spindle_rpm: f64, depth_mm: Option<f64>) -> Self {
        Peak {
            spindle_rpm,
            depth_mm,
            at_range_end: false,
            lower_quantile_mm: None,
        }
    }
}

/// Greatest value of a function with one maximum between `low` and `high`: place and value (golden section, with
/// the ends looked at too).
pub(super) fn golden_maximum(low: f64, high: f64, steps: usize, f: impl Fn(f64) -> f64) -> (f64, f64) {
    const SHRINK: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (low, high);
    let (mut x1, mut x2) = (b - SHRINK * (b - a), a + SHRINK * (b - a));
    let (mut f1, mut f2) = (f(x1), f(x2));
    for _ in 0..steps {
        if f1 >= f2 {
            (b, x2, f2) = (x2, x1, f1);
            x1 = b - SHRINK * (b - a);
            f1 = f(x1);
        } else {
            (a, x1, f1) = (x1, x2, f2);
            x2 = a + SHRINK * (b - a);
            f2 = f(x2);
        }
    }
    let inner = if f1 >= f2 { (x1, f1) } else { (x2, f2) };
    [(low, f(low)), (high, f(high))]
        .into_iter()
        .fold(inner, |best, end| if end.1 > best.1 { end } else { best })
}

/// Speeds from, to, step (rpm): `from`, `from + step`, … up to `to` (included within a millionth of a step).
///
/// # Errors
/// Where that is no ascending grid of positive speeds, or more than ten million of them.
pub fn speed_grid(from_to_step: [f64; 3]) -> Result<Vec<f64>> {
    let [from, to, step] = from_to_step;
    let count = ((to - from) / step + 1e-6).floor();
    if !(from > 0.0 && to >= from && step > 0.0 && to.is_finite() && count < 1e7) {
        return Err(Error::computation(format!(
            "lobes: from {from} to {to} rpm in steps of {step} is no grid of spindle speeds; \
             give [from, to, step] with 0 < from ≤ to and a positive step"
        )));
    }
    Ok((0..=count as usize).map(|i| from + step * i as f64).collect())
}

/// Unlimited counts as deepest.
pub(super) fn depth_order(depth_mm: Option<f64>) -> f64 {
    depth_mm.unwrap_or(f64::INFINITY)
}

/// Local maxima of a curve inside its speed range, ascending in speed; a stretch of equal depth (or without limit)
/// counts once, at its middle.
pub fn peaks(curve: &LobeCurve) -> Vec<Peak> {
    let depth: Vec<f64> = curve.depth_limit_mm.iter().map(|d| depth_order(*d)).collect();
    let mut found = Vec::new();
    let mut start = 1;
    while start + 1 < depth.len() {
        let mut end = start;
        while end + 1 < depth.len() && depth[end + 1] == depth[start] {
            end += 1;
        }
        let falls = end + 1 < depth.len() && depth[end + 1] < depth[start];
        if depth[start - 1] < depth[start] && falls {
            found.push(peak_at(curve, (start + end) / 2));
        }
        start = end + 1;
    }
    found
}

/// The deepest point of a curve between two speeds (both included); `None` where the curve has no speed there.
pub fn peak_near(curve: &LobeCurve, rpm_range: [f64; 2]) -> Option<Peak> {
    let deepest = (0..curve.spindle_rpm.len())
        .filter(|i| (rpm_range[0]..=rpm_range[1]).contains(&curve.spindle_rpm[*i]))
        .max_by(|i, j| {
            let order = |i: &usize| depth_order(curve.depth_limit_mm[*i]);
            order(i).total_cmp(&order(j))
        })?;
    Some(peak_at(curve, deepest))
}

fn peak_at(curve: &LobeCurve, index: usize) -> Peak {
    Peak {
        spindle_rpm: curve.spindle_rpm[index],
        depth_mm: curve.depth_limit_mm[index],
        at_range_end: index == 0 || index + 1 == curve.spindle_rpm.len(),
        lower_quantile_mm: None,
    }
}
