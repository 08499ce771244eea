//! The structural model as a function of its parameters.

use std::borrow::Cow;

use nalgebra::DVector;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::data::{Point, RobotSection};
use crate::effects::{
    ChannelFilter, Conditions, DataSummary, Known, LINK_FLEXIBILITY, PostureSetting, Structure,
};
use crate::identify::frfs::channels::Channels;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData};
use crate::identify::model::{AddedEffect, Model, Modelled};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::frf::RowSlopes;
use crate::robot::model::NOMINAL_DAMPING_RATIO;
use crate::robot::{Baseline, Chain, Dual, FileNumber, FrfBasis, Kinematics, RobotModel, System};
use crate::{Result, stop};

/// Robot, measurement points and the list of what may be tuned.
pub type StructureModel = Model<Structure>;

/// What of a structural model is not tuned, and which parameter each of the robot file's numbers is that are.
#[derive(Debug, Clone)]
pub struct StructureParts {
    /// As the robot file has it.
    pub robot: RobotModel,
    /// Where FRFs were measured; FRFs name them by index.
    pub points: Vec<Point>,
    /// For each link, which parameter its mass is, where it is tuned.
    masses: Vec<Option<usize>>,
    /// Further numbers of the robot file that are tuned, in the order of their parameters, and the first of those.
    file_numbers: Vec<FileNumber>,
    first_file_number: usize,
}

impl Modelled for Structure {
    type Fixed = StructureParts;
    type Data = FrfData;
}

/// The groups of the robot file's numbers that a section frees, each with the standard deviation of its parameters on the
/// solver's scale.
fn file_numbers_of(robot: &RobotModel, section: &RobotSection) -> Vec<(Vec<FileNumber>, f64)> {
    let (spec, links) = (&robot.spec, &section.links);
    let groups = [
        (FileNumber::inertias(spec), links.inertia),
        (FileNumber::centres(spec), links.centre_m),
        (FileNumber::lengths(spec), links.length_m),
        (FileNumber::walls(spec), links.wall),
    ];
    let free = groups
        .into_iter()
        .filter_map(|(of, tolerance)| Some((of, tolerance?)));
    free.collect()
}

/// Times its tolerance that a coordinate or length may be off.
const FARTHEST: f64 = 6.0;
/// Factors that moments of inertia may be off by, and walls.
const INERTIA_FACTOR: f64 = 10.0;
const WALL_FACTOR: f64 = 4.0;

fn file_parameter(robot: &RobotModel, number: FileNumber, tolerance: f64) -> Parameter {
    let nominal = number.of(robot);
    let (scale, bounds) = match number {
        FileNumber::Inertia { .. } => (
            Scale::Logarithmic,
            [nominal / INERTIA_FACTOR, nominal * INERTIA_FACTOR],
        ),
        FileNumber::Wall { link } => {
            let section = robot.spec.links[link - 1].section;
            let thickest = section
                .and_then(|s| s.shape.thickest_wall_m())
                .unwrap_or(f64::INFINITY);
            // A solid bar has no thicker wall.
            let most = (nominal * WALL_FACTOR).min(0.998 * thickest);
            (Scale::Logarithmic, [nominal / WALL_FACTOR, most.max(nominal)])
        }
        _ => (
            Scale::Linear,
            [nominal - FARTHEST * tolerance, nominal + FARTHEST * tolerance],
        ),
    };
    let mut parameter = Parameter {
        name: number.name(),
        unit: number.unit(),
        scale,
        nominal,
        prior: None,
        bounds,
    };
    parameter.prior = Some(Prior {
        mean: parameter.internal(nominal),
        std: tolerance,
    });
    parameter
}

/// Standard deviation of the logarithm of the damping ratio about its nominal 3 %: robots show 1–6 %.
const DAMPING_LOG_STD: f64 = 0.7;
/// A stiffness further than this factor from the robot file's value is no tolerance but a mistake in the file.
const STIFFNESS_FACTOR: f64 = 100.0;

impl StructureModel {
    /// The baseline for a robot: `section` says which of its numbers are how exact.
    pub fn new(robot: RobotModel, points: Vec<Point>, section: &RobotSection) -> Self {
        Self::freeing(robot, points, section, |_| true)
    }

