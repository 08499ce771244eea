use super::common::milling_only;
use super::{CutPhysics, CutSetting, Cutting};
use crate::effects::background::GAUTSCHI;
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Force channels leak into each other.
pub struct Crosstalk;

/// Off-diagonal elements as (row, column).
const LEAKS: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];

impl Effect<Cutting> for Crosstalk {
    fn id(&self) -> &'static str {
        "crosstalk"
    }

    fn explanation(&self) -> &'static str {
        "Each recorded channel shows a few per cent of the forces on the other two (plate stiffness, amplifier, cable): \
         recorded = M true with ones on the diagonal."
    }

    fn fingerprint(&self) -> &'static str {
        "One axis shows a small copy of another's waveform, at all speeds and feeds; up and down milling together make it \
         plain."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Hang a known weight along one axis at a time and read the other two channels: what they show is crosstalk. \
             The plate must be level and the screws tightened as for cutting.",
            typical: "Makers of piezoelectric dynamometers promise 2 % or less between axes; loose screws or a workpiece that \
             overhangs give 5 to 10 %.",
            best_measured: "Up and down milling of the same width: the force changes sides, its copy with it. \
             Otherwise cuts at immersions whose mean forces point in different directions.",
            sources: &[GAUTSCHI],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        milling_only(data).or_else(|| {
            (!data.channels[..3].iter().all(|c| *c)).then(|| "needs the three force channels".to_string())
        })
    }

    fn parameters(&self, _at: At, _known: &Known<Cutting>) -> Vec<Parameter> {
        LEAKS
            .iter()
            .map(|(i, j)| {
                Parameter::linear(
                    format!("matrix[{i}][{j}]"),
                    "1",
                    0.0,
                    Prior { mean: 0.0, std: 0.06 },
                    [-0.5, 0.5],
                )
            })
            .collect()
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "matrix",
                SizeRange::Either(0.05),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        let leak = |size: &Size| {
            size.outside(
                "a leak between channels",
                [-0.1, 0.1],
                (100.0, "%"),
                "makers promise 2, loose screws make it some times as much",
            )
        };
        sizes.iter().find_map(leak)
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0; p.len()])
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        let mut mixing = Dual::unit_matrix();
        for ((i, j), value) in LEAKS.iter().zip(values) {
            mixing[*i][*j] = value.clone();
        }
        physics.crosstalk = Some(mixing);
    }
}
