//! The deepest place of the surface b(n, θ) over spindle speed and redundancy angle, by enumeration and by particle swarm.
//!
//! Both climb the same function, [`margin_mm`] at an angle that can be used, and both end in a local search that goes on
//! until it has converged, so that they differ only where one of them is on another hill. A tip of the lobes is narrow in
//! speed and its ridge runs askew over the angle: a search that steps in both at once stops on the ridge. Here the angle
//! alone is stepped, and at every angle the best speed is sought anew (the costly part, the structure at an angle, is
//! then done once for all speeds).

use std::sync::Mutex;

use argmin::core::{CostFunction, Error as ArgminError, Executor, PopulationState};
use argmin::solver::particleswarm::{Particle, ParticleSwarm};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::curve::SpeedLimit;
use crate::{Error, Result};

/// The spindle speed and the structure's frequencies may be off by this share: a recommended depth is the least limit
/// within it.
pub const SPEED_MARGIN: f64 = 0.02;
/// Speeds looked at on either side within that margin, in even steps of the speed's logarithm.
const MARGIN_STEPS: usize = 4;
/// Deeper counts as this deep, mm: keeps unlimited places comparable.
const DEEPEST_MM: f64 = 1e6;
/// Tips over speed that are refined at one angle …
const TIPS: usize = 3;
/// … where they come to this share of the deepest.
const WORTH_REFINING: f64 = 0.8;
/// Halvings of a step in speed.
const SPEED_HALVINGS: usize = 9;
/// The grid of angles is halved about every angle that comes to this share of the best so far, round by round.
const HALVED_ABOVE: [f64; 4] = [0.5, 0.75, 0.9, 0.95];
/// Hills that are then climbed by steps in angle …
const CLIMBED: usize = 4;
/// … halved so often.
const ANGLE_HALVINGS: usize = 12;
/// Hills climbed from the places that the swarms visited.
const CLIMBED_BY_SWARM: usize = 6;
/// Swarms, each from a seed of its own: one alone settles on another hill now and then.
const SEEDS: [u64; 3] = [6640, 6641, 6642];
const PARTICLES: usize = 32;
const GENERATIONS: u64 = 20;
/// Steps of speed on either side within which a particle takes the best.
const PARTICLE_REACH: usize = 8;
/// Enumeration and swarm agree where their depths differ by no more than this share.
pub const AGREEMENT: f64 = 0.01;

/// A place on the surface: the least limit within the speed margin there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurfacePoint {
    /// Spindle speed, rpm.
    pub spindle_rpm: f64,
    /// Redundancy angle, degrees.
    pub angle_deg: f64,
    /// Least limit within ±2 % of the speed.
    pub depth_mm: f64,
}

/// The limit over speed at one angle; a method that builds the structure at an angle.
pub trait LimitAtAngle: Sync {
    /// Hands the limit over speed at an angle to `visit`; `false`, and no visit, where the angle cannot be used.
    fn visit(&self, angle_deg: f64, visit: &mut dyn FnMut(&dyn SpeedLimit)) -> bool;
}

/// The least limit within a factor 1 + [`SPEED_MARGIN`] of a speed, mm.
pub fn margin_mm(method: &dyn SpeedLimit, spindle_rpm: f64) -> f64 {
    let depths: Vec<f64> = (0..=2 * MARGIN_STEPS)
        .map(|i| {
            depth_mm(
                method,
                spindle_rpm * step_ratio().powi(i as i32 - MARGIN_STEPS as i32),
            )
        })
        .collect();
    least(&depths)
}

/// Neighbouring speeds of a margin.
fn step_ratio() -> f64 {
    (1.0 + SPEED_MARGIN).powf(1.0 / MARGIN_STEPS as f64)
}

fn depth_mm(method: &dyn SpeedLimit, spindle_rpm: f64) -> f64 {
    method
        .limit_at(spindle_rpm)
        .map_or(DEEPEST_MM, |l| l.depth_mm.min(DEEPEST_MM))
}

