//! Cutting forces: geometry, force models, regression of the coefficients.