    /// As [`new`](Self::new), where of the link parameters that `section` frees only those are that `kept` says of by name.
    pub fn freeing(
        robot: RobotModel,
        points: Vec<Point>,
        section: &RobotSection,
        kept: impl Fn(&str) -> bool,
    ) -> Self {
        let mut parameters = Vec::new();
        for (i, joint) in robot.spec.joints.iter().enumerate() {
            let nominal = 1.0 / joint.compliance_rad_per_nm;
            parameters.push(Parameter::logarithmic(
                format!("joint-{}.stiffness", i + 1),
                "N·m/rad",
                nominal,
                section.stiffness_tolerance,
                [nominal / STIFFNESS_FACTOR, nominal * STIFFNESS_FACTOR],
            ));
        }
        parameters.push(Parameter::logarithmic(
            "damping-ratio",
            "1",
            NOMINAL_DAMPING_RATIO,
            DAMPING_LOG_STD,
            [5e-4, 0.3],
        ));
        let mut masses = vec![None; robot.spec.links.len()];
        if let Some(tolerance) = section.mass_tolerance {
            for (i, link) in robot.spec.links.iter().enumerate() {
                let name = format!("link-{}.mass", i + 1);
                if !kept(&name) {
                    continue;
                }
                masses[i] = Some(parameters.len());
                parameters.push(Parameter {
                    name,
                    unit: "kg",
                    scale: Scale::Linear,
                    nominal: link.mass_kg,
                    prior: Some(Prior {
                        mean: link.mass_kg,
                        std: tolerance * link.mass_kg,
                    }),
                    bounds: [0.3 * link.mass_kg, 3.0 * link.mass_kg],
                });
            }
        }
        let first_file_number = parameters.len();
        let mut file_numbers = Vec::new();
        for (numbers, tolerance) in file_numbers_of(&robot, section) {
            for number in numbers.into_iter().filter(|n| kept(&n.name())) {
                parameters.push(file_parameter(&robot, number, tolerance));
                file_numbers.push(number);
            }
        }
        let parts = StructureParts {
            robot,
            points,
            masses,
            file_numbers,
            first_file_number,
        };
        Model::of(parts, parameters)
    }

