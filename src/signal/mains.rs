//! Hum of the mains.

/// Frequencies of the mains, Hz.
pub const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Highest multiple that is called hum: rectifiers make those of six and twelve.
const MOST_MAINS: f64 = 12.0;

/// Distance of a frequency from the nearest multiple of either mains frequency, up to the twelfth, Hz; infinite where there is none.
pub fn from_mains_hz(hz: f64) -> f64 {
    let from = |mains: &f64| {
        let multiple = (hz / mains).round();
        (1.0..=MOST_MAINS)
            .contains(&multiple)
            .then(|| (hz - multiple * mains).abs())
    };
    MAINS_HZ.iter().filter_map(from).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_up_to_the_twelfth_of_both() {
        for (hz, expected) in [
            (50.0, 0.0),
            (61.5, 1.5),
            (295.0, 5.0),
            (720.0, 0.0),
            (744.0, 24.0),
        ] {
            assert!((from_mains_hz(hz) - expected).abs() < 1e-9, "{hz}");
        }
        assert_eq!(from_mains_hz(24.9), f64::INFINITY);
        assert_eq!(from_mains_hz(751.0), f64::INFINITY);
    }
}
