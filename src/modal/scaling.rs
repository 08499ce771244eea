//! Modal mass, modal A, unity-modal-mass scaling and real normal modes, from the driving point; and whether a driving
//! point looks like one.
//!
//! With mass-normalised shapes φ the modal constant of response j and reference r is φ_j φ_r, so a driving point gives
//! φ_r = √A_rr and with it every φ_j = A_jr/φ_r (Ewins 2000, ch. 4; Heylen, Lammens & Sas 1997).

use std::f64::consts::TAU;

use num_complex::Complex64;
use serde::Serialize;

use super::shape;

/// One mode with a scale.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScaledMode {
    /// Number of the degree of freedom where response and force are the same.
    #[serde(skip)]
    pub driving_dof: usize,
    /// For the shape whose largest component is 1, kg.
    pub modal_mass_kg: f64,
    /// Standard deviation of the modal mass, kg.
    pub modal_mass_std_kg: f64,
    /// For the same shape: residue = ψ_j ψ_r / a, so a = 2i ω_d m for a real mode; kg/s (complex as re, im).
    pub modal_a: Complex64,
    /// Mass-normalised shape (unity modal mass), 1/√kg, by degree of freedom.
    #[serde(skip)]
    pub unity_mass: Vec<(usize, Complex64)>,
    /// Real shape next to it (turned to the best line, then its real part), 1/√kg.
    #[serde(skip)]
    pub real_normal: Vec<(usize, f64)>,
}

/// Scales a mode by its modal constants. `constants`: by FRF, 1/kg and its standard deviation; `dofs`: response and
/// reference of each FRF. `None` where no FRF is a driving point whose constant stands out of its error, or the constant
/// is negative (a sign is wrong then, see [`check_driving_point`]).
pub fn scaled(
    frequency_hz: f64,
    damping_ratio: f64,
    constants: &[Option<(Complex64, f64)>],
    dofs: &[Option<[usize; 2]>],
) -> Option<ScaledMode> {
    let pairs = || {
        constants
            .iter()
            .zip(dofs)
            .filter_map(|(c, d)| Some(((*c)?, (*d)?)))
    };
    // Of several driving points the one that shows the mode best.
    let ((own, std), [driving, _]) = pairs()
        .filter(|((a, std), [response, reference])| response == reference && a.re > 2.0 * std)
        .max_by(|a, b| (a.0.0.norm() / a.0.1).total_cmp(&(b.0.0.norm() / b.0.1)))?;
    let at_driving = own.sqrt();
    let mut unity_mass = vec![(driving, at_driving)];
    for ((a, _), [response, reference]) in pairs() {
        // By reciprocity the driving point may be either side.
        let other = match (response == driving, reference == driving) {
            (false, true) => response,
            (true, false) => reference,
            _ => continue,
        };
        if !unity_mass.iter().any(|(dof, _)| *dof == other) {
            unity_mass.push((other, a / at_driving));
        }
    }
    unity_mass.sort_by_key(|(dof, _)| *dof);
    let largest = unity_mass
        .iter()
        .map(|(_, z)| *z)
        .max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
    let mass = 1.0 / (largest * largest);
    let damped = TAU * frequency_hz * (1.0 - damping_ratio * damping_ratio).max(0.0).sqrt();
    let shape: Vec<Complex64> = unity_mass.iter().map(|(_, z)| *z).collect();
    let direction = Complex64::from_polar(1.0, -shape::principal_angle(&shape));
    Some(ScaledMode {
        driving_dof: driving,
        modal_mass_kg: mass.norm(),
        // m = A_rr/(A_jr)²·…: to first order the driving point's own error.
        modal_mass_std_kg: mass.norm() * std / own.norm(),
        modal_a: Complex64::new(0.0, 2.0 * damped) * mass,
        real_normal: unity_mass
            .iter()
            .map(|(dof, z)| (*dof, (z * direction).re))
            .collect(),
        unity_mass,
    })
}

/// What a driving point shows. The power that a force puts in at its own point is never negative, so the real part of the
/// mobility is not either, all modal constants are positive, and an antiresonance lies between every two resonances.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DrivingPoint {
    /// Name of the degree of freedom.
    pub name: String,
    /// Modes whose constant is negative by more than two standard deviations.
    pub wrong_sign_hz: Vec<f64>,
    /// Neighbouring modes without an antiresonance between them.
    pub no_antiresonance_between_hz: Vec<[f64; 2]>,
    /// Share of Σ|mobility|² on lines whose mobility has a negative real part.
    pub negative_power_share: f64,
    /// What the figures above come to, in words.
    pub verdict: &'static str,
}

