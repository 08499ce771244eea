use super::{CutPhysics, CutSetting, Cutting};
use crate::data::Process;
use crate::effects::Background;
use crate::effects::background::GAUTSCHI;
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::parameter::Parameter;
use crate::robot::Dual;

/// The zero line is no line: an exponential transient is added, or the charge amplifier leaks.
pub struct NonlinearDrift;

/// Milling and turning: x, y, z; drilling: thrust and torque.
fn channels(process: Process) -> std::ops::Range<usize> {
    match process {
        Process::Milling | Process::Turning => 0..3,
        Process::Drilling => 2..4,
    }
}

/// A transient shorter than this is over before the first sample: there is none, and no amplitude to fit.
const AT_ONCE_S: f64 = 1e-8;
/// A leak slower than this leaks nothing.
const FOR_EVER_S: f64 = 1e9;

impl Effect<Cutting> for NonlinearDrift {
    fn id(&self) -> &'static str {
        "nonlinear-drift"
    }

    fn explanation(&self) -> &'static str {
        "The zero line of a channel bends. Either a transient is added that decays exponentially (warming up; its size is \
         free in every cut and channel), or the charge amplifier leaks, which is a high-pass on the force."
    }

    fn fingerprint(&self) -> &'static str {
        "The air before and after the cut does not lie on one line, and the level during the cut bends with it."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Record two minutes without load after a reset of the charge amplifier: a straight line is leakage current, \
             a curve is warming up or a short time constant. Check that the amplifier's time constant is set to LONG \
             and the plugs are dry.",
            typical: "Leakage of a charge amplifier: 0.03 to 0.07 pC/s (about 0.01 N/s) when clean; thermal drift while cutting \
             0.1 to 5 N/s; amplifier time constants of 1 to 100 s on SHORT and MEDIUM.",
            best_measured: "Some seconds without load before and after each cut, with the amplifier reset before; \
             its time constant on LONG.",
            sources: &[GAUTSCHI],
        }
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        (0..2).collect()
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        ["additive", "leak"].get(variant).map(|kind| ("kind", *kind))
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        (!data.air_on_both_sides).then(|| "needs air before and after the cut".to_string())
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let nominal = data.longest_record_s.clamp(0.5, 20.0);
        channels(data.process)
            .map(|i| Parameter::logarithmic(format!("tau_s[{i}]"), "s", nominal, 1.5, [0.1, 1000.0]))
            .collect()
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let count = channels(data.process).count();
        [0.2, 3.0]
            .map(|share| vec![(share * data.longest_record_s).clamp(0.2, 100.0); count])
            .to_vec()
    }

    fn vanishing(&self, At { variant, .. }: At, p: &[Parameter]) -> Option<Vec<f64>> {
        // A transient that is over at once; a leak that takes for ever.
        let factor = if variant == 0 {
            NEGLIGIBLE
        } else {
            NEGLIGIBLE.recip()
        };
        Some(p.iter().map(|tau| factor * tau.nominal).collect())
    }

    fn nuisances_per_channel(&self, At { variant, .. }: At) -> usize {
        // The transient's amplitude; what a leak makes of the drift line.
        if variant == 0 { 1 } else { 0 }
    }

    fn apply(&self, At { variant, .. }: At, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics) {
        let is_gone = |tau: &Dual| match variant {
            0 => tau.value < AT_ONCE_S,
            _ => tau.value > FOR_EVER_S,
        };
        if values.iter().all(is_gone) {
            return;
        }
        let first = channels(setting.process).start;
        let by_channel = |missing: f64, f: &dyn Fn(&Dual) -> Dual| {
            std::array::from_fn(|i| {
                i.checked_sub(first)
                    .and_then(|k| values.get(k))
                    .map_or(Dual::constant(missing), f)
            })
        };
        if variant == 0 {
            physics.transient_s = Some(by_channel(1.0, &|tau| tau.clone()));
        } else {
            physics.leak_per_s = Some(by_channel(0.0, &|tau| tau.recip()));
        }
    }
}
