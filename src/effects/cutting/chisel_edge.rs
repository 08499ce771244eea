use super::common::drilling_only;
use super::{CutPhysics, CutSetting, Cutting};
use crate::effects::Background;
use crate::effects::background::SHAW_OXFORD;
use crate::effects::{At, Effect, Known, NEGLIGIBLE};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// The chisel edge indents: thrust ∝ feed^n in holes without pilot.
pub struct ChiselEdge;

impl Effect<Cutting> for ChiselEdge {
    fn id(&self) -> &'static str {
        "chisel-edge"
    }

    fn explanation(&self) -> &'static str {
        "In a hole without pilot the chisel edge presses into the material rather than cutting it: a thrust \
         coefficient · feed^exponent (feed in mm per revolution) with next to no torque."
    }

    fn fingerprint(&self) -> &'static str {
        "Full holes need more thrust than pilot holes predict, from the first contact on, while the torque agrees."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Drill one hole into the full and one with a pilot hole a little wider than the web: the difference in \
             thrust is the chisel edge.",
            typical: "Half the thrust of a drill with a plain point (a third to two thirds, growing with the web), and less than \
             a tenth of its torque. Web thinning halves it.",
            best_measured: "Full holes and holes with a pilot a little wider than the web, each at three feeds.",
            sources: &[
                SHAW_OXFORD,
                "Williams, R. A. (1974): A study of the drilling process. ASME Journal of Engineering for Industry 96.",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        drilling_only(data).or_else(|| {
            (data.full_holes == 0 || data.pilot_holes == 0).then(|| {
                "needs both full and pilot holes: with one kind it is other thrust coefficients".to_string()
            })
        })
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        // About the thrust of a chip as wide as the chisel, ten times as hard to cut.
        let nominal = data.cutting_scale_n_per_mm2.max(1.0);
        vec![
            Parameter::logarithmic(
                "coefficient_n",
                "N",
                nominal,
                2.0,
                [1e-3 * nominal, 100.0 * nominal],
            ),
            Parameter::linear("exponent", "1", 0.8, Prior { mean: 0.8, std: 0.4 }, [-0.5, 3.0]),
        ]
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![0.1 * data.cutting_scale_n_per_mm2.max(1.0), 0.6]]
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![NEGLIGIBLE * p[0].nominal, p[1].nominal])
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        let power = values[1].scale(setting.feed_mm.max(1e-9).ln()).exp();
        physics.chisel_thrust_n = Some(&values[0] * &power);
    }
}
