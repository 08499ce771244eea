//! The response channels between the structure and the file, arranged for evaluation line by line.

use num_complex::Complex64;

use crate::effects::ChannelFilter;
use crate::identify::frfs::frf_data::FrfDatum;
use crate::robot::frf::Response;
use crate::robot::{Dual, FrfBasis};

/// The channel filter arranged for evaluation: per measured axis the true axes that it is made of.
pub(crate) struct Channels {
    terms: [Vec<(usize, Dual)>; 3],
    filter: ChannelFilter,
    /// The channels show what is there: nothing to be mixed or delayed.
    faithful: bool,
}

impl Channels {
    pub(crate) fn new(filter: &ChannelFilter) -> Self {
        let matters = |d: &Dual| d.value != 0.0 || d.gradient.iter().any(|g| *g != 0.0);
        let terms: [Vec<(usize, Dual)>; 3] = [0, 1, 2].map(|i| {
            let row = filter.mixing[i].iter().enumerate();
            row.filter(|(_, d)| matters(d))
                .map(|(j, d)| (j, d.clone()))
                .collect()
        });
        let one = Dual::constant(1.0);
        let faithful = !matters(&filter.delay_s)
            && (0..3).all(|i| terms[i].len() == 1 && terms[i][0].0 == i && terms[i][0].1 == one);
        Channels {
            terms,
            filter: filter.clone(),
            faithful,
        }
    }

    /// What the file shows at the frequency of `response`, m/N.
    pub(crate) fn measured(&self, frf: &FrfDatum, basis: &FrfBasis, response: &Response) -> Complex64 {
        self.mixed(response.omega(), frf, |out| {
            basis.receptance(response, out, frf.input)
        })
    }

    /// What the response channel of `frf` shows of a motion, given for each output.
    pub(crate) fn mixed(&self, omega: f64, frf: &FrfDatum, motion: impl Fn(usize) -> Complex64) -> Complex64 {
        if self.faithful {
            return motion(frf.response_outputs[frf.response.axis.index()]) * frf.sign;
        }
        let terms = &self.terms[frf.response.axis.index()];
        let sum: Complex64 = terms
            .iter()
            .map(|(j, weight)| motion(frf.response_outputs[*j]) * weight.value)
            .sum();
        self.filter.factor(omega, frf.sign) * sum
    }

    /// Derivatives of [`Self::measured`] (given as `measured`) into `slope`, one a parameter. `slopes`: those of the true
    /// receptances for this FRF's input, parameters × outputs.
    pub(crate) fn slopes(
        &self,
        frf: &FrfDatum,
        measured: Complex64,
        (basis, response): (&FrfBasis, &Response),
        true_slope: impl Fn(usize, usize) -> Complex64,
        slope: &mut [Complex64],
    ) {
        if self.faithful {
            let out = frf.response_outputs[frf.response.axis.index()];
            for (p, s) in slope.iter_mut().enumerate() {
                *s = true_slope(p, out) * frf.sign;
            }
            return;
        }
        let terms = &self.terms[frf.response.axis.index()];
        let omega = response.omega();
        let factor = self.filter.factor(omega, frf.sign);
        for (p, s) in slope.iter_mut().enumerate() {
            *s = terms
                .iter()
                .map(|(j, weight)| true_slope(p, frf.response_outputs[*j]) * weight.value)
                .sum::<Complex64>()
                * factor;
            let late = self.filter.delay_s.derivative(p);
            if late != 0.0 {
                *s -= Complex64::new(0.0, omega * late) * measured;
            }
        }
        for (j, weight) in terms.iter().filter(|(_, w)| !w.gradient.is_empty()) {
            let h = basis.receptance(response, frf.response_outputs[*j], frf.input) * factor;
            for (s, g) in slope.iter_mut().zip(&weight.gradient) {
                *s += h * *g;
            }
        }
    }
}
