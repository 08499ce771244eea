//! What the data drew where the library had no name: a simple law at one place of the structure. `branch` acts on a
//! displacement that the model has (a link against the ground, a joint's turning), `series` adds one that it takes for
//! stiff (a bearing, the base, the motor's side of a gear). They are added on request, not tried by `diagnose`.

use nalgebra::{DMatrix, Point3, Vector3, Vector6};
use num_complex::Complex64;

use super::spot::AXES;
use super::{Background, Spot};
use crate::data::RobotSpec;
use crate::effects::structural::branch;
use crate::effects::structural::{DataSummary, PostureSetting, Structure};
use crate::effects::{At, Effect, Instance, Known, NEGLIGIBLE, Site};
use crate::parameter::{Parameter, Prior};
use crate::robot::{
    Attachment, AttachmentLaw, Branch as HungMass, Chain, Dual, Element, Grip, Place, Role, Slot,
};

/// A law of force over displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrawnForm {
    /// Force in proportion to the displacement.
    Spring,
    /// Force in proportion to the speed.
    Damper,
    /// Both next to each other.
    SpringDamper,
    /// Force in proportion to the acceleration.
    Mass,
    /// A mass on a spring.
    Resonator,
    /// Two masses, each on a spring of its own.
    TwoResonators,
    /// A spring with a loss factor.
    LossFactor,
    /// A spring in series with a damper.
    Maxwell,
    /// A spring and a damper along a direction of their own, near an axis.
    ObliqueSpringDamper,
    /// Series only: a spring with an inertia on it (the motor's rotor on its servo).
    RotorOnSpring,
    /// Under the base only: what the robot stands on, a mass on a spring along a direction of its own, near an axis.
    FloorMode,
    /// Base and bearings only: a spring that gives way alike along (or about) two axes: a foot plate's x and y, all that is across a
    /// bearing.
    IsotropicSpring,
    /// The same with a damper of its own.
    IsotropicSpringDamper,
}

impl DrawnForm {
    /// As in docs/json.md: `spring-damper`.
    pub fn label(self) -> &'static str {
        match self {
            DrawnForm::Spring => "spring",
            DrawnForm::Damper => "damper",
            DrawnForm::SpringDamper => "spring-damper",
            DrawnForm::Mass => "mass",
            DrawnForm::Resonator => "resonator",
            DrawnForm::TwoResonators => "two-resonators",
            DrawnForm::LossFactor => "loss-factor",
            DrawnForm::Maxwell => "maxwell",
            DrawnForm::ObliqueSpringDamper => "oblique-spring-damper",
            DrawnForm::RotorOnSpring => "rotor-on-spring",
            DrawnForm::FloorMode => "floor-mode",
            DrawnForm::IsotropicSpring => "isotropic-spring",
            DrawnForm::IsotropicSpringDamper => "isotropic-spring-damper",
        }
    }

    /// In a sentence: `a spring damper`.
    pub fn words(self) -> &'static str {
        match self {
            DrawnForm::Spring => "a spring",
            DrawnForm::Damper => "a damper",
            DrawnForm::SpringDamper => "a spring damper",
            DrawnForm::Mass => "a mass",
            DrawnForm::Resonator => "a resonator",
            DrawnForm::TwoResonators => "two resonators",
            DrawnForm::LossFactor => "a loss factor",
            DrawnForm::Maxwell => "a Maxwell element",
            DrawnForm::ObliqueSpringDamper => "an oblique spring damper",
            DrawnForm::RotorOnSpring => "a rotor on a spring",
            DrawnForm::FloorMode => "a floor mode",
            DrawnForm::IsotropicSpring => "an isotropic spring",
            DrawnForm::IsotropicSpringDamper => "an isotropic spring damper",
        }
    }

    /// Where it is, in words.
    pub fn place_in_words(self, spot: Spot) -> String {
        match self.is_isotropic() {
            true => spot.words_of_both(),
            false => spot.words(),
        }
    }

    /// Whether it acts alike along two axes.
    pub fn is_isotropic(self) -> bool {
        matches!(
            self,
            DrawnForm::IsotropicSpring | DrawnForm::IsotropicSpringDamper
        )
    }

    fn suits(self, spot: Spot) -> bool {
        let is_joint = matches!(spot, Spot::Joint(_));
        let is_drive = matches!(spot, Spot::Drive(_));
        match self {
            // In parallel with a joint's stiffness it is more of the same.
            DrawnForm::Spring => !is_joint && !is_drive,
            DrawnForm::SpringDamper => !is_joint,
            DrawnForm::LossFactor => !is_drive,
            DrawnForm::Damper | DrawnForm::Maxwell => is_joint,
            // What has a mass of its own does not stay with the base axes where a link turns.
            DrawnForm::Mass | DrawnForm::Resonator | DrawnForm::TwoResonators => {
                matches!(spot, Spot::LinkAxis(..) | Spot::ToolGround(_))
            }
            DrawnForm::ObliqueSpringDamper => matches!(spot, Spot::LinkGround(..) | Spot::ToolGround(_)),
            DrawnForm::RotorOnSpring => is_drive,
            DrawnForm::FloorMode => matches!(spot, Spot::Base(0..=2)),
            DrawnForm::IsotropicSpring | DrawnForm::IsotropicSpringDamper => spot.alike().is_some(),
        }
    }
}

