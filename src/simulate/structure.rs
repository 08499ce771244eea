//! Simulated FRF campaigns: a robot with known parameters, hidden effects, a sensor with noise.
//!
//! The model that makes the data is the one that the fits use, so a simulated campaign tests the identification and the
//! diagnosis, not the physics.

use num_complex::Complex64;
use serde_json::{Map, Value, json};

use super::campaign_folder::LabCampaign;
use super::departure::{self, Departed, LabDeparture};
use super::draw::{Draws, Purpose};
use super::files::{self, FrfEntry, FrfFormat};
use super::lab_robot::LabRobot;
use super::laboratory::{Laboratory, Slip};
use super::noise::LineNoise;
use super::postures;
use super::request::{HiddenEffect, described_parameters};
use super::scenario::{FrfLayout, NOISE_FLOOR_M_PER_N, StructureScenario};
use crate::campaign::{AxesRef, BodyRef, MeasuredDof, MeasuredFrf, Point, Posture, RobotSection};
use crate::identify::{FrfData, StructureModel};
use crate::ingest::{Axis, Dof, FrfRecord};
use crate::robot::RobotModel;
use crate::simulate::sizes::imitation::{self, Imitation};
use crate::simulate::sizes::strength::{self, Sight};
use crate::simulate::sizes::visibility::{self, HiddenTruth, Visibility};
use crate::{InputError, Result};

/// Stiffness tolerance that a campaign without the key has.
const DEFAULT_STIFFNESS_TOLERANCE: f64 = 0.3;
/// Range of the true damping ratio.
const DAMPING_RATIO: [f64; 2] = [0.02, 0.04];

/// The robot as it really is in the simulated lab.
struct TrueRobot {
    model: StructureModel,
    theta: Vec<f64>,
    joint_stiffness_nm_per_rad: Vec<f64>,
    damping_ratio: f64,
    mass_scale: Vec<f64>,
}

impl TrueRobot {
    fn draw(
        robot: &LabRobot,
        points: Vec<Point>,
        section: &RobotSection,
        scenario: &StructureScenario,
    ) -> Self {
        let mut draws = Draws::new(scenario.seed, Purpose::Robot);
        let spec = &robot.spec;
        let joint_stiffness_nm_per_rad: Vec<f64> = spec
            .joints
            .iter()
            .map(|j| (scenario.stiffness_error * draws.normal_within(2.5)).exp() / j.compliance_rad_per_nm)
            .collect();
        let damping_ratio = draws.uniform(DAMPING_RATIO[0], DAMPING_RATIO[1]);
        // Drawn even where they are exact, so that the mass error changes nothing else.
        let mass_scale: Vec<f64> = spec
            .links
            .iter()
            .map(|_| 1.0 + scenario.mass_error * draws.normal_within(2.5))
            .collect();
        let model = StructureModel::new(RobotModel::new(spec.clone()), points, section);
        let truth_of = |name: &str| -> Option<f64> {
            let (site, quantity) = name.split_once('.').unwrap_or((name, ""));
            let index = || site.rsplit('-').next()?.parse::<usize>().ok()?.checked_sub(1);
            match quantity {
                "stiffness" => joint_stiffness_nm_per_rad.get(index()?).copied(),
                "mass" => Some(spec.links.get(index()?)?.mass_kg * mass_scale[index()?]),
                _ => Some(damping_ratio),
            }
        };
        let theta = model
            .parameters
            .iter()
            .map(|p| p.internal(truth_of(&p.name).unwrap_or(p.nominal)))
            .collect();
        TrueRobot {
            model,
            theta,
            joint_stiffness_nm_per_rad,
            damping_ratio,
            mass_scale,
        }
    }
}

/// Points of a layout: node 1 is the tool point.
fn points(layout: FrfLayout, joints: usize) -> Vec<Point> {
    let point = |node, body| Point {
        node,
        body,
        position_m: [0.0; 3],
        axes: AxesRef::Base,
    };
    let mut all = vec![point(1, BodyRef::Tool)];
    if layout == FrfLayout::Roving {
        // Links 1, 2 and 4 of a six-axis robot.
        let mut links: Vec<usize> = [1, 2, joints.saturating_sub(2)]
            .into_iter()
            .filter(|l| (1..=joints).contains(l))
            .collect();
        links.sort_unstable();
        links.dedup();
        all.extend(
            (2..)
                .zip(links)
                .map(|(node, link)| point(node, BodyRef::Link(link))),
        );
    }
    all
}

