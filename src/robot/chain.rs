//! An open chain of compliant elements in relative coordinates, and its mass, stiffness and damping matrices with
//! their derivatives.
//!
//! Twists are (v, ω) in base axes. Coordinate ξ_e of an element turns or shifts everything behind it on the chain, so
//! a body's twist at its centre of mass is Σ over elements before it of S_e moved there (v += ω × r) times ξ_e, and
//! M = Σ Jᵀ diag(m I, R I_b Rᵀ) J, K = blockdiag(K_e) (link–joint–link reduction after Klimchik et al. 2014, with
//! the lever arms kept).

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6xX, Point3, Vector3, Vector6};

use super::dual::Dual;

/// Where on the chain something sits: it moves with every element at an earlier or equal place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// 0 is the base, i the link behind joint i.
    pub link: usize,
    /// Where along that link.
    pub slot: Slot,
}

/// The order of things along one link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Slot {
    /// The joint in front of the link: its rotation, its tilt; at link 0 the rocking of the base.
    Joint,
    /// First half of the link as a beam.
    FirstHalf,
    /// The link's own body.
    Body,
    /// Second half of the link as a beam.
    SecondHalf,
    /// The link's far end: next joint axis, or flange and tool.
    End,
}

impl Place {
    /// The slot of a link.
    pub fn new(link: usize, slot: Slot) -> Self {
        Place { link, slot }
    }
}

/// What an element stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Rotation of this joint (1-based) about its own axis.
    Joint(usize),
    /// Tilt of a joint's bearing.
    Bearing,
    /// Half of a link as a beam.
    Beam,
    /// Rocking of the base.
    Base,
}

/// A compliant element: `directions` are unit twists at `at`, one a coordinate; its stiffness is
/// `stiffness` × `shape`.
#[derive(Debug, Clone)]
pub struct Element {
    /// What it stands for.
    pub role: Role,
    /// Where on the chain it sits.
    pub place: Place,
    /// Point that the twists refer to, base frame, m.
    pub at: Point3<f64>,
    /// Unit twists (displacement, rotation) in base axes, one a coordinate.
    pub directions: Vec<Vector6<f64>>,
    /// Symmetric positive definite, as many rows as directions.
    pub shape: DMatrix<f64>,
    /// Factor on `shape`; N·m/rad where `shape` is the identity of a rotation.
    pub stiffness: Dual,
    /// Viscous damping of the element: `damping` × identity.
    pub damping: Option<Dual>,
}

/// A rigid body: `scale` multiplies its mass.
#[derive(Debug, Clone)]
pub struct Body {
    /// Where on the chain it sits.
    pub place: Place,
    /// Centre of mass, base frame, m.
    pub com: Point3<f64>,
    /// Mass before scaling, kg.
    pub mass_kg: f64,
    /// About the centre of mass, base axes.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Factor on the mass.
    pub scale: Dual,
    /// Whether `scale` multiplies its inertia, too; not where that is known, or tuned, by itself.
    pub inertia_follows_mass: bool,
}

/// A point mass on spring and viscous damper that hangs on the chain and moves along `directions` relative to it
/// (rigidly otherwise). Its damper is its own.
#[derive(Debug, Clone)]
pub struct Branch {
    /// Where on the chain its spring is fixed.
    pub place: Place,
    /// Where the mass is, base frame, m.
    pub at: Point3<f64>,
    /// Unit vectors that it moves along relative to the chain, base axes.
    pub directions: Vec<Vector3<f64>>,
    /// The point mass, kg.
    pub mass_kg: Dual,
    /// Its spring, the same in all directions, N/m.
    pub stiffness_n_per_m: Dual,
    /// Its damper, the same in all directions, N·s/m.
    pub damping_ns_per_m: Dual,
    /// True if what is measured or hit at `at` is the branch's mass (a flexible tool), not the chain.
    pub carries_tool_point: bool,
}

/// What an [`Attachment`] acts on: a displacement that is a linear combination of element coordinates, of the
/// displacement of a point along a direction, or of both.
#[derive(Debug, Clone, Default)]
pub struct Grip {
    /// Index into the chain's elements (its first coordinate is meant) and factor.
    pub coordinates: Vec<(usize, f64)>,
    /// A point that moves with the chain at a place, and a unit vector, base axes.
    pub point: Option<(Point3<f64>, Place, Vector3<f64>)>,
}

