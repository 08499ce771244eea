use super::{CutPhysics, CutSetting, Cutting};
use crate::data::Process;
use crate::effects::background::ALTINTAS;
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Cutting coefficients rise as the chip gets thin: K ∝ (h / 0.1 mm)^−p.
pub struct SizeEffect;

/// The coefficients share one exponent.
const ONE: usize = 0;
/// Each direction has its own.
const EACH: usize = 1;

impl Effect<Cutting> for SizeEffect {
    fn id(&self) -> &'static str {
        "size-effect"
    }

    fn explanation(&self) -> &'static str {
        "Thin chips cost more force per area than thick ones (edge radius, ploughing, strain-rate hardening): the cutting \
         coefficients grow as a power of the inverse chip thickness, referred to 0.1 mm: all by one (`exponents` \"one\": `p`), or \
         each direction of the force by its own (\"each\": tangential, radial and axial; drilling: torque and thrust), as in \
         Kienzle's law."
    }

    fn fingerprint(&self) -> &'static str {
        "Force against feed bends downwards, and within a revolution the thin ends of each chip are higher than a force \
         linear in chip thickness."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Cut the same pass at five feeds from a fifth to five times the usual one and plot mean force against feed: \
             linear with an offset is edge force, a bend at small feeds is the size effect.",
            typical: "Exponent p of 0.15 to 0.35 for steels and titanium (Kienzle's mc lies there; of the radial and the axial force \
             0.3 to 0.7 where the edge has no force of its own); it grows as the chip gets thinner than the edge radius (5 to 30 µm).",
            best_measured: "Feeds from a fifth to five times the usual one, three at least; low radial immersion \
             adds thin chips.",
            sources: &[
                "Kienzle, O. (1952): Die Bestimmung von Kräften und Leistungen an spanenden Werkzeugen und \
                 Werkzeugmaschinen. VDI-Zeitschrift 94.",
                ALTINTAS,
            ],
        }
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        vec![ONE, EACH]
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        Some(("exponents", if variant == ONE { "one" } else { "each" }))
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        let flat = data.process != Process::Milling && data.feeds < 3;
        flat.then(|| "needs three feeds: with fewer it is other cutting and edge coefficients".to_string())
    }

    fn parameters(&self, at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let prior = Prior { mean: 0.0, std: 0.3 };
        names(at, data.process)
            .iter()
            .map(|name| Parameter::linear(*name, "1", 0.15, prior, [-0.5, 0.9]))
            .collect()
    }

    fn starts(&self, at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![0.35; names(at, data.process).len()]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            const fn exponent(name: &'static str) -> UsualSize {
                UsualSize::new(name, SizeRange::Log(0.12, 0.35), FollowsSize::Power(1.0))
            }
            &[
                exponent("p"),
                exponent("p_tangential"),
                exponent("p_radial"),
                exponent("p_axial"),
                exponent("p_torque"),
                exponent("p_thrust"),
            ]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        // One for all is that of the tangential force, more or less, and that is known best.
        let most = if sizes.len() == 1 { 0.6 } else { 0.8 };
        let why = "thin chips are harder to cut, Kienzle's m";
        sizes
            .iter()
            .find_map(|p| p.outside("an exponent", [0.0, most], (1.0, ""), why))
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0; parameters.len()])
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        physics.size_exponent = Some(std::array::from_fn(|k| values[k.min(values.len() - 1)].clone()));
    }
}

/// Of the parameters.
fn names(at: At, process: Process) -> &'static [&'static str] {
    match (at.variant, process) {
        (ONE, _) => &["p"],
        (_, Process::Milling | Process::Turning) => &["p_tangential", "p_radial", "p_axial"],
        (_, Process::Drilling) => &["p_torque", "p_thrust"],
    }
}