    /// What effects are told: this robot, and a summary of its FRFs.
    pub fn known(&self, data: &DataSummary) -> Known<'_, Structure> {
        Known::robot(&self.robot.spec, *data)
    }

    /// The baseline's quantities at `theta` (solver's scale), with derivatives if asked for.
    pub fn baseline(&self, theta: &[f64], with_derivatives: bool) -> Baseline {
        let value = |i: usize| self.value(theta, i, with_derivatives);
        let joints = self.robot.joint_count();
        let links = &self.robot.spec.links;
        let mass_scale =
            links
                .iter()
                .enumerate()
                .map(|(i, link)| match self.masses[i].filter(|_| link.mass_kg > 0.0) {
                    Some(parameter) => value(parameter).scale(1.0 / link.mass_kg),
                    None => Dual::constant(1.0),
                });
        Baseline {
            joint_stiffness_nm_per_rad: (0..joints).map(value).collect(),
            damping_ratio: value(joints),
            mass_scale: mass_scale.collect(),
            young_pa: None,
        }
    }

    /// The robot with the numbers of its file that are tuned (other than joint stiffnesses and masses) as they are at `theta`.
    pub fn robot_at(&self, theta: &[f64]) -> Cow<'_, RobotModel> {
        if self.file_numbers.is_empty() {
            return Cow::Borrowed(&self.robot);
        }
        let mut robot = self.robot.clone();
        for (k, number) in self.file_numbers.iter().enumerate() {
            let i = self.first_file_number + k;
            number.set(&mut robot, self.parameters[i].natural(theta[i]));
        }
        Cow::Owned(robot)
    }

    /// The whole robot as it is at `theta`: joints, masses and all other numbers of its file that are tuned. Its nominal baseline is
    /// [`baseline`](Self::baseline) at `theta`, but for the damping.
    pub fn robot_as_fitted(&self, theta: &[f64]) -> RobotModel {
        let mut robot = self.robot_with(theta, |_| true);
        for (i, joint) in robot.spec.joints.iter_mut().enumerate() {
            joint.compliance_rad_per_nm = 1.0 / self.parameters[i].natural(theta[i]);
        }
        robot
    }

    /// The robot file's robot with those link parameters as they are at `theta` that `kept` says of by name; joints stay as in the file.
    pub fn robot_with(&self, theta: &[f64], kept: impl Fn(&str) -> bool) -> RobotModel {
        let mut robot = self.robot.clone();
        let value = |i: usize| {
            let parameter = &self.parameters[i];
            kept(&parameter.name).then(|| parameter.natural(theta[i]))
        };
        for (link, parameter) in robot.spec.links.iter_mut().zip(&self.masses) {
            let Some(mass_kg) = parameter.and_then(value).filter(|_| link.mass_kg > 0.0) else {
                continue;
            };
            if !self.tunes_inertia() {
                let factor = mass_kg / link.mass_kg;
                link.inertia_kg_m2 = link.inertia_kg_m2.map(|moment| factor * moment);
                link.products_kg_m2 = link.products_kg_m2.map(|product| factor * product);
            }
            link.mass_kg = mass_kg;
        }
        for (k, number) in self.file_numbers.iter().enumerate() {
            if let Some(value) = value(self.first_file_number + k) {
                number.set(&mut robot, value);
            }
        }
        robot
    }

    /// Whether moments of inertia are tuned for themselves; they follow the masses otherwise.
    fn tunes_inertia(&self) -> bool {
        let inertia = |number: &FileNumber| matches!(number, FileNumber::Inertia { .. });
        self.file_numbers.iter().any(inertia)
    }

    /// Young's modulus of the links at `theta`, Pa; `None` where the model has none that bend.
    pub fn young_pa(&self, theta: &[f64]) -> Option<f64> {
        let bending = |added: &&AddedEffect<Structure>| added.instance.label() == LINK_FLEXIBILITY;
        let added = self.effects().iter().find(bending)?;
        Some(self.parameters[added.parameters.start].natural(theta[added.parameters.start]))
    }

    /// Where the frames are at `theta`, where `kinematics` says where the robot file puts them.
    pub fn kinematics_at<'k>(&self, theta: &[f64], kinematics: &'k Kinematics) -> Cow<'k, Kinematics> {
        self.at(theta, kinematics).1
    }

    /// Both at once.
    pub fn at<'k>(
        &self,
        theta: &[f64],
        kinematics: &'k Kinematics,
    ) -> (Cow<'_, RobotModel>, Cow<'k, Kinematics>) {
        let robot = self.robot_at(theta);
        let kinematics = match self.file_numbers.iter().any(|number| number.is_length()) {
            true => Cow::Owned(kinematics.with_lengths(&self.robot.spec, &robot.spec)),
            false => Cow::Borrowed(kinematics),
        };
        (robot, kinematics)
    }

    /// The chain at a posture with all effects; `kinematics` as the robot file has them. `conditions`: see [`PostureSetting`].
    pub fn chain(
        &self,
        theta: &[f64],
        kinematics: &Kinematics,
        conditions: Conditions,
        with_derivatives: bool,
    ) -> Chain {
        let baseline = self.baseline(theta, with_derivatives);
        self.chain_on(&baseline, theta, kinematics, conditions, with_derivatives)
    }

    /// As [`Self::chain`], on a baseline that was changed by hand.
    pub fn chain_on(
        &self,
        baseline: &Baseline,
        theta: &[f64],
        kinematics: &Kinematics,
        conditions: Conditions,
        with_derivatives: bool,
    ) -> Chain {
        let (robot, kinematics) = self.at(theta, kinematics);
        let mut chain = robot.chain(&kinematics, baseline);
        if self.tunes_inertia() {
            for body in &mut chain.bodies {
                body.inertia_follows_mass = false;
            }
        }
        let setting = PostureSetting {
            robot: &robot,
            kinematics: &kinematics,
            conditions,
        };
        for added in self.effects_in_order() {
            let values = self.values(theta, added, with_derivatives);
            let instance = added.instance;
            instance
                .effect
                .apply(instance.at(), &values, &setting, &mut chain);
        }
        chain
    }

    /// What the effects do to the response channels.
    pub fn filter(&self, theta: &[f64], with_derivatives: bool) -> ChannelFilter {
        let mut filter = ChannelFilter::faithful();
        for added in self.effects() {
            let values = self.values(theta, added, with_derivatives);
            added.instance.effect.distort(&values, &mut filter);
        }
        filter
    }

    pub(crate) fn basis(&self, theta: &[f64], block: &FrfBlock, with_derivatives: bool) -> Result<FrfBasis> {
        stop::point();
        let chain = self.chain(theta, &block.kinematics, block.conditions, with_derivatives);
        let rows = self.output_rows(theta, &chain, block);
        if !with_derivatives {
            return FrfBasis::new(&chain.system(0), &rows);
        }
        let mut system = chain.system(theta.len());
        self.add_file_slopes(&mut system, theta, &block.kinematics, block.conditions);
        FrfBasis::with_moved_outputs(&system, &rows, &self.row_slopes(theta, block))
    }

    /// Displacement per coordinate of `chain`, which is this model's at `theta`, of each of the block's outputs.
    pub(crate) fn output_rows(&self, theta: &[f64], chain: &Chain, block: &FrfBlock) -> Vec<DVector<f64>> {
        let (robot, kinematics) = self.at(theta, &block.kinematics);
        let outputs = block.outputs.iter();
        outputs
            .map(|(point, axis)| {
                let point = &self.points[*point];
                robot.output_row(chain, &kinematics, point, *axis, false)
            })
            .collect()
    }

    /// `theta` with file number `k` a little more and a little less, and the derivative's factor on what differs between.
    /// The matrices of a robot are of the second degree in moments, centres and lengths: their differences over any width
    /// are exact; those of links that bend are so to 1e-8 in walls and lengths.
    fn beside(&self, theta: &[f64], k: usize) -> ([Vec<f64>; 2], f64) {
        const SHARE: f64 = 1e-4;
        const LENGTH_M: f64 = 3e-5;
        let i = self.first_file_number + k;
        let parameter = &self.parameters[i];
        let value = parameter.natural(theta[i]);
        let (half, slope) = match parameter.scale {
            Scale::Logarithmic => (SHARE * value, value),
            Scale::Linear => (LENGTH_M, 1.0),
        };
        let moved = [half, -half].map(|by| {
            let mut moved = theta.to_vec();
            moved[i] = parameter.internal(value + by);
            moved
        });
        (moved, slope / (2.0 * half))
    }

    /// Derivatives of the matrices with respect to the numbers of the robot file.
    pub(crate) fn add_file_slopes(
        &self,
        system: &mut System,
        theta: &[f64],
        kinematics: &Kinematics,
        conditions: Conditions,
    ) {
        for k in 0..self.file_numbers.len() {
            let (moved, per_unit) = self.beside(theta, k);
            let [above, below] = moved.map(|t| self.chain(&t, kinematics, conditions, false).system(0));
            system.derivatives[self.first_file_number + k] = System::difference(&above, &below, per_unit);
        }
    }

    /// Derivatives of the outputs' rows with respect to the lengths that are tuned.
    fn row_slopes(&self, theta: &[f64], block: &FrfBlock) -> Vec<RowSlopes> {
        let lengths = self.file_numbers.iter().enumerate();
        lengths
            .filter(|(_, number)| number.is_length())
            .map(|(k, _)| {
                let (moved, per_unit) = self.beside(theta, k);
                let [above, below] = moved.map(|t| {
                    let chain = self.chain(&t, &block.kinematics, block.conditions, false);
                    self.output_rows(&t, &chain, block)
                });
                let slopes = above.iter().zip(&below).map(|(a, b)| (a - b) * per_unit);
                (self.first_file_number + k, slopes.collect())
            })
            .collect()
    }

    /// Roughly the processor time of one evaluation on `data` with all derivatives, s, from the number of coordinates.
    pub fn work_s(&self, data: &FrfData) -> f64 {
        /// Seconds of one complex multiplication, sums included.
        const MULTIPLICATION_S: f64 = 2e-9;
        let count = self.parameters.len() as f64;
        let theta = self.nominal_theta();
        let of_block = |block: &FrfBlock| {
            let chain = self.chain(&theta, &block.kinematics, block.conditions, false);
            // Six coordinates of each body move with mass, the others give way without.
            let most =
                6 * chain.bodies.len() + chain.branches.iter().map(|b| b.directions.len()).sum::<usize>();
            let damped = chain.elements.iter().any(|e| e.damping.is_some());
            let all = chain.coordinate_count();
            let n = if damped { all } else { all.min(most) } as f64;
            let coupled = damped || !chain.branches.is_empty();
            let outputs = block.outputs.len() as f64;
            let inputs = block.inputs();
            let solved = if coupled {
                n * n * (n / 3.0 + outputs)
            } else {
                n * outputs
            };
            let slopes = inputs.len() as f64 * count * n * (n + outputs);
            let residuals = block.frfs.len() as f64 * count * count;
            block.frequency_hz.len() as f64 * (solved + slopes + residuals)
        };
        MULTIPLICATION_S * data.blocks.iter().map(|b| of_block(b)).sum::<f64>()
    }

    /// Predicted receptances, m/N, in the order of `data.frfs()`.
    pub fn predict(&self, theta: &[f64], data: &FrfData) -> Result<Vec<Vec<Complex64>>> {
        let filter = self.filter(theta, false);
        let per_block: Vec<Vec<Vec<Complex64>>> = data
            .blocks
            .par_iter()
            .map(|block| {
                let basis = self.basis(theta, block, false)?;
                let channels = Channels::new(&filter);
                let mut columns = vec![Vec::with_capacity(block.frequency_hz.len()); block.frfs.len()];
                basis.solve_lines(&block.rates(), &block.inputs(), |_, response| {
                    for (frf, column) in block.frfs.iter().zip(&mut columns) {
                        column.push(channels.measured(frf, &basis, response));
                    }
                    Ok(())
                })?;
                Ok(columns)
            })
            .collect::<Result<_>>()?;
        Ok(per_block.into_iter().flatten().collect())
    }
}
