//! Which channel of a record holds short pulses where the others ring on: the hammer of a tap test.

use super::blocks::median;

/// A hammer's samples that count are at most this share of the record …
const SHORT: f64 = 0.05;
/// … and so many times fewer than those of any other channel.
const SHORTER: f64 = 4.0;
/// What a hit sets in motion has so many times the power behind it as before it.
const SET_IN_MOTION: f64 = 4.0;
/// Part of the record on either side of the highest pulse in which that is looked for.
const AROUND: f64 = 0.02;

/// The only channel of short pulses that set another in motion; an electrical spike does not.
pub fn pulsed_channel(channels: &[&[f64]]) -> Option<usize> {
    let length = channels.iter().map(|c| c.len()).min()?;
    let channels: Vec<&[f64]> = channels.iter().map(|c| &c[..length]).collect();
    let levels: Vec<f64> = channels.iter().map(|c| median(c)).collect();
    let lasting: Vec<Option<f64>> = channels
        .iter()
        .zip(&levels)
        .map(|(c, level)| samples_that_count(c, *level))
        .collect();
    let known = || lasting.iter().enumerate().filter_map(|(k, n)| Some((k, (*n)?)));
    let (pulsed, shortest) = known().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut others = known().filter(|(k, _)| *k != pulsed);
    if shortest > SHORT * length as f64 || others.any(|(_, n)| n < SHORTER * shortest) {
        return None;
    }
    let height = |k: &usize| (channels[pulsed][*k] - levels[pulsed]).abs();
    let highest = (0..length).max_by(|a, b| height(a).total_cmp(&height(b)))?;
    let reach = ((AROUND * length as f64) as usize).max(4 * shortest.ceil() as usize);
    let gap = shortest.ceil() as usize;
    let before = highest.saturating_sub(reach + gap)..highest.saturating_sub(gap);
    let behind = highest..(highest + reach).min(length);
    let moves = |k: usize| {
        let power = |range: std::ops::Range<usize>| {
            let count = range.len().max(1) as f64;
            let squares = channels[k][range].iter().map(|x| (x - levels[k]).powi(2));
            squares.sum::<f64>() / count
        };
        power(behind.clone()) > SET_IN_MOTION * power(before.clone())
    };
    // A record that begins with the pulse has nothing before it to compare with.
    let begins_with_it = before.len() < reach / 4;
    (begins_with_it || known().any(|(k, _)| k != pulsed && moves(k))).then_some(pulsed)
}

/// How many samples share a channel's power about its level among them; `None` where it is flat.
fn samples_that_count(samples: &[f64], level: f64) -> Option<f64> {
    let (squares, fourths) = samples.iter().fold((0.0, 0.0), |(s, f), x| {
        let square = (x - level).powi(2);
        (s + square, f + square * square)
    });
    let count = squares * squares / fourths;
    count.is_finite().then_some(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hammer_is_the_channel_of_short_pulses() {
        let noise = |k: usize, seed: usize| 0.01 * ((k * k * 7 + seed * k) % 13) as f64 - 0.06;
        let hit = |k: usize| {
            if (200..204).contains(&(k % 2000)) {
                50.0
            } else {
                0.0
            }
        };
        let ring = |k: usize| match (k % 2000).checked_sub(200) {
            Some(t) => 5.0 * (-(t as f64) / 150.0).exp() * (0.4 * t as f64).sin(),
            None => 0.0,
        };
        let of = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..8000).map(f).collect() };
        let force = of(&|k| hit(k) + noise(k, 1));
        let near = of(&|k| ring(k) + noise(k, 2));
        let far = of(&|k| -0.3 * ring(k) + noise(k, 3));
        assert_eq!(pulsed_channel(&[&near, &far, &force]), Some(2));
        assert_eq!(pulsed_channel(&[&force, &near]), Some(0));
        // An electrical spike sets nothing in motion, nor do two channels that ring make one a hammer.
        let mut spiked = near.clone();
        spiked[1500] = 5000.0;
        assert_eq!(pulsed_channel(&[&spiked, &far]), None);
        assert_eq!(pulsed_channel(&[&near, &far]), None);
        assert_eq!(pulsed_channel(&[&force, &vec![0.0; 8000]]), None);
        assert_eq!(pulsed_channel(&[]), None);
    }
}
