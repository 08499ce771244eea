//! The dynamic stiffness in the modal basis, and responses to forces from it.

use faer::Mat;
use nalgebra::DMatrix;
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

use super::side_by_side::{LANES, Lanes, dot, eliminate_side_by_side, solve_in_place, solve_side_by_side};

#[derive(Debug, Clone)]
pub(super) enum DynamicStiffness {
    /// Uncoupled modes.
    Diagonal(Modes),
    /// Coupled modes: mass and damping in the basis; the stiffness is the identity plus i times what is hysteretic.
    Coupled {
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        hysteretic: DMatrix<f64>,
        /// Where few combinations of coordinates couple the modes.
        border: Option<Box<Border>>,
    },
}

/// Modes that move with mass.
#[derive(Debug, Clone)]
pub(super) struct Modes {
    /// μ = ω⁻², s².
    pub(super) mu: Vec<f64>,
    /// Coefficient 2ζ√μ of modal damping, s.
    pub(super) damping: Vec<f64>,
}

/// What couples the modes: D the diagonal of their dynamic stiffness, the whole is
/// ((D + Q W Qᵀ, B), (Bᵀ, E)) with few columns in Q and B. Eliminating the modes leaves a system as large as these are many
/// (block elimination; Woodbury 1950).
#[derive(Debug, Clone)]
pub(super) struct Border {
    modes: Modes,
    /// Mass, damping and hysteretic stiffness between modes (rows) and branches.
    between: [DMatrix<f64>; 3],
    /// Among branches; the stiffness is the identity.
    among: [DMatrix<f64>; 3],
    /// Combinations of modes that dampers act on: modes × r.
    damped: DMatrix<f64>,
    /// Damping and hysteretic stiffness W on these: r × r.
    on_damped: [DMatrix<f64>; 2],
}

/// Room for the solution of lines side by side.
#[derive(Default)]
pub(super) struct Room {
    dynamic: Vec<Lanes>,
    small: Vec<Lanes>,
    right: Vec<Lanes>,
    columns: Vec<Lanes>,
    weighed: Vec<Lanes>,
}

impl DynamicStiffness {
    /// `mass`, `damping` and `hysteretic` in the basis, of which `modes` come first. `damping` holds that of the modes.
    pub(super) fn coupled(
        modes: Modes,
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        hysteretic: DMatrix<f64>,
    ) -> Self {
        DynamicStiffness::Coupled {
            border: Border::new(modes, &mass, &damping, &hysteretic).map(Box::new),
            mass,
            damping,
            hysteretic,
        }
    }

    /// Responses to the forces in `columns` (n rows each) at `rates` s of exp(st), rad/s, in their place. False where they are to be
    /// solved each by itself; the columns are of no use then.
    pub(super) fn solve(&self, rates: [Complex64; LANES], columns: &mut [Lanes], room: &mut Room) -> bool {
        let (rate, square) = (Lanes::of(rates), Lanes::of(rates.map(|s| s * s)));
        match self {
            DynamicStiffness::Diagonal(modes) => {
                modes.inverse(rate, square, &mut room.dynamic);
                for column in columns.chunks_exact_mut(modes.mu.len().max(1)) {
                    for (x, inverse) in column.iter_mut().zip(&room.dynamic) {
                        *x = *x * *inverse;
                    }
                }
                true
            }
            DynamicStiffness::Coupled {
                border: Some(border), ..
            } => Arch::new().dispatch(Bordered {
                border,
                rate,
                square,
                columns,
                room,
            }),
            DynamicStiffness::Coupled {
                mass,
                damping,
                hysteretic,
                border: None,
            } => {
                let n = mass.nrows();
                room.dynamic.clear();
                let entries = mass.iter().zip(damping).zip(hysteretic);
                room.dynamic
                    .extend(entries.map(|((m, c), h)| entry(rate, square, [*m, *c, *h])));
                // The stiffness is the identity.
                for diagonal in room.dynamic.iter_mut().step_by(n + 1) {
                    *diagonal = diagonal.plus(1.0);
                }
                solve_side_by_side(n, &mut room.dynamic, columns)
            }
        }
    }

