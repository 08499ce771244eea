//! What an operational modal analysis starts from.

/// A record of responses, all of one length and any unit of motion.
#[derive(Debug, Clone, Copy)]
pub struct OperationalRecord<'a> {
    /// Sampling rate, Hz.
    pub sample_rate_hz: f64,
    /// By channel, its samples.
    pub channels: &'a [&'a [f64]],
}