/// Forms that a spot can have, in the order of their variants.
pub fn forms(spot: Spot) -> Vec<DrawnForm> {
    FORMS.into_iter().filter(|form| form.suits(spot)).collect()
}

/// All forms, in the order of their variants: one list for all spots, so that a variant means one form everywhere.
const FORMS: [DrawnForm; 13] = [
    DrawnForm::Spring,
    DrawnForm::Damper,
    DrawnForm::SpringDamper,
    DrawnForm::Mass,
    DrawnForm::Resonator,
    DrawnForm::TwoResonators,
    DrawnForm::LossFactor,
    DrawnForm::Maxwell,
    DrawnForm::RotorOnSpring,
    DrawnForm::ObliqueSpringDamper,
    DrawnForm::FloorMode,
    DrawnForm::IsotropicSpring,
    DrawnForm::IsotropicSpringDamper,
];

/// Acts on a displacement that the model has.
pub struct DrawnBranch;
/// Adds a displacement that the model takes for stiff.
pub struct Series;

/// The instance of a form at a spot.
pub fn instance(spot: Spot, form: DrawnForm) -> Instance<Structure> {
    Instance {
        effect: if spot.is_series() { &Series } else { &DrawnBranch },
        site: Site::At(spot),
        variant: number(form),
    }
}

/// The forms that a site can have, by number.
fn variants(site: Site) -> Vec<usize> {
    let Site::At(spot) = site else { return Vec::new() };
    forms(spot).into_iter().map(number).collect()
}

/// The variant that a form is.
fn number(form: DrawnForm) -> usize {
    FORMS.iter().position(|f| *f == form).unwrap_or(0)
}

/// DrawnForm of an instance of [`DrawnBranch`] or [`Series`].
pub fn form_of(variant: usize) -> DrawnForm {
    FORMS[variant]
}

/// Dynamic stiffness of a form at `frequency_hz`, N/m or N·m/rad; `values`: natural values of its parameters in their
/// order.
pub fn dynamic_stiffness(spot: Spot, form: DrawnForm, values: &[f64], frequency_hz: f64) -> Complex64 {
    let omega = std::f64::consts::TAU * frequency_hz;
    let complex = Complex64::new;
    // −ω² (k + iωc)/(k + iωc − ω² m) times m (Den Hartog 1956, chapter 3).
    let resonator = |own: &[f64]| {
        let natural = std::f64::consts::TAU * own[1];
        let spring = complex(natural * natural, 2.0 * own[2] * natural * omega);
        -own[0] * omega * omega * spring / (spring - omega * omega)
    };
    match form {
        DrawnForm::Spring | DrawnForm::IsotropicSpring => complex(values[0], 0.0),
        DrawnForm::Damper => complex(0.0, omega * values[0]),
        DrawnForm::SpringDamper | DrawnForm::IsotropicSpringDamper => complex(values[0], omega * values[1]),
        // Along the axis, from which the direction leans away.
        DrawnForm::ObliqueSpringDamper => {
            complex(values[0], omega * values[1]) / (1.0 + values[2].powi(2) + values[3].powi(2))
        }
        DrawnForm::Mass => complex(-omega * omega * values[0], 0.0),
        DrawnForm::Resonator | DrawnForm::TwoResonators => values.chunks_exact(3).map(resonator).sum(),
        DrawnForm::LossFactor if matches!(spot, Spot::Joint(_)) => complex(0.0, values[0]),
        DrawnForm::LossFactor => complex(values[0], values[0] * values[1]),
        DrawnForm::Maxwell => {
            let damper = complex(0.0, omega * values[1]);
            values[0] * damper / (values[0] + damper)
        }
        DrawnForm::RotorOnSpring => complex(values[0] - omega * omega * values[2], omega * values[1]),
        // Pushed along the axis it gives way along its own direction only.
        DrawnForm::FloorMode => {
            let natural = std::f64::consts::TAU * values[1];
            let own = complex(
                natural * natural - omega * omega,
                2.0 * values[2] * natural * omega,
            );
            own * values[0] * (1.0 + values[3].powi(2) + values[4].powi(2))
        }
    }
}

