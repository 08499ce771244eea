use nalgebra::{DMatrix, Vector3, Vector6};

use crate::data::RobotSpec;
use crate::effects::background::EWINS;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site, Spot};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::{Attachment, AttachmentLaw, Chain, Dual, Element, Grip, Place, Role, Slot};

/// The tool touches something: a spring and a damper from the tool point to the ground along one direction, or to a table
/// that is itself a mass on a spring along that direction.
pub struct ToolContact;

/// By number of the choice.
const GROUNDS: [&str; 2] = ["table", "rigid"];

impl Effect<Structure> for ToolContact {
    fn id(&self) -> &'static str {
        "contact"
    }

    fn explanation(&self) -> &'static str {
        "The tool touches something while it is measured (workpiece, table, clamp, hose): a spring and a damper to the ground \
         along one direction, or to a table that moves itself."
    }

    fn fingerprint(&self) -> &'static str {
        "The tool is stiffer in one direction, the same in base axes at every posture, at frequencies from zero on; where the \
         table moves, its resonance shows at every posture."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Pull a sheet of paper between tool and workpiece, retract by a millimetre and hit again: the stiffness in \
                        that direction must fall. A sensor on the table that answers to hits on the robot proves the contact.",
            typical: "Touching a clamped workpiece: 0.1 to 1 N/µm and more; a taut hose 0.01 to 0.1 N/µm; machine tables 100 to \
                      2,000 kg at 15 to 60 Hz.",
            best_measured: "FRFs of the tool in all three directions, down to a few Hz, at postures that differ; with a table \
                            that may move also a sensor on it.",
            sources: &[
                "de Klerk, D.; Rixen, D. J.; Voormeeren, S. N. (2008): General framework for dynamic substructuring. AIAA Journal \
                 46(5).",
                EWINS,
            ],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Tool]
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        (0..GROUNDS.len()).collect()
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        GROUNDS.get(variant).map(|ground| ("ground", *ground))
    }

    fn on_promise(&self) -> bool {
        true
    }

    fn parameters(&self, at: At, Known { data, .. }: &Known<Structure>) -> Vec<Parameter> {
        // Beyond a turn each way a direction comes again; so far that no fit stops there.
        let angle = |name: &str, nominal: f64| {
            let prior = Prior {
                mean: 0.0,
                std: 180.0,
            };
            Parameter::linear(name, "°", nominal, prior, [-720.0, 720.0])
        };
        let mut parameters = vec![
            Parameter::logarithmic("stiffness_n_per_m", "N/m", 1e5, 2.5, [1.0, 1e11]),
            Parameter::logarithmic("damping_ns_per_m", "N·s/m", 100.0, 3.0, [1e-4, 1e8]),
            angle("elevation_deg", 70.0),
            angle("azimuth_deg", 0.0),
        ];
        if GROUNDS[at.variant] == "table" {
            let band = [0.5 * data.lowest_hz, 2.0 * data.highest_hz];
            let table_hz = 30f64.clamp(band[0], band[1]);
            parameters.extend([
                Parameter::logarithmic("table_mass_kg", "kg", 200.0, 1.5, [1.0, 1e5]),
                Parameter::logarithmic("table_frequency_hz", "Hz", table_hz, 1.0, band),
                Parameter::logarithmic("table_damping_ratio", "1", 0.03, 1.0, [1e-4, 1.0]),
            ]);
        }
        parameters
    }

    fn starts(&self, at: At, Known { data, .. }: &Known<Structure>, peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let mut starts = Vec::new();
        let tables: Vec<f64> = match GROUNDS[at.variant] {
            "table" => peaks_hz
                .iter()
                .copied()
                .take(2)
                .chain([0.5 * data.highest_hz])
                .collect(),
            _ => vec![0.0],
        };
        for (elevation, azimuth) in [(80.0, 0.0), (10.0, 10.0), (10.0, 100.0)] {
            for stiffness in [3e3, 3e5] {
                for table_hz in &tables {
                    let mut start = vec![stiffness, 1e-3 * stiffness, elevation, azimuth];
                    if GROUNDS[at.variant] == "table" {
                        start.extend([200.0, *table_hz, 0.03]);
                    }
                    starts.push(start);
                }
            }
        }
        starts
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let hard = sizes.first()?.outside(
            "a contact",
            [100.0, 1e9],
            (1e-6, "N/µm"),
            "a cable is not softer, a clamped block of steel not stiffer",
        );
        let table = sizes.get(4).and_then(|mass| {
            mass.outside(
                "a table",
                [5.0, 2e4],
                (1.0, "kg"),
                "what is lighter is a part of the tool, what is heavier the foundation",
            )
        });
        hard.or(table)
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new(
                    "stiffness_n_per_m",
                    SizeRange::Log(1e5, 1e6),
                    FollowsSize::Power(1.0),
                ),
                UsualSize::new(
                    "damping_ns_per_m",
                    SizeRange::Log(50.0, 500.0),
                    FollowsSize::Power(1.0),
                ),
                UsualSize::new("elevation_deg", SizeRange::Either(80.0), FollowsSize::Not),
                UsualSize::new("azimuth_deg", SizeRange::Either(90.0), FollowsSize::Not),
                UsualSize::new("table_mass_kg", SizeRange::Log(100.0, 500.0), FollowsSize::Not),
                UsualSize::new("table_frequency_hz", SizeRange::Log(15.0, 40.0), FollowsSize::Not),
                UsualSize::new(
                    "table_damping_ratio",
                    SizeRange::Log(0.02, 0.06),
                    FollowsSize::Not,
                ),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        let size = |(i, p): (usize, &Parameter)| if i < 2 { NEGLIGIBLE * p.nominal } else { p.nominal };
        Some(parameters.iter().enumerate().map(size).collect())
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let [stiffness, damping, elevation, azimuth, table @ ..] = values else {
            return;
        };
        let mut grips: Vec<(Grip, Dual)> = (0..3)
            .zip(unit_vector(elevation, azimuth))
            .filter_map(|(axis, share)| {
                let point = Spot::ToolGround(axis).point(setting.kinematics)?;
                let grip = Grip {
                    coordinates: Vec::new(),
                    point: Some(point),
                };
                Some((grip, share))
            })
            .collect();
        if let [mass, frequency_hz, ratio] = table {
            let omega = frequency_hz.scale(std::f64::consts::TAU);
            let momentum = mass * &omega;
            let held = Grip {
                coordinates: vec![(chain.elements.len(), 1.0)],
                point: None,
            };
            // A coordinate behind everything on the chain: it moves nothing but what grips it.
            chain.elements.push(Element {
                role: Role::Bearing,
                place: Place::new(setting.robot.joint_count() + 1, Slot::End),
                at: setting.kinematics.tcp(),
                directions: vec![Vector6::zeros()],
                shape: DMatrix::identity(1, 1),
                stiffness: &momentum * &omega,
                damping: Some((&momentum * ratio).scale(2.0)),
            });
            chain.attachments.push(Attachment {
                grip: held.clone(),
                law: AttachmentLaw::Inertia,
                size: mass.clone(),
            });
            grips.push((held, Dual::constant(-1.0)));
        }
        attach(chain, &grips, AttachmentLaw::Spring, stiffness);
        attach(chain, &grips, AttachmentLaw::Damper, damping);
    }
}

