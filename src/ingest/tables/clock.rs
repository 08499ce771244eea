//! Time stamps of samples: whether they are even, at which rate, and what is done where they are not.

/// Deviation from an even grid, as a part of the step, that is taken for even.
const EVEN: f64 = 0.02;
/// Beyond this many times the usual step between two samples nothing can be interpolated.
const WIDEST_STEP: f64 = 4.0;
/// Fewer samples show no rate that they could be put on.
const LEAST_TO_RESAMPLE: usize = 8;
/// Samples of a block whose mean step is compared with that of other blocks.
const BLOCK: usize = 32;
/// Change of the mean step over the record that counts as another rate, not as jitter.
const RATE_CHANGE: f64 = 0.05;

/// Even times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Grid {
    pub rate_hz: f64,
    pub start_s: f64,
    pub samples: usize,
}

/// What time stamps are.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Stamps {
    Even(Grid),
    /// The grid to resample onto, and what to tell.
    Uneven(Grid, String),
}

/// Looks at the stamps of a record without gaps; `resolution_s` is what printing left of them.
///
/// The rate is (n − 1)/(t_last − t_first): single steps are rounded, the whole is not.
///
/// # Errors
/// What is wrong, where the samples cannot be put on a grid either: fewer than two, times that do not rise, holes.
pub(crate) fn look(times_s: &[f64], resolution_s: f64) -> Result<Stamps, String> {
    let [first, .., last] = times_s else {
        return Err("fewer than two samples".into());
    };
    let count = times_s.len();
    let step = (last - first) / (count - 1) as f64;
    if !(step > 0.0 && step.is_finite() && step.recip().is_finite() && step.is_normal()) {
        return Err("the times do not rise".into());
    }
    let grid = |step: f64| Grid {
        rate_hz: 1.0 / step,
        start_s: *first,
        samples: ((last - first) / step * (1.0 + 1e-12)).floor() as usize + 1,
    };
    if is_even(times_s, step, resolution_s) {
        return Ok(Stamps::Even(Grid {
            samples: count,
            ..grid(step)
        }));
    }
    let steps = || times_s.windows(2).map(|w| w[1] - w[0]);
    let shortest = steps().fold(f64::INFINITY, f64::min);
    let longest = steps().fold(0.0, f64::max);
    if shortest <= 0.0 {
        let at = steps().position(|s| s <= 0.0).map_or(*first, |i| times_s[i]);
        return Err(format!("the times do not rise at {at:.6} s"));
    }
    // Blocks tell a change of the rate from jitter: jitter averages out.
    let width = BLOCK.max(count / 64).min(count - 1);
    let means = times_s
        .windows(width + 1)
        .step_by(width)
        .map(|w| (w[width] - w[0]) / width as f64);
    let (fine, coarse) = means.fold((f64::INFINITY, 0.0_f64), |(low, high), m| {
        (low.min(m), high.max(m))
    });
    // Steps that scatter by so much (from their differences) make means of blocks differ by less than this.
    let second = times_s
        .windows(3)
        .map(|w| (w[2] - 2.0 * w[1] + w[0]).powi(2))
        .sum::<f64>();
    let scatter = (second / 2.0 / (count - 2) as f64).sqrt();
    let by_chance = 6.0 * scatter / (width as f64).sqrt();
    let changes = count > 4 * BLOCK && coarse - fine > RATE_CHANGE * fine + by_chance;
    let chosen = if changes { fine } else { step };
    if count < LEAST_TO_RESAMPLE {
        return Err(format!("steps from {shortest:.6} to {longest:.6} s"));
    }
    if longest > WIDEST_STEP * chosen {
        let at = steps().position(|s| s == longest).map_or(*first, |i| times_s[i]);
        return Err(format!(
            "a hole of {longest:.6} s behind {at:.6} s among steps of about {chosen:.6} s"
        ));
    }
    let kind = if changes {
        format!(
            "the rate changes between {:.1} and {:.1} Hz",
            1.0 / coarse,
            1.0 / fine
        )
    } else {
        format!("steps from {shortest:.3e} to {longest:.3e} s")
    };
    let grid = grid(chosen);
    let told = format!(
        "the samples are not evenly spaced in time ({kind}): resampled at {:.3} Hz by cubic interpolation, which weakens \
         what is near half that rate. If the recorder's clock is even and only its stamps are not, leave the time column \
         out and give the rate",
        grid.rate_hz
    );
    Ok(Stamps::Uneven(grid, told))
}

/// True where the times lie on an even grid, within the rounding of the stamps and [`EVEN`] of the step.
pub(crate) fn is_even(times_s: &[f64], step_s: f64, resolution_s: f64) -> bool {
    let Some(&start) = times_s.first() else {
        return false;
    };
    let slack = 1.01 * resolution_s + EVEN * step_s;
    let off = |(i, t): (usize, &f64)| (t - start - step_s * i as f64).abs() <= slack;
    times_s.iter().enumerate().all(off)
}