fn free(name: &str, unit: &'static str, nominal: f64, bounds: [f64; 2]) -> Parameter {
    Parameter::logarithmic(name, unit, nominal, 3.0, bounds)
}

fn parameters(site: Site, variant: usize, data: &DataSummary) -> Vec<Parameter> {
    let Site::At(spot) = site else {
        return Vec::new();
    };
    let angle = spot.is_angle();
    let stiffness = |nominal: f64| match angle {
        true => free("stiffness_nm_per_rad", "N·m/rad", nominal, [1.0, 1e11]),
        false => free("stiffness_n_per_m", "N/m", nominal, [10.0, 1e12]),
    };
    let damping = match angle {
        true => free("damping_nms_per_rad", "N·m·s/rad", 1e3, [1e-3, 1e9]),
        false => free("damping_ns_per_m", "N·s/m", 1e3, [1e-3, 1e9]),
    };
    let loss = free("loss_factor", "1", 0.1, [1e-5, 3.0]);
    let usual = if spot.is_series() { 1e7 } else { 1e5 };
    let resonator = || branch::parameters(data, 5.0, 15.0);
    match form_of(variant) {
        DrawnForm::Spring | DrawnForm::IsotropicSpring => vec![stiffness(usual)],
        DrawnForm::Damper => vec![damping],
        DrawnForm::SpringDamper | DrawnForm::IsotropicSpringDamper => vec![stiffness(usual), damping],
        DrawnForm::ObliqueSpringDamper => [stiffness(usual), damping]
            .into_iter()
            .chain(leans(spot))
            .collect(),
        DrawnForm::Mass => vec![free("mass_kg", "kg", 3.0, [1e-3, 1e3])],
        DrawnForm::Resonator => resonator(),
        DrawnForm::TwoResonators => {
            let second = resonator().into_iter().map(|p| Parameter {
                name: format!("second_{}", p.name),
                ..p
            });
            resonator().into_iter().chain(second).collect()
        }
        DrawnForm::LossFactor if matches!(spot, Spot::Joint(_)) => {
            // In parallel with a joint's own spring there is only the loss.
            vec![free("hysteretic_nm_per_rad", "N·m/rad", 1e4, [1.0, 1e9])]
        }
        DrawnForm::LossFactor => vec![stiffness(usual), loss],
        DrawnForm::Maxwell => vec![stiffness(1e5), damping],
        DrawnForm::RotorOnSpring => vec![
            stiffness(usual),
            damping,
            free("inertia_kg_m2", "kg·m²", 20.0, [1e-3, 1e4]),
        ],
        DrawnForm::FloorMode => {
            let mut resonator = branch::parameters(data, 5.0, 20.0);
            resonator[0] = free("mass_kg", "kg", 2e3, [1.0, 1e7]);
            resonator.into_iter().chain(leans(spot)).collect()
        }
    }
}

/// How far a direction near the axis of a spot leans towards the other two axes.
fn leans(spot: Spot) -> [Parameter; 2] {
    oblique_axes(spot).map(|axis| {
        let prior = Prior { mean: 0.0, std: 1.0 };
        Parameter::linear(format!("lean_{}", AXES[axis]), "1", 0.0, prior, [-4.0, 4.0])
    })
}

/// The axes towards which the direction of an oblique spring leans: by 1 is half-way.
fn oblique_axes(spot: Spot) -> [usize; 2] {
    let along = match spot {
        Spot::LinkGround(_, axis) | Spot::ToolGround(axis) | Spot::Base(axis) => axis,
        _ => 0,
    };
    [(along + 1) % 3, (along + 2) % 3]
}