/// Of a direction: elevation above the base's x-y plane and azimuth from its x axis, degrees.
fn unit_vector(elevation_deg: &Dual, azimuth_deg: &Dual) -> [Dual; 3] {
    let radians = |angle: &Dual| angle.scale(1f64.to_radians());
    let sin = |angle: &Dual| angle.chain(angle.value.sin(), angle.value.cos());
    let cos = |angle: &Dual| angle.chain(angle.value.cos(), -angle.value.sin());
    let (up, round) = (radians(elevation_deg), radians(azimuth_deg));
    [&cos(&up) * &cos(&round), &cos(&up) * &sin(&round), sin(&up)]
}

/// A law on the displacement Σ share · grip. Attachments hold fixed displacements only; their squares make up the square of
/// the sum: (Σ sᵢ qᵢ)² = Σᵢ sᵢ (2 sᵢ − Σⱼ sⱼ) qᵢ² + Σᵢ<ⱼ sᵢ sⱼ (qᵢ + qⱼ)².
fn attach(chain: &mut Chain, grips: &[(Grip, Dual)], law: AttachmentLaw, size: &Dual) {
    let sum = grips
        .iter()
        .fold(Dual::constant(0.0), |sum, (_, share)| &sum + share);
    for (i, (grip, share)) in grips.iter().enumerate() {
        chain.attachments.push(Attachment {
            grip: grip.clone(),
            law,
            size: size * &(share * &(&share.scale(2.0) - &sum)),
        });
        for (other, other_share) in &grips[i + 1..] {
            chain.attachments.push(Attachment {
                grip: both(grip, other),
                law,
                size: size * &(share * other_share),
            });
        }
    }
}

