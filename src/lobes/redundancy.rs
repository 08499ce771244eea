//! Lobes over the redundancy angle: the tool turned about its own axis at one place, b(n, θ).
//!
//! A rotating tool does not care how the robot stands behind it; the robot's structure does. The angle θ turns the tool
//! frame of the posture to keep about its z axis (right-handed); inverse kinematics follows the branch of that posture.

use argmin::core::{CostFunction, Error as ArgminError, Executor, PopulationState};
use argmin::solver::particleswarm::{Particle, ParticleSwarm};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::curve::{AbsoluteLimit, LobeCurve, SpeedLimit};
use crate::robot::{IkBranch, InverseKinematics, RobotModel};
use crate::{Error, Result};

/// The spindle speed and the structure's frequencies may be off by this share: a recommended depth is the least limit
/// within it.
pub const SPEED_MARGIN: f64 = 0.02;
/// Speeds looked at on either side within that margin.
const MARGIN_STEPS: i32 = 4;
/// Deeper counts as this deep, mm: keeps unlimited places comparable.
const DEEPEST_MM: f64 = 1e6;
const PARTICLES: usize = 48;
const GENERATIONS: u64 = 40;
const SEED: u64 = 6640;
/// Enumeration and swarm agree where their depths differ by less than this share.
const AGREEMENT: f64 = 0.01;
/// Cells of the grid from which the enumeration is refined.
const REFINED: usize = 6;

/// Whether a cut can be made at an angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum AngleStatus {
    Reachable,
    /// Within a forbidden band of the campaign.
    Forbidden,
    /// Out of reach, or a joint beyond its limit, on the posture's branch.
    Unreachable,
}

/// How the robot stands at one angle.
#[derive(Debug, Clone, Serialize)]
pub struct AnglePosture {
    /// 0 to below 360; 0 is the posture to keep.
    pub angle_deg: f64,
    pub status: AngleStatus,
    /// `None` where unreachable.
    pub joints_deg: Option<[f64; 6]>,
    /// Distance of the nearest joint to its limit; `None` where unreachable or no limits are known.
    pub limit_margin_deg: Option<f64>,
    /// Distance from the nearest singularity, 0 to 1 (see [`crate::robot::IkSolution`]).
    pub singularity_margin: Option<f64>,
}

/// All angles of one place.
pub struct RedundancySweep<'a> {
    robot: &'a RobotModel,
    ik: InverseKinematics<'a>,
    tool: Isometry3<f64>,
    branch: IkBranch,
    forbidden_deg: Vec<[f64; 2]>,
    pub angles: Vec<AnglePosture>,
}

impl<'a> RedundancySweep<'a> {
    /// `joints_deg`: the posture whose tool point and axis are kept. Angles run from 0 in steps; the posture is followed
    /// from 0 both ways, so that whole turns of a joint do not jump but at 180°.
    ///
    /// # Errors
    /// A robot without closed inverse kinematics, or a posture at a singularity.
    pub fn new(
        robot: &'a RobotModel,
        joints_deg: &[f64],
        step_deg: f64,
        forbidden_deg: &[[f64; 2]],
    ) -> Result<Self> {
        let ik = InverseKinematics::new(&robot.spec)?;
        let start: [f64; 6] = joints_deg
            .iter()
            .map(|d| d.to_radians())
            .collect::<Vec<f64>>()
            .try_into()
            .map_err(|_| Error::computation("the redundancy sweep needs six joint angles"))?;
        let tool = robot.kinematics(joints_deg)?.tool;
        let branch = ik.branch_of(&start).ok_or_else(|| {
            Error::computation(
                "the posture of the redundancy sweep stands at a singularity of the robot: choose another one",
            )
        })?;
        let mut sweep = RedundancySweep {
            robot,
            ik,
            tool,
            branch,
            forbidden_deg: forbidden_deg.to_vec(),
            angles: Vec::new(),
        };
        let count = steps_of_a_turn(step_deg);
        let angle = |i: usize| step_deg * i as f64;
        let half = (0..count).take_while(|i| angle(*i) <= 180.0).count();
        let mut angles: Vec<Option<AnglePosture>> = vec![None; count];
        for order in [(0..half).collect::<Vec<_>>(), (half..count).rev().collect()] {
            let mut reference = start;
            for i in order {
                let posture = sweep.at(angle(i), &reference);
                if let Some(joints) = posture.joints_deg {
                    reference = joints.map(f64::to_radians);
                }
                angles[i] = Some(posture);
            }
        }
        sweep.angles = angles.into_iter().flatten().collect();
        Ok(sweep)
    }

