//! A rotating tool as a beam whose section changes along its length: bending by Timoshenko, tension and twist as a rod.
//!
//! The state of a section (what moves, and the force that the tip's side puts on the holder's side) runs along a uniform
//! stretch by y' = A y, so that y(L) = e^{AL} y(0): the exact transcendental solution at any frequency (Pestel & Leckie,
//! Matrix Methods in Elastomechanics, 1963; the same as the dynamic stiffness of Cheng 1970 and of Howson & Williams
//! 1973). With r = R s at the holder face, R the receptance of what the tool is clamped in,
//!
//! R_tip = (T₁₁ R + T₁₂) (T₂₁ R + T₂₂)⁻¹, T = \[\[T₁₁, T₁₂\], \[T₂₁, T₂₂\]\]:
//!
//! receptance coupling (Schmitz & Smith, Machining Dynamics, 2nd ed. 2019, ch. 9; Schmitz & Duncan 2005) of all degrees of
//! freedom at once, rotations included, that also holds for a clamped (R = 0) tool and loses nothing at low frequency. T
//! grows like e^{βL}; stretches over which it would grow too much are coupled one after the other.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use nalgebra::{Matrix4, Matrix6};
use num_complex::Complex64;

/// Displacement (m, rad) over force (N, N·m), one row and column for each of: displacement along x, slope in x,
/// displacement along y, slope in y, displacement along the tool axis, turn about it. Axes as in [`crate::lobes::dynamics::tool_point`].
pub type Receptance6 = Matrix6<Complex64>;

/// A stretch of the tool of one section and material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamSegment {
    /// Length along the tool axis, m.
    pub length_m: f64,
    /// Of the round bar that is as stiff; for a fluted stretch less than the tool's own (about 0.8 of it for end mills:
    /// Kops & Vo 1990, Annals of the CIRP 39(1)).
    pub diameter_m: f64,
    /// Bore; 0 is solid.
    pub bore_m: f64,
    /// Young's modulus E, Pa.
    pub young_pa: f64,
    /// Shear modulus G, Pa.
    pub shear_pa: f64,
    /// Density, kg/m³.
    pub density_kg_per_m3: f64,
    /// η in E (1 + iη), G (1 + iη).
    pub loss_factor: f64,
    /// How twist and stretch of a helical segment are coupled, −1 < c < 1: tension N = EA z' + c √(EA·GJ) θ', torque
    /// T = c √(EA·GJ) z' + GJ θ'. Positive where unwinding by the cutting torque makes the drill longer.
    pub twist_coupling: f64,
}

type Transfer4 = Matrix4<Complex64>;

/// Where the phase of the fastest wave along a piece stays below this, rad, twenty terms of e^{AL} are exact.
const PIECE: f64 = 1.0;
const TERMS: u32 = 20;
/// Stretches are coupled separately where their phases together would exceed this, rad: T has grown by e⁶ = 400.
const GROWTH: f64 = 6.0;

impl BeamSegment {
    /// Area of the cross-section, m².
    pub fn area_m2(&self) -> f64 {
        FRAC_PI_4 * (self.diameter_m.powi(2) - self.bore_m.powi(2))
    }

    /// About a diameter; the polar one is twice this.
    pub fn second_moment_m4(&self) -> f64 {
        PI / 64.0 * (self.diameter_m.powi(4) - self.bore_m.powi(4))
    }

    /// Cowper (1966), J. Applied Mechanics 33: hollow round section.
    pub fn shear_coefficient(&self) -> f64 {
        let nu = 0.5 * self.young_pa / self.shear_pa - 1.0;
        let m2 = (self.bore_m / self.diameter_m).powi(2);
        let ring = (1.0 + m2).powi(2);
        6.0 * (1.0 + nu) * ring / ((7.0 + 6.0 * nu) * ring + (20.0 + 12.0 * nu) * m2)
    }

