//! What a technician wants to know of an effect besides what it does to the model.

/// How to check an effect without this program, what sizes to expect, and where to read on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Background {
    /// In the lab, with what a lab has.
    pub lab_check: &'static str,
    /// Sizes met in practice. Rules of thumb unless a source is named in the text.
    pub typical: &'static str,
    /// What to measure, and how, for the effect to show best in a campaign.
    pub best_measured: &'static str,
    /// Author, year, title, place. Empty where there is none that we vouch for.
    pub sources: &'static [&'static str],
}

/// Works that several effects rest on.
pub const EWINS: &str = "Ewins, D. J. (2000): Modal Testing: Theory, Practice and Application. 2nd edition, Research Studies \
                         Press.";
pub(super) const ALTINTAS: &str = "Altintas, Y. (2012): Manufacturing Automation: Metal Cutting Mechanics, Machine Tool Vibrations, \
                            and CNC Design. 2nd edition, Cambridge University Press.";
pub(super) const ABELE: &str = "Abele, E.; Weigold, M.; Rothenbücher, S. (2007): Modeling and identification of an industrial robot \
                         for machining applications. CIRP Annals 56(1).";
pub(super) const MOBERG: &str = "Moberg, S.; Wernholt, E.; Hanssen, S.; Brogårdh, T. (2014): Modeling and parameter estimation of \
                          robot manipulators using extended flexible joint models. ASME Journal of Dynamic Systems, \
                          Measurement, and Control 136(3).";
pub(super) const TUTTLE: &str = "Tuttle, T. D.; Seering, W. P. (1996): A nonlinear model of a harmonic drive gear transmission. \
                          IEEE Transactions on Robotics and Automation 12(3).";
pub(super) const KHALIL: &str = "Khalil, W.; Gautier, M.; Lemoine, P. (2007): Identification of the payload inertial parameters of \
                          industrial manipulators. IEEE International Conference on Robotics and Automation.";
pub(super) const BUDAK: &str = "Budak, E.; Altintas, Y.; Armarego, E. J. A. (1996): Prediction of milling force coefficients from \
                         orthogonal cutting data. ASME Journal of Manufacturing Science and Engineering 118(2).";
pub(super) const SHAW_OXFORD: &str = "Shaw, M. C.; Oxford, C. J. (1957): On the drilling of metals, 2: the torque and thrust in \
                               drilling. Transactions of the ASME 79.";
pub(super) const GAUTSCHI: &str = "Gautschi, G. (2002): Piezoelectric Sensorics. Springer.";