    /// The robot at any angle; whole turns of joints nearest to `reference_rad`.
    pub fn at(&self, angle_deg: f64, reference_rad: &[f64; 6]) -> AnglePosture {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_deg.to_radians());
        let pose = self.tool * turn;
        let solution = self
            .ik
            .tool_pose(&pose, reference_rad)
            .into_iter()
            .find(|s| s.branch == self.branch && s.limit_margin_rad >= -1e-9);
        let status = match (&solution, in_forbidden_band(&self.forbidden_deg, angle_deg)) {
            (None, _) => AngleStatus::Unreachable,
            (Some(_), true) => AngleStatus::Forbidden,
            (Some(_), false) => AngleStatus::Reachable,
        };
        AnglePosture {
            angle_deg,
            status,
            joints_deg: solution.as_ref().map(|s| s.joints_deg()),
            limit_margin_deg: solution
                .as_ref()
                .map(|s| s.limit_margin_rad.max(0.0).to_degrees())
                .filter(|m| m.is_finite()),
            singularity_margin: solution.as_ref().map(|s| s.singularity_margin),
        }
    }

    /// The robot at any angle, followed from the nearest angle of the sweep.
    pub fn between(&self, angle_deg: f64) -> AnglePosture {
        let angle_deg = angle_deg.rem_euclid(360.0);
        let distance = |a: &AnglePosture| {
            let d = (a.angle_deg - angle_deg).abs();
            d.min(360.0 - d)
        };
        let nearest = self
            .angles
            .iter()
            .filter(|a| a.joints_deg.is_some())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .and_then(|a| a.joints_deg);
        let reference = nearest.unwrap_or_default().map(f64::to_radians);
        self.at(angle_deg, &reference)
    }

    pub fn robot(&self) -> &RobotModel {
        self.robot
    }
}

/// Angles from 0 in steps that lie below 360°.
pub(super) fn steps_of_a_turn(step_deg: f64) -> usize {
    (360.0 / step_deg - 1e-9).ceil().max(1.0) as usize
}

/// Whether an angle lies in one of the bands, whole turns aside.
pub(super) fn in_forbidden_band(forbidden_deg: &[[f64; 2]], angle_deg: f64) -> bool {
    forbidden_deg.iter().any(|[from, to]| {
        [-360.0, 0.0, 360.0]
            .iter()
            .any(|turn| (*from..=*to).contains(&(angle_deg + turn)))
    })
}

/// A place on the surface: the least limit within the speed margin there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurfacePoint {
    pub spindle_rpm: f64,
    pub angle_deg: f64,
    /// Least limit within ±2 % of the speed.
    pub depth_mm: f64,
}

/// What the surface says to do.
#[derive(Debug, Clone, Serialize)]
pub struct Recommendation {
    pub point: SurfacePoint,
    /// The limit at exactly that speed.
    pub tip_depth_mm: Option<f64>,
    /// The 5 % quantile of `point.depth_mm` over the model's uncertainty, mm; `None` without a calibration.
    pub lower_quantile_mm: Option<f64>,
    pub posture: AnglePosture,
    pub absolute_limit: Option<AbsoluteLimit>,
    /// Best of the enumeration, refined.
    pub enumeration: SurfacePoint,
    /// Best of the particle swarm.
    pub swarm: SurfacePoint,
    pub agree: bool,
    pub speed_margin: f64,
}

/// The limit over speed at one angle; a method that builds the structure at an angle.
pub trait LimitAtAngle: Sync {
    /// The least limit within the speed margin at each speed, mm; `None` where the angle cannot be used.
    fn margins_mm(&self, angle_deg: f64, spindle_rpm: &[f64]) -> Option<Vec<f64>>;
}

