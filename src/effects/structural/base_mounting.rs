use crate::data::RobotSpec;
use crate::effects::background::EWINS;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Background, Effect, Known, Site, Size, Spot, shift};
use crate::parameter::Parameter;
use crate::robot::{Chain, Dual, Role};

/// The base shifts: sideways along base x and y, or up and down. Its rocking is `base-compliance`; its turning about the
/// vertical is joint 1 by another name.
pub struct BaseMounting;

/// By number of the choice: name, and coordinates of the base that give way.
const DIRECTIONS: [(&str, &[usize]); 2] = [("horizontal", &[0, 1]), ("vertical", &[2])];

impl Effect<Structure> for BaseMounting {
    fn id(&self) -> &'static str {
        "base-mounting"
    }

    fn explanation(&self) -> &'static str {
        "The robot's fixing to the floor shifts: the whole robot slides sideways (bolts, shims, a rail) or moves up and down \
         (a slab or steel floor that bends)."
    }

    fn fingerprint(&self) -> &'static str {
        "All points move by the same amount in base axes, points near the floor as far as those high up, at every posture."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "An accelerometer on the foot plate and one on the floor next to it, along base x, y and z, while the arm is \
                        hit: what moves against what? Torque the anchor bolts and look for fretting rust at shims.",
            typical: "Anchored foot plates: above 500 N/µm. Pedestals on shims, rails and pallets: 2 to 50 N/µm; steel floors and \
                      mezzanines 5 to 100 N/µm vertically.",
            best_measured: "A point on the base or low on the first link in all three directions besides the tool: there nothing \
                            else moves.",
            sources: &[
                "Rivin, E. I. (1999): Stiffness and Damping in Mechanical Design. Marcel Dekker.",
                EWINS,
            ],
        }
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
            "a fixing's stiffness",
            [2e5, f64::INFINITY],
            (1e-6, "N/µm"),
            "a robot that stands as soft as that sways when it moves",
        )
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "stiffness_n_per_m",
                SizeRange::Log(3e6, 1e7),
                FollowsSize::Power(-1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        shift::vanishing(parameters)
    }

    fn apply(&self, At { variant, .. }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let spots = DIRECTIONS[variant].1.iter().map(|k| Spot::Base(*k));
        shift::apply(spots, Role::Base, &values[0], setting, chain);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, RobotModel};
    use nalgebra::{Matrix3, Vector3};

    /// A force on the arm reaches the floor whole: every point gains 1/k along what gives way and nothing else.
    #[test]
    fn every_point_gains_the_fixings_own_compliance() {
        let model = RobotModel::new(irb6640());
        let k = 5e6;
        for q in &TAP_POSTURES[..2] {
            let kinematics = model.kinematics(q).unwrap();
            for (variant, gives) in [(0, Vector3::new(1.0, 1.0, 0.0)), (1, Vector3::z())] {
                let mut chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
                let tool = |chain: &Chain| chain.compliance(kinematics.tcp(), model.flange_place()).unwrap();
                let before = tool(&chain);
                let setting = PostureSetting::of_tests(&model, &kinematics);
                let at = At {
                    site: Site::Everywhere,
                    variant,
                };
                BaseMounting.apply(at, &[Dual::constant(k)], &setting, &mut chain);
                let gained = tool(&chain) - before;
                let expected = Matrix3::from_diagonal(&gives) / k;
                assert!((gained.fixed_view::<3, 3>(0, 0) - expected).norm() < 1e-9 * expected.norm());
                assert!(gained.fixed_view::<3, 3>(3, 3).norm() < 1e-9 * before.norm());
            }
        }
    }
}
