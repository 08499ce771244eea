//! Stability lobes.
