use crate::effects::cutting::common::{milling_only, one_helix_only, teeth_as_listed};
use crate::effects::cutting::{CutPhysics, CutSetting, Cutting, CuttingSummary, OwnTeeth};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// The teeth are not evenly spaced around the tool.
pub struct UnevenPitch;

fn even_deg(data: &CuttingSummary) -> f64 {
    360.0 / data.teeth.max(1) as f64
}

/// Teeth whose pitches are alternately wider and narrower by `share` of an even one.
fn alternating(data: &CuttingSummary, share: f64) -> Vec<f64> {
    let sign = |j: usize| if j.is_multiple_of(2) { 1.0 } else { -1.0 };
    (0..data.teeth.saturating_sub(1))
        .map(|j| even_deg(data) * (1.0 + sign(j) * share))
        .collect()
}

impl Effect<Cutting> for UnevenPitch {
    fn id(&self) -> &'static str {
        "uneven-pitch"
    }

    fn explanation(&self) -> &'static str {
        "The angles from tooth to tooth differ (a tool with variable pitch, inserts seated askew): a tooth further behind the one \
         before it cuts a thicker chip, and later. `pitch_deg` are the angles from each tooth to the one that cuts next, of all teeth \
         but the last; together they are 360°. Which tooth is the first, forces cannot tell. Once known it belongs into \
         campaign.toml: `pitch_deg` of `[tool]`."
    }

    fn fingerprint(&self) -> &'static str {
        "Lines at multiples of the rotation off the tooth-passing comb that grow with the feed and with the order; peaks of the \
         force come at uneven distances."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Read the catalogue (variable pitch is sold against chatter), or look along the tool's axis: photograph the face \
             and measure the angles. The peaks of a slow cut's force with few teeth in contact stand at these angles.",
            typical: "Variable-pitch end mills: 2 to 10° off even (84/96°, 88/92°); inserts seated askew 0.1 to 0.5°.",
            best_measured: "Low radial immersion, so that single teeth show; ten turns or more in the steady part, thirty samples and \
             more a tooth.",
            sources: &[
                "Altintas, Y.; Engin, S.; Budak, E. (1999): Analytical stability prediction and design of variable pitch cutters. ASME \
                 Journal of Manufacturing Science and Engineering 121(2).",
                "Slavicek, J. (1965): The effect of irregular tooth pitch on stability of milling. Proceedings of the 6th MTDR Conference, \
                 Manchester.",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        milling_only(data)
            .or_else(|| one_helix_only(data))
            .or_else(|| teeth_as_listed(data))
            .or_else(|| (data.teeth < 2).then(|| "a single tooth has no pitch to others".to_string()))
            .or_else(|| {
                (!data.even_pitch)
                    .then(|| "campaign.toml has angles of the teeth already (pitch_deg)".to_string())
            })
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let even = even_deg(data);
        let prior = Prior {
            mean: even,
            std: 0.1 * even,
        };
        let nominal = alternating(data, 0.01);
        let pitch = |(j, nominal): (usize, f64)| {
            Parameter::linear(
                format!("pitch_deg[{j}]"),
                "deg",
                nominal,
                prior,
                [0.4 * even, 1.6 * even],
            )
        };
        nominal.into_iter().enumerate().map(pitch).collect()
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let mut one = vec![even_deg(data); data.teeth.saturating_sub(1)];
        if let Some(first) = one.first_mut() {
            *first *= 1.05;
        }
        vec![alternating(data, 0.05), one]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "pitch_deg",
                SizeRange::Times(0.93, 1.07),
                FollowsSize::Not,
            )]
        }
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        let even = 360.0 / (sizes.len() + 1) as f64;
        let possible = [0.6 * even, 1.4 * even];
        let why = "no cutter is made so uneven: the chips would have no room";
        sizes
            .iter()
            .find_map(|pitch| pitch.outside("a pitch", possible, (1.0, "°"), why))
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![360.0 / (p.len() + 1) as f64; p.len()])
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        let own = physics.own_teeth.get_or_insert_with(OwnTeeth::default);
        let even = Dual::constant(360.0 / setting.teeth as f64);
        let mut delay = Dual::constant(0.0);
        for (j, pitch) in values.iter().enumerate() {
            delay = &delay + &(pitch - &even).scale(1f64.to_radians());
            own.add_delay(j + 1, setting.teeth, &delay);
        }
    }
}
