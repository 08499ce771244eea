use super::{CutPhysics, CutSetting, Cutting};
use crate::data::Process;
use crate::effects::Background;
use crate::effects::background::BUDAK;
use crate::effects::{At, Effect, Known};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Rubbing of the edge, for a baseline that was fitted without.
pub struct EdgeForce;

impl Effect<Cutting> for EdgeForce {
    fn id(&self) -> &'static str {
        "edge-force"
    }

    fn explanation(&self) -> &'static str {
        "The edge rubs and ploughs: a force per edge length that does not depend on the chip thickness, for a baseline that \
         has none."
    }

    fn fingerprint(&self) -> &'static str {
        "Forces do not go to zero with the feed."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Plot mean force against feed and draw the line to feed zero: what is left there is the edge force. A sharp \
             new tool has little of it.",
            typical: "10 to 60 N for each mm of edge in metals with sharp carbide (a tenth to a third of the force at usual \
             feeds), more with honed or worn edges.",
            best_measured: "Five feeds at one speed, the smallest as small as the tool still cuts: the shorter the way to feed \
             zero, the better the offset there is known.",
            sources: &[
                "Albrecht, P. (1960): New developments in the theory of the metal-cutting process, part I: the \
                 ploughing process in metal cutting. ASME Journal of Engineering for Industry 82.",
                "Armarego, E. J. A.; Brown, R. H. (1969): The Machining of Metals. Prentice-Hall.",
                BUDAK,
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        data.has_edge
            .then(|| "the baseline has edge coefficients already".to_string())
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let scale = 0.05 * data.cutting_scale_n_per_mm2.max(1.0);
        let names: &[&str] = match data.process {
            Process::Milling | Process::Turning => &["kte_n_per_mm", "kre_n_per_mm", "kae_n_per_mm"],
            Process::Drilling => &["kte_n_per_mm", "kfe_n_per_mm"],
        };
        names
            .iter()
            .map(|name| {
                Parameter::linear(
                    *name,
                    "N/mm",
                    0.2 * scale,
                    Prior {
                        mean: 0.0,
                        std: 3.0 * scale,
                    },
                    [-20.0 * scale, 20.0 * scale],
                )
            })
            .collect()
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0; p.len()])
    }

    fn order(&self) -> u8 {
        0
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        let edges: &[usize] = match setting.process {
            Process::Milling | Process::Turning => &[3, 4, 5],
            Process::Drilling => &[1, 3],
        };
        for (value, &edge) in values.iter().zip(edges) {
            physics.coefficient[edge] = &physics.coefficient[edge] + value;
        }
    }
}
