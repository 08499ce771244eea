//! FRFs taken together as a set.

use num_complex::Complex64;

use crate::modal::single::frf_modes::FrfModes;

/// One FRF of a set, with what was found in it.
#[derive(Clone, Copy)]
pub struct SetMember<'a> {
    /// Ascending, Hz.
    pub frequency_hz: &'a [f64],
    /// As given to [`crate::modal::analyse_frf`], m/N.
    pub receptance_m_per_n: &'a [Complex64],
    /// The modes of this FRF by itself.
    pub modes: &'a FrfModes,
    /// Response and reference, as numbers that are equal where the degree of freedom is; `None` where not known.
    pub dofs: Option<[usize; 2]>,
}