/// The least limit within ±[`SPEED_MARGIN`] of a speed, mm.
pub fn margin_mm(method: &dyn SpeedLimit, spindle_rpm: f64) -> f64 {
    (-MARGIN_STEPS..=MARGIN_STEPS)
        .map(|i| spindle_rpm * (1.0 + SPEED_MARGIN * f64::from(i) / f64::from(MARGIN_STEPS)))
        .map(|n| {
            method
                .limit_at(n)
                .map_or(DEEPEST_MM, |l| l.depth_mm.min(DEEPEST_MM))
        })
        .fold(f64::INFINITY, f64::min)
}

/// The deepest place of a surface by enumeration: on the grid of the curves, then refined by halving steps about the
/// best cells. `curves`: angle and curve. `None` without a curve.
pub fn by_enumeration(
    curves: &[(f64, &LobeCurve)],
    step_deg: f64,
    surface: &dyn LimitAtAngle,
) -> Option<SurfacePoint> {
    let mut cells: Vec<SurfacePoint> = Vec::new();
    for (angle_deg, curve) in curves {
        let n = &curve.spindle_rpm;
        let depth = |i: usize| curve.depth_limit_mm[i].map_or(DEEPEST_MM, |d| d.min(DEEPEST_MM));
        let least: Vec<f64> = (0..n.len())
            .map(|i| {
                let (low, high) = (n[i] * (1.0 - SPEED_MARGIN), n[i] * (1.0 + SPEED_MARGIN));
                let from = n.partition_point(|v| *v < low);
                let to = n.partition_point(|v| *v <= high);
                (from..to.max(from + 1)).map(depth).fold(f64::INFINITY, f64::min)
            })
            .collect();
        // Local maxima over speed, so that the best cells are not all one tip.
        for i in 0..n.len() {
            let before = i == 0 || least[i - 1] <= least[i];
            let after = i + 1 == n.len() || least[i + 1] < least[i];
            if before && after {
                cells.push(SurfacePoint {
                    spindle_rpm: n[i],
                    angle_deg: *angle_deg,
                    depth_mm: least[i],
                });
            }
        }
    }
    cells.sort_by(|a, b| b.depth_mm.total_cmp(&a.depth_mm));
    cells.truncate(REFINED);
    let range = curves
        .first()
        .map(|(_, c)| (c.spindle_rpm[0], c.spindle_rpm[c.spindle_rpm.len() - 1]))?;
    let step_rpm = curves
        .first()
        .and_then(|(_, c)| Some(c.spindle_rpm.get(1)? - c.spindle_rpm[0]))
        .unwrap_or(1.0);
    cells
        .par_iter()
        .filter_map(|cell| {
            refine(
                *cell,
                [step_deg, step_rpm.max(0.002 * cell.spindle_rpm)],
                range,
                surface,
            )
        })
        .max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
}

/// Compass search: steps along angle and speed, halved where none of them leads up.
fn refine(
    start: SurfacePoint,
    steps: [f64; 2],
    (low, high): (f64, f64),
    surface: &dyn LimitAtAngle,
) -> Option<SurfacePoint> {
    let depth = |angle_deg: f64, n: f64| surface.margins_mm(angle_deg, &[n]).map(|d| d[0]);
    let mut best = SurfacePoint {
        depth_mm: depth(start.angle_deg, start.spindle_rpm)?,
        ..start
    };
    let [mut angle_step, mut speed_step] = steps;
    for _ in 0..14 {
        loop {
            let tried = [
                (1.0, 0.0),
                (-1.0, 0.0),
                (0.0, 1.0),
                (0.0, -1.0),
                (1.0, 1.0),
                (1.0, -1.0),
                (-1.0, 1.0),
                (-1.0, -1.0),
            ]
            .iter()
            .filter_map(|(da, dn)| {
                let angle_deg = (best.angle_deg + da * angle_step).rem_euclid(360.0);
                let spindle_rpm = (best.spindle_rpm + dn * speed_step).clamp(low, high);
                Some(SurfacePoint {
                    spindle_rpm,
                    angle_deg,
                    depth_mm: depth(angle_deg, spindle_rpm)?,
                })
            })
            .max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm));
            match tried {
                Some(point) if point.depth_mm > best.depth_mm * (1.0 + 1e-9) => best = point,
                _ => break,
            }
        }
        angle_step *= 0.5;
        speed_step *= 0.5;
    }
    Some(best)
}

