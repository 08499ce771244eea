//! What a laboratory could measure next: other points, other hits, the same again, harder hits, another posture.

use serde::Serialize;

use crate::Result;
use crate::data::{AxesRef, Axis, BodyRef, MeasuredDof, Point, Posture};
use crate::discrepancy::outlook::noise_outlook;
use crate::discrepancy::outlook::prospect::Prospect;
use crate::identify::frfs::frf_data::{FrfBlock, FrfDatum};
use crate::identify::{FrfData, StructureModel};
use crate::robot::{JointSpec, Kinematics, RobotModel};
use crate::signal::noise_law::FrfNoise;

/// Lines of a posture that are looked at, at most: each then stands for its neighbours.
const MOST_LINES: usize = 150;
/// Postures near which new ones are proposed.
const NEAR: usize = 3;
/// How far one joint is turned for a new posture, degrees.
const TURN_DEG: f64 = 20.0;
/// Share of the arm's length that the tool keeps from the base axis.
const LEAST_REACH: f64 = 0.2;

/// Effort on top of the FRFs themselves, in units of one FRF (some ten hits with everything in place): glueing a sensor to a
/// new place, driving back to a posture, setting up at a new one, changing the hammer's mass and tip.
const NEW_PLACE: f64 = 2.0;
const DRIVE_BACK: f64 = 2.0;
const NEW_POSTURE: f64 = 4.0;
const NEW_LEVEL: f64 = 1.0;

/// A posture and hammer level at which one could measure, with every FRF that could be taken there.
#[derive(Debug, Clone)]
pub struct Stand {
    /// Index into the campaign's postures; `None` for a new one.
    pub posture: Option<usize>,
    /// In words: `posture p2`.
    pub name: String,
    /// Joint angles, degrees.
    pub joints_deg: Vec<f64>,
    /// All FRFs that could be taken, on the lines looked at; without values.
    pub block: FrfBlock,
    /// Noise that they would have.
    pub noise: FrfNoise,
    /// Measured lines for each line looked at.
    pub lines_each: f64,
    /// Which of them are there already.
    pub present: Vec<bool>,
    /// Hammer force against the present one.
    pub harder: f64,
}

/// One FRF of a stand, measured `times` times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasurementPart {
    /// Index among the [`Lab`]'s stands.
    pub stand: usize,
    /// Index among the stand's FRFs.
    pub frf: usize,
    /// How often it is measured.
    pub times: f64,
}

/// Something that could be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// In words, beginning with `measure`.
    pub what: String,
    /// Effort in units of one FRF with everything in place.
    pub cost: f64,
    /// The FRFs that it consists of.
    pub parts: Vec<MeasurementPart>,
}

/// FRFs of a [`Measurement`] taken at one posture, for a program.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Setup {
    /// `null`: a new posture.
    pub posture: Option<String>,
    /// Joint angles, degrees.
    pub joints_deg: Vec<f64>,
    /// `2X/1Y`: response / hit.
    pub frfs: Vec<String>,
    /// How often each is measured.
    pub times: f64,
    /// Hammer force against the present one.
    pub harder: f64,
}

/// A point that the campaign does not have yet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NewPoint {
    /// Node number that is still free.
    pub node: i64,
    /// The body that it sits on: `link3`, `tool`.
    pub body: String,
    /// In the frame of that body, m.
    pub position_m: [f64; 3],
}

/// All that could be measured on a robot.
#[derive(Debug, Clone)]
pub struct Lab {
    /// The campaign's points, then the far ends of links that have none.
    pub points: Vec<Point>,
    /// How many of them are the campaign's own.
    own_points: usize,
    /// Postures and hammer levels at which one could measure.
    pub stands: Vec<Stand>,
    /// What could be measured there.
    pub measurements: Vec<Measurement>,
}