/// Response and reference (point, axis) of every FRF of a file.
fn channels(layout: FrfLayout, points: usize) -> Vec<[(usize, Axis); 2]> {
    match layout {
        FrfLayout::Direct => [Axis::X, Axis::Y].map(|a| [(0, a), (0, a)]).to_vec(),
        FrfLayout::Tool | FrfLayout::Roving => (0..points)
            .flat_map(|p| Axis::ALL.map(|a| (p, a)))
            .flat_map(|response| Axis::ALL.map(|a| [response, (0, a)]))
            .collect(),
    }
}

/// The measurement as it is set up: every FRF, with nothing measured yet.
fn arrange(
    scenario: &StructureScenario,
    model: &RobotModel,
    postures: &[Posture],
    points: &[Point],
) -> Result<FrfData> {
    let dof = |(point, axis): (usize, Axis)| MeasuredDof {
        point,
        axis,
        negative: false,
    };
    let name = |(point, axis): (usize, Axis)| Dof {
        node: points[point].node,
        axis,
        negative: false,
    };
    let levels: Vec<Option<f64>> = match scenario.force_levels_n.is_empty() {
        true => vec![None],
        false => scenario.force_levels_n.iter().copied().map(Some).collect(),
    };
    let lines = scenario.lines_hz();
    let mut frfs = Vec::new();
    for posture in 0..postures.len() {
        for level in &levels {
            for [response, reference] in channels(scenario.layout, points.len()) {
                frfs.push(MeasuredFrf {
                    posture,
                    response: dof(response),
                    reference: dof(reference),
                    name: format!("{}/{}", name(response), name(reference)),
                    frequency_hz: lines.clone(),
                    receptance_m_per_n: Vec::new(),
                    coherence: None,
                    force_level_n: *level,
                    file: Default::default(),
                });
            }
        }
    }
    FrfData::arrange(postures, model, frfs)
}

