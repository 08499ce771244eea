//! Physical constraints: edge coefficients cannot be negative. A conic program, solved by clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use super::regression::Observation;
use crate::{Error, Result};

/// A constrained solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Constrained {
    pub value: Vec<f64>,
    /// True where the bound at zero holds the coefficient.
    pub active: Vec<bool>,
}

/// Minimises Σ weight (value − row·x)² subject to x_j ≥ 0 where `nonnegative[j]`: in Gram form
/// ½ xᵀPx + qᵀx with P = AᵀWA, q = −AᵀWb, columns scaled to unit diagonal.
///
/// # Errors
/// The solver finds no solution, or a column of the model is empty (nothing determines that coefficient).
pub fn nonnegative_least_squares(
    observations: &[Observation],
    weight: &[f64],
    nonnegative: &[bool],
) -> Result<Constrained> {
    let n = nonnegative.len();
    let gram = |i: usize, j: usize| -> f64 {
        observations
            .iter()
            .zip(weight)
            .map(|(o, w)| w * o.row[i] * o.row[j])
            .sum()
    };
    let scale: Vec<f64> = (0..n).map(|j| gram(j, j).sqrt()).collect();
    if scale.iter().any(|s| !s.is_finite() || *s <= 0.0) {
        return Err(Error::computation(
            "a coefficient is not determined by any axis of the data",
        ));
    }
    // Upper triangle, column by column.
    let (mut column_start, mut row_index, mut p_value) = (vec![0], Vec::new(), Vec::new());
    for j in 0..n {
        for i in 0..=j {
            row_index.push(i);
            p_value.push(gram(i, j) / scale[i] / scale[j]);
        }
        column_start.push(row_index.len());
    }
    let p = CscMatrix::new(n, n, column_start, row_index, p_value);
    let right: Vec<f64> = (0..n)
        .map(|j| {
            observations
                .iter()
                .zip(weight)
                .map(|(o, w)| w * o.row[j] * o.value)
                .sum::<f64>()
                / scale[j]
        })
        .collect();
    // The size of the unknowns, so that the solver's absolute tolerances mean something.
    let size = right.iter().map(|r| r.abs()).fold(0.0, f64::max).max(1e-300);
    let q: Vec<f64> = right.iter().map(|r| -r / size).collect();

    // Constraints s = b − A x ≥ 0 with A = −1 on the bounded coefficients, b = 0.
    let bounded: Vec<usize> = (0..n).filter(|&j| nonnegative[j]).collect();
    let (mut a_start, mut a_row) = (vec![0], Vec::new());
    for &bound in nonnegative {
        if bound {
            a_row.push(a_row.len());
        }
        a_start.push(a_row.len());
    }
    let a = CscMatrix::new(bounded.len(), n, a_start, a_row, vec![-1.0; bounded.len()]);
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-12)
        .tol_gap_rel(1e-12)
        .tol_feas(1e-12)
        .build()
        .map_err(|e| Error::computation(format!("conic solver settings: {e}")))?;
    let cones = [SupportedConeT::NonnegativeConeT(bounded.len())];
    let mut solver = DefaultSolver::new(&p, &q, &a, &vec![0.0; bounded.len()], &cones, settings)
        .map_err(|e| Error::computation(format!("conic program: {e}")))?;
    solver.solve();
    if !matches!(
        solver.solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved
    ) {
        return Err(Error::computation(format!(
            "the constrained regression found no solution ({:?})",
            solver.solution.status
        )));
    }
    let mut value: Vec<f64> = (0..n).map(|j| solver.solution.x[j] * size / scale[j]).collect();
    let mut active = vec![false; n];
    for (k, &j) in bounded.iter().enumerate() {
        // Complementary slackness: the multiplier outweighs the slack where the bound holds.
        if solver.solution.z[k] > solver.solution.s[k] {
            active[j] = true;
            value[j] = 0.0;
        }
    }
    Ok(Constrained { value, active })
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
        let fit = nonnegative_least_squares(&line(&points), &[1.0; 3], &[false, true]).unwrap();
        let slope =
            points.iter().map(|(x, y)| x * y).sum::<f64>() / points.iter().map(|(x, _)| x * x).sum::<f64>();
        assert_eq!(fit.active, [false, true]);
        assert_eq!(fit.value[1], 0.0);
        assert!((fit.value[0] / slope - 1.0).abs() < 1e-6, "{fit:?} {slope}");
    }

    #[test]
    fn an_idle_constraint_changes_nothing() {
        let points = [(0.1, 12.0), (0.2, 22.5), (0.3, 31.5)];
        let fit = nonnegative_least_squares(&line(&points), &[1.0; 3], &[false, true]).unwrap();
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
        assert!(nonnegative_least_squares(&all, &[1.0; 2], &[false, true]).is_err());
    }
}
