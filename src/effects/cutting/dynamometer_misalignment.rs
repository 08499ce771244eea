use super::common::milling_only;
use super::{CutPhysics, CutSetting, Cutting};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::Dual;

/// The dynamometer is tilted about its x or y axis.
pub struct DynamometerMisalignment;

impl Effect<Cutting> for DynamometerMisalignment {
    fn id(&self) -> &'static str {
        "dynamometer-misalignment"
    }

    fn explanation(&self) -> &'static str {
        "The dynamometer is tilted about its own x or y axis: the axial channel shows a share of a lateral force and the \
         other way round. (A turn about the tool's axis is exactly another set of coefficients and cannot be seen.)"
    }

    fn fingerprint(&self) -> &'static str {
        "The axial channel and one lateral channel carry equal and opposite shares of each other."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Level and dial gauge over the dynamometer's plate along the machine's axes: 1 mm in 100 mm is 0.6°. A \
             static load along the tool axis must show on the axial channel only.",
            typical: "Set up with a gauge: below 0.2°. Bolted by eye, or a robot's tool frame a little off: 1 to 5°.",
            best_measured: "Slots of several depths with a straight-edged cutter, up and down milling: the lateral force turns \
             round, and with it what the axial channel takes of it.",
            sources: &[],
        }
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        (0..2).collect()
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        ["x", "y"].get(variant).map(|axis| ("axis", *axis))
    }

    fn obstacle(&self, Known { data, .. }: &Known<Cutting>) -> Option<String> {
        milling_only(data).or_else(|| {
            (!data.channels[..3].iter().all(|c| *c)).then(|| "needs the three force channels".to_string())
        })
    }

    fn parameters(&self, _at: At, _known: &Known<Cutting>) -> Vec<Parameter> {
        vec![Parameter::linear(
            "angle_deg",
            "deg",
            1.0,
            Prior { mean: 0.0, std: 6.0 },
            [-45.0, 45.0],
        )]
    }

    fn starts(&self, _at: At, _known: &Known<Cutting>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![-4.0], vec![4.0]]
    }

    fn impossible(&self, _site: Site, _object: &(), sizes: &[Size]) -> Option<String> {
        sizes
            .first()?
            .outside("a tilt", [-20.0, 20.0], (1.0, "°"), "every eye sees that")
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }

    fn apply(
        &self,
        At { variant, .. }: At,
        values: &[Dual],
        _setting: &CutSetting,
        physics: &mut CutPhysics,
    ) {
        let angle = values[0].scale(1f64.to_radians());
        let (s, c) = angle.value.sin_cos();
        let (sin, cos) = (angle.chain(s, c), angle.chain(c, -s));
        let mut tilt = Dual::unit_matrix();
        // Right-handed about the axis: (y, z) for x, (z, x) for y.
        let (a, b) = if variant == 0 { (1, 2) } else { (2, 0) };
        (tilt[a][a], tilt[b][b]) = (cos.clone(), cos);
        (tilt[a][b], tilt[b][a]) = (sin.scale(-1.0), sin);
        physics.tilt = Some(tilt);
    }
}
