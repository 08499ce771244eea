//! Draws what the floors below computed; computes nothing itself.