fn least(depths: &[f64]) -> f64 {
    depths.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Speed and depth.
type Tip = (f64, f64);

fn deeper(a: &Tip, b: &Tip) -> std::cmp::Ordering {
    a.1.total_cmp(&b.1)
}

/// Margins at `count` speeds from `from_rpm` upwards in steps of the margin: each limit serves nine of them.
fn margins(method: &dyn SpeedLimit, from_rpm: f64, count: usize) -> Vec<Tip> {
    let speed = |i: i32| from_rpm * step_ratio().powi(i);
    let margin = MARGIN_STEPS as i32;
    let depths: Vec<f64> = (-margin..count as i32 + margin)
        .map(|i| depth_mm(method, speed(i)))
        .collect();
    (0..count)
        .map(|i| (speed(i as i32), least(&depths[i..=i + 2 * MARGIN_STEPS])))
        .collect()
}

/// The tip next to a speed: steps up and down in the speed's logarithm, halved where neither leads up.
fn climb_speed(method: &dyn SpeedLimit, start: Tip, [low, high]: [f64; 2]) -> Tip {
    let mut best = start;
    let mut step = 0.5 * step_ratio().ln();
    for _ in 0..SPEED_HALVINGS {
        loop {
            let tried = [step, -step]
                .map(|s| (best.0 * s.exp()).clamp(low, high))
                .map(|n| (n, margin_mm(method, n)))
                .into_iter()
                .max_by(deeper);
            match tried {
                Some(tip) if tip.1 > best.1 * (1.0 + 1e-9) => best = tip,
                _ => break,
            }
        }
        step *= 0.5;
    }
    best
}

/// The deepest margin over a range of speeds: at every step of the margin, then about the best tips.
fn deepest_speed(method: &dyn SpeedLimit, [low, high]: [f64; 2]) -> Tip {
    let count = ((high / low).ln() / step_ratio().ln() - 1e-9).ceil().max(0.0) as usize;
    let mut grid = margins(method, low, count);
    grid.push((high, margin_mm(method, high)));
    let depth = |i: usize| grid[i].1;
    let mut tips: Vec<Tip> = (0..grid.len())
        .filter(|i| *i == 0 || depth(i - 1) <= depth(*i))
        .filter(|i| i + 1 == grid.len() || depth(i + 1) < depth(*i))
        .map(|i| grid[i])
        .collect();
    tips.sort_by(|a, b| deeper(b, a));
    let worth = WORTH_REFINING * tips.first().map_or(0.0, |t| t.1);
    tips.iter()
        .take(TIPS)
        .filter(|tip| tip.1 >= worth)
        .map(|tip| climb_speed(method, *tip, [low, high]))
        .max_by(deeper)
        .unwrap_or((low, 0.0))
}

/// The deepest margin near a speed.
fn deepest_near(method: &dyn SpeedLimit, spindle_rpm: f64, [low, high]: [f64; 2]) -> Tip {
    let reach = PARTICLE_REACH as i32;
    let from = spindle_rpm * step_ratio().powi(-reach);
    let inside = |tip: &Tip| (low..=high).contains(&tip.0);
    let mut around: Vec<Tip> = margins(method, from, 2 * PARTICLE_REACH + 1);
    around.retain(inside);
    for end in [low, high] {
        if ((end / spindle_rpm).ln() / step_ratio().ln()).abs() <= f64::from(reach) {
            around.push((end, margin_mm(method, end)));
        }
    }
    around
        .into_iter()
        .max_by(deeper)
        .unwrap_or_else(|| (spindle_rpm, margin_mm(method, spindle_rpm)))
}

/// Where the deepest place is sought.
pub struct Search<'a> {
    /// The limit over speed and angle.
    pub surface: &'a dyn LimitAtAngle,
    /// Angles in even steps that can be used, ascending, degrees.
    pub usable_deg: &'a [f64],
    /// Step of those angles, degrees.
    pub step_deg: f64,
    /// Lowest and highest spindle speed, rpm.
    pub rpm_range: [f64; 2],
}