/// Simulates a campaign.
///
/// # Errors
/// Settings that make no campaign, and effects that there are not or that this campaign cannot show.
pub fn simulate(scenario: &StructureScenario, robot: &LabRobot) -> Result<LabCampaign> {
    scenario.check()?;
    let section = RobotSection {
        model: robot.reference.clone(),
        mass_tolerance: (scenario.mass_error > 0.0).then_some(scenario.mass_error),
        stiffness_tolerance: scenario.stiffness_error.max(DEFAULT_STIFFNESS_TOLERANCE),
        links: Default::default(),
    };
    let points = points(scenario.layout, robot.spec.joints.len());
    let lab = TrueRobot::draw(robot, points, &section, scenario);
    let mut draws = Draws::new(scenario.seed, Purpose::Postures);
    let postures = postures::draw(
        &lab.model.robot,
        robot.is_built_in(),
        scenario.postures,
        &mut draws,
    )?;
    let mut data = arrange(scenario, &lab.model.robot, &postures, &lab.model.points)?;
    let truth = HiddenTruth {
        bare: &lab.model,
        bare_theta: &lab.theta,
        summary: data.summary(),
    };

    let mut draws = Draws::new(scenario.seed, Purpose::Effects);
    let mut hidden: Vec<HiddenEffect> = Vec::new();
    for request in &scenario.effects {
        let mut effect = request.settle(&robot.spec, &truth.summary, &mut draws)?;
        effect.size = scenario.strength;
        if hidden
            .iter()
            .any(|h| h.instance.label() == effect.instance.label())
        {
            return Err(InputError::new("the same effect twice")
                .key(format!("--effect {}", effect.instance.label()))
                .remedy("give it once, or another site")
                .into());
        }
        hidden.push(effect);
    }
    // Effects on the channels' mixing must come after those that replace it.
    hidden.sort_by_key(|h| h.foreign);

    // Without noise there is still a scale on which an effect is seen: the noise that is usual.
    let noiseless = scenario.noise_relative == 0.0 && scenario.noise_floor_m_per_n == 0.0;
    let (relative, floor) = match noiseless {
        true => (0.02, NOISE_FLOOR_M_PER_N),
        false => (scenario.noise_relative, scenario.noise_floor_m_per_n),
    };
    // A value of exactly zero would get an endless weight.
    let noise = move |magnitude: f64| (relative * magnitude).hypot(floor).max(1e-15);
    let stride = refit_stride(&data, scenario);
    let values = (data.frfs().count() * scenario.lines_hz().len()) as f64;
    let share_sigmas = scenario.excess_share.map(|share| (2.0 * share * values).sqrt());
    for i in 0..hidden.len() {
        let asked = share_sigmas
            .filter(|_| hidden[i].foreign)
            .or(scenario.visibility_sigmas);
        if let Some(sigmas) = asked {
            visibility::resize(
                &truth,
                &mut hidden,
                i,
                sigmas,
                (scenario.largest_size, scenario.possible_only),
                (&mut data, &noise, stride),
            )?;
        }
    }
    let (model, theta) = truth.with(&hidden);
    visibility::fill(&mut data, &model, &theta, noise)?;
    let seen: Vec<Visibility> = (0..hidden.len())
        .map(|i| visibility::of(&truth, &hidden, i, &data, stride))
        .collect::<Result<_>>()?;

    let sight = Sight {
        model: &model,
        theta: &theta,
        postures: &postures,
        noise: &noise,
        stride,
    };
    let mut departed = Vec::new();
    let mut departures_seen = Vec::new();
    for kind in &scenario.departures {
        let departure = departure::drawn(kind, &robot.spec, scenario.seed)
            .ok_or_else(|| InputError::new(format!("{kind} is no departure")).key("--unknown"))?;
        departed.push(Departed {
            departure,
            strength: scenario.strength.min(1.0),
        });
        let asked = scenario.visibility_sigmas.map(|s| 0.5 * s * s / values);
        if let Some(excess) = scenario.excess_share.or(asked) {
            strength::settle(&mut departed, excess, &sight, &mut data)?;
        }
        departures_seen.push(sight.fill(&departed, &mut data)?);
    }

    // What is foreign stands last; with what is hidden besides it in the model, how near does the library come?
    let imitation = match hidden.last() {
        _ if !departed.is_empty() => Some(imitation::nearest(&model, &theta, &truth.summary, &data, stride)?),
        Some(last) if last.foreign => {
            let (model, theta) = truth.with(&hidden[..hidden.len() - 1]);
            Some(imitation::nearest(&model, &theta, &truth.summary, &data, stride)?)
        }
        _ => None,
    };

    let mut laboratory = None;
    if !scenario.slips.is_empty() {
        let joints = robot.spec.joints.len();
        let lab = Laboratory::draw(
            scenario.seed,
            &scenario.slips,
            &data,
            joints,
            lab.model.points.len(),
        );
        let drawn = lab.described(1.0);
        departed.push(Departed {
            departure: Box::new(lab),
            strength: 1.0,
        });
        laboratory = Some((drawn, sight.fill(&departed, &mut data)?));
    }
    let line_noise = match scenario.slips.contains(&Slip::Lines) {
        true => LineNoise::Hann,
        false => scenario.line_noise,
    };

    let mut measured = Vec::new();
    let mut entries = Vec::new();
    let mut draws = Draws::new(scenario.seed, Purpose::Noise);
    let mut common_draws = Draws::new(scenario.seed, Purpose::CommonNoise);
    let (common_part, own_part) = (scenario.common_noise.sqrt(), (1.0 - scenario.common_noise).sqrt());
    for block in &data.blocks {
        // One disturbance a hit: the same share of every output of that hit.
        let common: Vec<Vec<Complex64>> = match scenario.common_noise > 0.0 {
            true => (0..block.outputs.len())
                .map(|_| line_noise.draw(block.frequency_hz.len(), &mut common_draws))
                .collect(),
            false => Vec::new(),
        };
        let records: Vec<FrfRecord> = block
            .frfs
            .iter()
            .map(|frf| {
                let own = line_noise.draw(block.frequency_hz.len(), &mut draws);
                let value = block
                    .frequency_hz
                    .iter()
                    .enumerate()
                    .zip(&frf.receptance)
                    .map(|((k, f), h)| {
                        let std = match noiseless {
                            true => 0.0,
                            false => noise(h.norm()) * std::f64::consts::FRAC_1_SQRT_2,
                        };
                        let error = match common.get(frf.input) {
                            Some(common) if h.norm() > 0.0 => {
                                common[k] * (h / h.norm()) * common_part + own[k] * own_part
                            }
                            _ => own[k],
                        };
                        files::as_quantity(h + error * std, *f, scenario.quantity)
                    })
                    .collect();
                let dof = |d: MeasuredDof| Dof {
                    node: lab.model.points[d.point].node,
                    axis: d.axis,
                    negative: d.negative,
                };
                FrfRecord {
                    name: frf.name.clone(),
                    response: Some(dof(frf.response)),
                    reference: Some(dof(frf.reference)),
                    quantity: Some(scenario.quantity),
                    frequency_hz: block.frequency_hz.clone(),
                    value,
                    coherence: None,
                }
            })
            .collect();
        let level = block.force_level_n.map_or(String::new(), |l| format!("-{l}n"));
        let file = format!(
            "frf/{}{level}.{}",
            postures[block.posture].id,
            scenario.format.extension()
        );
        measured.push((file.clone(), scenario.format.bytes(&records)));
        entries.push(FrfEntry {
            file,
            posture: block.posture,
            quantity: (scenario.format == FrfFormat::Csv).then_some(scenario.quantity),
            force_level_n: block.force_level_n,
        });
    }
    let toml = files::campaign_toml(
        &format!("simulated {}", scenario.seed),
        &section,
        DEFAULT_STIFFNESS_TOLERANCE,
        &lab.model.points,
        &postures,
        &entries,
    );
    let mut all = vec![("campaign.toml".to_string(), toml.into_bytes())];
    all.extend(robot.file.clone());
    all.extend(measured);
    Ok(LabCampaign {
        files: all,
        truth: truth_document(
            scenario,
            &lab,
            &Hidden {
                effects: &hidden,
                seen: &seen,
                departed: &departed,
                departures_seen: &departures_seen,
                imitation,
                laboratory,
                line_noise,
            },
        ),
    })
}

