//! The noise that FRFs not measured yet will have, from that of the measured ones.

use crate::identify::FrfData;
use crate::signal::median;
use crate::signal::noise_law::FrfNoise;

/// Share of the magnitude and floor that the noise of the measured FRFs follows: of each FRF by least squares, of all the
/// middle one, so that one bad channel does not speak for the others. The floor's power of the frequency is the one that
/// describes all of them best.
pub fn of_measured(data: &FrfData) -> FrfNoise {
    let mean_ln = |values: &mut dyn Iterator<Item = f64>| -> f64 {
        let (sum, n) = values.fold((0.0, 0.0), |(s, n), f| (s + f.ln(), n + 1.0));
        if n > 0.0 { f64::exp(sum / n) } else { 1.0 }
    };
    let lines = data.blocks.iter().flat_map(|b| b.frequency_hz.iter().copied());
    let reference_hz = mean_ln(&mut lines.filter(|f| *f > 0.0));
    let mut best: Option<(f64, FrfNoise)> = None;
    for power in [0, 1, 2] {
        let (mut relative, mut floors, mut misfit) = (Vec::new(), Vec::new(), 0.0);
        for (block, frf) in data.frfs() {
            let rows: Vec<[f64; 3]> = block
                .frequency_hz
                .iter()
                .zip(&frf.receptance)
                .zip(&frf.noise_std)
                .filter(|((f, _), std)| **f > 0.0 && **std > 0.0)
                .map(|((f, h), std)| [h.norm_sqr(), (f / reference_hz).powi(-2 * power), std * std])
                .collect();
            let (squares, left) = law(&rows);
            relative.push(squares[0].sqrt());
            floors.push(squares[1].sqrt());
            misfit += left;
        }
        if best.as_ref().is_none_or(|(least, _)| misfit < 0.99 * least) {
            let noise = FrfNoise {
                relative: median(&relative),
                floor: median(&floors),
                power,
                reference_hz,
            };
            best = Some((misfit, noise));
        }
    }
    best.map_or(
        FrfNoise {
            relative: 0.05,
            floor: 0.0,
            power: 0,
            reference_hz,
        },
        |(_, noise)| noise,
    )
}

/// a², b² ≥ 0 of σ² = a² x + b² y over rows (x, y, σ²), and the sum of squared relative departures.
fn law(rows: &[[f64; 3]]) -> ([f64; 2], f64) {
    let sum = |f: &dyn Fn(f64, f64) -> f64| rows.iter().map(|[x, y, s]| f(x / s, y / s)).sum::<f64>();
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    let (x1, y1) = (sum(&|x, _| x), sum(&|_, y| y));
    let determinant = xx * yy - xy * xy;
    let alone = |first: f64, own: f64| if own > 0.0 { first / own } else { 0.0 };
    let both = [
        (x1 * yy - y1 * xy) / determinant,
        (y1 * xx - x1 * xy) / determinant,
    ];
    let squares = match both {
        [a, b] if a >= 0.0 && b >= 0.0 && a.is_finite() && b.is_finite() => [a, b],
        [a, _] if a < 0.0 => [0.0, alone(y1, yy)],
        _ => [alone(x1, xx), 0.0],
    };
    let left = sum(&|x, y| (squares[0] * x + squares[1] * y - 1.0).powi(2));
    (squares, left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn both_parts_of_the_law_come_back_and_neither_is_negative() {
        let rows = |a: f64, b: f64| -> Vec<[f64; 3]> {
            (1..60)
                .map(|k| {
                    let (x, y) = (1e-12 * f64::from(k * k), 1.0 + 0.1 * f64::from(k));
                    [x, y, a * a * x + b * b * y]
                })
                .collect()
        };
        let ([a2, b2], left) = law(&rows(0.02, 3e-8));
        assert_relative_eq!(a2.sqrt(), 0.02, max_relative = 1e-9);
        assert_relative_eq!(b2.sqrt(), 3e-8, max_relative = 1e-9);
        assert!(left < 1e-12);
        // Less noise where the FRF is large: no share of the magnitude, though the free fit would make it negative.
        let inverse: Vec<[f64; 3]> = rows(0.0, 1e-7).iter().map(|[x, _, s]| [*x, 1.0, s / x]).collect();
        let ([a2, b2], _) = law(&inverse);
        assert_eq!(a2, 0.0);
        assert!(b2 > 0.0);
    }
}
