use super::{CutPhysics, CutSetting, Cutting};
use crate::data::Process;
use crate::effects::background::{ALTINTAS, BUDAK};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// Cutting coefficients fall with cutting speed: K ∝ v^−q.
pub struct SpeedDependence;

impl Effect<Cutting> for SpeedDependence {
    fn id(&self) -> &'static str {
        "speed-dependence"
    }

    fn explanation(&self) -> &'static str {
        "The material softens as cutting gets faster and hotter (or hardens): the cutting coefficients follow a power of \
         the cutting speed; they are given at the geometric mean of the slowest and fastest cut."
    }

    fn fingerprint(&self) -> &'static str {
        "Forces at one feed differ between speeds by one factor, the same on all axes."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Cut the same feed and depth at three speeds, the first one again at the end (to rule out wear), and \
             compare the mean forces.",
            typical: "Exponent q of 0 to 0.2: forces fall by up to 15 % when the speed doubles. Built-up edge at low speed in \
             steel and aluminium can turn the sign.",
            best_measured: "Three speeds over a factor of two or more at one feed, in an order that is not that \
             of the speeds, so that wear does not look like it.",
            sources: &[ALTINTAS, BUDAK],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        let [slow, fast] = data.speed_m_per_min;
        (fast < 1.05 * slow).then(|| "all cuts were made at one speed".to_string())
    }

    fn parameters(&self, _at: At, _known: &Known<Cutting>) -> Vec<Parameter> {
        vec![Parameter::linear(
            "q",
            "1",
            0.1,
            Prior { mean: 0.0, std: 0.4 },
            [-2.0, 2.0],
        )]
    }

    fn starts(&self, _at: At, _known: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![-0.1], vec![0.4]]
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "an exponent",
            [-0.5, 0.7],
            (1.0, ""),
            "twice the speed changes forces by less than a third",
        )
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        let cutting: &[usize] = match setting.process {
            Process::Milling | Process::Turning => &[0, 1, 2],
            Process::Drilling => &[0, 2],
        };
        let factor = values[0].scale(-setting.speed_ratio.ln()).exp();
        for &k in cutting {
            physics.coefficient[k] = &physics.coefficient[k] * &factor;
        }
    }
}