struct SwarmProblem<'a> {
    surface: &'a dyn LimitAtAngle,
}

impl CostFunction for SwarmProblem<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, at: &Vec<f64>) -> std::result::Result<f64, ArgminError> {
        // An angle that cannot be used is worse than any that can.
        let depth = self.surface.margins_mm(at[0].rem_euclid(360.0), &[at[1]]);
        Ok(depth.map_or(0.0, |d| -d[0]))
    }

    fn bulk_cost<P: std::borrow::Borrow<Vec<f64>>>(
        &self,
        at: &[P],
    ) -> std::result::Result<Vec<f64>, ArgminError> {
        let places: Vec<Vec<f64>> = at.iter().map(|p| p.borrow().clone()).collect();
        places.par_iter().map(|p| self.cost(p)).collect()
    }
}

/// The deepest place of a surface by particle swarm (Kennedy & Eberhart 1995, as in argmin), over all angles and the
/// given speeds; a fixed seed makes it repeatable.
///
/// # Errors
/// Where the swarm finds no usable angle.
pub fn by_swarm(rpm_range: [f64; 2], surface: &dyn LimitAtAngle) -> Result<SurfacePoint> {
    let bounds = (
        vec![0.0, rpm_range[0]],
        vec![360.0, rpm_range[1].max(rpm_range[0] * (1.0 + 1e-9))],
    );
    let solver = ParticleSwarm::new(bounds, PARTICLES).with_rng_generator(ChaCha8Rng::seed_from_u64(SEED));
    let result = Executor::new(SwarmProblem { surface }, solver)
        .configure(|state: PopulationState<Particle<Vec<f64>, f64>, f64>| state.max_iters(GENERATIONS))
        .run()
        .map_err(|e| Error::computation(format!("lobes: particle swarm: {e}")))?;
    let best = result
        .state
        .individual
        .filter(|p| p.cost < 0.0)
        .ok_or_else(|| Error::computation("lobes: the particle swarm found no angle that can be used"))?;
    Ok(SurfacePoint {
        spindle_rpm: best.position[1],
        angle_deg: best.position[0].rem_euclid(360.0),
        depth_mm: -best.cost,
    })
}

