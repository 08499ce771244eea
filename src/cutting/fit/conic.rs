//! Regression as a conic program, solved by clarabel: coefficients that cannot be negative, and Huber's loss, which
//! lets no single average pull harder than a bound.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use crate::cutting::fit::regression::Observation;
use crate::{Error, Result};

/// What a residual costs, in standard deviations e.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// e²/2.
    Squares,
    /// e²/2 up to the threshold k, k |e| − k²/2 beyond (Huber, Ann. Math. Statist. 35, 1964).
    Huber(f64),
}

/// The solution of a conic program.
#[derive(Debug, Clone, PartialEq)]
pub struct ConicFit {
    /// The coefficients, in the order of the columns.
    pub value: Vec<f64>,
    /// True where the bound at zero holds the coefficient.
    pub active: Vec<bool>,
}

/// Minimises Σ loss(√weight (value − row·x)) subject to x_j ≥ 0 where `nonnegative[j]`, as a quadratic program
/// over the step d from `start` (best: the least squares solution, so that all numbers are of the size of the
/// residuals), z and, for Huber's loss, p, q ≥ 0:
/// minimise ½ zᵀz + k Σ (p + q), where A d − z − p + q = r, r the residuals at `start`, A and r times √weight.
/// (Mangasarian & Musicant, IEEE Trans. Pattern Anal. 22, 2000, with bounds added.)
///
/// # Errors
/// The solver finds no solution, or a column of the model is empty (nothing determines that coefficient).
pub fn conic_fit(
    observations: &[Observation],
    weight: &[f64],
    start: &[f64],
    nonnegative: &[bool],
    loss: Loss,
) -> Result<ConicFit> {
    let (n, m) = (nonnegative.len(), observations.len());
    let root: Vec<f64> = weight.iter().map(|w| w.sqrt()).collect();
    let scale: Vec<f64> = (0..n)
        .map(|j| {
            let column = observations.iter().zip(&root).map(|(o, w)| w * o.row[j]);
            column.map(|v| v * v).sum::<f64>().sqrt()
        })
        .collect();
    if scale.iter().any(|s| !s.is_finite() || *s <= 0.0) {
        return Err(Error::computation(
            "a coefficient is not determined by any axis of the data",
        ));
    }
    let residual: Vec<f64> = observations
        .iter()
        .zip(&root)
        .map(|(o, w)| w * (o.value - o.row.iter().zip(start).map(|(r, x)| r * x).sum::<f64>()))
        .collect();
    let bounded: Vec<usize> = (0..n).filter(|&j| nonnegative[j]).collect();
    // One common scale, so that the solver's absolute tolerances mean something.
    let violation = bounded.iter().map(|&j| -start[j] * scale[j]);
    let size = residual
        .iter()
        .map(|r| r.abs())
        .chain(violation)
        .fold(1.0, f64::max);

    let slack_columns = match loss {
        Loss::Squares => 0,
        Loss::Huber(_) => 2 * m,
    };
    let columns = n + m + slack_columns;
    let mut p = Triplets::new(columns, columns);
    let mut q = vec![0.0; columns];
    let mut a = Triplets::new(m + bounded.len() + slack_columns, columns);
    let mut b: Vec<f64> = residual.iter().map(|r| r / size).collect();
    for j in 0..n {
        for (i, o) in observations.iter().enumerate() {
            a.push(i, j, root[i] * o.row[j] / scale[j]);
        }
    }
    for i in 0..m {
        p.push(n + i, n + i, 1.0);
        a.push(i, n + i, -1.0);
    }
    // Below the equations: start + d ≥ 0, then p, q ≥ 0, each as b − A x ≥ 0.
    for (k, &j) in bounded.iter().enumerate() {
        a.push(m + k, j, -1.0);
        b.push(start[j] * scale[j] / size);
    }
    if let Loss::Huber(threshold) = loss {
        for i in 0..2 * m {
            let (column, sign) = (n + m + i, if i < m { -1.0 } else { 1.0 });
            q[column] = threshold / size;
            a.push(i % m, column, sign);
            a.push(m + bounded.len() + i, column, -1.0);
            b.push(0.0);
        }
    }
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-12)
        .tol_gap_rel(1e-12)
        .tol_feas(1e-12)
        .build()
        .map_err(|e| Error::computation(format!("conic solver settings: {e}")))?;
    let cones = [
        SupportedConeT::ZeroConeT(m),
        SupportedConeT::NonnegativeConeT(bounded.len() + slack_columns),
    ];
    let mut solver = DefaultSolver::new(&p.matrix(), &q, &a.matrix(), &b, &cones, settings)
        .map_err(|e| Error::computation(format!("conic program: {e}")))?;
    solver.solve();
    let solution = &solver.solution;
    if !matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return Err(Error::computation(format!(
            "the conic regression found no solution ({:?})",
            solution.status
        )));
    }
    let mut value: Vec<f64> = (0..n)
        .map(|j| start[j] + solution.x[j] * size / scale[j])
        .collect();
    let mut active = vec![false; n];
    for (k, &j) in bounded.iter().enumerate() {
        // Complementary slackness: the multiplier outweighs the slack where the bound holds.
        if solution.z[m + k] > solution.s[m + k] {
            active[j] = true;
            value[j] = 0.0;
        }
    }
    Ok(ConicFit { value, active })
}