/// Every how many lines the refits behind a visibility use.
fn refit_stride(data: &FrfData, scenario: &StructureScenario) -> usize {
    const VALUES: usize = 5_000;
    let lines = scenario.lines_hz().len();
    // Nothing is measured yet: what the FRFs will hold.
    let values = data.frfs().count() * lines;
    (values / VALUES).clamp(1, 10).min(lines / 20 + 1)
}

/// What was hidden, and how plainly it shows.
struct Hidden<'a> {
    effects: &'a [HiddenEffect],
    seen: &'a [Visibility],
    departed: &'a [Departed],
    /// One for each departure that is not the laboratory.
    departures_seen: &'a [Visibility],
    imitation: Option<Imitation>,
    laboratory: Option<(Map<String, Value>, Visibility)>,
    line_noise: LineNoise,
}

/// The truth file: the keys of the practice campaigns' and what else is known.
fn truth_document(scenario: &StructureScenario, lab: &TrueRobot, hidden: &Hidden) -> Value {
    let effects = hidden
        .effects
        .iter()
        .zip(hidden.seen)
        .map(|(h, v)| described(h, v));
    let departed = hidden.departed.iter().zip(hidden.departures_seen);
    let described: Vec<Value> = effects
        .chain(departed.map(|(d, v)| described_departure(d, v)))
        .collect();
    let main = described
        .first()
        .cloned()
        .unwrap_or_else(|| json!({ "effect": "none", "site": null, "parameters": {}, "visibility": null }));
    let laboratory = hidden
        .laboratory
        .as_ref()
        .map(|(slips, seen)| json!({ "slips": slips, "visibility": seen }));
    json!({
        "schema": "lobestone/truth/1",
        "domain": "structure",
        "seed": scenario.seed,
        "kind": scenario.kind,
        "effect": main["effect"],
        "site": main["site"],
        "parameters": main["parameters"],
        "visibility": main["visibility"],
        "nearest_library_effect": hidden.imitation,
        "also": described.get(1..).unwrap_or_default(),
        "joint_stiffness": lab.joint_stiffness_nm_per_rad,
        "zeta": lab.damping_ratio,
        "mass_scale": lab.mass_scale,
        "noise": [scenario.noise_relative, scenario.noise_floor_m_per_n],
        "line_noise": hidden.line_noise,
        "common_noise": scenario.common_noise,
        "laboratory": laboratory,
        "layout": scenario.layout,
        "postures": scenario.postures.count,
    })
}

fn described_departure(departed: &Departed, seen: &Visibility) -> Value {
    let mut parameters = departed.departure.described(departed.strength);
    parameters.insert("kind".into(), json!(departed.departure.id()));
    parameters.insert("strength".into(), json!(departed.strength));
    json!({
        "effect": "unknown",
        "site": departed.departure.site(),
        "parameters": parameters,
        "visibility": seen,
    })
}

fn described(hidden: &HiddenEffect, seen: &Visibility) -> Value {
    let id = hidden.instance.effect.id();
    let mut parameters = described_parameters(&hidden.instance, &hidden.parameters, &hidden.values());
    if hidden.foreign {
        parameters.insert("kind".into(), json!(id));
    }
    json!({
        "effect": if hidden.foreign { "unknown" } else { id },
        "site": hidden.instance.site.label(),
        "parameters": parameters,
        "visibility": seen,
    })
}