/// Spring, damper, inertia or hysteretic spring on one displacement of the chain. At a point it acts against the ground.
#[derive(Debug, Clone)]
pub struct Attachment {
    /// The displacement that it acts on.
    pub grip: Grip,
    /// What it answers that displacement with.
    pub law: AttachmentLaw,
    /// N/m, N·s/m, kg or N/m; for an angle N·m/rad, N·m·s/rad, kg·m² or N·m/rad.
    pub size: Dual,
}

/// What an [`Attachment`] answers a displacement q with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttachmentLaw {
    /// k·q
    Spring,
    /// iω c q
    Damper,
    /// −ω² m q
    Inertia,
    /// i h q at every frequency: a loss factor h/k parallel to a spring k. Known to frequency responses only; what works on
    /// real matrices leaves it out.
    Hysteresis,
}

/// Everything that makes up the structure at one posture.
#[derive(Debug, Clone)]
pub struct Chain {
    /// Compliant elements.
    pub elements: Vec<Element>,
    /// Rigid bodies.
    pub bodies: Vec<Body>,
    /// Point masses on springs.
    pub branches: Vec<Branch>,
    /// Springs, dampers and inertias on single displacements.
    pub attachments: Vec<Attachment>,
    /// One damping ratio for all modes of the chain (its branches' masses held fast to it); zero where the elements carry dampers.
    pub modal_damping_ratio: Dual,
}

/// Matrices of a chain: the coordinates of the elements come first, those of the branches after them.
#[derive(Debug, Clone)]
pub struct System {
    /// Number of element coordinates.
    pub chain_count: usize,
    /// Stiffness matrix K, all coordinates square.
    pub stiffness: DMatrix<f64>,
    /// Mass matrix M, all coordinates square.
    pub mass: DMatrix<f64>,
    /// Mass of the chain with the branches' masses held fast to it, `chain_count` square: what modal damping is defined on.
    pub chain_mass: DMatrix<f64>,
    /// Viscous damping matrix C; `None` where nothing has a damper.
    pub viscous: Option<DMatrix<f64>>,
    /// Hysteretic stiffness H: the dynamic stiffness has iH at every frequency.
    pub hysteretic: Option<DMatrix<f64>>,
    /// As [`Chain::modal_damping_ratio`].
    pub modal_damping_ratio: Dual,
    /// One entry a parameter.
    pub derivatives: Vec<SystemDerivative>,
}

/// Derivative of a [`System`] with respect to one parameter; `None` where it is zero.
#[derive(Debug, Clone, Default)]
pub struct SystemDerivative {
    /// Of [`System::stiffness`].
    pub stiffness: Option<DMatrix<f64>>,
    /// Of [`System::mass`].
    pub mass: Option<DMatrix<f64>>,
    /// Of [`System::chain_mass`].
    pub chain_mass: Option<DMatrix<f64>>,
    /// Of [`System::viscous`].
    pub viscous: Option<DMatrix<f64>>,
    /// Of [`System::hysteretic`].
    pub hysteretic: Option<DMatrix<f64>>,
}

fn add_scaled(
    target: &mut Option<DMatrix<f64>>,
    size: usize,
    corner: usize,
    block: &DMatrix<f64>,
    factor: f64,
) {
    if factor == 0.0 {
        return;
    }
    let matrix = target.get_or_insert_with(|| DMatrix::zeros(size, size));
    let (rows, columns) = block.shape();
    let mut view = matrix.view_mut((corner, corner), (rows, columns));
    view += block * factor;
}

impl System {
    /// Derivative of the matrices with respect to one more parameter, from those at two of its values (`above` and `below`)
    /// whose distance is 1/`per_unit`.
    pub fn difference(above: &System, below: &System, per_unit: f64) -> SystemDerivative {
        let of = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            let slope = (a - b) * per_unit;
            slope.iter().any(|v| *v != 0.0).then_some(slope)
        };
        let of_optional = |a: &Option<DMatrix<f64>>, b: &Option<DMatrix<f64>>| match (a, b) {
            (Some(a), Some(b)) => of(a, b),
            _ => None,
        };
        SystemDerivative {
            stiffness: of(&above.stiffness, &below.stiffness),
            mass: of(&above.mass, &below.mass),
            chain_mass: of(&above.chain_mass, &below.chain_mass),
            viscous: of_optional(&above.viscous, &below.viscous),
            hysteretic: of_optional(&above.hysteretic, &below.hysteretic),
        }
    }
}

impl Chain {
    fn chain_count(&self) -> usize {
        self.elements.iter().map(|e| e.directions.len()).sum()
    }

    fn branch_count(&self) -> usize {
        self.branches.iter().map(|b| b.directions.len()).sum()
    }

    /// Total number of coordinates.
    pub fn coordinate_count(&self) -> usize {
        self.chain_count() + self.branch_count()
    }

