//! Order statistics, and the normal law.

/// The value that the share `share` (0..1) of `values` lies below, interpolated linearly between order statistics (Hyndman and
/// Fan 1996, type 7). What is not a number is left out; what is unlimited counts as infinite. `None` where nothing is left, or
/// where the answer is infinite.
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().filter(|v| !v.is_nan()).collect();
    let place = place(values.len(), share)?;
    // Only the two that count are put in their order: the cost is linear.
    let (_, low, above) = values.select_nth_unstable_by(place.floor() as usize, f64::total_cmp);
    let low = *low;
    let high = match place.fract() {
        0.0 => low,
        _ => above.iter().copied().min_by(f64::total_cmp)?,
    };
    between(low, high, place.fract())
}

/// As [`quantile`], of values that ascend and are numbers.
pub fn quantile_of_sorted(sorted: &[f64], share: f64) -> Option<f64> {
    let place = place(sorted.len(), share)?;
    between(
        sorted[place.floor() as usize],
        sorted[place.ceil() as usize],
        place.fract(),
    )
}

/// Place of the quantile among `count` values in their order, from 0; `None` where there is none.
fn place(count: usize, share: f64) -> Option<f64> {
    Some(share.clamp(0.0, 1.0) * count.checked_sub(1)? as f64)
}

/// What lies at `part` of the way; `None` where it is infinite.
fn between(low: f64, high: f64, part: f64) -> Option<f64> {
    let value = if low == high {
        low
    } else {
        low + (high - low) * part
    };
    value.is_finite().then_some(value)
}

/// ln of the density of a normal law of this standard deviation, `difference` from its mean.
pub fn ln_normal(difference: f64, std: f64) -> f64 {
    -0.5 * ((difference / std).powi(2) + (std::f64::consts::TAU * std * std).ln())
}

/// For tests: a number that is near enough to standard normal, the sum of twelve uniform ones less six.
#[cfg(test)]
pub(crate) fn nearly_normal(random: &mut impl rand::Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_leave_out_what_is_no_number_and_count_the_unlimited() {
        let infinite = f64::INFINITY;
        assert_eq!(quantile([3.0, 1.0, 2.0], 0.25), Some(1.5));
        assert_eq!(quantile([3.0, 1.0, 2.0, f64::NAN], 0.5), Some(2.0));
        assert_eq!(quantile([1.0, infinite, infinite], 0.95), None);
        assert_eq!(quantile([1.0, infinite, 1.0, 1.0], 0.05), Some(1.0));
        assert_eq!(quantile([], 0.5), None);
        assert_eq!(quantile([f64::NAN], 0.5), None);
        let many: Vec<f64> = (0..101).map(|k| ((k * 37) % 101) as f64).collect();
        let mut sorted = many.clone();
        sorted.sort_by(f64::total_cmp);
        for share in [0.0, 0.013, 0.25, 0.5, 0.777, 1.0] {
            assert_eq!(
                quantile(many.iter().copied(), share),
                quantile_of_sorted(&sorted, share)
            );
        }
    }
}
