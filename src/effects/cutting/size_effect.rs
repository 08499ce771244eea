use super::common::straight_edge_only;
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

impl Effect<Cutting> for SizeEffect {
    fn id(&self) -> &'static str {
        "size-effect"
    }

    fn explanation(&self) -> &'static str {
        "Thin chips cost more force per area than thick ones (edge radius, ploughing, strain-rate hardening): the cutting \
         coefficients grow as a power of the inverse chip thickness, referred to 0.1 mm."
    }

    fn fingerprint(&self) -> &'static str {
        "Force against feed bends downwards, and within a revolution the thin ends of each chip are higher than a force \
         linear in chip thickness."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Cut the same pass at five feeds from a fifth to five times the usual one and plot mean force against feed: \
             linear with an offset is edge force, a bend at small feeds is the size effect.",
            typical: "Exponent p of 0.15 to 0.35 for steels and titanium (Kienzle's 1 − m lies there); it grows as the chip gets \
             thinner than the edge radius (5 to 30 µm).",
            best_measured: "Feeds from a fifth to five times the usual one, three at least; low radial immersion \
             adds thin chips.",
            sources: &[
                "Kienzle, O. (1952): Die Bestimmung von Kräften und Leistungen an spanenden Werkzeugen und \
                 Werkzeugmaschinen. VDI-Zeitschrift 94.",
                ALTINTAS,
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        let flat = data.process != Process::Milling && data.feeds < 3;
        flat.then(|| "needs three feeds: with fewer it is other cutting and edge coefficients".to_string())
            .or_else(|| straight_edge_only(data))
    }

    fn parameters(&self, _at: At, _known: &Known<Cutting>) -> Vec<Parameter> {
        vec![Parameter::linear(
            "p",
            "1",
            0.15,
            Prior { mean: 0.0, std: 0.3 },
            [-0.5, 0.8],
        )]
    }

    fn starts(&self, _at: At, _known: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![0.35]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "p",
                SizeRange::Log(0.12, 0.35),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "an exponent",
            [0.0, 0.6],
            (1.0, ""),
            "thin chips are harder to cut, Kienzle's 1 − m",
        )
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        physics.size_exponent = Some(values[0].clone());
    }
}
