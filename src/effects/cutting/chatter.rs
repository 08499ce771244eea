use super::common::{milling_only, straight_edge_only};
use super::{CutPhysics, CutSetting, Cutting, Vibration};
use crate::effects::Background;
use crate::effects::{At, Effect, Known, NEGLIGIBLE};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Amplitude per feed below which there is none.
const NO_AMPLITUDE_PER_FEED: f64 = 1e-9;

/// A self-excited vibration off the tooth-passing comb.
pub struct Chatter;

impl Effect<Cutting> for Chatter {
    fn id(&self) -> &'static str {
        "chatter"
    }

    fn explanation(&self) -> &'static str {
        "The tool vibrates against the workpiece at a frequency of its own in some cuts, regenerating through the wave left \
         by the tooth before. Its amplitude is taken in proportion to the feed, repeatable within a quarter."
    }

    fn fingerprint(&self) -> &'static str {
        "Lines off the tooth-passing comb, at one frequency and that shifted by the tooth-passing frequency."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Listen, and look at the surface: chatter marks are not one a tooth. A microphone's spectrum shows a line \
             that is no multiple of the tooth-passing frequency; it stays where it is while the speed changes. Half the \
             depth silences it.",
            typical: "The line lies 0 to 15 % above a natural frequency of robot, spindle or tool; vibration of 10 to 500 µm on \
             robots.",
            best_measured: "Long records (a hundred turns and more) at a depth below and one above the limit, two \
             speeds: the line stays where it is while the tooth-passing comb moves.",
            sources: &[
                "Tlusty, J.; Polacek, M. (1963): The stability of machine tools against self-excited vibrations in \
                 machining. ASME International Research in Production Engineering.",
                "Altintas, Y.; Budak, E. (1995): Analytical prediction of stability lobes in milling. CIRP Annals \
                 44(1).",
                "Schmitz, T. L.; Smith, K. S. (2009): Machining Dynamics: Frequency Response to Improved Productivity. \
                 Springer.",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        milling_only(data)
            .or_else(|| straight_edge_only(data))
            .or_else(|| {
                data.vibration_hz
                    .is_none()
                    .then(|| "no line off the tooth-passing comb stands above the noise".to_string())
            })
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let frequency = data.vibration_hz.unwrap_or(500.0);
        vec![
            Parameter::logarithmic(
                "frequency_hz",
                "Hz",
                frequency,
                0.5,
                [0.5 * frequency, 2.0 * frequency],
            ),
            Parameter::logarithmic("amplitude_per_feed", "1", 0.1, 2.0, [1e-5, 10.0]),
            Parameter::linear(
                "direction_deg",
                "deg",
                45.0,
                Prior {
                    mean: 0.0,
                    std: 180.0,
                },
                [-360.0, 360.0],
            ),
        ]
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let frequency = data.vibration_hz.unwrap_or(500.0);
        [
            (0.03, 0.0),
            (0.03, 90.0),
            (0.03, 135.0),
            (0.3, 20.0),
            (0.3, 110.0),
        ]
        .map(|(a, d)| vec![frequency, a, d])
        .to_vec()
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![p[0].nominal, NEGLIGIBLE * p[1].nominal, p[2].nominal])
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        // A vibration of no size has no frequency that could be wrong, either.
        if setting.has_vibration && values[1].value > NO_AMPLITUDE_PER_FEED {
            physics.vibration = Some(Vibration {
                frequency_hz: values[0].clone(),
                amplitude_mm: values[1].scale(setting.feed_mm),
                direction_rad: values[2].scale(1f64.to_radians()),
            });
        }
    }
}
