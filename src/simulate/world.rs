//! FRFs of a lab that departs from the model: true angles, true chain, true channels.
//!
//! Written apart from [`crate::identify::frfs::structure`], which cannot express most of this; without departures both must
//! agree to rounding.

use nalgebra::{DMatrix, DVector, Rotation3, Vector3};
use num_complex::Complex64;
use rayon::prelude::*;

use super::departure::{Departed, FrfChannel, Matrices, Scene};
use crate::campaign::Posture;
use crate::identify::FrfData;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfBlock;
use crate::ingest::Axis;
use crate::robot::{Chain, FrfBasis, Kinematics, ModalBasis, System};
use crate::{Error, Result};

/// A lab: what the model has, at true parameters, and what departs from it.
pub struct World<'a> {
    pub model: &'a StructureModel,
    /// Solver's scale.
    pub theta: &'a [f64],
    pub departed: &'a [Departed],
    /// As the campaign writes them.
    pub postures: &'a [Posture],
}

/// The dynamics of one posture, ready to give receptances between rows.
enum Dynamics {
    /// As the model computes it: nothing but elements, bodies and branches.
    Modal(Box<FrfBasis>),
    /// Matrices and rows as they stand, solved at each frequency.
    Direct {
        matrices: Matrices,
        /// Imaginary part of the stiffness.
        loss: DMatrix<f64>,
        rows: Vec<DVector<f64>>,
    },
}

