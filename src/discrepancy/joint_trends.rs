//! Joint stiffness and damping as each posture alone wants them, against what was different: order of measurement, level of the hammer,
//! angle of the joint and torque of gravity, with a test for each.

use nalgebra::{DMatrix, DVector, Vector3};
use serde::Serialize;

use super::trend::{SIGNIFICANT, TrendPoint, test};
use crate::Result;
use crate::data::Posture;
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::frf_problem::FrfProblem;
use crate::identify::levenberg_marquardt::{LeastSquares, Linearisation, Stopping, minimise};
use crate::identify::{StructureModel, StructureStudy};
use crate::parameter::Scale;
use crate::robot::rigid::STANDARD_GRAVITY;

/// What a joint's values are held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum JointAgainst {
    /// Place of the posture in the campaign.
    Order,
    /// Of the hammer.
    ForceLevel,
    /// The joint's own angle.
    Angle,
    /// What gravity asks of the joint, without sign.
    GravityTorque,
}

impl JointAgainst {
    /// For people.
    pub fn words(self) -> &'static str {
        match self {
            JointAgainst::Order => "the order of measurement",
            JointAgainst::ForceLevel => "the level of the hammer",
            JointAgainst::Angle => "the joint's angle",
            JointAgainst::GravityTorque => "the torque of gravity",
        }
    }

    /// Of the abscissa.
    pub fn unit(self) -> &'static str {
        match self {
            JointAgainst::Order => "",
            JointAgainst::ForceLevel => "N",
            JointAgainst::Angle => "°",
            JointAgainst::GravityTorque => "N·m",
        }
    }

    /// What usually makes a joint follow it.
    pub fn usual_cause(self) -> &'static str {
        match self {
            JointAgainst::Order => {
                "warming up from posture to posture (grease, preload), or a bolt that settles"
            }
            JointAgainst::ForceLevel => {
                "friction that lets go, or a gear whose flanks lift off: the joint is softer or damped otherwise where it is hit harder"
            }
            JointAgainst::Angle => {
                "a gear or bearing that is not the same all round, a cable or hose that pulls at one end of the range, a brake that drags"
            }
            JointAgainst::GravityTorque => {
                "backlash or a preload that is used up: a gear is soft where gravity leaves it free, and stiff where gravity holds its flanks"
            }
        }
    }

    /// Ten minutes in the laboratory that tell whether it is so.
    pub fn lab_check(self) -> &'static str {
        match self {
            JointAgainst::Order => {
                "Hit the first posture once more now: if its peaks stand where the last postures have them, it is the time that counts, and not \
                 the posture. Warm the robot up for an hour and repeat."
            }
            JointAgainst::ForceLevel => {
                "In one posture, hit the same point with half and with twice the force: the peaks that this joint makes move or change in width."
            }
            JointAgainst::Angle => {
                "Turn this joint alone by 10° one way and the other and hit again: its peaks move as the figure says. Take cables and hoses off \
                 it, or release its brake, and repeat."
            }
            JointAgainst::GravityTorque => {
                "In one posture, hang a weight of some kilograms on the tool so that gravity pulls more at this joint, and hit again: beside what \
                 the mass does, its peaks rise where a preload or backlash is the cause."
            }
        }
    }

    /// Degree of what is sought in so many points: an angle may act in both directions from somewhere between, the others go one way.
    fn degree(self, points: usize) -> usize {
        match self {
            JointAgainst::Angle if points >= 6 => 2,
            _ => 1,
        }
    }
}

/// What the FRFs of one posture and level of the hammer want a parameter to be.
#[derive(Debug, Clone, Serialize)]
pub struct PostureValue {
    /// The posture's name.
    pub posture: String,
    /// `None` where nobody says.
    pub force_level_n: Option<f64>,
    /// Logarithm of it over the value that fits all postures together.
    pub change: f64,
    /// Standard error that the noise gives it.
    pub std: f64,
}

/// A parameter refitted posture by posture.
#[derive(Debug, Clone, Serialize)]
pub struct JointCourse {
    /// `joint-2.stiffness`, `damping-ratio`.
    pub parameter: String,
    /// Those that the posture's FRFs determine.
    pub values: Vec<PostureValue>,
}