    /// Greatest wave number of bending, shear, tension and torsion at a frequency, rad/m.
    fn wave_number(&self, omega: f64) -> f64 {
        let (rho, e) = (self.density_kg_per_m3, self.young_pa);
        let bending = (omega * omega * rho * self.area_m2() / (e * self.second_moment_m4())).powf(0.25);
        let shear = omega * (rho / (self.shear_coefficient() * self.shear_pa)).sqrt();
        let coupling = (1.0 - self.twist_coupling.powi(2)).sqrt();
        bending
            .max(shear)
            .max(shear / coupling)
            .max(omega * (rho / e).sqrt() / coupling)
    }

    /// A of displacement w, slope ψ, shear force V, moment M.
    fn bending(&self, omega: f64) -> Transfer4 {
        let complex = Complex64::new(1.0, self.loss_factor);
        let (rho, area, i) = (self.density_kg_per_m3, self.area_m2(), self.second_moment_m4());
        let mut a = Transfer4::zeros();
        a[(0, 1)] = Complex64::ONE;
        a[(0, 2)] = (complex * self.shear_coefficient() * self.shear_pa * area).inv();
        a[(1, 3)] = (complex * self.young_pa * i).inv();
        a[(2, 0)] = (-rho * area * omega * omega).into();
        a[(3, 1)] = (-rho * i * omega * omega).into();
        a[(3, 2)] = -Complex64::ONE;
        a
    }

    /// A of displacement z, turn θ, tension N, torque T.
    fn axial(&self, omega: f64) -> Transfer4 {
        let complex = Complex64::new(1.0, self.loss_factor);
        let (rho, area, polar) = (
            self.density_kg_per_m3,
            self.area_m2(),
            2.0 * self.second_moment_m4(),
        );
        let (ea, gj) = (self.young_pa * area, self.shear_pa * polar);
        let both = self.twist_coupling * (ea * gj).sqrt();
        let determinant = complex * (ea * gj - both * both);
        let mut a = Transfer4::zeros();
        a[(0, 2)] = gj / determinant;
        a[(0, 3)] = -both / determinant;
        a[(1, 2)] = -both / determinant;
        a[(1, 3)] = ea / determinant;
        a[(2, 0)] = (-rho * area * omega * omega).into();
        a[(3, 1)] = (-rho * polar * omega * omega).into();
        a
    }
}

/// e^{aL} where the waves of `a` turn by no more than [`PIECE`] along L.
///
/// The waves of a stretch run both ways alike, so its eigenvalues come as ±λ₁, ±λ₂ and a⁴ = p a² + q (Cayley & Hamilton)
/// with p = λ₁² + λ₂², q = −λ₁² λ₂²: all powers are sums of 1, a, a², a³.
fn exponential(a: &Transfer4, length_m: f64) -> Transfer4 {
    let square = a * a;
    let p = 0.5 * square.trace();
    // ½ tr a⁴ = λ₁⁴ + λ₂⁴.
    let fourth: Complex64 = square
        .iter()
        .zip(square.transpose().iter())
        .map(|(x, y)| x * y)
        .sum();
    let q = 0.5 * (0.5 * fourth - p * p);
    // a^{2j} = (even) a² + (one); a^{2j+1} is the same times a. Sums over j of both, and of both times a.
    let (mut even, mut one) = (Complex64::ZERO, Complex64::ONE);
    let mut sums = [Complex64::ZERO; 4];
    let mut weight = 1.0;
    for k in (0..=TERMS).step_by(2) {
        let odd_weight = weight * length_m / f64::from(k + 1);
        sums[0] += one * weight;
        sums[1] += one * odd_weight;
        sums[2] += even * weight;
        sums[3] += even * odd_weight;
        (even, one) = (p * even + one, q * even);
        weight = odd_weight * length_m / f64::from(k + 2);
    }
    let mut out = a * sums[1] + square * sums[2] + square * a * sums[3];
    for i in 0..4 {
        out[(i, i)] += sums[0];
    }
    out
}

/// Transfer of a stretch in bending (in either plane) and in tension and twist.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    bending: Transfer4,
    axial: Transfer4,
}

impl Stretch {
    const fn new(bending: Transfer4, axial: Transfer4) -> Self {
        Stretch { bending, axial }
    }