    /// As [`Self::solve`] at one rate, of any system.
    pub(super) fn solve_one(&self, rate: Complex64, columns: &mut [Complex64]) {
        let square = rate * rate;
        match self {
            DynamicStiffness::Diagonal(Modes { mu, damping }) => {
                for column in columns.chunks_exact_mut(mu.len().max(1)) {
                    for (x, (mu, damping)) in column.iter_mut().zip(mu.iter().zip(damping)) {
                        *x /= 1.0 + square * mu + rate * damping;
                    }
                }
            }
            DynamicStiffness::Coupled {
                mass,
                damping,
                hysteretic,
                ..
            } => {
                let n = mass.nrows();
                let entries = mass.iter().zip(damping).zip(hysteretic);
                let mut dynamic: Vec<Complex64> = entries
                    .map(|((m, c), h)| square * m + rate * c + Complex64::new(0.0, *h))
                    .collect();
                for diagonal in dynamic.iter_mut().step_by(n + 1) {
                    diagonal.re += 1.0;
                }
                solve_in_place(n, &mut dynamic, columns);
            }
        }
    }
}

/// s² m + s c + i h.
#[inline(always)]
fn entry(rate: Lanes, square: Lanes, [m, c, h]: [f64; 3]) -> Lanes {
    let mut z = square.times(m);
    z += rate.times(c);
    z.im.iter_mut().for_each(|im| *im += h);
    z
}

impl Modes {
    /// Inverse of each mode's dynamic stiffness.
    #[inline(always)]
    fn inverse(&self, rate: Lanes, square: Lanes, inverse: &mut Vec<Lanes>) {
        inverse.clear();
        let modes = self.mu.iter().zip(&self.damping);
        inverse.extend(modes.map(|(mu, c)| entry(rate, square, [*mu, *c, 0.0]).plus(1.0).inverse()));
    }
}

impl Border {
    /// `None` where so much couples that the whole is solved as fast.
    fn new(
        modes: Modes,
        mass: &DMatrix<f64>,
        damping: &DMatrix<f64>,
        hysteretic: &DMatrix<f64>,
    ) -> Option<Self> {
        /// Modes up to which the bookkeeping takes as long as it saves.
        const FEW: usize = 10;
        let (m, n) = (modes.mu.len(), mass.nrows());
        let worth = |columns: usize| m > FEW && 2 * columns <= m;
        if !worth(n - m) {
            return None;
        }
        let mut viscous: DMatrix<f64> = damping.view((0, 0), (m, m)).into_owned();
        for (i, c) in modes.damping.iter().enumerate() {
            viscous[(i, i)] -= c;
        }
        let lossy: DMatrix<f64> = hysteretic.view((0, 0), (m, m)).into_owned();
        let damped = range_of([&viscous, &lossy], damping.amax().max(hysteretic.amax()));
        let columns = n - m + damped.ncols();
        if columns == 0 || !worth(columns) {
            return None;
        }
        let of = |all: &DMatrix<f64>, row: usize, rows: usize| all.view((row, m), (rows, n - m)).into_owned();
        let all = [mass, damping, hysteretic];
        Some(Border {
            between: all.map(|x| of(x, 0, m)),
            among: all.map(|x| of(x, m, n - m)),
            on_damped: [&viscous, &lossy].map(|x| damped.transpose() * x * &damped),
            damped,
            modes,
        })
    }
}