/// A form of these natural values whose direction leans further than half-way towards another axis, as one of that axis: its spot
/// there, and the values. `None` where it is named after the right axis.
pub fn along_its_axis(spot: Spot, form: DrawnForm, values: &[f64]) -> Option<(Spot, Vec<f64>)> {
    if !matches!(form, DrawnForm::ObliqueSpringDamper | DrawnForm::FloorMode) {
        return None;
    }
    let (sizes, leans) = values.split_at(values.len().checked_sub(2)?);
    let mut components = [1.0; 3];
    for (axis, lean) in oblique_axes(spot).into_iter().zip(leans) {
        components[axis] = *lean;
    }
    let most = (0..3).max_by(|a, b| components[*a].abs().total_cmp(&components[*b].abs()))?;
    let renamed = match spot {
        Spot::LinkGround(link, _) => Spot::LinkGround(link, most),
        Spot::ToolGround(_) => Spot::ToolGround(most),
        Spot::Base(_) => Spot::Base(most),
        _ => return None,
    };
    let leans = oblique_axes(renamed).map(|axis| components[axis] / components[most]);
    (components[most].abs() > 1.0).then(|| (renamed, [sizes, &leans].concat()))
}

/// Starts of an oblique form of these sizes: along the axis, and leaning.
pub fn leaning(sizes: &[f64]) -> Vec<Vec<f64>> {
    [[0.0, 0.0], [0.7, 0.0], [-0.7, 0.0], [0.0, 0.7], [0.0, -0.7]]
        .map(|leans| [sizes, &leans].concat())
        .to_vec()
}

fn starts(site: Site, variant: usize, data: &DataSummary, peaks_hz: &[f64]) -> Vec<Vec<f64>> {
    let Site::At(spot) = site else {
        return Vec::new();
    };
    let scale: &[f64] = if spot.is_series() {
        &[1e5, 1e6, 1e8, 1e9]
    } else {
        &[1e3, 1e4, 1e6, 1e7]
    };
    match form_of(variant) {
        DrawnForm::Spring | DrawnForm::IsotropicSpring => scale.iter().map(|k| vec![*k]).collect(),
        DrawnForm::Damper => [10.0, 100.0, 1e4].map(|c| vec![c]).to_vec(),
        DrawnForm::SpringDamper | DrawnForm::IsotropicSpringDamper => {
            scale.iter().map(|k| vec![*k, 1e-3 * k]).collect()
        }
        DrawnForm::ObliqueSpringDamper => leaning(&[1e5, 1e2]),
        DrawnForm::Mass => [0.2, 1.0, 10.0, 50.0].map(|m| vec![m]).to_vec(),
        DrawnForm::Resonator => branch::starts(data, peaks_hz, 5.0),
        DrawnForm::TwoResonators => {
            let firsts = branch::starts(data, peaks_hz, 5.0);
            let mut pairs = Vec::new();
            for (i, a) in firsts.iter().enumerate().step_by(2) {
                for b in firsts.iter().skip(i + 2).step_by(2).take(3) {
                    pairs.push([a.as_slice(), b.as_slice()].concat());
                }
            }
            pairs
        }
        DrawnForm::LossFactor if matches!(spot, Spot::Joint(_)) => [1e2, 1e3, 1e5].map(|h| vec![h]).to_vec(),
        DrawnForm::LossFactor => scale.iter().map(|k| vec![*k, 0.1]).collect(),
        DrawnForm::Maxwell => scale.iter().map(|k| vec![*k, 1e-2 * k]).collect(),
        // Rotors count with the square of the gear ratio; a servo damps most of them well.
        DrawnForm::RotorOnSpring => [
            (3e5, 1e-2, 60.0),
            (1.5e6, 1e-2, 250.0),
            (1e6, 1e-3, 60.0),
            (1e6, 1e-3, 5.0),
        ]
        .map(|(stiffness, damping, inertia)| vec![stiffness, damping * stiffness, inertia])
        .to_vec(),
        DrawnForm::FloorMode => [12.0, 18.0, 27.0, 40.0]
            .map(|frequency_hz| vec![2e3, frequency_hz, 0.03, 0.0, 0.0])
            .to_vec(),
    }
}

/// Sizes at which a form is not there: what it holds with (a mass alone: its mass) times `factor`, frequencies and ratios
/// as they are.
fn vanishing(parameters: &[Parameter], factor: f64) -> Vec<f64> {
    let is = |p: &Parameter, names: &[&str]| names.iter().any(|name| p.name.contains(name));
    let stiff = parameters.iter().any(|p| is(p, &["stiffness"]));
    let held: &[&str] = if stiff {
        &["stiffness"]
    } else {
        &["mass_kg", "damping_n", "hysteretic"]
    };
    let size = |p: &Parameter| match is(p, held) {
        true => factor * p.nominal,
        // In parallel with a spring that is not there a damper must not be there either.
        false if factor < 1.0 && is(p, &["damping_n"]) => factor * p.nominal,
        false => p.nominal,
    };
    parameters.iter().map(size).collect()
}