impl World<'_> {
    /// Receptances, m/N, in the order of `data.frfs()`; only lines, points and axes of `data` are used.
    ///
    /// # Errors
    /// A stiffness matrix that is not positive definite.
    pub fn receptances(&self, data: &FrfData) -> Result<Vec<Vec<Complex64>>> {
        let mut first = 0;
        let numbered: Vec<(usize, &FrfBlock)> = data
            .blocks
            .iter()
            .map(|block| {
                let at = first;
                first += block.frfs.len();
                (at, block.as_ref())
            })
            .collect();
        let blocks: Vec<Vec<Vec<Complex64>>> = numbered
            .par_iter()
            .map(|(first, block)| self.block(*first, block))
            .collect::<Result<_>>()?;
        Ok(blocks.into_iter().flatten().collect())
    }

    /// `first`: index of the block's first FRF among all.
    fn block(&self, first: usize, block: &FrfBlock) -> Result<Vec<Vec<Complex64>>> {
        let robot = &self.model.robot;
        let mut joints_deg = self.postures[block.posture].joints_deg.clone();
        for d in self.departed {
            d.departure
                .turn_joints(d.strength, block.posture, &mut joints_deg);
        }
        let kinematics = robot.kinematics(&joints_deg)?;
        let mut chain = self.model.chain(self.theta, &kinematics, block.conditions, false);
        let scene = Scene {
            robot,
            kinematics: &kinematics,
            posture: block.posture,
            postures: self.postures.len(),
        };
        for d in self.departed {
            d.departure.change_chain(d.strength, &scene, &mut chain);
        }

        // Measured responses and hits, each once.
        let mut responses: Vec<(usize, Axis)> = block
            .frfs
            .iter()
            .map(|f| (f.response.point, f.response.axis))
            .collect();
        responses.sort_unstable();
        responses.dedup();
        let mut hits: Vec<(usize, Axis)> = block
            .frfs
            .iter()
            .map(|f| (f.reference.point, f.reference.axis))
            .collect();
        hits.sort_unstable();
        hits.dedup();
        let mut rows: Vec<DVector<f64>> = responses
            .iter()
            .map(|(point, axis)| self.response_row(&scene, &chain, *point, *axis))
            .collect();
        rows.extend(
            hits.iter()
                .map(|(point, axis)| self.hit_row(&scene, &chain, *point, *axis)),
        );

        let dynamics = self.dynamics(&scene, &chain, rows)?;
        let delay_s = self.model.filter(self.theta, false).delay_s.value;
        let place: Vec<(usize, usize)> = block
            .frfs
            .iter()
            .map(|f| {
                let find = |all: &[(usize, Axis)], what| all.iter().position(|x| *x == what).unwrap_or(0);
                let out = find(&responses, (f.response.point, f.response.axis));
                let into = find(&hits, (f.reference.point, f.reference.axis));
                (out, responses.len() + into)
            })
            .collect();
        let mut all = vec![Vec::with_capacity(block.frequency_hz.len()); block.frfs.len()];
        for frequency_hz in &block.frequency_hz {
            let omega = std::f64::consts::TAU * frequency_hz;
            let matrix = dynamics.between(omega, &place)?;
            for (k, (frf, h)) in block.frfs.iter().zip(matrix).enumerate() {
                let channel = FrfChannel {
                    frf: first + k,
                    posture: block.posture,
                    response: (frf.response.point, frf.response.axis),
                    reference: (frf.reference.point, frf.reference.axis),
                };
                let mut value = h;
                for d in self.departed {
                    value += d.departure.added_m_per_n(d.strength, *frequency_hz, &channel);
                }
                value *= Complex64::from_polar(frf.sign, -omega * delay_s);
                for d in self.departed {
                    value *= d.departure.factor(d.strength, *frequency_hz, &channel);
                }
                all[k].push(value);
            }
        }
        Ok(all)
    }

    fn row(&self, scene: &Scene, chain: &Chain, point: usize, direction: &Vector3<f64>) -> DVector<f64> {
        let written = &self.model.points[point];
        let mut point_there = written.clone();
        for d in self.departed {
            let offset = d.departure.point_offset_m(d.strength, point);
            for (x, by) in point_there.position_m.iter_mut().zip(offset.iter()) {
                *x += by;
            }
        }
        let (position, place) = scene.robot.locate(scene.kinematics, &point_there);
        let at_tool = written.body == crate::campaign::BodyRef::Tool;
        chain.output_row(position, place, at_tool, direction)
    }

    /// Direction, base axes, of a point's axis.
    fn axis(&self, kinematics: &Kinematics, point: usize, axis: Axis) -> Vector3<f64> {
        self.model
            .robot
            .direction(kinematics, &self.model.points[point], axis, false)
    }

    fn response_row(&self, scene: &Scene, chain: &Chain, point: usize, axis: Axis) -> DVector<f64> {
        let axes = Axis::ALL.map(|a| self.axis(scene.kinematics, point, a));
        // Channels show a mixture of the motions along the sensor's own axes, which the departures turn.
        let mixing = self.model.filter(self.theta, false).mixing;
        let turned = axes.map(|own| {
            self.departed.iter().fold(own, |v, d| {
                turn(d.departure.sensor_turn_deg(d.strength, scene.posture, point), v)
            })
        });
        let mut seen = Vector3::zeros();
        for (weight, along) in mixing[axis.index()].iter().zip(&turned) {
            seen += along * weight.value;
        }
        self.row(scene, chain, point, &seen)
    }

    fn hit_row(&self, scene: &Scene, chain: &Chain, point: usize, axis: Axis) -> DVector<f64> {
        let own = self.axis(scene.kinematics, point, axis);
        let along = self.departed.iter().fold(own, |v, d| {
            turn(d.departure.hit_turn_deg(d.strength, scene.posture, axis), v)
        });
        self.row(scene, chain, point, &along)
    }

    fn dynamics(&self, scene: &Scene, chain: &Chain, rows: Vec<DVector<f64>>) -> Result<Dynamics> {
        let system = chain.system(0);
        let before = matrices(&system)?;
        let mut matrices = Matrices {
            mass: before.mass.clone(),
            damping: before.damping.clone(),
            stiffness: before.stiffness.clone(),
        };
        let mut loss = DMatrix::zeros(system.stiffness.nrows(), system.stiffness.nrows());
        for d in self.departed {
            d.departure
                .change_matrices(d.strength, scene, chain, &mut matrices);
            let mut corner = 0;
            for element in &chain.elements {
                let size = element.directions.len();
                let factor = d.departure.loss_factor(d.strength, element);
                let mut view = loss.view_mut((corner, corner), (size, size));
                view += &element.shape * (factor * element.stiffness.value);
                corner += size;
            }
        }
        let as_modelled = loss.amax() == 0.0
            && matrices.mass == before.mass
            && matrices.damping == before.damping
            && matrices.stiffness == before.stiffness;
        Ok(match as_modelled {
            true => Dynamics::Modal(Box::new(FrfBasis::new(&system, &rows)?)),
            false => Dynamics::Direct { matrices, loss, rows },
        })
    }
}

/// A direction turned by a rotation vector in degrees, base axes.
fn turn(rotation_deg: Vector3<f64>, direction: Vector3<f64>) -> Vector3<f64> {
    Rotation3::from_scaled_axis(rotation_deg * 1f64.to_radians()) * direction
}