impl Search<'_> {
    fn at(&self, angle_deg: f64, deepest: impl Fn(&dyn SpeedLimit, [f64; 2]) -> Tip) -> Option<SurfacePoint> {
        let angle_deg = angle_deg.rem_euclid(360.0);
        let mut found = None;
        self.surface.visit(angle_deg, &mut |method| {
            let (spindle_rpm, depth_mm) = deepest(method, self.rpm_range);
            found = Some(SurfacePoint {
                spindle_rpm,
                angle_deg,
                depth_mm,
            });
        });
        found
    }

    /// From a place up its hill: steps in angle, halved where neither way leads up; at every angle the best of speeds that
    /// `deepest` finds.
    fn climb(
        &self,
        start: SurfacePoint,
        step_deg: f64,
        deepest: impl Fn(&dyn SpeedLimit, [f64; 2], f64) -> Tip + Sync,
    ) -> SurfacePoint {
        let mut best = start;
        let mut step = step_deg;
        for _ in 0..ANGLE_HALVINGS {
            loop {
                let tried = [best.angle_deg - step, best.angle_deg + step]
                    .par_iter()
                    .filter_map(|a| self.at(*a, |method, range| deepest(method, range, best.spindle_rpm)))
                    .max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm));
                match tried {
                    Some(point) if point.depth_mm > best.depth_mm * (1.0 + 1e-9) => best = point,
                    _ => break,
                }
            }
            step *= 0.5;
        }
        best
    }

    /// The deepest place by enumeration: every usable angle with all its speeds, angles halved about the good ones, then
    /// up the best hills. `None` where no angle can be used.
    pub fn by_enumeration(&self) -> Option<SurfacePoint> {
        let enumerate = |angles: &[f64]| -> Vec<SurfacePoint> {
            angles
                .par_iter()
                .filter_map(|a| self.at(*a, deepest_speed))
                .collect()
        };
        let best_of = |places: &[SurfacePoint]| places.iter().map(|p| p.depth_mm).fold(0.0, f64::max);
        let mut tried: Vec<f64> = self.usable_deg.to_vec();
        let mut places = enumerate(&tried);
        let mut step = self.step_deg;
        for share in HALVED_ABOVE {
            step *= 0.5;
            let worth = share * best_of(&places);
            let mut new: Vec<f64> = Vec::new();
            for place in places.iter().filter(|p| p.depth_mm >= worth) {
                for angle in [place.angle_deg - step, place.angle_deg + step].map(|a| a.rem_euclid(360.0)) {
                    let known = |b: &f64| apart_deg(angle, *b) < 1e-6 * step;
                    if !tried.iter().chain(&new).any(known) {
                        new.push(angle);
                    }
                }
            }
            places.extend(enumerate(&new));
            tried.extend(new);
        }
        let other_hill =
            |a: &SurfacePoint, b: &SurfacePoint| apart_deg(a.angle_deg, b.angle_deg) > 1.5 * step;
        deepest_of_each(places, CLIMBED, other_hill)
            .into_iter()
            .map(|hill| self.climb(hill, 0.5 * step, |method, range, _| deepest_speed(method, range)))
            .max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
    }

    /// The usable steps laid side by side over the full turn, so that no particle is lost where nothing can be used and
    /// narrow stretches are not passed over: angle of a place on it.
    fn laid_out_deg(&self, laid_deg: f64) -> f64 {
        let place = laid_deg.rem_euclid(360.0) / 360.0 * self.usable_deg.len() as f64;
        let step = (place as usize).min(self.usable_deg.len() - 1);
        let within = place - step as f64 - 0.5;
        (self.usable_deg[step] + within * self.step_deg).rem_euclid(360.0)
    }

    /// The deepest place by particle swarm (Kennedy & Eberhart 1995, as in argmin) over the usable angles and the speeds,
    /// then up the best hills that its particles visited; fixed seeds make it repeatable. Every particle takes the best
    /// speed close to its own.
    ///
    /// # Errors
    /// Where no swarm finds a usable angle.
    pub fn by_swarm(&self) -> Result<SurfacePoint> {
        let none = || Error::computation("lobes: the particle swarm found no angle that can be used");
        if self.usable_deg.is_empty() {
            return Err(none());
        }
        let mut visited = Vec::new();
        for seed in SEEDS {
            visited.extend(self.swarm(seed)?);
        }
        let other_hill = |a: &SurfacePoint, b: &SurfacePoint| {
            apart_deg(a.angle_deg, b.angle_deg) > self.step_deg
                || (a.spindle_rpm / b.spindle_rpm).ln().abs() > 2.0 * SPEED_MARGIN
        };
        deepest_of_each(visited, CLIMBED_BY_SWARM, other_hill)
            .into_iter()
            .map(|start| {
                self.climb(start, 0.5 * self.step_deg, |method, range, rpm| {
                    climb_speed(method, deepest_near(method, rpm, range), range)
                })
            })
            .max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
            .ok_or_else(none)
    }

    /// All usable places that a swarm visited.
    fn swarm(&self, seed: u64) -> Result<Vec<SurfacePoint>> {
        let [low, high] = self.rpm_range.map(f64::ln);
        // The swarm wants a range of some width.
        let bounds = (vec![0.0, low], vec![360.0, high.max(low + 1e-9)]);
        let solver =
            ParticleSwarm::new(bounds, PARTICLES).with_rng_generator(ChaCha8Rng::seed_from_u64(seed));
        let visited = Mutex::new(Vec::new());
        let problem = SwarmProblem {
            search: self,
            visited: &visited,
        };
        Executor::new(problem, solver)
            .configure(|state: PopulationState<Particle<Vec<f64>, f64>, f64>| state.max_iters(GENERATIONS))
            .run()
            .map_err(|e| Error::computation(format!("lobes: particle swarm: {e}")))?;
        Ok(visited.into_inner().unwrap_or_default())
    }

    /// `at`: place on the angles laid out, logarithm of the speed.
    fn particle(&self, at: &[f64]) -> Option<SurfacePoint> {
        let [low, high] = self.rpm_range;
        let spindle_rpm = at[1].exp().clamp(low, high);
        self.at(self.laid_out_deg(at[0]), |method, range| {
            deepest_near(method, spindle_rpm, range)
        })
    }
}