/// An orthonormal basis of what the columns of symmetric matrices span, up to rounding of numbers of the `size`.
fn range_of(matrices: [&DMatrix<f64>; 2], size: f64) -> DMatrix<f64> {
    const ROUNDING: f64 = 1e-13;
    let n = matrices[0].nrows();
    let used = matrices.iter().filter(|x| x.amax() > ROUNDING * size);
    let columns: Vec<_> = used.flat_map(|x| x.column_iter()).collect();
    if columns.is_empty() {
        return DMatrix::zeros(n, 0);
    }
    let side_by_side = Mat::from_fn(n, columns.len(), |i, j| columns[j][i]);
    let qr = side_by_side.col_piv_qr();
    let (q, r) = (qr.compute_thin_Q(), qr.thin_R());
    let rank = (0..r.nrows().min(r.ncols()))
        .take_while(|i| r[(*i, *i)].abs() > ROUNDING * size)
        .count();
    DMatrix::from_fn(n, rank, |i, j| q[(i, j)])
}

struct Bordered<'a> {
    border: &'a Border,
    rate: Lanes,
    square: Lanes,
    columns: &'a mut [Lanes],
    room: &'a mut Room,
}

/// Below this dynamic stiffness of a mode, as a share of its static one, eliminating it would lose digits.
const AT_RESONANCE: f64 = 1e-8;