/// A parameter against one quantity.
#[derive(Debug, Clone, Serialize)]
pub struct JointTrend {
    /// `joint-2.stiffness`, `damping-ratio`.
    pub parameter: String,
    /// Against what.
    pub against: JointAgainst,
    /// Of x.
    pub x_unit: &'static str,
    /// Probability that noise follows it as much, times the number of tests made.
    pub p_value: f64,
    /// Number of tests made.
    pub tests: usize,
    /// What it usually comes from.
    pub usual_cause: &'static str,
    /// x, logarithm of the value over that of all postures, standard error; ascending.
    pub points: Vec<TrendPoint>,
}

impl JointTrend {
    /// Whether the parameter follows it by more than chance.
    pub fn is_significant(&self) -> bool {
        self.p_value < SIGNIFICANT
    }
}

/// All of it.
#[derive(Debug, Clone, Default)]
pub struct JointTrends {
    /// Parameter by parameter.
    pub courses: Vec<JointCourse>,
    /// What is least of a chance first.
    pub trends: Vec<JointTrend>,
}

impl JointTrends {
    /// Those that are no chance, the surest of each parameter.
    pub fn followed(&self) -> Vec<&JointTrend> {
        let mut told: Vec<&JointTrend> = Vec::new();
        for trend in self.trends.iter().filter(|t| t.is_significant()) {
            if told.iter().all(|t| t.parameter != trend.parameter) {
                told.push(trend);
            }
        }
        told
    }
}

/// How far a posture's own value is let from that of all postures: standard deviation of its logarithm.
const TIED: f64 = 0.3;
/// Share of that from which on it is the tie that speaks and not the posture's FRFs.
const LITTLE_KNOWN: f64 = 0.5;
/// A posture's own values are near those of all.
const OWN: Stopping = Stopping {
    max_iterations: 6,
    relative_decrease: 1e-4,
};

/// Stiffness and damping of the joints refitted to the FRFs of each posture and level of the hammer, each tied to its value at `theta`
/// (solver's scale), all else held there.
///
/// # Errors
/// A model that cannot be set up.
pub fn joint_trends(
    study: &StructureStudy,
    model: &StructureModel,
    theta: &[f64],
    postures: &[Posture],
) -> Result<JointTrends> {
    let free: Vec<usize> = (0..theta.len())
        .filter(|&i| {
            let parameter = &model.parameters[i];
            is_of_a_joint(&parameter.name) && parameter.scale == Scale::Logarithmic
        })
        .collect();
    let groups = groups(&study.data);
    if free.is_empty() || groups.len() < 2 {
        return Ok(JointTrends::default());
    }
    let own: Vec<(DVector<f64>, DVector<f64>)> = groups
        .iter()
        .map(|group| changes(model, &group.data, theta, &free))
        .collect::<Result<_>>()?;
    let gravity = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);
    let torques_nm: Vec<Vec<f64>> = groups
        .iter()
        .map(|group| {
            let kinematics = group.data.blocks.first().map(|block| &block.kinematics);
            kinematics.map_or_else(Vec::new, |k| model.robot.gravity_torques_nm(k, gravity))
        })
        .collect();
    let mut found = JointTrends::default();
    for (k, &i) in free.iter().enumerate() {
        let name = &model.parameters[i].name;
        let joint = joint_of(name);
        let known: Vec<usize> = (0..groups.len())
            .filter(|&g| own[g].1[k] < LITTLE_KNOWN * TIED)
            .collect();
        let x = |against: JointAgainst, g: usize| -> Option<f64> {
            let PostureFrfs { posture, level_n, .. } = &groups[g];
            match (against, joint) {
                (JointAgainst::Order, _) => Some(*posture as f64 + 1.0),
                (JointAgainst::ForceLevel, _) => *level_n,
                (JointAgainst::Angle, Some(j)) => postures.get(*posture)?.joints_deg.get(j - 1).copied(),
                (JointAgainst::GravityTorque, Some(j)) => torques_nm[g].get(j - 1).map(|t| t.abs()),
                (JointAgainst::Angle | JointAgainst::GravityTorque, None) => None,
            }
        };
        use JointAgainst::{Angle, ForceLevel, GravityTorque, Order};
        for against in [Order, ForceLevel, Angle, GravityTorque] {
            let points: Vec<TrendPoint> = known
                .iter()
                .filter_map(|&g| {
                    Some(TrendPoint {
                        x: x(against, g)?,
                        rest: own[g].0[k],
                        std: own[g].1[k],
                    })
                })
                .collect();
            let degree = against.degree(points.len());
            if let Some(mut tested) = test(points, degree) {
                tested.points.sort_by(|a, b| a.x.total_cmp(&b.x));
                found.trends.push(JointTrend {
                    parameter: name.clone(),
                    against,
                    x_unit: against.unit(),
                    p_value: tested.p_value,
                    tests: 1,
                    usual_cause: against.usual_cause(),
                    points: tested.points,
                });
            }
        }
        found.courses.push(JointCourse {
            parameter: name.clone(),
            values: known
                .iter()
                .map(|&g| PostureValue {
                    posture: study.data.posture_ids[groups[g].posture].clone(),
                    force_level_n: groups[g].level_n,
                    change: own[g].0[k],
                    std: own[g].1[k],
                })
                .collect(),
        });
    }
    let tests = found.trends.len();
    for trend in &mut found.trends {
        trend.tests = tests;
        trend.p_value = (trend.p_value * tests as f64).min(1.0);
    }
    found.trends.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    Ok(found)
}

