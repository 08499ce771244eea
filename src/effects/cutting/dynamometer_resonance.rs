use super::*;

/// Each channel of the dynamometer is a second-order system.
pub struct DynamometerResonance;

impl CuttingEffect for DynamometerResonance {
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

    fn obstacle(&self, data: &CuttingSummary) -> Option<String> {
        milling_only(data).or_else(|| {
            (!data.channels[..3].iter().all(|c| *c)).then(|| "needs the three force channels".to_string())
        })
    }

    fn parameters(&self, _variant: usize, data: &CuttingSummary) -> Vec<Parameter> {
        let highest = data.highest_hz.max(50.0);
        let nominal = 0.5 * highest;
        let frequency = |i: usize| {
            logarithmic(
                format!("frequency_hz[{i}]"),
                "Hz",
                nominal,
                2.0,
                [0.03 * highest, 8.0 * highest],
            )
        };
        let damping = |i: usize| logarithmic(format!("zeta[{i}]"), "1", 0.04, 1.0, [1e-3, 1.0]);
        (0..3).map(frequency).chain((0..3).map(damping)).collect()
    }

    fn starts(&self, _variant: usize, data: &CuttingSummary) -> Vec<Vec<f64>> {
        // A tuned channel attracts only from nearby; high starting points leave low orders untouched.
        let highest = data.highest_hz.max(50.0);
        [0.2, 0.3, 0.42, 0.55, 0.75, 1.0, 1.4, 2.5]
            .map(|share| {
                let f = share * highest;
                vec![f, f, f, 0.1, 0.1, 0.1]
            })
            .to_vec()
    }

    fn apply(&self, _variant: usize, values: &[Dual], _setting: &CutSetting, physics: &mut CutPhysics) {
        physics.dynamics = Some([0, 1, 2].map(|i| [values[i].clone(), values[3 + i].clone()]));
    }
}