/// The deepest places, at most `count`, of which none is on the hill of a deeper one. The order of `places` does not
/// matter.
fn deepest_of_each(
    mut places: Vec<SurfacePoint>,
    count: usize,
    other_hill: impl Fn(&SurfacePoint, &SurfacePoint) -> bool,
) -> Vec<SurfacePoint> {
    places.sort_by(|a, b| {
        let place = |p: &SurfacePoint| [-p.depth_mm, p.angle_deg, p.spindle_rpm];
        let ([da, aa, na], [db, ab, nb]) = (place(a), place(b));
        da.total_cmp(&db).then(aa.total_cmp(&ab)).then(na.total_cmp(&nb))
    });
    let mut hills: Vec<SurfacePoint> = Vec::new();
    for place in places {
        if hills.len() < count && hills.iter().all(|h| other_hill(h, &place)) {
            hills.push(place);
        }
    }
    hills
}

struct SwarmProblem<'a> {
    search: &'a Search<'a>,
    /// Usable places, in whatever order the threads came by.
    visited: &'a Mutex<Vec<SurfacePoint>>,
}

impl CostFunction for SwarmProblem<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, at: &Vec<f64>) -> std::result::Result<f64, ArgminError> {
        // An angle that cannot be used is worse than any that can.
        let Some(place) = self.search.particle(at) else {
            return Ok(0.0);
        };
        if let Ok(mut visited) = self.visited.lock() {
            visited.push(place);
        }
        Ok(-place.depth_mm)
    }

    fn bulk_cost<P: std::borrow::Borrow<Vec<f64>>>(
        &self,
        at: &[P],
    ) -> std::result::Result<Vec<f64>, ArgminError> {
        let places: Vec<Vec<f64>> = at.iter().map(|p| p.borrow().clone()).collect();
        places.par_iter().map(|p| self.cost(p)).collect()
    }
}

/// The way between two angles, degrees.
pub fn apart_deg(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(360.0);
    d.min(360.0 - d)
}

/// Difference of two optima as a share of the deeper one.
pub fn difference(a: &SurfacePoint, b: &SurfacePoint) -> f64 {
    let deeper = a.depth_mm.max(b.depth_mm);
    if deeper > 0.0 {
        (a.depth_mm - b.depth_mm).abs() / deeper
    } else {
        0.0
    }
}