/// `joint-2.stiffness` of the baseline, damping of all or of one joint.
fn is_of_a_joint(name: &str) -> bool {
    name == "damping-ratio"
        || joint_of(name).is_some() && (name.ends_with(".stiffness") || name.ends_with(".damping-ratio"))
}

/// 1-based.
fn joint_of(name: &str) -> Option<usize> {
    name.strip_prefix("joint-")?.split('.').next()?.parse().ok()
}

/// FRFs that are refitted together.
struct PostureFrfs {
    posture: usize,
    level_n: Option<f64>,
    data: FrfData,
}

fn groups(data: &FrfData) -> Vec<PostureFrfs> {
    let mut groups: Vec<PostureFrfs> = Vec::new();
    for block in &data.blocks {
        let same = |g: &&mut PostureFrfs| g.posture == block.posture && g.level_n == block.force_level_n;
        match groups.iter_mut().find(same) {
            Some(group) => group.data.blocks.push(block.clone()),
            None => groups.push(PostureFrfs {
                posture: block.posture,
                level_n: block.force_level_n,
                data: FrfData {
                    blocks: vec![block.clone()],
                    posture_ids: data.posture_ids.clone(),
                },
            }),
        }
    }
    groups
}

/// By how much `free` have to change for these FRFs alone (solver's scale), and standard errors.
fn changes(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    free: &[usize],
) -> Result<(DVector<f64>, DVector<f64>)> {
    let problem = OwnJoints {
        problem: FrfProblem::likelihood(model, data),
        centre: theta,
        free,
    };
    let start: Vec<f64> = free.iter().map(|&i| theta[i]).collect();
    let bounds: Vec<[f64; 2]> = free
        .iter()
        .map(|&i| model.parameters[i].internal_bounds())
        .collect();
    let fit = minimise(&problem, &start, &bounds, OWN)?;
    let change = DVector::from_fn(free.len(), |k, _| fit.theta[k] - start[k]);
    let std = match fit.hessian.cholesky() {
        Some(factor) => factor.inverse().diagonal().map(f64::sqrt),
        None => DVector::repeat(free.len(), f64::INFINITY),
    };
    Ok((change, std))
}

/// The misfit of some FRFs where only `free` may change, each tied to where it stands.
struct OwnJoints<'a> {
    problem: FrfProblem<'a>,
    centre: &'a [f64],
    free: &'a [usize],
}

