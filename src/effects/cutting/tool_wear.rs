use super::{CutPhysics, CutSetting, Cutting};
use crate::data::Process;
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Edge coefficients grow along the sequence of cuts.
pub struct ToolWear;

impl Effect<Cutting> for ToolWear {
    fn id(&self) -> &'static str {
        "tool-wear"
    }

    fn explanation(&self) -> &'static str {
        "The edge wears from cut to cut: the edge coefficients grow linearly over the sequence of cuts. `growth` is their \
         ratio at the last cut to the first, in each direction."
    }

    fn fingerprint(&self) -> &'static str {
        "Forces rise with the order in which the cuts were made, by the same amount at every feed."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Look at the flank under a microscope and measure the wear land VB before and after the cuts. Repeat the \
             first cut at the end: its force is higher by what the tool lost.",
            typical: "ISO 8688-2 ends the life of an end mill at a uniform wear land of 0.3 mm; edge coefficients may double on \
             the way there.",
            best_measured: "Every cut with its place in the order (`order`), the first cut repeated at the end, \
             feeds not in the order of time.",
            sources: &[
                "ISO 8688-2: Tool life testing in milling – Part 2: End milling.",
                "Taylor, F. W. (1907): On the art of cutting metals. Transactions of the ASME 28.",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        (data.sequence_length < 3)
            .then(|| "the campaign does not say in which order the cuts were made (order = n)".to_string())
            .or_else(|| (!data.has_edge).then(|| "the baseline has no edge coefficients".to_string()))
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let directions: &[&str] = match data.process {
            Process::Milling | Process::Turning => &["t", "r", "a"],
            Process::Drilling => &["t", "f"],
        };
        directions
            .iter()
            .map(|d| {
                Parameter::linear(
                    format!("growth[{d}]"),
                    "1",
                    1.5,
                    Prior { mean: 1.0, std: 1.5 },
                    [-5.0, 30.0],
                )
            })
            .collect()
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "growth",
                SizeRange::Log(1.3, 3.0),
                FollowsSize::Ratio,
            )]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        let growth = |size: &Size| {
            size.outside(
                "a growth",
                [0.8, 10.0],
                (1.0, "times"),
                "an edge gets blunter as it cuts, and is changed before it is ten times as blunt",
            )
        };
        sizes.iter().find_map(growth)
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![1.0; p.len()])
    }

    fn order(&self) -> u8 {
        2
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        let edges: &[usize] = match setting.process {
            Process::Milling | Process::Turning => &[3, 4, 5],
            Process::Drilling => &[1, 3],
        };
        for (growth, &edge) in values.iter().zip(edges) {
            let factor = &Dual::constant(1.0 - setting.progress) + &growth.scale(setting.progress);
            physics.coefficient[edge] = &physics.coefficient[edge] * &factor;
        }
    }
}