    /// Twist (6 × coordinates) of a point that moves with the chain at `place`; branch coordinates are zero.
    pub fn jacobian(&self, point: Point3<f64>, place: Place) -> Matrix6xX<f64> {
        let mut jacobian = Matrix6xX::zeros(self.coordinate_count());
        let mut column = 0;
        for element in &self.elements {
            if element.place <= place {
                let r = point - element.at;
                for (i, direction) in element.directions.iter().enumerate() {
                    let omega: Vector3<f64> = direction.fixed_rows::<3>(3).into_owned();
                    let v: Vector3<f64> = direction.fixed_rows::<3>(0) + omega.cross(&r);
                    let mut target = jacobian.column_mut(column + i);
                    target.fixed_rows_mut::<3>(0).copy_from(&v);
                    target.fixed_rows_mut::<3>(3).copy_from(&omega);
                }
            }
            column += element.directions.len();
        }
        jacobian
    }

    /// Displacement per coordinate along `direction` of a point at `place`, a row as long as there are coordinates.
    /// A point at the tool follows a flexible tool where there is one.
    pub fn output_row(
        &self,
        point: Point3<f64>,
        place: Place,
        at_tool_point: bool,
        direction: &Vector3<f64>,
    ) -> DVector<f64> {
        let jacobian = self.jacobian(point, place);
        let mut row = jacobian.fixed_rows::<3>(0).transpose() * direction;
        if at_tool_point {
            let mut column = self.chain_count();
            for branch in &self.branches {
                for own in &branch.directions {
                    if branch.carries_tool_point {
                        row[column] = own.dot(direction);
                    }
                    column += 1;
                }
            }
        }
        row
    }

    /// Displacement per coordinate of what a grip holds.
    pub fn grip_row(&self, grip: &Grip) -> DVector<f64> {
        let mut row = match &grip.point {
            Some((point, place, direction)) => self.output_row(*point, *place, false, direction),
            None => DVector::zeros(self.coordinate_count()),
        };
        for (element, factor) in &grip.coordinates {
            let before = self.elements.iter().take(*element);
            row[before.map(|e| e.directions.len()).sum::<usize>()] += factor;
        }
        row
    }