/// More than this share of negative power is no noise.
const NEGATIVE: f64 = 0.1;

/// Checks the FRF of a driving point. `receptance_m_per_n` in e^{+iωt} on `frequency_hz`; `modes`: frequency, Hz,
/// damping ratio and modal constant with its standard deviation, ascending in frequency.
pub fn check_driving_point(
    name: &str,
    frequency_hz: &[f64],
    receptance_m_per_n: &[Complex64],
    modes: &[(f64, f64, Complex64, f64)],
) -> DrivingPoint {
    let seen: Vec<&(f64, f64, Complex64, f64)> = modes.iter().filter(|m| m.2.re.abs() > 2.0 * m.3).collect();
    let wrong_sign_hz: Vec<f64> = seen.iter().filter(|m| m.2.re < 0.0).map(|m| m.0).collect();
    let lines: Vec<(f64, Complex64)> = frequency_hz
        .iter()
        .copied()
        .zip(receptance_m_per_n.iter().copied())
        .filter(|(f, h)| *f > 0.0 && h.re.is_finite() && h.im.is_finite())
        .collect();
    let (mut negative, mut total) = (0.0, 0.0);
    for (f, h) in &lines {
        let mobility = Complex64::new(0.0, TAU * f) * h;
        total += mobility.norm_sqr();
        if mobility.re < 0.0 {
            negative += mobility.norm_sqr();
        }
    }
    let mut missing = Vec::new();
    for pair in seen.windows(2) {
        let (below, above) = (pair[0], pair[1]);
        // Between the half-power points: inside, a mode is all there is.
        let (from, to) = (below.0 * (1.0 + below.1), above.0 * (1.0 - above.1));
        let between: Vec<Complex64> = lines
            .iter()
            .filter(|(f, _)| *f > from && *f < to)
            .map(|(_, h)| *h)
            .collect();
        if between.len() < 5 {
            continue;
        }
        // Above a resonance the receptance of a driving point is negative, below the next positive: the antiresonance is
        // where it changes sign. At the half-power points the modes themselves decide the sign.
        let middle =
            |lines: &[Complex64]| crate::signal::median(&lines.iter().map(|h| h.re).collect::<Vec<_>>());
        let (above_first, below_second) = (middle(&between[..3]), middle(&between[between.len() - 3..]));
        if !(above_first < 0.0 && below_second > 0.0) {
            missing.push([below.0, above.0]);
        }
    }
    let negative_power_share = if total > 0.0 { negative / total } else { 0.0 };
    let verdict = match (wrong_sign_hz.len(), seen.len()) {
        (_, 0) => "no mode stands out here",
        (wrong, all) if wrong == all || negative_power_share > 0.5 => {
            "the sign is turned: force or sensor counts the other way"
        }
        (0, _) if missing.is_empty() && negative_power_share < NEGATIVE => "as a driving point must be",
        _ => "not quite one point: sensor and force are apart, or a phase is wrong",
    };
    DrivingPoint {
        name: name.to_owned(),
        wrong_sign_hz,
        no_antiresonance_between_hz: missing,
        negative_power_share,
        verdict,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two masses of 3 and 2 kg on springs, fixed on one side: shapes by hand from the eigenvalues.
    fn two_masses() -> ([f64; 2], [[f64; 2]; 2]) {
        let (m1, m2, k1, k2): (f64, f64, f64, f64) = (3.0, 2.0, 4.0e5, 1.0e5);
        let (a, b, c) = ((k1 + k2) / m1, -k2 / (m1 * m2).sqrt(), k2 / m2);
        let root = (0.25 * (a - c) * (a - c) + b * b).sqrt();
        let mean = 0.5 * (a + c);
        let of = |l: f64| {
            let v = [b, l - a];
            let n = v[0].hypot(v[1]);
            // φ = M^(−1/2) q.
            [v[0] / n / m1.sqrt(), v[1] / n / m2.sqrt()]
        };
        let values = [mean - root, mean + root];
        (values.map(|l| l.sqrt() / TAU), values.map(of))
    }

    #[test]
    fn the_modal_mass_of_two_masses_is_that_of_theory() {
        let (frequencies, shapes) = two_masses();
        for (f, phi) in frequencies.into_iter().zip(shapes) {
            let constant = |j: usize| Some((Complex64::from(phi[j] * phi[1]), 1e-6));
            let found = scaled(
                f,
                0.01,
                &[constant(0), constant(1)],
                &[Some([0, 1]), Some([1, 1])],
            )
            .unwrap();
            let largest = phi[0].abs().max(phi[1].abs());
            approx::assert_relative_eq!(
                found.modal_mass_kg,
                1.0 / (largest * largest),
                max_relative = 1e-9
            );
            // φᵀ M φ = 1 with the masses of the model.
            let unity: Vec<Complex64> = found.unity_mass.iter().map(|u| u.1).collect();
            let mass = 3.0 * unity[0].norm_sqr() + 2.0 * unity[1].norm_sqr();
            approx::assert_relative_eq!(mass, 1.0, max_relative = 1e-9);
            // Residue ψ_j ψ_r / a = φ_j φ_r / (2i ω_d).
            let damped = TAU * f * (1.0f64 - 1e-4).sqrt();
            let (psi0, psi1) = (phi[0] / largest, phi[1] / largest);
            let residue = psi0 * psi1 / found.modal_a;
            let expected = phi[0] * phi[1] / Complex64::new(0.0, 2.0 * damped);
            assert!((residue - expected).norm() < 1e-9 * expected.norm());
            approx::assert_relative_eq!(found.real_normal[0].1.abs(), phi[0].abs(), max_relative = 1e-9);
        }
        // Without a driving point nothing has a scale.
        assert!(scaled(10.0, 0.01, &[Some((Complex64::ONE, 0.01))], &[Some([0, 1])]).is_none());
    }

    fn receptance(f: f64, modes: &[(f64, f64, Complex64, f64)]) -> Complex64 {
        modes
            .iter()
            .map(|(f0, zeta, a, _)| {
                let (w, w0) = (TAU * f, TAU * f0);
                a / Complex64::new(w0 * w0 - w * w, 2.0 * zeta * w * w0)
            })
            .sum()
    }

    fn check(signs: [f64; 3]) -> DrivingPoint {
        let modes: Vec<(f64, f64, Complex64, f64)> = [10.0, 20.0, 35.0]
            .iter()
            .zip(signs)
            .map(|(f, sign)| (*f, 0.01, Complex64::from(0.01 * sign), 1e-5))
            .collect();
        let lines: Vec<f64> = (20..500).map(|k| 0.1 * f64::from(k)).collect();
        let h: Vec<Complex64> = lines.iter().map(|f| receptance(*f, &modes)).collect();
        check_driving_point("1X/1X", &lines, &h, &modes)
    }

    #[test]
    fn a_driving_point_is_told_from_a_turned_one_and_from_two_points() {
        let good = check([1.0, 1.0, 1.0]);
        assert_eq!(good.verdict, "as a driving point must be", "{good:?}");
        assert_eq!(good.negative_power_share, 0.0);
        let turned = check([-1.0, -1.0, -1.0]);
        assert!(turned.verdict.contains("turned"), "{turned:?}");
        let apart = check([1.0, -1.0, 1.0]);
        assert_eq!(apart.wrong_sign_hz, [20.0]);
        assert_eq!(apart.no_antiresonance_between_hz, [[10.0, 20.0], [20.0, 35.0]]);
        assert!(apart.verdict.contains("not quite"), "{apart:?}");
    }

    /// A modal mass is known as well as the driving point's constant: to 1 % here. The point beside it is three times as mobile.
    #[test]
    fn a_modal_mass_is_as_certain_as_its_driving_point() {
        let constants = [
            Some((Complex64::from(0.5), 0.005)),
            Some((Complex64::from(1.5), 0.1)),
        ];
        let found = scaled(10.0, 0.01, &constants, &[Some([0, 0]), Some([1, 0])]).unwrap();
        // φ₀² = 0.5, φ₁ = 3 φ₀.
        approx::assert_relative_eq!(found.modal_mass_kg, 1.0 / 4.5, max_relative = 1e-12);
        approx::assert_relative_eq!(found.modal_mass_std_kg, 0.01 / 4.5, max_relative = 1e-12);
    }

    /// Mobilities of 1 and −3: nine tenths of the power come back out.
    #[test]
    fn power_that_comes_back_is_a_share_of_the_mobility() {
        let of = |mobility: f64, f: f64| Complex64::from(mobility) / Complex64::new(0.0, TAU * f);
        let found = check_driving_point("a", &[2.0, 5.0], &[of(1.0, 2.0), of(-3.0, 5.0)], &[]);
        approx::assert_relative_eq!(found.negative_power_share, 0.9, max_relative = 1e-12);
    }
}
