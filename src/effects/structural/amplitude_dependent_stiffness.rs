use crate::data::RobotSpec;
use crate::effects::background::TUTTLE;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::{Chain, Dual, Role};

/// Backlash or lost motion: a joint's stiffness differs between hammer levels.
pub struct AmplitudeDependentStiffness;

impl Effect<Structure> for AmplitudeDependentStiffness {
    fn id(&self) -> &'static str {
        "amplitude-dependent-stiffness"
    }

    fn explanation(&self) -> &'static str {
        "Backlash or lost motion in this joint: hit softly it is not as stiff as hit hard."
    }

    fn fingerprint(&self) -> &'static str {
        "The same point measured at two hammer levels gives two FRFs: modes of this joint lie at different frequencies."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Measure the same FRF with soft and hard hits, or sweep with a shaker at two levels: a linear structure \
             gives the same FRF. The joint's lost motion is read with a dial gauge while a small torque changes its \
             sign.",
            typical: "Gears: lost motion of 0.5 to 3 arc minutes; stiffness at small torque half to nine tenths of that at full \
             torque.",
            best_measured: "The same FRFs at two or three hammer levels (`force_level_n`), hit so that this joint \
             is twisted, with the load that gravity leaves it as small as possible: a preloaded gear hides its \
             backlash.",
            sources: &[
                TUTTLE,
                "Worden, K.; Tomlinson, G. R. (2001): Nonlinearity in Structural Dynamics: Detection, Identification \
                 and Modelling. Institute of Physics Publishing.",
            ],
        }
    }

    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        (1..=robot.joints.len()).map(Site::Joint).collect()
    }

    fn obstacle(&self, Known { data, .. }: &Known<Structure>) -> Option<String> {
        (data.force_levels < 2)
            .then(|| "needs FRFs at two hammer levels (force_level_n in campaign.toml)".to_string())
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![Parameter {
            name: "low_level_ratio".into(),
            unit: "1",
            scale: Scale::Logarithmic,
            nominal: 0.9,
            prior: Some(Prior { mean: 0.0, std: 0.5 }),
            bounds: [0.05, 5.0],
        }]
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        sizes.first()?.outside(
            "a stiffness ratio",
            [0.2, 2.0],
            (1.0, "(small over large force)"),
            "gears keep half of their stiffness at small torque and friction adds less than as much again",
        )
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![0.7], vec![1.2]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "low_level_ratio",
                SizeRange::Log(0.6, 0.9),
                FollowsSize::Ratio,
            )]
        }
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![1.0])
    }

    fn apply(&self, At { site, .. }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let Site::Joint(i) = site else { return };
        // Exactly the ratio at the lowest level, geometric between the levels.
        let ln_ratio = values[0].chain(values[0].value.ln(), 1.0 / values[0].value);
        let factor = ln_ratio.scale(setting.conditions.level_fraction).exp();
        for element in chain.elements.iter_mut().filter(|e| e.role == Role::Joint(i)) {
            element.stiffness = &element.stiffness * &factor;
        }
    }
}