    /// Mass, stiffness and damping matrices and their derivatives with respect to `parameter_count` parameters.
    pub fn system(&self, parameter_count: usize) -> System {
        let chain_count = self.chain_count();
        let n = self.coordinate_count();
        let mut stiffness = None;
        let mut mass = None;
        let mut chain_mass = None;
        let mut viscous = None;
        let mut hysteretic = None;
        let mut derivatives = vec![SystemDerivative::default(); parameter_count];

        let mut corner = 0;
        for element in &self.elements {
            add_scaled(&mut stiffness, n, corner, &element.shape, element.stiffness.value);
            for (p, derivative) in derivatives.iter_mut().enumerate() {
                add_scaled(
                    &mut derivative.stiffness,
                    n,
                    corner,
                    &element.shape,
                    element.stiffness.derivative(p),
                );
            }
            if let Some(damping) = &element.damping {
                let identity = DMatrix::identity(element.directions.len(), element.directions.len());
                add_scaled(&mut viscous, n, corner, &identity, damping.value);
                for (p, derivative) in derivatives.iter_mut().enumerate() {
                    add_scaled(
                        &mut derivative.viscous,
                        n,
                        corner,
                        &identity,
                        damping.derivative(p),
                    );
                }
            }
            corner += element.directions.len();
        }

        for body in &self.bodies {
            let jacobian = self.jacobian(body.com, body.place);
            let chain = jacobian.columns(0, chain_count);
            let v = chain.fixed_rows::<3>(0);
            let w = chain.fixed_rows::<3>(3);
            let mut block: DMatrix<f64> = v.transpose() * v * body.mass_kg;
            let turning: DMatrix<f64> = w.transpose() * body.inertia_kg_m2 * w;
            if body.inertia_follows_mass {
                block += turning;
            } else {
                add_scaled(&mut mass, n, 0, &turning, 1.0);
                add_scaled(&mut chain_mass, chain_count, 0, &turning, 1.0);
            }
            add_scaled(&mut mass, n, 0, &block, body.scale.value);
            add_scaled(&mut chain_mass, chain_count, 0, &block, body.scale.value);
            for (p, derivative) in derivatives.iter_mut().enumerate() {
                let slope = body.scale.derivative(p);
                add_scaled(&mut derivative.mass, n, 0, &block, slope);
                add_scaled(&mut derivative.chain_mass, chain_count, 0, &block, slope);
            }
        }

        let mut column = chain_count;
        for branch in &self.branches {
            let count = branch.directions.len();
            let mut motion = self
                .jacobian(branch.at, branch.place)
                .fixed_rows::<3>(0)
                .into_owned();
            for (i, direction) in branch.directions.iter().enumerate() {
                motion.column_mut(column + i).copy_from(direction);
            }
            let block: DMatrix<f64> = motion.transpose() * &motion;
            // Modal damping is that of the chain with the branch's mass held fast to it.
            let held: DMatrix<f64> = block.view((0, 0), (chain_count, chain_count)).into_owned();
            let identity = DMatrix::identity(count, count);
            add_scaled(&mut mass, n, 0, &block, branch.mass_kg.value);
            add_scaled(&mut chain_mass, chain_count, 0, &held, branch.mass_kg.value);
            add_scaled(
                &mut stiffness,
                n,
                column,
                &identity,
                branch.stiffness_n_per_m.value,
            );
            add_scaled(&mut viscous, n, column, &identity, branch.damping_ns_per_m.value);
            for (p, derivative) in derivatives.iter_mut().enumerate() {
                let m = branch.mass_kg.derivative(p);
                add_scaled(&mut derivative.mass, n, 0, &block, m);
                add_scaled(&mut derivative.chain_mass, chain_count, 0, &held, m);
                let k = branch.stiffness_n_per_m.derivative(p);
                add_scaled(&mut derivative.stiffness, n, column, &identity, k);
                let c = branch.damping_ns_per_m.derivative(p);
                add_scaled(&mut derivative.viscous, n, column, &identity, c);
            }
            column += count;
        }

        for attachment in &self.attachments {
            let row = self.grip_row(&attachment.grip);
            let block: DMatrix<f64> = &row * row.transpose();
            let size = &attachment.size;
            match attachment.law {
                AttachmentLaw::Spring => add_scaled(&mut stiffness, n, 0, &block, size.value),
                AttachmentLaw::Damper => add_scaled(&mut viscous, n, 0, &block, size.value),
                AttachmentLaw::Hysteresis => add_scaled(&mut hysteretic, n, 0, &block, size.value),
                AttachmentLaw::Inertia => {
                    let held: DMatrix<f64> = block.view((0, 0), (chain_count, chain_count)).into_owned();
                    add_scaled(&mut mass, n, 0, &block, size.value);
                    add_scaled(&mut chain_mass, chain_count, 0, &held, size.value);
                }
            }
            for (p, derivative) in derivatives.iter_mut().enumerate() {
                let slope = size.derivative(p);
                match attachment.law {
                    AttachmentLaw::Spring => add_scaled(&mut derivative.stiffness, n, 0, &block, slope),
                    AttachmentLaw::Damper => add_scaled(&mut derivative.viscous, n, 0, &block, slope),
                    AttachmentLaw::Hysteresis => add_scaled(&mut derivative.hysteretic, n, 0, &block, slope),
                    AttachmentLaw::Inertia => {
                        let held: DMatrix<f64> = block.view((0, 0), (chain_count, chain_count)).into_owned();
                        add_scaled(&mut derivative.mass, n, 0, &block, slope);
                        add_scaled(&mut derivative.chain_mass, chain_count, 0, &held, slope);
                    }
                }
            }
        }

        System {
            chain_count,
            stiffness: stiffness.unwrap_or_else(|| DMatrix::zeros(n, n)),
            mass: mass.unwrap_or_else(|| DMatrix::zeros(n, n)),
            chain_mass: chain_mass.unwrap_or_else(|| DMatrix::zeros(chain_count, chain_count)),
            viscous,
            hysteretic,
            modal_damping_ratio: self.modal_damping_ratio.clone(),
            derivatives,
        }
    }

    /// Static compliance (6×6, displacement and rotation per force and moment, base axes) of a point on the chain.
    pub fn compliance(&self, point: Point3<f64>, place: Place) -> crate::Result<nalgebra::Matrix6<f64>> {
        let jacobian = self.jacobian(point, place);
        let system = self.system(0);
        let n = system.chain_count;
        let cholesky = system
            .stiffness
            .view((0, 0), (n, n))
            .into_owned()
            .cholesky()
            .ok_or_else(|| crate::Error::computation("the stiffness matrix is not positive definite"))?;
        let transposed = jacobian.columns(0, n).transpose();
        let compliance = jacobian.columns(0, n) * cholesky.solve(&transposed);
        Ok(nalgebra::Matrix6::from_iterator(compliance.iter().copied()))
    }
}
