use nalgebra::Vector3;

use crate::data::RobotSpec;
use crate::effects::structural::branch;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::effects::{Background, Size};
use crate::parameter::Parameter;
use crate::robot::{Branch, Chain, Dual, Place, Slot};

/// Something hung on a link that resonates by itself: a mass on a spring along one axis of the link.
pub struct LocalResonator;

const MASS_KG: f64 = 6.0;

impl Effect<Structure> for LocalResonator {
    fn id(&self) -> &'static str {
        "local-resonator"
    }

    fn explanation(&self) -> &'static str {
        "Something hung on this link resonates by itself (cable pack, cover, motor on its mount): a mass on a spring along \
         one axis of the link."
    }

    fn fingerprint(&self) -> &'static str {
        "A small extra resonance, or a split peak, at one frequency at all postures; its direction turns with the link."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Hold or wedge what hangs on the link (cable pack, cover, valve box) by hand or with a strap and hit again: \
             the small peak goes. A sensor on the part itself shows it large.",
            typical: "Cable packs and covers: 2 to 30 kg at 5 to 60 Hz, damping 2 to 10 % of critical.",
            best_measured: "A response point on the link that carries it, all three axes, and lines of a tenth of \
             its width around its frequency; one more posture shows that it turns with the link.",
            sources: &[
                "Den Hartog, J. P. (1956): Mechanical Vibrations. 4th edition, McGraw-Hill (chapter on the dynamic \
                 vibration absorber).",
            ],
        }
    }

    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        (2..=4.min(robot.links.len())).map(Site::Link).collect()
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        (0..3).collect()
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        ["x", "y", "z"].get(variant).map(|axis| ("direction", *axis))
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Structure>) -> Vec<Parameter> {
        branch::parameters(data, MASS_KG, 15.0)
    }

    fn impossible(&self, site: Site, robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let Site::Link(i) = site else { return None };
        branch::impossible(robot.links.get(i - 1)?.mass_kg, sizes)
    }

    fn starts(&self, _at: At, Known { data, .. }: &Known<Structure>, peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        branch::starts(data, peaks_hz, MASS_KG)
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("mass_kg", SizeRange::Log(4.0, 12.0), FollowsSize::Power(1.0)),
                UsualSize::new("frequency_hz", SizeRange::Log(8.0, 25.0), FollowsSize::Not),
                UsualSize::new("damping_ratio", SizeRange::Log(0.03, 0.08), FollowsSize::Not),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![
            NEGLIGIBLE * parameters[0].nominal,
            parameters[1].nominal,
            parameters[2].nominal,
        ])
    }

    fn apply(&self, At { site, variant }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let Site::Link(i) = site else { return };
        let (stiffness, damping) = branch::spring_and_damper(values);
        let (start, end) = setting.kinematics.link_ends(i);
        let mut axis = Vector3::zeros();
        axis[variant] = 1.0;
        chain.branches.push(Branch {
            place: Place::new(i, Slot::Body),
            at: nalgebra::center(&start, &end),
            directions: vec![setting.kinematics.frames[i].rotation * axis],
            mass_kg: values[0].clone(),
            stiffness_n_per_m: stiffness,
            damping_ns_per_m: damping,
            carries_tool_point: false,
        });
    }
}