    fn then(&self, next: &Stretch) -> Stretch {
        Stretch::new(next.bending * self.bending, next.axial * self.axial)
    }

    /// Receptance at the far end of the stretch; `None` at a resonance without damping.
    fn couple(&self, root: &Receptance6) -> Option<Receptance6> {
        // Rows of T₁₁ R + T₁₂ and of T₂₁ R + T₂₂, one plane after the other.
        let (mut motion, mut force) = (Receptance6::zeros(), Receptance6::zeros());
        for (corner, transfer) in [(0, &self.bending), (2, &self.bending), (4, &self.axial)] {
            let own = root.fixed_rows::<2>(corner);
            for (row, out) in [(0, &mut motion), (2, &mut force)] {
                let mut rows = out.fixed_rows_mut::<2>(corner);
                rows.copy_from(&(transfer.fixed_view::<2, 2>(row, 0) * own));
                let mut diagonal = rows.fixed_columns_mut::<2>(corner);
                diagonal += transfer.fixed_view::<2, 2>(row, 2);
            }
        }
        // X (T₂₁ R + T₂₂) = motion.
        let tip = force.transpose().lu().solve(&motion.transpose())?.transpose();
        tip.iter().all(|v| v.is_finite()).then_some(tip)
    }
}

/// The tool from the holder face to the tip; without segments the tip is at the holder face.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolBeam {
    /// From the holder face to the tip.
    pub segments: Vec<BeamSegment>,
}

impl ToolBeam {
    /// Length of all segments, m.
    pub fn length_m(&self) -> f64 {
        self.segments.iter().map(|s| s.length_m).sum()
    }

    /// The tool in stretches short enough to be coupled without loss.
    fn stretches(&self, omega: f64) -> Vec<Stretch> {
        let mut out: Vec<Stretch> = Vec::new();
        let mut phase = GROWTH;
        for segment in &self.segments {
            let turned = segment.wave_number(omega) * segment.length_m;
            let pieces = (turned / PIECE).ceil().max(1.0);
            let length = segment.length_m / pieces;
            let piece = Stretch::new(
                exponential(&segment.bending(omega), length),
                exponential(&segment.axial(omega), length),
            );
            for _ in 0..pieces as usize {
                phase += turned / pieces;
                match out.last_mut() {
                    Some(last) if phase <= GROWTH => *last = last.then(&piece),
                    _ => {
                        out.push(piece);
                        phase = turned / pieces;
                    }
                }
            }
        }
        out
    }

    /// Receptance of the tip when that of the holder face is `root`. At a resonance without any damping it is the
    /// greatest number that can be squared, so that nothing is safe there.
    pub fn tip(&self, root: &Receptance6, frequency_hz: f64) -> Receptance6 {
        let stretches = self.stretches(TAU * frequency_hz);
        stretches
            .iter()
            .try_fold(*root, |r, stretch| stretch.couple(&r))
            .unwrap_or_else(|| Receptance6::identity() * Complex64::new(0.0, -f64::MAX.sqrt()))
    }

    /// Determinant of what forces at the tip make of forces at a clamped end: zero at the natural frequencies of the tool
    /// clamped at the holder face, without damping, (bending, tension and twist); scaled.
    fn clamped(&self, frequency_hz: f64) -> [f64; 2] {
        let lossless = ToolBeam {
            segments: self
                .segments
                .iter()
                .map(|s| BeamSegment {
                    loss_factor: 0.0,
                    ..*s
                })
                .collect(),
        };
        let all = lossless.stretches(TAU * frequency_hz);
        let Some(whole) = all.into_iter().reduce(|a, b| a.then(&b)) else {
            return [1.0; 2];
        };
        let force = |t: &Transfer4| t[(2, 2)].re * t[(3, 3)].re - t[(2, 3)].re * t[(3, 2)].re;
        [force(&whole.bending), force(&whole.axial)]
    }