/// Whether two optima are the same depth.
pub fn agree(a: &SurfacePoint, b: &SurfacePoint) -> bool {
    difference(a, b) <= AGREEMENT
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::{Limit, ModalFrf, Mode, RegenerativeForce, StabilitySolver};
    use rand::Rng;
    use std::f64::consts::TAU;

    struct Hill;

    struct AtAngle(f64);

    impl SpeedLimit for AtAngle {
        fn limit_at(&self, n: f64) -> Option<Limit> {
            let a = (self.0 - 213.3).to_radians();
            Some(Limit {
                depth_mm: 1.0 + 2.0 * a.cos() + (-((n - 371.7) / 40.0).powi(2)).exp(),
                chatter_hz: 1.0,
                lobe: 0,
            })
        }
    }

    impl LimitAtAngle for Hill {
        fn visit(&self, angle_deg: f64, visit: &mut dyn FnMut(&dyn SpeedLimit)) -> bool {
            let usable = !(100.0..150.0).contains(&angle_deg);
            if usable {
                visit(&AtAngle(angle_deg));
            }
            usable
        }
    }

    /// A smooth surface of known optimum with a forbidden stretch. The margin of ±2 % takes exp(−(7.4/40)²) off the tip.
    #[test]
    fn enumeration_and_swarm_agree_on_a_known_surface() {
        let usable: Vec<f64> = (0..72)
            .map(|i| f64::from(i) * 5.0)
            .filter(|a| !(100.0..150.0).contains(a))
            .collect();
        let search = Search {
            surface: &Hill,
            usable_deg: &usable,
            step_deg: 5.0,
            rpm_range: [100.0, 900.0],
        };
        let places = [search.by_enumeration().unwrap(), search.by_swarm().unwrap()];
        assert!(difference(&places[0], &places[1]) < 1e-4, "{places:?}");
        let expected = 3.0 + (-(0.0198f64 * 371.7 / 40.0).powi(2)).exp();
        for p in places {
            assert!((p.depth_mm / expected - 1.0).abs() < 1e-3, "{p:?}");
            assert!(apart_deg(p.angle_deg, 213.3) < 0.5, "{p:?}");
            assert!((p.spindle_rpm - 371.7).abs() < 2.0, "{p:?}");
        }
    }

    /// A made-up robot whose modes turn and shift with the angle; some angles cannot be used.
    struct RandomRobot {
        /// Frequency Hz, its swing and phase; damping; stiffness N/m; direction rad, and how often it turns.
        modes: Vec<[f64; 7]>,
        forbidden_deg: [f64; 2],
    }

    impl RandomRobot {
        fn new(seed: u64) -> Self {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
            let from = between(0.0, 300.0);
            RandomRobot {
                modes: (0..6)
                    .map(|i| {
                        [
                            7.0 + 5.0 * f64::from(i) + between(-2.0, 2.0),
                            between(0.3, 1.5),
                            between(0.0, TAU),
                            between(0.008, 0.04),
                            between(0.5e6, 4e6),
                            between(0.0, TAU),
                            between(0.5, 2.5).round(),
                        ]
                    })
                    .collect(),
                forbidden_deg: [from, from + 50.0],
            }
        }
    }

    impl LimitAtAngle for RandomRobot {
        fn visit(&self, angle_deg: f64, visit: &mut dyn FnMut(&dyn SpeedLimit)) -> bool {
            let [from, to] = self.forbidden_deg;
            if (from..to).contains(&angle_deg) {
                return false;
            }
            let turn = angle_deg.to_radians();
            let modes = self
                .modes
                .iter()
                .map(|&[f, swing, phase, zeta, k, direction, turns]| {
                    let omega = TAU * (f + swing * (turn + phase).sin());
                    let (s, c) = (direction + turns * turn).sin_cos();
                    Mode {
                        omega_n_rad_per_s: omega,
                        damping_ratio: zeta,
                        shape: [c * omega / k.sqrt(), s * omega / k.sqrt()],
                    }
                });
            let frf = ModalFrf::from_mode_shapes(modes.collect(), [[0.0; 2]; 2]).unwrap();
            let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap();
            visit(&StabilitySolver::new(force, &frf));
            true
        }
    }

    /// Random surfaces of true lobes: both searches agree within [`AGREEMENT`], and no place of a dense grid (1°, 0.5 %)
    /// is deeper by more than that.
    #[test]
    fn enumeration_and_swarm_agree_on_random_robots() {
        for seed in 0..6 {
            let robot = RandomRobot::new(seed);
            let can_be_used = |a: &f64| robot.visit(*a, &mut |_| ());
            let step_deg = [5.0, 10.0, 15.0][seed as usize % 3];
            let usable: Vec<f64> = (0..(360.0 / step_deg) as i32)
                .map(|i| f64::from(i) * step_deg)
                .filter(can_be_used)
                .collect();
            let search = Search {
                surface: &robot,
                usable_deg: &usable,
                step_deg,
                rpm_range: [100.0, 1500.0],
            };
            let (first, second) = (search.by_enumeration().unwrap(), search.by_swarm().unwrap());
            assert!(agree(&first, &second), "seed {seed}: {first:?} {second:?}");
            let dense = (0..360)
                .into_par_iter()
                .filter_map(|a| {
                    let mut deepest = None;
                    robot.visit(f64::from(a), &mut |method| {
                        let grid = margins(method, 100.0, 546);
                        let inside = grid.iter().filter(|tip| tip.0 <= 1500.0);
                        deepest = inside.map(|tip| tip.1).reduce(f64::max);
                    });
                    deepest
                })
                .reduce(|| 0.0, f64::max);
            let found = first.depth_mm.min(second.depth_mm);
            assert!(found >= (1.0 - AGREEMENT) * dense, "seed {seed}: {found} {dense}");
        }
    }
}
