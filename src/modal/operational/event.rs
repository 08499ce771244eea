//! Motion that is one event and not lasting: a release, a drop, a single hit, a door. What decays is no random motion, and its slow
//! oscillation looks like the line of a rotating part.

/// Stretches into which a record is divided.
const STRETCHES: usize = 40;
/// So much of the motion …
const MOST: f64 = 0.95;
/// … in so little of the record is one event.
const BRIEF: f64 = 0.25;

/// A level that changes so many times between stretches of a record is told.
const CHANGES: f64 = 5.0;

/// A record of which one part is much louder than the rest.
#[derive(Debug, PartialEq)]
pub(super) struct LevelChange {
    /// How many times as large the motion is there.
    pub times: f64,
    /// From where to where, as shares of the record.
    pub loud: [f64; 2],
}

/// Power of the motion stretch by stretch.
type Motion = [f64; STRETCHES];

/// Says where the motion is much larger than in the rest, where that is one stretch of some length.
pub(super) fn level_changes(motion: &Motion) -> Option<LevelChange> {
    let middle = |mut values: Vec<f64>| -> Option<f64> {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let mut sorted = motion.to_vec();
    sorted.sort_by(f64::total_cmp);
    // Between the levels, of powers.
    let between = (sorted[STRETCHES / 10] * sorted[STRETCHES - 1 - STRETCHES / 10]).sqrt();
    let is_loud = |k: &usize| motion[*k] > between;
    let from = (0..STRETCHES).find(is_loud)?;
    let to = (0..STRETCHES).rfind(is_loud)? + 1;
    let (loud, quiet): (Vec<usize>, Vec<usize>) = (0..STRETCHES).partition(is_loud);
    let power = |of: Vec<usize>| middle(of.into_iter().map(|k| motion[k]).collect());
    // With holes in it, it is no stretch.
    let whole = 10 * loud.len() >= 9 * (to - from);
    let times = (power(loud)? / power(quiet)?).sqrt();
    let share = |stretch: usize| stretch as f64 / STRETCHES as f64;
    (whole && times.is_finite() && times > CHANGES).then(|| LevelChange {
        times,
        loud: [share(from), share(to)],
    })
}

/// From where to where, as shares of the record, nearly all motion lies, if that is one brief stretch of it.
pub(super) fn one_event(motion: &Motion) -> Option<[f64; 2]> {
    let whole: f64 = motion.iter().sum();
    let brief = (BRIEF * STRETCHES as f64) as usize;
    let (from, held) = motion
        .windows(brief)
        .map(|window| window.iter().sum::<f64>())
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    if !(held > MOST * whole) {
        return None;
    }
    let loud: Vec<usize> = (from..from + brief)
        .filter(|&k| motion[k] > (1.0 - MOST) * whole / brief as f64)
        .collect();
    let share = |stretch: usize| stretch as f64 / STRETCHES as f64;
    Some([share(*loud.first()?), share(loud.last()? + 1)])
}

/// Each channel with the weight one; `None` for a record of a few samples.
pub(super) fn motion(channels: &[Vec<f64>]) -> Option<Motion> {
    let lines = channels.first()?.len();
    let length = lines / STRETCHES;
    if length < 2 {
        return None;
    }
    // About the mean of the stretch: where a sensor stands still it has no motion, whatever it shows.
    let mut motion = [0.0; STRETCHES];
    for channel in channels {
        let of_stretches: Vec<f64> = channel
            .chunks_exact(length)
            .take(STRETCHES)
            .map(squares_about_mean)
            .collect();
        let whole: f64 = of_stretches.iter().sum();
        if whole > 0.0 {
            for (sum, own) in motion.iter_mut().zip(of_stretches) {
                *sum += own / whole;
            }
        }
    }
    Some(motion)
}

fn squares_about_mean(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|v| (v - mean).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::{LevelChange, motion};

    fn one_event(channels: &[Vec<f64>]) -> Option<[f64; 2]> {
        super::one_event(&motion(channels)?)
    }

    fn level_changes(channels: &[Vec<f64>]) -> Option<LevelChange> {
        super::level_changes(&motion(channels)?)
    }

    fn record(motion: impl Fn(f64) -> f64) -> Vec<Vec<f64>> {
        let samples = (0..8000).map(|k| f64::from(k) / 1000.0);
        vec![samples.map(motion).collect()]
    }

    fn decay(t: f64) -> f64 {
        if t < 0.0 {
            0.0
        } else {
            (-2.5 * t).exp() * (TAU * 3.0 * t).sin()
        }
    }

    #[test]
    fn a_release_is_one_event_and_where_it_is_is_said() {
        // Held at 40, let go at 1 s.
        let released = record(|t| if t < 1.0 { 40.0 } else { 40.0 * decay(t - 1.0) });
        let [from, to] = one_event(&released).unwrap();
        assert!((8.0 * from - 1.0).abs() < 0.21, "{from}");
        assert!((1.6..3.0).contains(&(8.0 * to)), "{to}");
    }

    #[test]
    fn a_cut_within_air_is_told_and_steady_motion_is_not() {
        let level = |t: f64| if (1.0..4.0).contains(&t) { 1.0 } else { 0.05 };
        let cut = record(|t| level(t) * (TAU * 37.0 * t).sin());
        let found = level_changes(&cut).unwrap();
        assert!((found.times / 20.0 - 1.0).abs() < 0.2, "{found:?}");
        assert!((8.0 * found.loud[0] - 1.0).abs() < 0.21 && (8.0 * found.loud[1] - 4.0).abs() < 0.21);
        assert_eq!(level_changes(&record(|t| (TAU * 37.0 * t).sin())), None);
        let hits = record(|t| (0..4).map(|k| decay(t - 0.3 - 2.0 * f64::from(k))).sum());
        assert_eq!(level_changes(&hits), None);
        assert_eq!(level_changes(&record(|_| 1.0)), None);
        assert_eq!(level_changes(&[]), None);
    }

    #[test]
    fn what_lasts_or_comes_again_is_not_one_event() {
        assert_eq!(one_event(&record(|t| (TAU * 7.0 * t).sin())), None);
        let hits = record(|t| (0..4).map(|k| decay(t - 0.3 - 2.0 * f64::from(k))).sum());
        assert_eq!(one_event(&hits), None);
        // A bump that is no more than the rest of the record.
        let bump = record(|t| (TAU * 7.0 * t).sin() + 2.0 * decay(t - 3.0));
        assert_eq!(one_event(&bump), None);
        assert_eq!(one_event(&record(|_| 1.0)), None);
        assert_eq!(one_event(&[vec![0.0; 10]]), None);
        assert_eq!(one_event(&[]), None);
    }
}