impl Lab {
    /// `data`: what is measured (or planned) already, with its noise.
    ///
    /// # Errors
    /// A posture that does not fit the robot.
    pub fn new(robot: &RobotModel, points: &[Point], postures: &[Posture], data: &FrfData) -> Result<Self> {
        let mut lab = Lab {
            points: with_link_ends(robot, points),
            own_points: points.len(),
            stands: Vec::new(),
            measurements: Vec::new(),
        };
        let noise = noise_outlook::of_measured(data);
        let hit_point = most_used_hit(data);
        let mut seen: Vec<usize> = Vec::new();
        for block in &data.blocks {
            // Of several levels the hardest hits: the least noise.
            let lowest = |b: &&std::sync::Arc<FrfBlock>| {
                b.posture == block.posture && b.conditions.level_fraction < block.conditions.level_fraction
            };
            if seen.contains(&block.posture) || data.blocks.iter().any(|b| lowest(&b)) {
                continue;
            }
            seen.push(block.posture);
            let posture = &postures[block.posture];
            let stand = Stand {
                posture: Some(block.posture),
                name: format!("posture {}", posture.id),
                joints_deg: posture.joints_deg.clone(),
                ..lab.stand(block, hit_point, noise, data)
            };
            lab.stands.push(stand);
        }
        let present = lab.stands.len();
        for i in 0..present {
            let harder = Stand {
                noise: FrfNoise {
                    floor: 0.5 * noise.floor,
                    ..noise
                },
                harder: 2.0,
                ..lab.stands[i].clone()
            };
            lab.stands.push(harder);
        }
        lab.add_new_postures(robot, present)?;
        lab.list_measurements(present);
        Ok(lab)
    }

    /// Everything that could be measured where `like` was.
    fn stand(&self, like: &FrfBlock, hit_point: usize, noise: FrfNoise, data: &FrfData) -> Stand {
        let dof = |point, axis| MeasuredDof {
            point,
            axis,
            negative: false,
        };
        let stride = like.frequency_hz.len().div_ceil(MOST_LINES).max(1);
        let frequency_hz: Vec<f64> = like.frequency_hz.iter().copied().step_by(stride).collect();
        let outputs: Vec<(usize, Axis)> = (0..self.points.len())
            .flat_map(|p| Axis::ALL.map(|a| (p, a)))
            .collect();
        let mut frfs = Vec::new();
        for point in 0..self.points.len() {
            for hit in Axis::ALL {
                for axis in Axis::ALL {
                    frfs.push(FrfDatum {
                        name: format!(
                            "{}{}/{}{}",
                            self.points[point].node,
                            axis.letter(),
                            self.points[hit_point].node,
                            hit.letter()
                        ),
                        posture: like.posture,
                        response: dof(point, axis),
                        reference: dof(hit_point, hit),
                        response_outputs: [3 * point, 3 * point + 1, 3 * point + 2],
                        input: 3 * hit_point + hit.index(),
                        sign: 1.0,
                        receptance: Vec::new(),
                        noise_std: Vec::new(),
                    });
                }
            }
        }
        let same = |a: &MeasuredDof, b: &MeasuredDof| a.point == b.point && a.axis == b.axis;
        let is_present = |frf: &FrfDatum| {
            data.frfs().any(|(_, there)| {
                let direct = same(&there.response, &frf.response) && same(&there.reference, &frf.reference);
                // The reciprocal FRF says the same.
                let swapped = same(&there.response, &frf.reference) && same(&there.reference, &frf.response);
                there.posture == like.posture && (direct || swapped)
            })
        };
        let present = frfs.iter().map(is_present).collect();
        Stand {
            posture: None,
            name: String::new(),
            joints_deg: Vec::new(),
            lines_each: like.frequency_hz.len() as f64 / frequency_hz.len().max(1) as f64,
            block: FrfBlock {
                posture: like.posture,
                force_level_n: None,
                conditions: like.conditions,
                kinematics: like.kinematics.clone(),
                frequency_hz,
                outputs,
                frfs,
            },
            noise,
            present,
            harder: 1.0,
        }
    }

