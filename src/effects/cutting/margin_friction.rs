use super::common::drilling_only;
use super::{CutPhysics, CutSetting, Cutting};
use crate::effects::Background;
use crate::effects::background::SHAW_OXFORD;
use crate::effects::{At, Effect, Known};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// The drill's margins rub in the hole: torque grows with depth.
pub struct MarginFriction;

impl Effect<Cutting> for MarginFriction {
    fn id(&self) -> &'static str {
        "margin-friction"
    }

    fn explanation(&self) -> &'static str {
        "The drill's margins and the chips in its flutes rub on the wall of the hole: a friction force on the \
         circumference that grows with the depth at full diameter, seen as torque."
    }

    fn fingerprint(&self) -> &'static str {
        "Torque climbs steadily while the hole gets deeper; thrust does not."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Turn the drill in the finished hole without feed and read the torque: that is margin and chips. Compare a \
             deep and a shallow hole.",
            typical: "Torque grows by 2 to 10 % for each diameter of depth, far more once the flutes pack with chips (beyond \
             about three diameters without pecking).",
            best_measured: "Holes of three diameters of depth and more, torque recorded from the first contact \
             on; a shallow one to compare with.",
            sources: &[SHAW_OXFORD],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        drilling_only(data).or_else(|| (!data.channels[3]).then(|| "needs the torque".to_string()))
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let scale = 0.02 * data.cutting_scale_n_per_mm2.max(1.0);
        vec![Parameter::linear(
            "k_margin_n_per_mm",
            "N/mm",
            0.05 * scale,
            Prior {
                mean: 0.0,
                std: scale,
            },
            [-10.0 * scale, 10.0 * scale],
        )]
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        physics.margin_n_per_mm = Some(values[0].clone());
    }
}