    /// Natural frequencies of the tool clamped at the holder face, Hz ascending, up to `top_hz`: of bending, and of tension
    /// and twist. For a first look at where they lie; two closer than 1 % may be missed.
    pub fn clamped_hz(&self, top_hz: f64) -> [Vec<f64>; 2] {
        const FROM_HZ: f64 = 1.0;
        const RATIO: f64 = 1.01;
        let mut found = [Vec::new(), Vec::new()];
        let mut low = (FROM_HZ, self.clamped(FROM_HZ));
        while low.0 < top_hz {
            let high_hz = (low.0 * RATIO).min(top_hz);
            let high = (high_hz, self.clamped(high_hz));
            for (kind, found) in found.iter_mut().enumerate() {
                if low.1[kind] * high.1[kind] < 0.0 {
                    let [mut a, mut b] = [low.0, high.0];
                    for _ in 0..40 {
                        let middle = 0.5 * (a + b);
                        if self.clamped(middle)[kind] * low.1[kind] > 0.0 {
                            a = middle;
                        } else {
                            b = middle;
                        }
                    }
                    found.push(0.5 * (a + b));
                }
            }
            low = high;
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const STEEL: BeamSegment = BeamSegment {
        length_m: 0.1,
        diameter_m: 0.01,
        bore_m: 0.0,
        young_pa: 210e9,
        shear_pa: 80e9,
        density_kg_per_m3: 7850.0,
        loss_factor: 0.0,
        twist_coupling: 0.0,
    };

    fn tool(segments: &[BeamSegment]) -> ToolBeam {
        ToolBeam {
            segments: segments.to_vec(),
        }
    }

    fn clamped_in() -> Receptance6 {
        Receptance6::zeros()
    }

    fn whole(beam: &ToolBeam, omega: f64) -> Stretch {
        beam.stretches(omega)
            .into_iter()
            .reduce(|a, b| a.then(&b))
            .unwrap()
    }

    /// Roots of a determinant of the bending transfer between two frequencies, Hz.
    fn roots(beam: &ToolBeam, rows: [usize; 2], columns: [usize; 2], from: f64, to: f64) -> Vec<f64> {
        let value = |f: f64| {
            let t = whole(beam, TAU * f).bending;
            let e = |i: usize, j: usize| t[(rows[i], columns[j])].re;
            e(0, 0) * e(1, 1) - e(0, 1) * e(1, 0)
        };
        let mut found = Vec::new();
        let mut f = from;
        while f < to {
            let next = f * 1.01;
            if value(f) * value(next) < 0.0 {
                let (mut a, mut b) = (f, next);
                for _ in 0..60 {
                    let middle = 0.5 * (a + b);
                    if value(middle) * value(f) > 0.0 {
                        a = middle;
                    } else {
                        b = middle;
                    }
                }
                found.push(a);
            }
            f = next;
        }
        found
    }

    /// A slender bar has Euler and Bernoulli's frequencies, (βL)² √(EI/ρA)/(2πL²): clamped–free and free–free βL from
    /// Blevins (1979), table 8-1.
    #[test]
    fn slender_bars_have_the_textbook_frequencies() {
        let segment = BeamSegment {
            length_m: 2.0,
            diameter_m: 0.002,
            ..STEEL
        };
        let beam = tool(&[segment]);
        let hz = |beta_l: f64| {
            let bar = segment.young_pa * segment.second_moment_m4()
                / (segment.density_kg_per_m3 * segment.area_m2());
            beta_l.powi(2) * bar.sqrt() / (TAU * segment.length_m.powi(2))
        };
        let found = roots(&beam, [2, 3], [2, 3], hz(1.0), hz(9.0));
        for (found, beta_l) in found.iter().zip([1.87510407, 4.69409113, 7.85475744]) {
            assert_relative_eq!(*found, hz(beta_l), max_relative = 2e-5);
        }
        assert_eq!(found.len(), 3);
        let found = roots(&beam, [2, 3], [0, 1], hz(3.0), hz(12.0));
        for (found, beta_l) in found.iter().zip([4.73004074, 7.85320462, 10.9956078]) {
            assert_relative_eq!(*found, hz(beta_l), max_relative = 5e-5);
        }
        assert_eq!(found.len(), 3);
    }

    /// A stubby hinged bar (L/d = 4): with k = nπ/L Timoshenko's equation has ω⁴ ρI ρA/(κGA) − ω² (ρA + ρI k² +
    /// ρA EI k²/(κGA)) + EI k⁴ = 0 (Timoshenko 1921); the lower root.
    #[test]
    fn a_stubby_hinged_bar_has_timoshenkos_frequencies() {
        let segment = BeamSegment {
            length_m: 0.04,
            bore_m: 0.004,
            ..STEEL
        };
        let beam = tool(&[segment]);
        let (rho, area, i) = (
            segment.density_kg_per_m3,
            segment.area_m2(),
            segment.second_moment_m4(),
        );
        let shear = segment.shear_coefficient() * segment.shear_pa * area;
        let ei = segment.young_pa * i;
        let expected: Vec<f64> = [1.0, 2.0, 3.0]
            .map(|n| {
                let k2 = (n * PI / segment.length_m).powi(2);
                let (a, b, c) = (
                    rho * i * rho * area / shear,
                    rho * area + rho * i * k2 + rho * area * ei * k2 / shear,
                    ei * k2 * k2,
                );
                (2.0 * c / (b + (b * b - 4.0 * a * c).sqrt())).sqrt() / TAU
            })
            .to_vec();
        let found = roots(&beam, [0, 3], [1, 2], 0.5 * expected[0], 1.02 * expected[2]);
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(&expected) {
            assert_relative_eq!(*found, *expected, max_relative = 1e-9);
        }
        // Solid round section: Cowper's 6(1+ν)/(7+6ν).
        let nu = 210.0 / 160.0 - 1.0;
        assert_relative_eq!(
            STEEL.shear_coefficient(),
            6.0 * (1.0 + nu) / (7.0 + 6.0 * nu),
            max_relative = 1e-14
        );
    }

    /// Clamped at one end a rod and a shaft resonate first where a quarter of a wave stands on them: c/(4L).
    #[test]
    fn rod_and_shaft_have_a_quarter_wave() {
        let [_, found] = tool(&[STEEL]).clamped_hz(16_000.0);
        let quarter = |modulus: f64| (modulus / 7850.0).sqrt() / 0.4;
        assert_eq!(found.len(), 2);
        assert_relative_eq!(found[0], quarter(80e9), max_relative = 1e-9);
        assert_relative_eq!(found[1], quarter(210e9), max_relative = 1e-9);
    }

    /// With coupled stretch and twist the waves of the rod have c² = λ of P⁻¹S: closed form for the quarter waves.
    #[test]
    fn a_twisted_rod_has_its_two_quarter_waves() {
        let segment = BeamSegment {
            twist_coupling: 0.4,
            ..STEEL
        };
        let [_, found] = tool(&[segment]).clamped_hz(16_000.0);
        let (a, b) = (210e9 / 7850.0, 80e9 / 7850.0);
        // Eigenvalues of [[a, c√(ab)], [c√(ab), b]] (the polar radius drops out).
        let root = (0.25f64 * (a - b) * (a - b) + 0.16 * a * b).sqrt();
        let expected = [-1.0, 1.0].map(|sign: f64| (0.5 * (a + b) + sign * root).sqrt() / 0.4);
        assert_eq!(found.len(), 2);
        for (found, expected) in found.iter().zip(expected) {
            assert_relative_eq!(*found, expected, max_relative = 1e-9);
        }
    }

    /// At low frequency the clamped bar is the textbook's: L³/3EI + L/κGA, L²/2EI, L/EI, L/EA, L/GJ.
    #[test]
    fn the_static_tip_is_the_textbook_cantilever() {
        let tip = tool(&[STEEL]).tip(&clamped_in(), 1e-3);
        let (l, ei) = (0.1f64, 210e9 * STEEL.second_moment_m4());
        let shear = STEEL.shear_coefficient() * 80e9 * STEEL.area_m2();
        let expected = [
            (0, 0, l.powi(3) / (3.0 * ei) + l / shear),
            (0, 1, l * l / (2.0 * ei)),
            (1, 1, l / ei),
            (2, 3, l * l / (2.0 * ei)),
            (4, 4, l / (210e9 * STEEL.area_m2())),
            (5, 5, l / (80e9 * 2.0 * STEEL.second_moment_m4())),
        ];
        for (i, j, value) in expected {
            assert_relative_eq!(tip[(i, j)].re, value, max_relative = 1e-9);
            assert_relative_eq!(tip[(j, i)].re, value, max_relative = 1e-9);
        }
        assert_eq!(tip[(0, 2)], Complex64::ZERO);
    }

    /// Held by nothing (a very soft holder) the bar moves as a free mass: tip over tip force −4/(mω²), axial −1/(mω²).
    #[test]
    fn a_free_bar_is_a_mass_at_low_frequency() {
        let soft = Receptance6::identity() * Complex64::from(1e12);
        let tip = tool(&[STEEL]).tip(&soft, 1.0);
        let mass = 7850.0 * STEEL.area_m2() * 0.1;
        let w2 = TAU * TAU;
        // About its centre I = m (L²/12 + d²/16).
        let turn = 0.05f64.powi(2) / (0.01 / 12.0 + 1e-4 / 16.0);
        assert_relative_eq!(tip[(0, 0)].re, -(1.0 + turn) / (mass * w2), max_relative = 1e-5);
        assert_relative_eq!(tip[(4, 4)].re, -1.0 / (mass * w2), max_relative = 1e-5);
    }

    /// Two parts of a uniform bar coupled are the whole bar, from 0.1 Hz to where a hundred waves stand on it; reciprocal
    /// and finite everywhere.
    #[test]
    fn parts_make_the_whole_at_any_frequency() {
        let damped = BeamSegment {
            loss_factor: 0.01,
            twist_coupling: 0.2,
            ..STEEL
        };
        let part = |length_m| BeamSegment { length_m, ..damped };
        let (one, two) = (tool(&[part(0.1)]), tool(&[part(0.037), part(0.063)]));
        // A holder that couples everything with everything.
        let holder = Receptance6::from_fn(|i, j| {
            Complex64::new(
                if i == j {
                    2e-7
                } else {
                    3e-8 / (1.0 + (i + j) as f64)
                },
                -1e-8,
            )
        });
        for f in [0.1, 10.0, 500.0, 3e3, 2e4, 2e5, 5e6] {
            let (a, b) = (one.tip(&holder, f), two.tip(&holder, f));
            assert!(
                (a - b).norm() < 1e-9 * a.norm(),
                "{f} Hz: {}",
                (a - b).norm() / a.norm()
            );
            assert!((a - a.transpose()).norm() < 1e-9 * a.norm(), "{f} Hz");
            assert!(a.iter().all(|v| v.is_finite()));
        }
    }

    /// Receptance coupling by hand (Schmitz & Duncan 2005, eq. 4) of a rigid-free bar in tension: H = h₁₁ − h₁₂ (h₂₂ + R)⁻¹
    /// h₂₁ with the free–free rod's h₁₁ = −cos kL/(EA k sin kL), h₁₂ = −1/(EA k sin kL).
    #[test]
    fn coupling_a_rod_by_hand_gives_the_same() {
        let f = 7_300.0;
        let mut holder = Receptance6::zeros();
        holder[(4, 4)] = Complex64::new(3e-9, -1e-9);
        let ea = 210e9 * STEEL.area_m2();
        let k = TAU * f * (7850.0f64 / 210e9).sqrt();
        let (s, c) = (k * 0.1).sin_cos();
        let (own, across) = (-c / (ea * k * s), -1.0 / (ea * k * s));
        let expected = own - across * across / (own + holder[(4, 4)]);
        let found = tool(&[STEEL]).tip(&holder, f)[(4, 4)];
        assert!(
            (found - expected).norm() < 1e-9 * expected.norm(),
            "{found} {expected}"
        );
    }
}