    /// Measured postures with one joint turned, where that keeps to the joint limits and the tool above the floor. Joint 1
    /// only turns the whole, the last joint hardly anything.
    fn add_new_postures(&mut self, robot: &RobotModel, present: usize) -> Result<()> {
        let joints = robot.joint_count();
        let lowest_tool = self.stands[..present]
            .iter()
            .map(|s| s.block.kinematics.tcp().z)
            .fold(0.0, f64::min);
        for near in 0..present.min(NEAR) {
            for joint in 1..joints.saturating_sub(1) {
                for turn in [-TURN_DEG, TURN_DEG] {
                    let from = &self.stands[near];
                    let mut joints_deg = from.joints_deg.clone();
                    joints_deg[joint] = (10.0 * (joints_deg[joint] + turn)).round() / 10.0;
                    let kinematics = robot.kinematics(&joints_deg)?;
                    if !reachable(robot, &joints_deg, &kinematics, lowest_tool) {
                        continue;
                    }
                    let stand = Stand {
                        posture: None,
                        name: format!(
                            "a new posture ({} with joint {} at {}° instead of {}°)",
                            from.name.trim_start_matches("posture "),
                            joint + 1,
                            joints_deg[joint],
                            from.joints_deg[joint]
                        ),
                        joints_deg,
                        block: FrfBlock {
                            kinematics,
                            ..from.block.clone()
                        },
                        ..from.clone()
                    };
                    self.stands.push(stand);
                }
            }
        }
        Ok(())
    }

    /// `present`: stands of measured postures; after them as many with harder hits; then new postures.
    fn list_measurements(&mut self, present: usize) {
        let mut all = Vec::new();
        let everywhere: Vec<usize> = (0..present).collect();
        for point in 0..self.points.len() {
            let place = self.place(point);
            for hits in [&Axis::ALL[..1], &Axis::ALL[1..2], &Axis::ALL[2..], &Axis::ALL] {
                let hit = self.hit_words(hits);
                let what = format!("{place} in X, Y and Z, hitting {hit}");
                for stand in 0..present {
                    all.extend(self.missing(&what, &[stand], point, &Axis::ALL, hits));
                    if let [only] = hits {
                        all.extend(Axis::ALL.iter().filter_map(|axis| {
                            let what = format!("{place} in {}, hitting {hit}", axis.letter());
                            self.missing(&what, &[stand], point, &[*axis], &[*only])
                        }));
                    }
                }
                if present > 1 {
                    all.extend(self.missing(&what, &everywhere, point, &Axis::ALL, hits));
                }
            }
        }
        all.extend((0..present).flat_map(|stand| self.again(&[stand], stand..stand + 1)));
        if present > 1 {
            all.extend(self.again(&everywhere, 0..present));
        }
        all.push(self.harder(present));
        for stand in 2 * present..self.stands.len() {
            all.extend(self.at_new_posture(stand));
        }
        all.retain(|m| !m.parts.is_empty());
        self.measurements = all;
    }

    fn parts(
        &self,
        stand: usize,
        times: f64,
        wanted: impl Fn(&FrfDatum, bool) -> bool,
    ) -> Vec<MeasurementPart> {
        let Stand { block, present, .. } = &self.stands[stand];
        let chosen = block.frfs.iter().zip(present).enumerate();
        chosen
            .filter(|(_, (frf, there))| wanted(frf, **there))
            .map(|(frf, _)| MeasurementPart { stand, frf, times })
            .collect()
    }

    /// FRFs of a point that are not there yet; `None` where all are.
    fn missing(
        &self,
        what: &str,
        stands: &[usize],
        point: usize,
        axes: &[Axis],
        hits: &[Axis],
    ) -> Option<Measurement> {
        let wanted = |frf: &FrfDatum, there: bool| {
            !there
                && frf.response.point == point
                && axes.contains(&frf.response.axis)
                && hits.contains(&frf.reference.axis)
        };
        let parts: Vec<Vec<MeasurementPart>> = stands.iter().map(|s| self.parts(*s, 1.0, wanted)).collect();
        if parts.iter().any(Vec::is_empty) {
            return None;
        }
        let new_place = match self.is_used(point) {
            true => 0.0,
            false => NEW_PLACE,
        };
        let parts: Vec<MeasurementPart> = parts.into_iter().flatten().collect();
        let at = match stands {
            [one] => format!("at {}", self.stands[*one].name),
            _ => "at every posture".into(),
        };
        Some(Measurement {
            what: format!("measure {what}, {at}"),
            cost: parts.len() as f64 + stands.len() as f64 * (DRIVE_BACK + new_place),
            parts,
        })
    }

    fn again(&self, stands: &[usize], names: std::ops::Range<usize>) -> Vec<Measurement> {
        let at = match names.len() {
            1 => format!("at {}", self.stands[names.start].name),
            _ => "at every posture".into(),
        };
        [(1.0, "once more"), (3.0, "three times more")]
            .map(|(times, words)| {
                let parts: Vec<MeasurementPart> = stands
                    .iter()
                    .flat_map(|s| self.parts(*s, times, |_, there| there))
                    .collect();
                Measurement {
                    what: format!("measure the same FRFs {words} {at}"),
                    cost: times * parts.len() as f64 + stands.len() as f64 * DRIVE_BACK,
                    parts,
                }
            })
            .to_vec()
    }

