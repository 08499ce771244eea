use crate::data::RobotSpec;
use crate::effects::background::EWINS;
use crate::effects::structural::{ChannelFilter, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Response channel late against the force channel: factor exp(−iωτ).
pub struct TimeDelay;

impl Effect<Structure> for TimeDelay {
    fn id(&self) -> &'static str {
        "time-delay"
    }

    fn explanation(&self) -> &'static str {
        "The response channel is late against the force channel (different filters, a trigger skew, a vibrometer's delay)."
    }

    fn fingerprint(&self) -> &'static str {
        "Magnitudes fit, phase does not: its error grows in proportion to frequency, the same in every FRF."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Hit a free mass with both the hammer and the sensor's amplifier in line: its acceleration must follow the \
             force with no phase. A phase that falls in proportion to frequency is a delay. Look for different filters, \
             wireless sensors and multiplexed inputs.",
            typical: "One sampling interval of a multiplexed card: 20 to 500 µs. Wireless and camera systems: 1 to 20 ms.",
            best_measured: "A wide band: the phase that a delay takes grows with frequency. One direct FRF up to \
             the highest frequency of the sensor says more than ten up to 50 Hz.",
            sources: &[
                "Bendat, J. S.; Piersol, A. G. (2010): Random Data: Analysis and Measurement Procedures. 4th edition, \
                 Wiley.",
                EWINS,
            ],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![Parameter::linear(
            "delay_s",
            "s",
            2e-4,
            Prior { mean: 0.0, std: 3e-3 },
            [-0.02, 0.02],
        )]
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "a delay",
            [0.0, 0.02],
            (1e6, "µs"),
            "the response cannot come before the force, nor later than wireless sensors do",
        )
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![2e-3], vec![-5e-4]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "delay_s",
                SizeRange::Log(2e-4, 1.2e-3),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }

    fn distort(&self, values: &[Dual], filter: &mut ChannelFilter) {
        filter.delay_s = &filter.delay_s + &values[0];
    }
}