impl WithSimd for Bordered<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Bordered {
            border,
            rate,
            square,
            columns,
            room,
        } = self;
        let Border {
            modes,
            between,
            among,
            damped,
            on_damped,
        } = border;
        let (m, b, r) = (modes.mu.len(), among[0].nrows(), damped.ncols());
        let (n, q) = (m + b, b + r);
        let Room {
            dynamic: inverse,
            small,
            right,
            columns: border_columns,
            weighed,
        } = room;
        modes.inverse(rate, square, inverse);
        let too_large = |x: &Lanes| (0..LANES).any(|l| !(x.get(l).l1_norm() < AT_RESONANCE.recip()));
        if inverse.iter().any(too_large) {
            return false;
        }
        // G = (B, Q), and D⁻¹ G.
        border_columns.clear();
        let [mass, damping, hysteretic] = between;
        let entries = mass.iter().zip(damping).zip(hysteretic);
        border_columns.extend(entries.map(|((m, c), h)| entry(rate, square, [*m, *c, *h])));
        border_columns.extend(damped.iter().map(|x| Lanes::splat(*x)));
        for k in 0..m * q {
            border_columns.push(border_columns[k] * inverse[k % m]);
        }
        let (g, solved) = border_columns.split_at(m * q);
        // W times what the dampers see, in its place: entries from b on.
        let weigh = |seen: &mut [Lanes], room: &mut Vec<Lanes>| {
            room.clear();
            for i in 0..r {
                let mut sum = Lanes::default();
                for j in 0..r {
                    let w = [0.0, on_damped[0][(i, j)], on_damped[1][(i, j)]];
                    sum += entry(rate, square, w) * seen[b + j];
                }
                room.push(sum);
            }
            seen[b..].copy_from_slice(room);
        };
        // Gᵀ D⁻¹ G and, for each force f, Gᵀ D⁻¹ f.
        small.clear();
        for j in 0..q {
            for i in 0..q {
                small.push(dot(&g[m * i..m * (i + 1)], &solved[m * j..m * (j + 1)]));
            }
        }
        right.clear();
        for column in columns.chunks_exact(n) {
            for j in 0..q {
                right.push(dot(&solved[m * j..m * (j + 1)], &column[..m]));
            }
        }
        // (E − Bᵀ D⁻¹ B) x − Bᵀ D⁻¹ Q y = f_b − Bᵀ D⁻¹ f and W Qᵀ D⁻¹ B x + (1 + W Qᵀ D⁻¹ Q) y = W Qᵀ D⁻¹ f.
        for (j, column) in small.chunks_exact_mut(q.max(1)).enumerate() {
            for (i, x) in column[..b].iter_mut().enumerate() {
                let mut own = Lanes::default();
                if j < b {
                    own = entry(rate, square, [0, 1, 2].map(|k: usize| among[k][(i, j)]));
                    own = own.plus(if i == j { 1.0 } else { 0.0 });
                }
                own -= *x;
                *x = own;
            }
            weigh(column, weighed);
            if j >= b {
                column[j] = column[j].plus(1.0);
            }
        }
        for (seen, column) in right.chunks_exact_mut(q.max(1)).zip(columns.chunks_exact(n)) {
            for (x, own) in seen[..b].iter_mut().zip(&column[m..]) {
                let mut own = *own;
                own -= *x;
                *x = own;
            }
            weigh(seen, weighed);
        }
        if !eliminate_side_by_side(q, small, right) {
            return false;
        }
        for (x, column) in right.chunks_exact(q.max(1)).zip(columns.chunks_exact_mut(n)) {
            for (value, inverse) in column.iter_mut().zip(inverse.iter()) {
                *value = *value * *inverse;
            }
            for (x, solved) in x.iter().zip(solved.chunks_exact(m)) {
                for (value, solved) in column[..m].iter_mut().zip(solved) {
                    *value -= *solved * *x;
                }
            }
            column[m..].copy_from_slice(&x[..b]);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lanes_of(columns: &[Complex64]) -> Vec<Lanes> {
        columns.iter().map(|x| Lanes::of([*x; LANES])).collect()
    }

    /// Twelve modes, two branches, two dampers and a lossy combination: the bordered solution is that of the whole.
    #[test]
    fn the_border_is_eliminated_exactly() {
        let (m, b) = (12, 2);
        let n = m + b;
        let wave = |i: usize, j: usize| (((j + 2) * (i + 1)) as f64 * 0.37).sin();
        let modes = Modes {
            mu: (0..m).map(|i| 1e-4 / (1 + i * i) as f64).collect(),
            damping: (0..m).map(|i| 6e-4 / (1 + i) as f64).collect(),
        };
        let mut mass = DMatrix::zeros(n, n);
        let mut damping = DMatrix::zeros(n, n);
        let mut hysteretic = DMatrix::zeros(n, n);
        for i in 0..m {
            mass[(i, i)] = modes.mu[i];
            damping[(i, i)] = modes.damping[i];
            for k in 0..b {
                mass[(i, m + k)] = 1e-5 * wave(i, k);
                mass[(m + k, i)] = mass[(i, m + k)];
            }
            for j in 0..m {
                let dampers = wave(i, 7) * wave(j, 7) - 0.3 * wave(i, 9) * wave(j, 9);
                damping[(i, j)] += 1e-3 * dampers;
                hysteretic[(i, j)] += 0.02 * wave(i, 4) * wave(j, 4);
            }
        }
        for k in 0..b {
            mass[(m + k, m + k)] = 5e-5 * (1 + k) as f64;
            damping[(m + k, m + k)] = 2e-4;
        }
        let whole = DynamicStiffness::coupled(modes.clone(), mass, damping, hysteretic);
        let DynamicStiffness::Coupled {
            border: Some(border), ..
        } = &whole
        else {
            panic!("no border");
        };
        assert_eq!(border.damped.ncols(), 3);
        let forces: Vec<Complex64> = (0..2 * n).map(|k| wave(k, 2).into()).collect();
        let mut room = Room::default();
        for omega in [30.0, 95.0, 99.9, 400.0] {
            let rate = Complex64::new(-0.5, omega);
            let mut expected = forces.clone();
            whole.solve_one(rate, &mut expected);
            let mut found = lanes_of(&forces);
            assert!(whole.solve([rate; LANES], &mut found, &mut room));
            let largest = expected.iter().map(|x| x.norm()).fold(0.0, f64::max);
            for (x, y) in found.iter().zip(&expected) {
                assert!((x.get(3) - y).norm() < 1e-11 * largest, "{omega}: {x:?} {y}");
            }
        }
        // On an undamped mode's own resonance nothing can be eliminated.
        let mut undamped = whole.clone();
        if let DynamicStiffness::Coupled {
            border: Some(border), ..
        } = &mut undamped
        {
            border.modes.damping.fill(0.0);
        }
        let rate = Complex64::new(0.0, modes.mu[0].sqrt().recip());
        assert!(!undamped.solve([rate; LANES], &mut lanes_of(&forces), &mut room));
    }
}