fn attach(chain: &mut Chain, grip: &Grip, law: AttachmentLaw, size: &Dual) {
    chain.attachments.push(Attachment {
        grip: grip.clone(),
        law,
        size: size.clone(),
    });
}

/// The direction near the axis of `spot` that leans so far: its components in base axes, not normalised, and the square of its
/// length.
fn leaning_direction(spot: Spot, leans: &[Dual]) -> ([Dual; 3], Dual) {
    let [first, second] = oblique_axes(spot);
    let one = Dual::constant(1.0);
    let square = &(&(&leans[0] * &leans[0]) + &(&leans[1] * &leans[1])) + &one;
    let mut component = [one.clone(), one.clone(), one];
    component[first] = leans[0].clone();
    component[second] = leans[1].clone();
    (component, square)
}

/// k d dᵀ between the displacements along three axes, where `size` is k and `components` are those of d, of any length. Grips
/// have constant directions, so it is made of six springs: k dᵢ dⱼ (eᵢ eⱼᵀ + eⱼ eᵢᵀ) = k dᵢ dⱼ [(eᵢ + eⱼ)(eᵢ + eⱼ)ᵀ − eᵢ eᵢᵀ − eⱼ eⱼᵀ];
/// single ones may be negative, their sum is not. `grip`: what holds a unit vector.
fn attach_oblique(
    chain: &mut Chain,
    grip: impl Fn(Vector3<f64>) -> Grip,
    law: AttachmentLaw,
    size: &Dual,
    components: &[Dual; 3],
) {
    let unit = |axis: usize| Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
    let product = |i: usize, j: usize| size * &(&components[i] * &components[j]);
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let others = &product(i, j) + &product(i, k);
        attach(
            chain,
            &grip(unit(i)),
            law,
            &(&product(i, i) + &others.scale(-1.0)),
        );
        let between = grip((unit(i) + unit(j)).normalize());
        attach(chain, &between, law, &product(i, j).scale(2.0));
    }
}

/// What the robot stands on gives way along one direction: three displacements of the base, stiff but for that direction.
fn attach_floor(chain: &mut Chain, spot: Spot, values: &[Dual]) {
    /// Across the direction, N/m: a thousand times what carries robots.
    const STIFF: f64 = 1e12;
    let first = chain.elements.len();
    for axis in 0..3 {
        let twist = Vector6::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 });
        chain.elements.push(Element {
            role: Role::Base,
            place: Place::new(0, Slot::Joint),
            at: Point3::origin(),
            directions: vec![twist],
            shape: DMatrix::identity(1, 1),
            stiffness: Dual::constant(STIFF),
            damping: Some(Dual::constant(0.0)),
        });
    }
    let grip = |direction: Vector3<f64>| Grip {
        coordinates: (0..3)
            .filter(|&axis| direction[axis] != 0.0)
            .map(|axis| (first + axis, direction[axis]))
            .collect(),
        point: None,
    };
    let (stiffness, damping) = branch::spring_and_damper(values);
    let (components, square) = leaning_direction(spot, &values[3..]);
    let along = |size: &Dual| size * &square.recip();
    let softer = &stiffness + &Dual::constant(-STIFF);
    attach_oblique(chain, grip, AttachmentLaw::Spring, &along(&softer), &components);
    attach_oblique(chain, grip, AttachmentLaw::Damper, &along(&damping), &components);
    for axis in 0..3 {
        let unit = Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
        attach(chain, &grip(unit), AttachmentLaw::Inertia, &values[0]);
    }
}

