use super::common::milling_only;
use super::{CutPhysics, CutSetting, Cutting};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::effects::{Background, Size};
use crate::parameter::Parameter;
use crate::robot::Dual;

/// Each channel of the dynamometer is a second-order system.
pub struct DynamometerResonance;

impl Effect<Cutting> for DynamometerResonance {
    fn id(&self) -> &'static str {
        "dynamometer-resonance"
    }

    fn explanation(&self) -> &'static str {
        "The dynamometer with the workpiece on it resonates: each channel shows the force through a second-order system \
         of its own natural frequency and damping."
    }

    fn fingerprint(&self) -> &'static str {
        "Harmonics of tooth passing near one frequency are too high and turned in phase, at whatever speed brings them there."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Tap the workpiece as it is clamped on the dynamometer with a modal hammer and divide the record by the \
             hammer's force: the FRF must be 1 up to the highest tooth-passing harmonic used.",
            typical: "Table dynamometers: 1 to 3.5 kHz bare on a stiff base (data sheets), down to 300 to 1000 Hz with vice and \
             workpiece; damping 1 to 5 %. Stay below a third of it, or correct for it.",
            best_measured: "Spindle speeds that put a harmonic of tooth passing on either side of the suspected \
             frequency, sampled at ten times it, no low-pass in between.",
            sources: &[
                "Tounsi, N.; Otho, A. (2000): Dynamic cutting force measuring. International Journal of Machine Tools \
                 and Manufacture 40(8).",
                "Altintas, Y.; Park, S. S. (2004): Dynamic compensation of spindle-integrated force sensors. CIRP \
                 Annals 53(1).",
            ],
        }
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        milling_only(data).or_else(|| {
            (!data.channels[..3].iter().all(|c| *c)).then(|| "needs the three force channels".to_string())
        })
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Cutting>) -> Vec<Parameter> {
        let highest = data.highest_hz.max(50.0);
        let nominal = 0.5 * highest;
        let frequency = |i: usize| {
            Parameter::logarithmic(
                format!("frequency_hz[{i}]"),
                "Hz",
                nominal,
                2.0,
                [0.03 * highest, 8.0 * highest],
            )
        };
        let damping = |i: usize| Parameter::logarithmic(format!("zeta[{i}]"), "1", 0.04, 1.0, [1e-3, 1.0]);
        (0..3).map(frequency).chain((0..3).map(damping)).collect()
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        // A tuned channel attracts only from nearby; high starting points leave low orders untouched.
        let highest = data.highest_hz.max(50.0);
        [0.2, 0.3, 0.42, 0.55, 0.75, 1.0, 1.4, 2.5]
            .map(|share| {
                let f = share * highest;
                vec![f, f, f, 0.1, 0.1, 0.1]
            })
            .to_vec()
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        let damping = |size: &Size| {
            size.outside(
                "a damping ratio",
                [1e-3, 0.3],
                (1.0, "of critical"),
                "a dynamometer on its bolts has 0.01 to 0.1; more is a filter",
            )
        };
        sizes.iter().skip(3).find_map(damping)
    }

    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        // Its natural frequencies far above all that is measured.
        let (frequencies, dampings) = p.split_at(3);
        let far = frequencies.iter().map(|f| f.nominal / NEGLIGIBLE);
        Some(far.chain(dampings.iter().map(|z| z.nominal)).collect())
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        physics.dynamics = Some([0, 1, 2].map(|i| [values[i].clone(), values[3 + i].clone()]));
    }
}
