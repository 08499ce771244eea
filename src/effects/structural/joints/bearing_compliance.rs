use crate::data::RobotSpec;
use crate::effects::background::{ABELE, MOBERG};
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Background, Effect, Known, Site, Size, Spot, shift};
use crate::parameter::Parameter;
use crate::robot::{Chain, Dual, Role};

/// A joint's bearing shifts: radially (both ways across the joint's axis) or axially. Its tilt is
/// `joint-transverse-compliance`.
pub struct BearingCompliance;

/// By number of the choice: name, and coordinates of the bearing that give way (x and y across the axis, z along it).
const DIRECTIONS: [(&str, &[usize]); 2] = [("radial", &[0, 1]), ("axial", &[2])];

impl Effect<Structure> for BearingCompliance {
    fn id(&self) -> &'static str {
        "bearing-compliance"
    }

    fn explanation(&self) -> &'static str {
        "The bearing of this joint shifts without tilting: across its axis (radial) or along it (axial)."
    }

    fn fingerprint(&self) -> &'static str {
        "Everything behind the joint moves by the same amount, points near the joint as far as the tool; the direction follows \
         the bearing when the arm changes posture."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Dial gauges on both rings of the bearing while the arm is pushed across the joint's axis and along it: they \
                        show the same shift on either side where it does not tilt. Check preload and bolts.",
            typical: "Catalogues promise 500 to 5,000 N/µm; with housing and bolts far less. What a tap test can show begins \
                      below about 50 N/µm: lost preload, cracked housing.",
            best_measured: "Points on both sides of this joint close to its axis, in the directions across and along it, at \
                            postures that turn the next joints by 90°.",
            sources: &[
                "Harris, T. A.; Kotzalas, M. N. (2006): Rolling Bearing Analysis. 5th edition, CRC Press.",
                MOBERG,
                ABELE,
            ],
        }
    }

    /// At joint 1 it is the sliding of the base by another name; a wrist's last joint carries little behind it.
    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        (2..robot.joints.len()).map(Site::Joint).collect()
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        (0..DIRECTIONS.len()).collect()
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        DIRECTIONS.get(variant).map(|(name, _)| ("direction", *name))
    }

    fn on_promise(&self) -> bool {
        true
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        shift::parameters()
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        shift::starts()
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "a bearing's stiffness",
            [5e5, f64::INFINITY],
            (1e-6, "N/µm"),
            "as soft as that one would see it by eye",
        )
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "stiffness_n_per_m",
                SizeRange::Log(2e6, 8e6),
                FollowsSize::Power(-1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        shift::vanishing(parameters)
    }

    fn apply(&self, At { site, variant }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let Site::Joint(i) = site else { return };
        let spots = DIRECTIONS[variant].1.iter().map(|k| Spot::Bearing(i, *k));
        shift::apply(spots, Role::Bearing, &values[0], setting, chain);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, RobotModel};
    use nalgebra::Vector3;

    /// A force at the tool passes through the bearing whole: what the tool gains in compliance is P/k, with P the projector on
    /// the directions that give way, whatever the lever arm.
    #[test]
    fn the_tool_gains_the_bearings_own_compliance() {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[1]).unwrap();
        let (joint, k) = (3, 4e6);
        let axis = kinematics.joint_axis(joint);
        let along = axis * axis.transpose();
        let across = nalgebra::Matrix3::identity() - along;
        for (variant, gives) in [(0, across), (1, along)] {
            let mut chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
            let tool = |chain: &Chain| chain.compliance(kinematics.tcp(), model.flange_place()).unwrap();
            let before = tool(&chain);
            let setting = PostureSetting::of_tests(&model, &kinematics);
            let at = At {
                site: Site::Joint(joint),
                variant,
            };
            BearingCompliance.apply(at, &[Dual::constant(k)], &setting, &mut chain);
            let gained = tool(&chain) - before;
            let expected = gives / k;
            assert!((gained.fixed_view::<3, 3>(0, 0) - expected).norm() < 1e-9 * expected.norm());
            assert!(gained.fixed_view::<3, 3>(3, 3).norm() < 1e-9 * before.norm());
            assert!(Vector3::from(gained.fixed_view::<3, 1>(0, 0)).norm() <= 1.0 / k + 1e-12);
        }
    }
}
