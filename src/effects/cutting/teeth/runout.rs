use crate::effects::cutting::common::milling_only;
use crate::effects::cutting::{CutPhysics, CutSetting, Cutting, Runout};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// The tool's axis lies off the spindle's: every tooth has its own radius.
pub struct RunoutEffect;

impl Effect<Cutting> for RunoutEffect {
    fn id(&self) -> &'static str {
        "runout"
    }

    fn explanation(&self) -> &'static str {
        "The tool's axis lies off the spindle's axis, so that every tooth cuts a chip of its own thickness and some may \
         miss the cut. The direction is counted from one of the teeth; which one, forces cannot tell."
    }

    fn fingerprint(&self) -> &'static str {
        "Lines at once per revolution and its multiples, off the tooth-passing comb, the stronger the smaller the feed."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Dial gauge at the shank, turned by hand, and at each tooth (a setting device or a laser measures radii). \
             Turn the tool in its holder by 180° and look whether the pattern of the teeth goes with it.",
            typical: "Shrink and hydraulic holders 3 to 5 µm, collets 5 to 20 µm, robot spindles with worn collets up to 50 µm. \
             It matters from about a tenth of the feed per tooth.",
            best_measured: "Small feeds, below ten times the runout, with ten turns or more in the steady part \
             and at least 30 samples a tooth.",
            sources: &[
                "Kline, W. A.; DeVor, R. E. (1983): The effect of runout on cutting geometry and forces in end milling. \
                 International Journal of Machine Tool Design and Research 23(2–3).",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        milling_only(data)
            .or_else(|| (data.teeth < 2).then(|| "a single tooth has no runout against others".to_string()))
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        vec![
            Parameter::logarithmic("offset_mm", "mm", 0.01, 1.5, [1e-4, 1.0]),
            Parameter::linear(
                "angle_deg",
                "deg",
                0.3 * 360.0 / data.teeth as f64,
                Prior {
                    mean: 0.0,
                    std: 360.0,
                },
                [-720.0, 720.0],
            ),
        ]
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let pitch_deg = 360.0 / data.teeth as f64;
        let offsets = [0.1, 0.3, 0.8].map(|share| (share * data.smallest_feed_mm).clamp(0.002, 0.2));
        let angles = [0.05, 0.4, 0.75];
        offsets
            .iter()
            .flat_map(|o| angles.map(|a| vec![*o, a * pitch_deg]))
            .collect()
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("offset_mm", SizeRange::Log(0.006, 0.05), FollowsSize::Power(1.0)),
                UsualSize::new("angle_deg", SizeRange::Either(180.0), FollowsSize::Not),
            ]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "a runout",
            [5e-4, 0.2],
            (1000.0, "µm"),
            "no holder runs truer, and no tool that far off survives",
        )
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![NEGLIGIBLE * p[0].nominal, p[1].nominal])
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        physics.runout = Some(Runout {
            offset_mm: values[0].clone(),
            angle_rad: values[1].scale(1f64.to_radians()),
        });
    }
}
