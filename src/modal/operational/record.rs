//! What an operational modal analysis starts from.

/// A record of responses, all of one length and any unit of motion.
#[derive(Debug, Clone, Copy)]
pub struct OperationalRecord<'a> {
    /// Sampling rate, Hz.
    pub sample_rate_hz: f64,
    /// By channel, its samples.
    pub channels: &'a [&'a [f64]],
    /// How often each channel has to be differentiated in time to be what the shapes are of (a velocity once, where others are
    /// accelerations); empty: all are alike.
    pub differentiations: &'a [u8],
}