impl OwnJoints<'_> {
    fn at(&self, own: &[f64], with_derivatives: bool) -> Result<Linearisation> {
        let mut theta = self.centre.to_vec();
        for (&i, value) in self.free.iter().zip(own) {
            theta[i] = *value;
        }
        let all = self.problem.of_data(&theta, with_derivatives)?;
        let count = if with_derivatives { own.len() } else { 0 };
        let mut found = Linearisation {
            cost: all.cost,
            gradient: DVector::from_fn(count, |k, _| all.gradient[self.free[k]]),
            hessian: DMatrix::from_fn(count, count, |k, l| all.hessian[(self.free[k], self.free[l])]),
        };
        for (k, &i) in self.free.iter().enumerate() {
            let off = (own[k] - self.centre[i]) / TIED;
            found.add_half_square(k, [0.5 * off * off, off / TIED, TIED.powi(-2)]);
        }
        Ok(found)
    }
}

impl LeastSquares for OwnJoints<'_> {
    fn cost(&self, own: &[f64]) -> Result<f64> {
        Ok(self.at(own, false)?.cost)
    }

    fn linearise(&self, own: &[f64]) -> Result<Linearisation> {
        self.at(own, true)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::discrepancy::localise::tests::{measured_at, model};
    use crate::identify::Options;
    use crate::robot::fixture::TAP_POSTURES;

    /// Eight postures that differ in all joints.
    fn postures() -> Vec<[f64; 6]> {
        let more = TAP_POSTURES.map(|q| {
            [
                q[0] - 25.0,
                q[1] + 14.0,
                q[2] - 9.0,
                q[3] + 31.0,
                q[4] - 22.0,
                q[5] + 40.0,
            ]
        });
        [TAP_POSTURES, more].concat()
    }

    /// Trends where joint 2 is by `change` of the posture stiffer, and the model is fitted to all postures together.
    fn found(change: impl Fn(usize, f64) -> f64) -> JointTrends {
        let model = model();
        let truth = model.nominal_theta();
        let postures = postures();
        let load = |p: usize| {
            let kinematics = model.robot.kinematics(&postures[p]).unwrap();
            let gravity = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);
            model.robot.gravity_torques_nm(&kinematics, gravity)[1].abs()
        };
        let of = |p: usize| {
            let mut theta = truth.clone();
            theta[1] += change(p, load(p));
            theta
        };
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let data = measured_at(&model, &postures, of, &mut random);
        let study = StructureStudy::new(data, Options::default());
        let everywhere = FrfProblem::likelihood(&model, &study.data);
        let fit = minimise(&everywhere, &truth, &model.bounds(), OWN).unwrap();
        let named: Vec<Posture> = postures
            .iter()
            .enumerate()
            .map(|(p, q)| Posture {
                id: format!("p{}", p + 1),
                joints_deg: q.to_vec(),
            })
            .collect();
        joint_trends(&study, &model, &fit.theta, &named).unwrap()
    }

    #[test]
    fn a_joint_that_warms_up_follows_the_order_and_is_weighed() {
        let found = found(|p, _| 0.02 * p as f64);
        let followed = found.followed();
        let told: Vec<_> = followed
            .iter()
            .map(|t| (t.parameter.as_str(), t.against))
            .collect();
        assert_eq!(told, [("joint-2.stiffness", JointAgainst::Order)]);
        let [first, .., last] = followed[0].points.as_slice() else {
            panic!("{followed:?}");
        };
        assert_eq!((first.x, last.x), (1.0, 8.0));
        let error = first.std.hypot(last.std);
        assert!(
            (last.rest - first.rest - 0.14).abs() < 3.0 * error,
            "{first:?} {last:?}"
        );
        assert!(error < 0.01, "{error}");
    }

    #[test]
    fn a_gear_that_stiffens_under_load_follows_the_torque_of_gravity() {
        let found = found(|_, torque_nm| 0.06 * torque_nm / 1000.0);
        let followed = found.followed();
        assert_eq!(followed[0].parameter, "joint-2.stiffness");
        assert_eq!(followed[0].against, JointAgainst::GravityTorque);
    }

    #[test]
    fn joints_that_do_not_change_follow_nothing_and_their_errors_are_what_they_say() {
        let found = found(|_, _| 0.0);
        assert!(found.followed().is_empty(), "{:?}", found.followed());
        let values = || found.courses.iter().flat_map(|c| &c.values);
        let squares: f64 = values().map(|v| (v.change / v.std).powi(2)).sum();
        let mean = squares / values().count() as f64;
        assert!((0.5..1.6).contains(&mean), "{mean}");
    }
}