    fn harder(&self, present: usize) -> Measurement {
        let parts: Vec<MeasurementPart> = (present..2 * present)
            .flat_map(|s| self.parts(s, 1.0, |_, there| there))
            .collect();
        Measurement {
            what: "measure the same FRFs at every posture, hitting twice as hard".into(),
            cost: parts.len() as f64 + present as f64 * DRIVE_BACK + NEW_LEVEL,
            parts,
        }
    }

    fn at_new_posture(&self, stand: usize) -> Vec<Measurement> {
        let name = &self.stands[stand].name;
        let measurement = |words: String, parts: Vec<MeasurementPart>| Measurement {
            what: format!("measure {words} at {name}"),
            cost: parts.len() as f64 + NEW_POSTURE,
            parts,
        };
        let hit = self.stands[stand]
            .block
            .frfs
            .first()
            .map_or(0, |f| f.reference.point);
        let full = self.parts(stand, 1.0, |frf, _| frf.response.point == hit);
        vec![
            measurement(
                "the FRFs of the other postures".into(),
                self.parts(stand, 1.0, |_, there| there),
            ),
            measurement(
                format!("{} in X, Y and Z, hitting it in X, Y and Z,", self.place(hit)),
                full,
            ),
        ]
    }

    /// Whether a sensor or the hammer was at a point.
    fn is_used(&self, point: usize) -> bool {
        self.stands.iter().any(|stand| {
            let frfs = stand.block.frfs.iter().zip(&stand.present);
            frfs.into_iter()
                .any(|(frf, there)| *there && frf.response.point == point)
        })
    }

    /// `node 2 (link 3)`, or `the far end of link 3` where there is no node yet.
    fn place(&self, point: usize) -> String {
        let Point { node, body, .. } = self.points[point];
        match body {
            BodyRef::Tool if point >= self.own_points => "the tool point".into(),
            BodyRef::Link(i) if point >= self.own_points => format!("the far end of link {i}"),
            body => format!("node {node} ({})", body_words(body)),
        }
    }

    fn hit_words(&self, hits: &[Axis]) -> String {
        let stand = self.stands.first().and_then(|s| s.block.frfs.first());
        let point = stand.map_or(0, |f| f.reference.point);
        let axes: Vec<String> = hits.iter().map(|a| a.letter().to_string()).collect();
        let axes = match axes.as_slice() {
            [one] => one.clone(),
            [most @ .., last] => format!("{} and {last}", most.join(", ")),
            [] => String::new(),
        };
        format!("{} in {axes}", self.place(point))
    }

    /// The model with the points of the lab.
    pub fn with_points(&self, model: &StructureModel) -> StructureModel {
        model.with_fixed(|fixed| fixed.points.clone_from(&self.points))
    }

    /// What each FRF of each stand would say against `rival`, were `truth` true: `[stand][frf]`. Both are a model and its
    /// parameters (solver's scale).
    ///
    /// # Errors
    /// A model that has no response.
    pub fn prospects(
        &self,
        truth: (&StructureModel, &[f64]),
        rival: (&StructureModel, &[f64]),
    ) -> Result<Vec<Vec<Prospect>>> {
        use rayon::prelude::*;
        let (truth, rival) = (
            (self.with_points(truth.0), truth.1),
            (self.with_points(rival.0), rival.1),
        );
        self.stands
            .par_iter()
            .map(|stand| {
                let true_frfs = truth.0.predict_block(truth.1, &stand.block)?;
                let models = rival.0.predict_with_slopes(rival.1, &stand.block)?;
                let each = true_frfs.iter().zip(&models);
                Ok(each
                    .map(|(h, model)| {
                        let lines = stand.block.frequency_hz.iter().zip(h);
                        let std: Vec<f64> = lines
                            .map(|(f, h)| stand.noise.std(*f, h.norm()).max(f64::MIN_POSITIVE))
                            .collect();
                        Prospect::of_frf(h, &std, model, stand.lines_each)
                    })
                    .collect())
            })
            .collect()
    }