/// Whether two optima are the same depth.
pub fn agree(a: &SurfacePoint, b: &SurfacePoint) -> bool {
    (a.depth_mm - b.depth_mm).abs() <= AGREEMENT * a.depth_mm.max(b.depth_mm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    fn limited() -> RobotModel {
        let mut spec = irb6640();
        let limits = [
            [-180.0, 180.0],
            [-65.0, 85.0],
            [-180.0, 70.0],
            [-300.0, 300.0],
            [-120.0, 120.0],
            [-360.0, 360.0],
        ];
        for (joint, limits) in spec.joints.iter_mut().zip(limits) {
            joint.limits_rad = Some(limits.map(f64::to_radians));
        }
        RobotModel::new(spec)
    }

    /// The four tap-test postures are one sweep in steps of 90°: joint angles within what whole degrees and the 20 mm
    /// between the four tool points leave open.
    #[test]
    fn the_four_thesis_postures_are_one_sweep() {
        let robot = limited();
        let sweep = RedundancySweep::new(&robot, &TAP_POSTURES[0], 1.0, &[]).unwrap();
        assert_eq!(sweep.angles.len(), 360);
        let mut angles = Vec::new();
        for posture in &TAP_POSTURES {
            let off = |a: &AnglePosture| -> f64 {
                a.joints_deg.map_or(f64::INFINITY, |joints| {
                    joints
                        .iter()
                        .zip(posture)
                        .map(|(a, b)| (a - b + 180.0).rem_euclid(360.0) - 180.0)
                        .fold(0.0, |worst: f64, d| worst.max(d.abs()))
                })
            };
            let nearest = sweep
                .angles
                .iter()
                .min_by(|a, b| off(a).total_cmp(&off(b)))
                .unwrap();
            assert!(
                off(nearest) < 4.0,
                "{posture:?}: {nearest:?} off by {}",
                off(nearest)
            );
            angles.push(nearest.angle_deg);
        }
        for pair in angles.windows(2) {
            let turned = (pair[1] - pair[0]).rem_euclid(360.0);
            assert!(
                (turned - 90.0).abs() < 4.0 || (turned - 270.0).abs() < 4.0,
                "{angles:?}"
            );
        }
    }

    /// Tool point and axis stay where they are at every reachable angle; neighbours differ little.
    #[test]
    fn the_tool_stays_and_joints_move_smoothly() {
        let robot = limited();
        let sweep = RedundancySweep::new(&robot, &TAP_POSTURES[1], 5.0, &[[350.0, 370.0]]).unwrap();
        let start = robot.kinematics(&TAP_POSTURES[1]).unwrap();
        for a in &sweep.angles {
            let banned = a.angle_deg <= 10.0 || a.angle_deg >= 350.0;
            let Some(joints) = a.joints_deg else {
                assert_eq!(a.status, AngleStatus::Unreachable);
                continue;
            };
            assert_eq!(a.status == AngleStatus::Forbidden, banned, "{a:?}");
            let here = robot.kinematics(&joints).unwrap();
            assert!((here.tcp() - start.tcp()).norm() < 1e-9);
            assert!((here.tool_axis() - start.tool_axis()).norm() < 1e-9);
        }
        assert!(sweep.angles[0].joints_deg.is_some());
        for pair in sweep.angles.windows(2).filter(|p| p[1].angle_deg <= 180.0) {
            if let (Some(a), Some(b)) = (pair[0].joints_deg, pair[1].joints_deg) {
                let jump = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(jump < 60.0, "{pair:?}");
            }
        }
    }

    /// A smooth surface of known optimum with a forbidden stretch: both searches find it.
    #[test]
    fn enumeration_and_swarm_agree_on_a_known_surface() {
        struct Hill;
        impl LimitAtAngle for Hill {
            fn margins_mm(&self, angle_deg: f64, n: &[f64]) -> Option<Vec<f64>> {
                let usable = !(100.0..150.0).contains(&angle_deg);
                usable.then(|| n.iter().map(|n| height(angle_deg, *n)).collect())
            }
        }
        fn height(angle_deg: f64, n: f64) -> f64 {
            let a = (angle_deg - 213.3).to_radians();
            1.0 + 2.0 * a.cos() + (-((n - 371.7) / 40.0).powi(2)).exp()
        }
        let speeds: Vec<f64> = (100..=900).map(f64::from).collect();
        let curves: Vec<(f64, LobeCurve)> = (0..72)
            .map(|i| f64::from(i) * 5.0)
            .filter(|a| !(100.0..150.0).contains(a))
            .map(|a| {
                let depth: Vec<Option<f64>> = speeds.iter().map(|n| Some(height(a, *n))).collect();
                let curve = LobeCurve {
                    spindle_rpm: speeds.clone(),
                    chatter_hz: depth.clone(),
                    depth_limit_mm: depth,
                };
                (a, curve)
            })
            .collect();
        let borrowed: Vec<(f64, &LobeCurve)> = curves.iter().map(|(a, c)| (*a, c)).collect();
        let first = by_enumeration(&borrowed, 5.0, &Hill).unwrap();
        let second = by_swarm([100.0, 900.0], &Hill).unwrap();
        assert!(agree(&first, &second), "{first:?} {second:?}");
        for p in [first, second] {
            assert!((p.depth_mm - 4.0).abs() < 0.01, "{p:?}");
            assert!(
                (p.angle_deg - 213.3).abs() < 5.0 && (p.spindle_rpm - 371.7).abs() < 5.0,
                "{p:?}"
            );
        }
    }
}