impl Effect<Structure> for DrawnBranch {
    fn id(&self) -> &'static str {
        "branch"
    }

    fn explanation(&self) -> &'static str {
        "What the data drew at this place: a spring, a damper, a mass or a mass on a spring that the model does not have, \
         acting on a displacement that it has."
    }

    fn fingerprint(&self) -> &'static str {
        "One and the same dynamic stiffness at this place explains the misfit at all postures."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Look at the place: what touches, hangs or rubs there? Take it off, wedge it or add a known mass there and \
             hit again; the drawn curve must change with it.",
            typical: "Whatever the fit gives; a size that nothing at the place can have means that the cause is elsewhere.",
            best_measured: "A point at the place itself, all three axes, and postures that turn it against gravity and against \
             the direction of the hits.",
            sources: &[
                "Mottershead, J. E., Link, M., Friswell, M. I. (2011): The sensitivity method in finite element model \
                 updating: a tutorial. Mechanical Systems and Signal Processing 25, 2275–2296.",
                "de Klerk, D., Rixen, D. J., Voormeeren, S. N. (2008): General framework for dynamic substructuring. AIAA \
                 Journal 46, 1169–1181.",
            ],
        }
    }

    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        Spot::parallel(robot).into_iter().map(Site::At).collect()
    }

    fn variants(&self, site: Site) -> Vec<usize> {
        variants(site)
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        FORMS.get(variant).map(|form| ("form", form.label()))
    }

    fn parameters(&self, At { site, variant }: At, Known { data, .. }: &Known<Structure>) -> Vec<Parameter> {
        parameters(site, variant, data)
    }

    fn starts(
        &self,
        At { site, variant }: At,
        Known { data, .. }: &Known<Structure>,
        peaks_hz: &[f64],
    ) -> Vec<Vec<f64>> {
        starts(site, variant, data, peaks_hz)
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vanishing(parameters, NEGLIGIBLE))
    }

    fn apply(&self, At { site, variant }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let Site::At(spot) = site else { return };
        let Some(grip) = spot.grip(setting.kinematics, &chain.elements) else {
            return;
        };
        match form_of(variant) {
            DrawnForm::Spring => attach(chain, &grip, AttachmentLaw::Spring, &values[0]),
            DrawnForm::Damper => attach(chain, &grip, AttachmentLaw::Damper, &values[0]),
            DrawnForm::SpringDamper => {
                attach(chain, &grip, AttachmentLaw::Spring, &values[0]);
                attach(chain, &grip, AttachmentLaw::Damper, &values[1]);
            }
            DrawnForm::ObliqueSpringDamper => {
                let Some((point, place, _)) = grip.point else {
                    return;
                };
                let held = |direction| Grip {
                    coordinates: Vec::new(),
                    point: Some((point, place, direction)),
                };
                let (components, square) = leaning_direction(spot, &values[2..]);
                for (law, size) in [
                    (AttachmentLaw::Spring, &values[0]),
                    (AttachmentLaw::Damper, &values[1]),
                ] {
                    attach_oblique(chain, held, law, &(size * &square.recip()), &components);
                }
            }
            DrawnForm::Mass => attach(chain, &grip, AttachmentLaw::Inertia, &values[0]),
            DrawnForm::LossFactor if matches!(spot, Spot::Joint(_)) => {
                attach(chain, &grip, AttachmentLaw::Hysteresis, &values[0]);
            }
            DrawnForm::LossFactor => {
                attach(chain, &grip, AttachmentLaw::Spring, &values[0]);
                attach(
                    chain,
                    &grip,
                    AttachmentLaw::Hysteresis,
                    &(&values[0] * &values[1]),
                );
            }
            DrawnForm::Resonator | DrawnForm::TwoResonators => {
                let Some((at, place, direction)) = spot.point(setting.kinematics) else {
                    return;
                };
                for own in values.chunks_exact(3) {
                    let (stiffness, damping) = branch::spring_and_damper(own);
                    chain.branches.push(HungMass {
                        place,
                        at,
                        directions: vec![direction],
                        mass_kg: own[0].clone(),
                        stiffness_n_per_m: stiffness,
                        damping_ns_per_m: damping,
                        carries_tool_point: false,
                    });
                }
            }
            DrawnForm::Maxwell => {
                // The point between spring and damper is a coordinate that moves nothing else.
                let between = chain.elements.len();
                let Some(element) = grip.coordinates.first().map(|(element, _)| *element) else {
                    return;
                };
                let held = &chain.elements[element];
                chain.elements.push(Element {
                    role: Role::Bearing,
                    place: held.place,
                    at: held.at,
                    directions: vec![Vector6::zeros()],
                    shape: DMatrix::identity(1, 1),
                    stiffness: Dual::constant(0.0),
                    damping: None,
                });
                let spring = Grip {
                    coordinates: vec![(element, 1.0), (between, -1.0)],
                    point: None,
                };
                let damper = Grip {
                    coordinates: vec![(between, 1.0)],
                    point: None,
                };
                attach(chain, &spring, AttachmentLaw::Spring, &values[0]);
                attach(chain, &damper, AttachmentLaw::Damper, &values[1]);
            }
            DrawnForm::RotorOnSpring
            | DrawnForm::FloorMode
            | DrawnForm::IsotropicSpring
            | DrawnForm::IsotropicSpringDamper => (),
        }
    }
}

