//! What the structure does between the points of an FRF, before a mistake spoils it.

use num_complex::Complex64;

use crate::data::Axis;
use crate::effects::ChannelFilter;
use crate::identify::frfs::frf_data::FrfDatum;
use crate::robot::FrfBasis;
use crate::robot::frf::Response;

/// The true receptances between the two points of an FRF, m/N.
pub struct Truth<'t> {
    pub(super) basis: &'t FrfBasis,
    pub(super) response: &'t Response,
    pub(super) filter: &'t ChannelFilter,
    /// First of the three outputs of the response point and of the reference point.
    pub(super) first: [usize; 2],
    /// Complex rate, 1/s.
    pub rate: Complex64,
}

impl Truth<'_> {
    /// Displacement along `response` at the response point, as its channel would have it without the mistake, per force
    /// along `reference` at the reference point.
    pub fn between(&self, response: Axis, reference: Axis) -> Complex64 {
        let row = &self.filter.mixing[response.index()];
        let input = self.first[1] + reference.index();
        let terms = row.iter().enumerate().filter(|(_, weight)| weight.value != 0.0);
        terms
            .map(|(j, weight)| self.basis.receptance(self.response, self.first[0] + j, input) * weight.value)
            .sum()
    }

    /// With the sign of the file's axes and the delay of the channel.
    pub(super) fn recorded(&self, frf: &FrfDatum, shown: Complex64) -> Complex64 {
        shown * self.filter.factor(self.rate.im, frf.sign)
    }

    /// Between the axes of the response point itself.
    pub fn at_response(&self, a: usize, b: usize) -> Complex64 {
        self.basis
            .receptance(self.response, self.first[0] + a, self.first[0] + b)
    }

    /// From the force along `reference` to axis `a` of the response point, before any channel.
    pub fn bare(&self, a: usize, reference: Axis) -> Complex64 {
        self.basis.receptance(
            self.response,
            self.first[0] + a,
            self.first[1] + reference.index(),
        )
    }
}
