//! Postures of a simulated campaign.

use super::draw::Draws;
use crate::campaign::Posture;
use crate::robot::{JointSpec, RobotModel, posture_deg};
use crate::{Error, Result};

/// Tap-test postures of the built-in robot, in the order in which campaigns visit their neighbourhoods.
const TAP_IDS: [&str; 4] = ["1", "2", "3", "4"];
/// Postures nearer than this in every joint are one posture.
const LEAST_DISTANCE_DEG: f64 = 5.0;
/// Range of a joint whose robot file gives no limits, degrees.
const UNLIMITED_DEG: [f64; 2] = [-120.0, 120.0];
/// Share of the arm's length that the tool keeps from the base axis.
const LEAST_REACH: f64 = 0.2;
const ATTEMPTS: usize = 2000;

/// How postures are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PostureScheme {
    /// How many there are.
    pub count: usize,
    /// The first so many are the tap-test postures themselves (built-in robot only).
    pub exact: usize,
    /// The others are uniform within ± this of a tap-test posture (of a posture drawn from the middle of the joint
    /// limits, for another robot), joint by joint.
    pub spread_deg: f64,
}

/// Draws postures within the joint limits, the tool above the floor and away from the base axis, all different.
///
/// # Errors
/// A robot whose limits leave no such posture.
pub fn draw(
    model: &RobotModel,
    built_in: bool,
    scheme: PostureScheme,
    draws: &mut Draws,
) -> Result<Vec<Posture>> {
    let limits_deg: Vec<[f64; 2]> = model
        .spec
        .joints
        .iter()
        .map(|j| j.limits_rad.map_or(UNLIMITED_DEG, |l| l.map(f64::to_degrees)))
        .collect();
    let references: Vec<Vec<f64>> = match built_in {
        true => TAP_IDS
            .iter()
            .map(|id| Ok(posture_deg(id)?.to_vec()))
            .collect::<Result<_>>()?,
        false => Vec::new(),
    };
    let mut postures: Vec<Posture> = Vec::new();
    for i in 0..scheme.count {
        let near = (!references.is_empty()).then(|| &references[i % references.len()]);
        let exact = near.filter(|_| i < scheme.exact.min(references.len()));
        let joints_deg = match exact {
            Some(joints) => joints.clone(),
            None => one(model, &limits_deg, near, scheme.spread_deg, &postures, draws)?,
        };
        postures.push(Posture {
            id: format!("p{}", i + 1),
            joints_deg,
        });
    }
    Ok(postures)
}

fn one(
    model: &RobotModel,
    limits_deg: &[[f64; 2]],
    near: Option<&Vec<f64>>,
    spread_deg: f64,
    others: &[Posture],
    draws: &mut Draws,
) -> Result<Vec<f64>> {
    for _ in 0..ATTEMPTS {
        let joints: Vec<f64> = limits_deg
            .iter()
            .enumerate()
            .map(|(j, [low, high])| {
                let centre = match near {
                    Some(reference) => reference[j],
                    None => draws.uniform(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high),
                };
                // Tenths of a degree, as a controller shows them.
                (10.0 * (centre + draws.uniform(-spread_deg, spread_deg))).round() / 10.0
            })
            .collect();
        let within = joints
            .iter()
            .zip(limits_deg)
            .all(|(q, [low, high])| (*low..=*high).contains(q));
        if within && is_sensible(model, &joints)? && is_new(&joints, others) {
            return Ok(joints);
        }
    }
    Err(Error::computation(format!(
        "no {} postures found within the joint limits, the tool above the floor and each at least {LEAST_DISTANCE_DEG}° from \
         the others: ask for fewer, or for a wider spread",
        others.len() + 1
    )))
}

fn is_sensible(model: &RobotModel, joints_deg: &[f64]) -> Result<bool> {
    let tool = model.kinematics(joints_deg)?.tcp();
    let length: f64 = model.spec.joints.iter().map(JointSpec::length_m).sum();
    Ok(tool.z >= -1e-9 && tool.x.hypot(tool.y) >= LEAST_REACH * length)
}

fn is_new(joints_deg: &[f64], others: &[Posture]) -> bool {
    others.iter().all(|other| {
        let pairs = joints_deg.iter().zip(&other.joints_deg);
        pairs
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
            .total_cmp(&LEAST_DISTANCE_DEG)
            .is_ge()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::irb6640;
    use crate::simulate::draw::Purpose;

    #[test]
    fn postures_keep_to_the_limits_and_differ() {
        let mut spec = irb6640();
        for joint in &mut spec.joints {
            joint.limits_rad = Some([-1.2, 1.0]);
        }
        let model = RobotModel::new(spec);
        let scheme = PostureScheme {
            count: 12,
            exact: 2,
            spread_deg: 25.0,
        };
        let found = draw(&model, false, scheme, &mut Draws::new(3, Purpose::Postures)).unwrap();
        assert_eq!(found.len(), 12);
        for (i, posture) in found.iter().enumerate() {
            for q in &posture.joints_deg {
                assert!((-1.2..=1.0).contains(&q.to_radians()));
            }
            assert!(is_new(&posture.joints_deg, &found[..i]));
            assert!(model.kinematics(&posture.joints_deg).unwrap().tcp().z >= 0.0);
        }
        let none = PostureScheme {
            count: 3,
            exact: 0,
            spread_deg: 0.0,
        };
        let mut fixed = irb6640();
        for joint in &mut fixed.joints {
            joint.limits_rad = Some([0.1, 0.11]);
        }
        let error = draw(
            &RobotModel::new(fixed),
            false,
            none,
            &mut Draws::new(3, Purpose::Postures),
        );
        assert!(error.unwrap_err().to_string().contains("joint limits"));
    }
}