impl Effect<Structure> for Series {
    fn id(&self) -> &'static str {
        "series"
    }

    fn explanation(&self) -> &'static str {
        "What the data drew at this place: the structure gives way where the model takes it for stiff."
    }

    fn fingerprint(&self) -> &'static str {
        "One and the same stiffness between the two sides of this place explains the misfit at all postures."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Two accelerometers, one on each side of the place (both rings of the bearing, foot plate and floor): \
             hit the arm and see whether they move against each other at the frequencies of the drawn curve.",
            ..DrawnBranch.background()
        }
    }

    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        Spot::series(robot).into_iter().map(Site::At).collect()
    }

    fn variants(&self, site: Site) -> Vec<usize> {
        variants(site)
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        FORMS.get(variant).map(|form| ("form", form.label()))
    }

    fn parameters(&self, At { site, variant }: At, Known { data, .. }: &Known<Structure>) -> Vec<Parameter> {
        parameters(site, variant, data)
    }

    fn starts(
        &self,
        At { site, variant }: At,
        Known { data, .. }: &Known<Structure>,
        peaks_hz: &[f64],
    ) -> Vec<Vec<f64>> {
        starts(site, variant, data, peaks_hz)
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vanishing(parameters, 1.0 / NEGLIGIBLE))
    }

    fn apply(&self, At { site, variant }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let Site::At(spot) = site else { return };
        if form_of(variant) == DrawnForm::FloorMode {
            return attach_floor(chain, spot, values);
        }
        let Some((place, at, twist)) = spot.twist(setting.kinematics) else {
            return;
        };
        let coordinate = Grip {
            coordinates: vec![(chain.elements.len(), 1.0)],
            point: None,
        };
        let form = form_of(variant);
        let other = spot.alike().filter(|_| form.is_isotropic());
        let other = other.and_then(|spot| spot.twist(setting.kinematics));
        let directions: Vec<Vector6<f64>> = std::iter::once(twist)
            .chain(other.map(|(_, _, twist)| twist))
            .collect();
        let damped = matches!(
            form,
            DrawnForm::SpringDamper | DrawnForm::RotorOnSpring | DrawnForm::IsotropicSpringDamper
        );
        chain.elements.push(Element {
            role: if place.link == 0 {
                Role::Base
            } else {
                Role::Bearing
            },
            place,
            at,
            shape: DMatrix::identity(directions.len(), directions.len()),
            directions,
            stiffness: values[0].clone(),
            damping: damped.then(|| values[1].clone()),
        });
        match form {
            DrawnForm::LossFactor => {
                attach(
                    chain,
                    &coordinate,
                    AttachmentLaw::Hysteresis,
                    &(&values[0] * &values[1]),
                );
            }
            DrawnForm::RotorOnSpring => attach(chain, &coordinate, AttachmentLaw::Inertia, &values[2]),
            _ => (),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Baseline;
    use crate::robot::RobotModel;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    /// The six springs of an oblique one together are k d dᵀ, and they lose or add nothing across d.
    #[test]
    fn an_oblique_spring_acts_along_its_direction_only() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let bare = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
        let spot = Spot::LinkGround(4, 1);
        let mut chain = bare.clone();
        let setting = PostureSetting::of_tests(&robot, &kinematics);
        let (k, c, towards_z, towards_x) = (4e4, 300.0, 0.5, -0.3);
        let values = [k, c, towards_z, towards_x].map(Dual::constant);
        let at = At {
            site: Site::At(spot),
            variant: number(DrawnForm::ObliqueSpringDamper),
        };
        DrawnBranch.apply(at, &values, &setting, &mut chain);
        let (point, place, _) = spot.point(&kinematics).unwrap();
        let direction = Vector3::new(towards_x, 1.0, towards_z).normalize();
        let row = bare.output_row(point, place, false, &direction);
        let expected = k * &row * row.transpose();
        let added = chain.system(0).stiffness - bare.system(0).stiffness;
        let size = expected.norm();
        assert!(size > 0.0 && (added - expected).norm() < 1e-9 * size);
    }

    /// Under a steady force the floor gives way along its direction only, by F/k; and its mass moves with the base.
    #[test]
    fn a_floor_mode_gives_way_along_its_direction_only() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let bare = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
        let mut chain = bare.clone();
        let setting = PostureSetting::of_tests(&robot, &kinematics);
        let (mass_kg, frequency_hz, towards_y, towards_z) = (1500.0, 20.0, 0.6, -0.4);
        let values = [mass_kg, frequency_hz, 0.03, towards_y, towards_z].map(Dual::constant);
        let at = At {
            site: Site::At(Spot::Base(0)),
            variant: number(DrawnForm::FloorMode),
        };
        Series.apply(at, &values, &setting, &mut chain);
        let direction = Vector3::new(1.0, towards_y, towards_z).normalize();
        let stiffness = mass_kg * (std::f64::consts::TAU * frequency_hz).powi(2);
        let place = Place::new(kinematics.joint_count(), Slot::End);
        let compliance = |chain: &Chain, force: &Vector3<f64>| {
            let row = chain.output_row(kinematics.tcp(), place, false, force);
            let held = chain.system(0).stiffness.cholesky().unwrap();
            row.dot(&held.solve(&row))
        };
        for force in [
            Vector3::x(),
            Vector3::y(),
            Vector3::new(1.0, -1.0, 1.0).normalize(),
        ] {
            let more = compliance(&chain, &force) - compliance(&bare, &force);
            let expected = direction.dot(&force).powi(2) / stiffness;
            assert!((more - expected).abs() < 1e-3 / stiffness, "{more} {expected}");
        }
        let light = {
            let mut values = values.clone();
            (values[0], values[1]) = (Dual::constant(0.25 * mass_kg), Dual::constant(2.0 * frequency_hz));
            let mut chain = bare.clone();
            Series.apply(at, &values, &setting, &mut chain);
            chain
        };
        let difference = chain.system(0).mass - light.system(0).mass;
        assert!((difference.trace() - 3.0 * 0.75 * mass_kg).abs() < 1e-6 * mass_kg);
        assert!((chain.system(0).stiffness - light.system(0).stiffness).norm() < 1e-3 * stiffness);
    }

    /// Whichever axis an oblique spring is named after, it is the same spring.
    #[test]
    fn an_oblique_spring_is_named_after_the_axis_it_mostly_follows() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let setting = PostureSetting::of_tests(&robot, &kinematics);
        let stiffness = |spot, values: &[f64]| {
            let mut chain = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
            let at = At {
                site: Site::At(spot),
                variant: number(DrawnForm::ObliqueSpringDamper),
            };
            let values: Vec<Dual> = values.iter().map(|v| Dual::constant(*v)).collect();
            DrawnBranch.apply(at, &values, &setting, &mut chain);
            chain.system(0).stiffness
        };
        let form = DrawnForm::ObliqueSpringDamper;
        // Direction (0.5, 1, −2): of z.
        let (spot, values) = (Spot::ToolGround(1), [4e5, 300.0, -2.0, 0.5]);
        let (renamed, own) = along_its_axis(spot, form, &values).unwrap();
        assert_eq!(
            (renamed, own.as_slice()),
            (Spot::ToolGround(2), &[4e5, 300.0, -0.25, -0.5][..])
        );
        let difference = stiffness(renamed, &own) - stiffness(spot, &values);
        assert!(difference.norm() < 1e-9 * stiffness(spot, &values).norm());
        assert!(along_its_axis(spot, form, &[4e5, 300.0, 0.9, -1.0]).is_none());
        assert!(along_its_axis(spot, DrawnForm::Resonator, &[5.0, 27.0, 3.0]).is_none());
        let floor = along_its_axis(Spot::Base(2), DrawnForm::FloorMode, &[2e3, 20.0, 0.03, 2.0, 1.0]);
        assert_eq!(floor.unwrap(), (Spot::Base(0), vec![2e3, 20.0, 0.03, 0.5, 0.5]));
    }

    /// A force on the arm finds the foot plate's stiffness along x and y alike, and only there; the model's own dissipation is kept.
    #[test]
    fn an_isotropic_spring_gives_way_along_two_axes() {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let setting = PostureSetting::of_tests(&robot, &kinematics);
        let bare = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
        let tool = |chain: &Chain| {
            let gained = chain.compliance(kinematics.tcp(), robot.flange_place()).unwrap();
            gained.fixed_view::<3, 3>(0, 0).into_owned()
        };
        let k = 5e6;
        for form in [DrawnForm::IsotropicSpring, DrawnForm::IsotropicSpringDamper] {
            let mut chain = bare.clone();
            let at = At {
                site: Site::At(Spot::Base(0)),
                variant: number(form),
            };
            Series.apply(at, &[k, 400.0].map(Dual::constant), &setting, &mut chain);
            let expected = nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)) / k;
            assert!((tool(&chain) - tool(&bare) - expected).norm() < 1e-9 * expected.norm());
        }
        assert!(forms(Spot::Base(1)).iter().all(|form| !form.is_isotropic()));
        assert!(forms(Spot::Bearing(3, 3)).contains(&DrawnForm::IsotropicSpring));
    }
}
