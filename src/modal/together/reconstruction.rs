//! What the common modes say of one FRF.

use num_complex::Complex64;

use crate::modal::max_likelihood::joint_fit::{Data, Group};

/// What the common modes say of one FRF.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// sqrt(Σ|fitted − measured|² / Σ|measured|²) of the mobility: in receptance a robot's lowest mode alone would
    /// count, in accelerance its highest.
    pub error_nrms: f64,
    /// The same for the noise alone.
    pub noise_nrms: f64,
    /// Lines that the common fits cover, Hz.
    pub frequency_hz: Vec<f64>,
    /// Turned where it was conjugated.
    pub measured_m_per_n: Vec<Complex64>,
    /// The common modes and their residual terms on the same lines.
    pub fitted_m_per_n: Vec<Complex64>,
}

/// FRF m on the lines that a group covers; errors as mobility, within `band_hz`.
pub(crate) fn reconstruction(d: &Data, groups: &[Group], m: usize, band_hz: [f64; 2]) -> Reconstruction {
    let mut found = Reconstruction {
        error_nrms: 0.0,
        noise_nrms: 0.0,
        frequency_hz: Vec::with_capacity(d.frequency_hz.len()),
        measured_m_per_n: Vec::with_capacity(d.frequency_hz.len()),
        fitted_m_per_n: Vec::with_capacity(d.frequency_hz.len()),
    };
    let mut total = 0.0;
    for group in groups.iter().filter(|g| g.solution.frfs[m].took_part()) {
        let from = d.frequency_hz.partition_point(|&f| f < group.window_hz[0]);
        let to = d.frequency_hz.partition_point(|&f| f < group.window_hz[1]);
        let fitted = group.solution.fitted(m, &d.frequency_hz[from..to]);
        for (k, fitted) in (from..to).zip(fitted) {
            let (f, h) = (d.frequency_hz[k], d.receptance[k]);
            found.frequency_hz.push(f);
            found.measured_m_per_n.push(h);
            found.fitted_m_per_n.push(fitted);
            if (band_hz[0]..=band_hz[1]).contains(&f) {
                found.error_nrms += f * f * (h - fitted).norm_sqr();
                found.noise_nrms += (f * d.sigma[k]).powi(2);
                total += f * f * h.norm_sqr();
            }
        }
    }
    // Nothing measured there: nothing to be wrong about.
    let total = if total > 0.0 { total } else { 1.0 };
    found.error_nrms = (found.error_nrms / total).sqrt();
    found.noise_nrms = (found.noise_nrms / total).sqrt();
    found
}
