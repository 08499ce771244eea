//! Modal parameters from measured FRFs.