/// A sparse matrix in the making.
struct Triplets {
    size: [usize; 2],
    row: Vec<usize>,
    column: Vec<usize>,
    value: Vec<f64>,
}

impl Triplets {
    fn new(rows: usize, columns: usize) -> Self {
        Triplets {
            size: [rows, columns],
            row: Vec::new(),
            column: Vec::new(),
            value: Vec::new(),
        }
    }

    fn push(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.row.push(row);
            self.column.push(column);
            self.value.push(value);
        }
    }

    fn matrix(self) -> CscMatrix<f64> {
        let [rows, columns] = self.size;
        CscMatrix::new_from_triplets(rows, columns, self.row, self.column, self.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::ForceAxis;

    fn line(points: &[(f64, f64)]) -> Vec<Observation> {
        points
            .iter()
            .enumerate()
            .map(|(cut, (x, y))| Observation {
                cut,
                axis: ForceAxis::Z,
                row: vec![*x, 1.0],
                value: *y,
                std_error: 1.0,
            })
            .collect()
    }

    #[test]
    fn a_negative_edge_is_held_at_zero_and_named() {
        // y = 100 x − 2: with the intercept held at zero the slope is Σxy/Σx².
        let points = [(0.1, 8.0), (0.2, 18.0), (0.3, 28.0)];
        let fit = conic_fit(
            &line(&points),
            &[1.0; 3],
            &[0.0; 2],
            &[false, true],
            Loss::Squares,
        )
        .unwrap();
        let slope =
            points.iter().map(|(x, y)| x * y).sum::<f64>() / points.iter().map(|(x, _)| x * x).sum::<f64>();
        assert_eq!(fit.active, [false, true]);
        assert_eq!(fit.value[1], 0.0);
        assert!((fit.value[0] / slope - 1.0).abs() < 1e-6, "{fit:?} {slope}");
    }

    #[test]
    fn an_idle_constraint_changes_nothing() {
        let points = [(0.1, 12.0), (0.2, 22.5), (0.3, 31.5)];
        let fit = conic_fit(
            &line(&points),
            &[1.0; 3],
            &[0.0; 2],
            &[false, true],
            Loss::Squares,
        )
        .unwrap();
        assert_eq!(fit.active, [false, false]);
        assert!(
            (fit.value[0] / 97.5 - 1.0).abs() < 1e-6 && (fit.value[1] / 2.5 - 1.0).abs() < 1e-6,
            "{fit:?}"
        );
    }

    #[test]
    fn an_empty_column_is_refused() {
        let mut all = line(&[(0.1, 12.0), (0.2, 22.0)]);
        all.iter_mut().for_each(|o| o.row[0] = 0.0);
        assert!(conic_fit(&all, &[1.0; 2], &[0.0; 2], &[false, true], Loss::Squares).is_err());
    }

    /// Nine points near 2 + 3 x, one of them far off; the minimum of Huber's loss (k = 1.345) was found with a
    /// general minimiser of another library (scipy, Nelder–Mead), with and without the bound.
    #[test]
    fn hubers_loss_reaches_its_independent_minimum() {
        let y = [2.3, 4.6, 8.4, 10.9, 14.2, 40.0, 19.7, 23.4, 26.1];
        let points: Vec<(f64, f64)> = y.iter().enumerate().map(|(i, y)| (i as f64, *y)).collect();
        let all = line(&points);
        let huber = |nonnegative: [bool; 2], start: [f64; 2], all: &[Observation]| {
            conic_fit(all, &[1.0; 9], &start, &nonnegative, Loss::Huber(1.345)).unwrap()
        };
        let free = huber([false, true], [0.0; 2], &all);
        assert_eq!(free.active, [false, false]);
        let want = [3.03207007, 2.11885349];
        for (got, want) in free.value.iter().zip(want) {
            assert!((got - want).abs() < 1e-6, "{got} {want}");
        }
        // Where the program starts does not matter.
        let elsewhere = huber([false, true], [10.0, -30.0], &all);
        for (got, want) in elsewhere.value.iter().zip(want) {
            assert!((got - want).abs() < 1e-6, "{got} {want}");
        }
        let mut lower = all.clone();
        lower.iter_mut().for_each(|o| o.value -= 5.0);
        let held = huber([false, true], [0.0; 2], &lower);
        assert_eq!(held.active, [false, true]);
        assert!((held.value[0] - 2.553060606).abs() < 1e-6, "{held:?}");
    }
}