/// Rounding of times that are stored or printed with about six digits (`E13.5`, single precision), s.
pub(crate) fn six_digits(times_s: &[f64]) -> f64 {
    1e-5 * times_s.iter().fold(0.0_f64, |most, t| most.max(t.abs()))
}

/// Values taken at rising times, on the grid: through the four samples around each place (Lagrange, third order).
pub(crate) fn resample(times_s: &[f64], values: &[f64], grid: Grid) -> Vec<f64> {
    let count = times_s.len().min(values.len());
    let mut behind = 0;
    (0..grid.samples)
        .map(|k| {
            let t = grid.start_s + k as f64 / grid.rate_hz;
            while behind + 1 < count && times_s[behind + 1] <= t {
                behind += 1;
            }
            let from = behind.saturating_sub(1).min(count.saturating_sub(4));
            let near = from..(from + 4).min(count);
            if values[near.clone()].iter().all(|v| *v == values[from]) {
                return values[from];
            }
            near.clone()
                .map(|i| {
                    let others = near.clone().filter(|j| *j != i);
                    let weight = |j: usize| (t - times_s[j]) / (times_s[i] - times_s[j]);
                    values[i] * others.map(weight).product::<f64>()
                })
                .sum()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(count: usize, mut at: impl FnMut(f64) -> f64) -> Vec<f64> {
        (0..count).map(|i| at(i as f64)).collect()
    }

    #[test]
    fn the_rate_is_that_of_the_whole_and_not_of_rounded_steps() {
        // 25.6 kHz with stamps in whole microseconds: the median step, 39 µs, would be 25,641 Hz.
        let stamps = times(25_600, |i| (i / 25_600.0 * 1e6).round() * 1e-6);
        let Stamps::Even(grid) = look(&stamps, 1e-6).unwrap() else {
            panic!("even");
        };
        assert!((grid.rate_hz / 25_600.0 - 1.0).abs() < 2e-6, "{}", grid.rate_hz);
        assert_eq!(grid.samples, 25_600);
    }

    #[test]
    fn uneven_samples_come_back_on_an_even_grid() {
        let wave = |t: f64| (2.0 * std::f64::consts::PI * 20.0 * t).sin();
        let jitter = |i: f64| 1e-3 * (i + 0.3 * (i * 12.9898).sin());
        let drift = |i: f64| 1e-3 * (i + 5e-5 * i * i);
        // Half a step: single steps from nearly nothing to nearly two.
        let wild = |i: f64| 1e-3 * (i + 0.49 * (i * 78.233).sin());
        let change = |i: f64| {
            1e-3 * if i < 1000.0 {
                i
            } else {
                1000.0 + (i - 1000.0) / 0.7
            }
        };
        let mut now = 0.0;
        let random = times(2000, |i| {
            now += 1e-3 * (1.0 + 0.5 * (i * i * 78.233).sin());
            now
        });
        for (name, stamps, rate) in [
            ("jitter", times(2000, jitter), 1000.0),
            ("wild", times(2000, wild), 1000.0),
            ("random steps", random, 1000.0),
            ("drift", times(2000, drift), 1000.0),
            ("change", times(2000, change), 1000.0),
        ] {
            let Stamps::Uneven(grid, told) = look(&stamps, 1e-9).unwrap() else {
                panic!("{name}");
            };
            assert!(told.contains("not evenly spaced"));
            assert!(
                (grid.rate_hz / rate - 1.0).abs() < 0.03,
                "{name} {}",
                grid.rate_hz
            );
            let values: Vec<f64> = stamps.iter().map(|t| wave(*t)).collect();
            let even = resample(&stamps, &values, grid);
            let worst = even
                .iter()
                .enumerate()
                .map(|(k, v)| (v - wave(grid.start_s + k as f64 / grid.rate_hz)).abs())
                .fold(0.0, f64::max);
            assert!(
                worst < if name == "wild" { 1e-2 } else { 1e-3 },
                "{name}: {worst}"
            );
        }
    }

    #[test]
    fn what_has_no_order_or_holes_is_refused() {
        assert!(look(&[1.0], 0.0).is_err());
        assert!(look(&[1.0, 1.0, 1.0], 0.0).unwrap_err().contains("do not rise"));
        assert!(
            look(&[0.0, 1.0, 0.5, 3.0], 0.0)
                .unwrap_err()
                .contains("do not rise")
        );
        let hole = times(100, |i| if i < 50.0 { i } else { i + 30.0 });
        assert!(look(&hole, 0.0).unwrap_err().starts_with("a hole of 31.0"));
    }
}