/// Mass, stiffness and damping of all coordinates, modal damping written out: C = K X diag(2ζ√μ) Xᵀ K of the chain.
fn matrices(system: &System) -> Result<Matrices> {
    let (n, chain) = (system.stiffness.nrows(), system.chain_count);
    let own = system.stiffness.view((0, 0), (chain, chain)).into_owned();
    let modes = ModalBasis::new(&own, &system.chain_mass)?;
    let forces = &own * &modes.shapes;
    let ratio = 2.0 * system.modal_damping_ratio.value;
    let damping_of = DVector::from_iterator(chain, modes.inverse_omega2.iter().map(|mu| ratio * mu.sqrt()));
    let modal = &forces * DMatrix::from_diagonal(&damping_of) * forces.transpose();
    let mut damping = system.viscous.clone().unwrap_or_else(|| DMatrix::zeros(n, n));
    let mut view = damping.view_mut((0, 0), (chain, chain));
    view += modal;
    Ok(Matrices {
        mass: system.mass.clone(),
        damping,
        stiffness: system.stiffness.clone(),
    })
}

impl Dynamics {
    /// Receptances, m/N, between pairs of rows (response, hit).
    fn between(&self, omega: f64, pairs: &[(usize, usize)]) -> Result<Vec<Complex64>> {
        match self {
            Dynamics::Modal(basis) => {
                let response = basis.solve(omega)?;
                let pairs = pairs.iter();
                Ok(pairs
                    .map(|(out, into)| basis.receptance(&response, *out, *into))
                    .collect())
            }
            Dynamics::Direct { matrices, loss, rows } => {
                let n = loss.nrows();
                let dynamic = DMatrix::from_fn(n, n, |i, j| {
                    let real = matrices.stiffness[(i, j)] - omega * omega * matrices.mass[(i, j)];
                    Complex64::new(real, omega * matrices.damping[(i, j)] + loss[(i, j)])
                });
                let mut inputs: Vec<usize> = pairs.iter().map(|(_, into)| *into).collect();
                inputs.sort_unstable();
                inputs.dedup();
                let forces = DMatrix::from_fn(n, inputs.len(), |i, j| Complex64::from(rows[inputs[j]][i]));
                let moved = dynamic
                    .lu()
                    .solve(&forces)
                    .ok_or_else(|| Error::computation("the simulated structure is singular"))?;
                Ok(pairs
                    .iter()
                    .map(|(out, into)| {
                        let column = inputs.iter().position(|i| i == into).unwrap_or(0);
                        rows[*out]
                            .iter()
                            .zip(moved.column(column).iter())
                            .map(|(r, u)| u * *r)
                            .sum()
                    })
                    .collect())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{AxesRef, BodyRef, MeasuredDof, MeasuredFrf, Point, RobotSection};
    use crate::effects::Registry;
    use crate::robot::RobotModel;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::simulate::Slip;
    use crate::simulate::departure::{self, LabDeparture};
    use crate::simulate::laboratory::Laboratory;

    fn postures() -> Vec<Posture> {
        let two = TAP_POSTURES[..2].iter().enumerate();
        two.map(|(i, q)| Posture {
            id: format!("p{i}"),
            joints_deg: q.to_vec(),
        })
        .collect()
    }

    fn model(effect: Option<&str>) -> StructureModel {
        let section = RobotSection {
            model: "irb6640".into(),
            mass_tolerance: None,
            stiffness_tolerance: 0.3,
            links: Default::default(),
        };
        let point = |node, body| Point {
            node,
            body,
            position_m: [0.0; 3],
            axes: AxesRef::Base,
        };
        let points = vec![point(1, BodyRef::Tool), point(2, BodyRef::Link(3))];
        let bare = StructureModel::new(RobotModel::new(irb6640()), points, &section);
        match effect {
            Some(name) => {
                let instance = Registry::structure().find(&bare.robot.spec, name)[0];
                bare.with_effect(instance, &bare.known(&data(&bare, &postures()).summary()))
            }
            None => bare,
        }
    }

    /// Three axes of both points, hit along x and y of the tool; one response the other way round.
    fn data(model: &StructureModel, postures: &[Posture]) -> FrfData {
        let dof = |point, axis, negative| MeasuredDof {
            point,
            axis,
            negative,
        };
        let mut frfs = Vec::new();
        for posture in 0..postures.len() {
            for (point, axis) in [0, 1].into_iter().flat_map(|p| Axis::ALL.map(|a| (p, a))) {
                for into in [Axis::X, Axis::Y] {
                    frfs.push(MeasuredFrf {
                        posture,
                        response: dof(point, axis, point == 1 && axis == Axis::Y),
                        reference: dof(0, into, false),
                        name: String::new(),
                        frequency_hz: vec![4.0, 7.5, 13.0, 22.0, 40.0, 80.0],
                        receptance_m_per_n: Vec::new(),
                        coherence: None,
                        force_level_n: None,
                        file: Default::default(),
                    });
                }
            }
        }
        FrfData::arrange(postures, &model.robot, frfs).unwrap()
    }

    fn world(model: &StructureModel, departed: &[Departed]) -> Vec<Vec<Complex64>> {
        let postures = postures();
        let world = World {
            model,
            theta: &model.nominal_theta(),
            departed,
            postures: &postures,
        };
        world.receptances(&data(model, &postures)).unwrap()
    }

    fn departed(id: &str, strength: f64) -> Departed {
        Departed {
            departure: departure::drawn(id, &irb6640(), 3).unwrap(),
            strength,
        }
    }

    /// Largest difference over the size of the FRF that it is in.
    fn difference(a: &[Vec<Complex64>], b: &[Vec<Complex64>]) -> f64 {
        let size = |h: &[Complex64]| h.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt();
        let of = |(a, b): (&Vec<Complex64>, &Vec<Complex64>)| {
            let off: Vec<Complex64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
            size(&off) / size(b)
        };
        a.iter().zip(b).map(of).fold(0.0, f64::max)
    }

    /// Root of all squared differences over that of all squares.
    fn overall(a: &[Vec<Complex64>], b: &[Vec<Complex64>]) -> f64 {
        let pairs = || a.iter().flatten().zip(b.iter().flatten());
        let off: f64 = pairs().map(|(a, b)| (a - b).norm_sqr()).sum();
        let size: f64 = pairs().map(|(_, b)| b.norm_sqr()).sum();
        (off / size).sqrt()
    }

    const EFFECTS: [Option<&str>; 6] = [
        None,
        Some("sensor-misalignment"),
        Some("time-delay"),
        Some("tool-flexibility"),
        Some("joint-damping"),
        Some("base-compliance"),
    ];

    /// Two programs for one thing: nothing departs, by the model's own basis and by the matrices as they stand.
    #[test]
    fn without_departures_the_model_is_met() {
        for effect in EFFECTS {
            let model = model(effect);
            let predicted = model
                .predict(&model.nominal_theta(), &data(&model, &postures()))
                .unwrap();
            let off = difference(&world(&model, &[]), &predicted);
            assert!(off < 1e-10, "{effect:?} {off}");
            // A spring too soft to matter sends it the other way.
            let direct = world(&model, &[departed("clamp-to-table", 1e-12)]);
            let off = difference(&direct, &predicted);
            assert!(off > 0.0 && off < 1e-8, "{effect:?} {off}");
        }
    }

    /// Every departure vanishes with its strength, the faint change growing in proportion to it.
    #[test]
    fn departures_vanish_with_their_strength() {
        let model = model(None);
        let bare = world(&model, &[]);
        for id in departure::ids() {
            let at = |strength| difference(&world(&model, &[departed(id, strength)]), &bare);
            let (small, large) = (at(1e-5), at(1e-4));
            assert!(
                small > 0.0 && (large / small - 10.0).abs() < 0.2,
                "{id}: {small} {large}"
            );
            assert!(at(1.0) > 1e-3, "{id}: {}", at(1.0));
        }
    }

    /// A wrong encoder is a right model at other angles.
    #[test]
    fn an_encoder_offset_is_another_posture() {
        let model = model(None);
        let one = departed("encoder-offset", 0.7);
        let mut true_postures = postures();
        for posture in &mut true_postures {
            one.departure.turn_joints(0.7, 0, &mut posture.joints_deg);
        }
        let there = data(&model, &true_postures);
        let expected = model.predict(&model.nominal_theta(), &there).unwrap();
        assert!(difference(&world(&model, &[one]), &expected) < 1e-10);
    }

    /// Each slip does something by itself, of the size of a per cent, and the truth file tells it.
    #[cfg(feature = "cli")]
    #[test]
    fn slips_are_small_and_told() {
        let model = model(None);
        let bare = world(&model, &[]);
        let arranged = data(&model, &postures());
        let all = <Slip as clap::ValueEnum>::value_variants();
        for slip in all {
            let laboratory = Laboratory::draw(4, &[*slip], &arranged, 6, 2);
            assert_eq!(laboratory.described(1.0).len(), 1);
            let one = Departed {
                departure: Box::new(laboratory),
                strength: 1.0,
            };
            let off = overall(&world(&model, &[one]), &bare);
            match slip {
                // In the noise, not in the FRFs.
                Slip::Lines => assert_eq!(off, 0.0),
                _ => assert!((1e-4..0.1).contains(&off), "{slip:?} {off}"),
            }
        }
        let everything = Laboratory::draw(4, all, &arranged, 6, 2);
        assert_eq!(everything.described(1.0).len(), all.len());
        // Switching others off leaves a slip as it was.
        let alone = Laboratory::draw(4, &[Slip::Encoders], &arranged, 6, 2);
        assert_eq!(
            everything.described(1.0)["encoders"],
            alone.described(1.0)["encoders"]
        );
    }
}
