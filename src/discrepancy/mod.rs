//! Where the model fails: comparison of model and measurement.
