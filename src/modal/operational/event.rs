//! Motion that is one event and not lasting: a release, a drop, a single hit, a door. What decays is no random motion, and its slow
//! oscillation looks like the line of a rotating part.

/// Stretches into which a record is divided.
const STRETCHES: usize = 40;
/// So much of the motion …
const MOST: f64 = 0.95;
/// … in so little of the record is one event.
const BRIEF: f64 = 0.25;

/// From where to where, as shares of the record, nearly all motion lies, if that is one brief stretch of it.
pub(super) fn one_event(channels: &[Vec<f64>]) -> Option<[f64; 2]> {
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

fn squares_about_mean(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|v| (v - mean).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

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
