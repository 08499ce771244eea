use super::common::{milling_only, straight_edge_only};
use super::{CutPhysics, CutSetting, Cutting};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// The axial force pushes a soft robot or spindle out of the work: the depth falls with it.
pub struct PushOff;

impl Effect<Cutting> for PushOff {
    fn id(&self) -> &'static str {
        "push-off"
    }

    fn explanation(&self) -> &'static str {
        "The mean axial force of the cut pushes the tool out of the work along its axis, as far as robot, spindle and clamping give way: \
         the depth that is cut is the stated one less `compliance_um_per_n` times that force, and all forces fall in proportion."
    }

    fn fingerprint(&self) -> &'static str {
        "All forces of a cut are lower by one factor, the lower the larger the feed; within the turn nothing changes but the helix' \
         share."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Measure the depth of the slot, at a small and at a large feed: it is less than commanded, the less the larger the \
             axial force. Push along the tool's axis with a known force and read a dial gauge.",
            typical: "Industrial robots of 100 to 300 kg payload 0.3 to 5 µm/N along the tool; machine tools below 0.05 µm/N.",
            best_measured: "Feeds over a factor of four and more at one depth; the depths of the slots measured afterwards settle it.",
            sources: &[
                "Pan, Z.; Zhang, H. (2008): Robotic machining from programming to process control: a complete solution by force control. \
                 Industrial Robot 35(5).",
                "Cordes, M.; Hintze, W. (2017): Offline simulation of path deviation due to joint compliance and hysteresis for robot \
                 machining. International Journal of Advanced Manufacturing Technology 90.",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        milling_only(data)
            .or_else(|| straight_edge_only(data))
            .or_else(|| {
                (data.feeds < 2).then(|| "needs two feeds: with one it is other coefficients".to_string())
            })
    }

    fn parameters(&self, _at: At, _known: &Known<Cutting>) -> Vec<Parameter> {
        vec![Parameter::linear(
            "compliance_um_per_n",
            "µm/N",
            0.3,
            Prior { mean: 0.0, std: 1.0 },
            [-2.0, 50.0],
        )]
    }

    fn starts(&self, _at: At, _known: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![2.0]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "compliance_um_per_n",
                SizeRange::Log(0.3, 3.0),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "a compliance along the tool",
            [0.005, 20.0],
            (1.0, "µm/N"),
            "what holds the tool gives way in the direction of the force, and no robot that mills gives way so far",
        )
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        physics.axial_compliance_mm_per_n = Some(values[0].scale(1e-3));
    }
}