    /// For a program: what is measured where.
    pub fn setups(&self, measurement: &Measurement, postures: &[Posture]) -> Vec<Setup> {
        let mut setups: Vec<(usize, Setup)> = Vec::new();
        for part in &measurement.parts {
            let stand = &self.stands[part.stand];
            let at = setups
                .iter()
                .position(|(s, _)| *s == part.stand)
                .unwrap_or_else(|| {
                    let setup = Setup {
                        posture: stand.posture.map(|p| postures[p].id.clone()),
                        joints_deg: stand.joints_deg.clone(),
                        frfs: Vec::new(),
                        times: part.times,
                        harder: stand.harder,
                    };
                    setups.push((part.stand, setup));
                    setups.len() - 1
                });
            setups[at].1.frfs.push(stand.block.frfs[part.frf].name.clone());
        }
        setups.into_iter().map(|(_, setup)| setup).collect()
    }

    /// Points of a measurement that campaign.toml does not have yet.
    pub fn new_points(&self, measurement: &Measurement) -> Vec<NewPoint> {
        let mut used: Vec<usize> = measurement
            .parts
            .iter()
            .flat_map(|p| {
                let frf = &self.stands[p.stand].block.frfs[p.frf];
                [frf.response.point, frf.reference.point]
            })
            .filter(|p| *p >= self.own_points)
            .collect();
        used.sort_unstable();
        used.dedup();
        used.into_iter()
            .map(|p| {
                let Point {
                    node,
                    body,
                    position_m,
                    ..
                } = self.points[p];
                NewPoint {
                    node,
                    body: body_words(body).replace(' ', ""),
                    position_m,
                }
            })
            .collect()
    }
}

impl Measurement {
    /// What it would say, from the table of [`Lab::prospects`].
    pub fn prospect(&self, table: &[Vec<Prospect>], parameters: usize) -> Prospect {
        let mut sum = Prospect::nothing(parameters);
        for part in &self.parts {
            sum.add(&table[part.stand][part.frf].repeated(part.times));
        }
        sum
    }
}

/// `link 3`, `tool`, `base`.
fn body_words(body: BodyRef) -> String {
    match body {
        BodyRef::Base => "base".into(),
        BodyRef::Link(i) => format!("link {i}"),
        BodyRef::Tool => "tool".into(),
    }
}

/// The points, then the tool point and the far ends of links that have no point; base axes.
fn with_link_ends(robot: &RobotModel, points: &[Point]) -> Vec<Point> {
    let mut all = points.to_vec();
    let links = (1..robot.joint_count()).map(BodyRef::Link);
    for body in std::iter::once(BodyRef::Tool).chain(links) {
        if !all.iter().any(|p| p.body == body) {
            all.push(Point {
                node: all.iter().map(|p| p.node).max().unwrap_or(0) + 1,
                body,
                position_m: [0.0; 3],
                axes: AxesRef::Base,
            });
        }
    }
    all
}

/// The point that was hit most: with a roving hammer any of them, which reciprocity makes good.
fn most_used_hit(data: &FrfData) -> usize {
    let mut counts: Vec<(usize, usize)> = Vec::new();
    for (_, frf) in data.frfs() {
        match counts.iter_mut().find(|(p, _)| *p == frf.reference.point) {
            Some((_, n)) => *n += 1,
            None => counts.push((frf.reference.point, 1)),
        }
    }
    let most = counts.iter().map(|(_, n)| *n).max().unwrap_or(0);
    counts.iter().find(|(_, n)| *n == most).map_or(0, |(p, _)| *p)
}

fn reachable(robot: &RobotModel, joints_deg: &[f64], kinematics: &Kinematics, lowest_tool_m: f64) -> bool {
    let joints = robot.spec.joints.iter().zip(joints_deg);
    let within = joints.into_iter().all(|(joint, q)| {
        let limits = joint.limits_rad.map(|l| l.map(f64::to_degrees));
        limits.is_none_or(|[low, high]| (low..=high).contains(q))
    });
    let tool = kinematics.tcp();
    let length: f64 = robot.spec.joints.iter().map(JointSpec::length_m).sum();
    within && tool.z >= lowest_tool_m - 1e-9 && tool.x.hypot(tool.y) >= LEAST_REACH * length
}
