//! Fits models to measurements: parameters with priors, solvers, uncertainty.