/// The sum of two displacements; points of grips are the same.
fn both(a: &Grip, b: &Grip) -> Grip {
    let point = match (a.point, b.point) {
        (Some((at, place, u)), Some((_, _, v))) => Some((at, place, Vector3::from(u + v))),
        (one, other) => one.or(other),
    };
    Grip {
        coordinates: [a.coordinates.as_slice(), &b.coordinates].concat(),
        point,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, FrfBasis, RobotModel};
    use num_complex::Complex64;

    /// Receptances between tool x, y, z, with the contact or without.
    fn receptances(contact: Option<&[f64]>, hz: f64) -> nalgebra::Matrix3<Complex64> {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[0]).unwrap();
        let mut baseline = Baseline::nominal(&model.spec);
        // Modal damping is that of the structure with the contact: without it the closed form is exact.
        baseline.damping_ratio = Dual::constant(0.0);
        let mut chain = model.chain(&kinematics, &baseline);
        if let Some(values) = contact {
            let setting = PostureSetting::of_tests(&model, &kinematics);
            let at = At {
                site: Site::Tool,
                variant: usize::from(values.len() == 4),
            };
            let values: Vec<Dual> = values.iter().map(|v| Dual::constant(*v)).collect();
            ToolContact.apply(at, &values, &setting, &mut chain);
        }
        let rows: Vec<_> = [Vector3::x(), Vector3::y(), Vector3::z()]
            .iter()
            .map(|axis| chain.output_row(kinematics.tcp(), model.flange_place(), true, axis))
            .collect();
        let basis = FrfBasis::new(&chain.system(0), &rows).unwrap();
        let omega = std::f64::consts::TAU * hz;
        nalgebra::Matrix3::from_fn(|i, j| basis.receptance_at(omega, i, j).unwrap())
    }

    /// H' = H − H u z uᵀ H / (1 + z uᵀ H u) (Sherman and Morrison 1950), with z = k + iωc on the ground, and on a table of
    /// dynamic stiffness z_t both in series.
    #[test]
    fn a_contact_is_a_change_of_rank_one() {
        let (elevation, azimuth) = (35f64, -120f64);
        let (up, round) = (elevation.to_radians(), azimuth.to_radians());
        let u = Vector3::new(up.cos() * round.cos(), up.cos() * round.sin(), up.sin()).map(Complex64::from);
        let (k, c, mass, table_hz, ratio) = (3e5, 400.0, 150.0, 30.0, 0.04);
        for hz in [1.0, 9.0, 21.0, 33.0] {
            let omega = std::f64::consts::TAU * hz;
            let spring = Complex64::new(k, omega * c);
            let natural = std::f64::consts::TAU * table_hz;
            let table =
                mass * Complex64::new(natural * natural - omega * omega, 2.0 * ratio * natural * omega);
            let free = receptances(None, hz);
            for (z, values) in [
                (spring, vec![k, c, elevation, azimuth]),
                (
                    spring * table / (spring + table),
                    vec![k, c, elevation, azimuth, mass, table_hz, ratio],
                ),
            ] {
                let moved = free * u;
                let exact = free - moved * moved.transpose() * (z / (1.0 + z * u.dot(&moved)));
                let found = receptances(Some(&values), hz);
                assert!(
                    (found - exact).norm() < 1e-8 * exact.norm(),
                    "{hz}: {found} {exact}"
                );
            }
        }
    }
}
