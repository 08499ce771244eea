//! Force records of milled cuts whose truth is known.
//!
//! The chip is counted angle by angle, slice by slice and tooth by tooth, against every pass before. Nothing is shared with the closed
//! forms that a fit works with but the physics, so that these campaigns try that mathematics, too.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use serde_json::{Map, Value, json};

use super::campaign_folder::LabCampaign;
use super::draw::{Draws, Purpose};
use super::request::{EffectRequest, described_parameters};
use super::sizes::magnitude;
use crate::cutting::waveform::ToothPlace;
use crate::data::Process;
use crate::effects::cutting::{CutPhysics, CutSetting, CuttingSummary, Mixing};
use crate::effects::{CUTTING, Cutting, Instance, Known, Registry, Site};
use crate::parameter::Parameter;
use crate::robot::Dual;
use crate::text::closest;
use crate::{InputError, Result};

/// Effects whose records are not made: they have frequencies or drifts of their own.
const NOT_MADE: [&str; 5] = [
    "chatter",
    "dynamometer-resonance",
    "nonlinear-drift",
    "chisel-edge",
    "margin-friction",
];

/// A campaign of milled cuts to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceScenario {
    /// Everything that is not given comes from it.
    pub seed: u64,
    /// Physics hidden in the records.
    pub effects: Vec<EffectRequest>,
    /// Size of what is drawn against what its file calls usual.
    pub strength: f64,
    /// Noise of each channel, N; `None`: drawn.
    pub noise_n: Option<f64>,
}

/// Whether `id` is an effect on cutting forces.
pub fn is_on_forces(id: &str) -> bool {
    CUTTING.iter().any(|e| e.id() == id)
}

const SAMPLE_RATE_HZ: f64 = 5000.0;
/// Air before, cut, air after, s.
const STRETCHES_S: [f64; 3] = [0.4, 1.6, 0.4];
/// Angles of the tool at which a turn is counted, and the share of half the sampling rate that the amplifier passes.
const ANGLES: usize = 2880;
const PASSED: f64 = 0.9;
/// Slices of the depth: their stairs put a line at order 30 off by 5e-4 of itself where the helix is steep.
const SLICES: usize = 100;

/// The tool and what is cut.
struct Lab {
    teeth: usize,
    diameter_mm: f64,
    helix_deg: f64,
    depth_mm: f64,
    immersion_deg: [f64; 2],
    coefficients: [f64; 6],
    noise_n: f64,
    cuts: Vec<LabCut>,
}

struct LabCut {
    rpm: f64,
    feed_mm: f64,
    order: usize,
}

struct Hidden {
    instance: Instance<Cutting>,
    parameters: Vec<Parameter>,
    values: Vec<f64>,
}

/// Makes the campaign.
///
/// # Errors
/// An effect that there is not, that is not made here or that such cuts cannot show; a value that it cannot have.
pub fn simulate(scenario: &ForceScenario) -> Result<LabCampaign> {
    let lab = Lab::drawn(scenario);
    let summary = lab.summary();
    let mut draws = Draws::new(scenario.seed, Purpose::CuttingEffects);
    let hidden: Vec<Hidden> = scenario
        .effects
        .iter()
        .map(|request| settle(request, &summary, scenario.strength, &mut draws))
        .collect::<Result<_>>()?;
    let mut noise = Draws::new(scenario.seed, Purpose::ForceNoise);
    let mut files = vec![("campaign.toml".to_string(), lab.toml().into_bytes())];
    for (index, cut) in lab.cuts.iter().enumerate() {
        let record = lab.record(cut, &hidden, &mut noise);
        files.push((format!("force/c{:02}.txt", index + 1), record.into_bytes()));
    }
    Ok(LabCampaign {
        files,
        truth: lab.truth(scenario, &hidden),
    })
}

impl Lab {
    fn drawn(scenario: &ForceScenario) -> Lab {
        let mut draws = Draws::new(scenario.seed, Purpose::Cutting);
        let teeth = *draws.pick(&[3, 4, 4, 4, 5, 6]);
        let diameter_mm = *draws.pick(&[10.0, 12.0, 16.0, 20.0]);
        let helix_deg = *draws.pick(&[25.0, 30.0, 35.0, 45.0]);
        let depth_mm = *draws.pick(&[1.5, 2.0, 3.0]);
        let immersion_deg = *draws.pick(&[
            [0.0, 180.0],
            [0.0, 180.0],
            [0.0, 90.0],
            [90.0, 180.0],
            [30.0, 150.0],
        ]);
        let ktc = draws.log_uniform(700.0, 1900.0);
        let kte = draws.uniform(8.0, 30.0);
        let coefficients = [
            ktc,
            ktc * draws.uniform(0.25, 0.6),
            ktc * draws.uniform(0.1, 0.35),
            kte,
            kte * draws.uniform(0.6, 1.2),
            kte * draws.uniform(0.05, 0.3),
        ];
        let drawn_noise = draws.log_uniform(2.0, 7.0);
        let speed = draws.uniform(0.8, 1.25);
        let mut orders: Vec<usize> = (1..=12).collect();
        for last in (1..orders.len()).rev() {
            orders.swap(last, draws.pick_index(last + 1));
        }
        let mut cuts = Vec::new();
        for feed_mm in [0.04, 0.07, 0.11, 0.16] {
            for rpm in [1500.0, 2100.0, 3000.0] {
                cuts.push(LabCut {
                    rpm: (rpm * speed * 12.0 / diameter_mm).round(),
                    feed_mm,
                    order: orders[cuts.len()],
                });
            }
        }
        Lab {
            teeth,
            diameter_mm,
            helix_deg,
            depth_mm,
            immersion_deg,
            coefficients,
            noise_n: scenario.noise_n.unwrap_or(drawn_noise),
            cuts,
        }
    }

    fn lag_rad(&self) -> f64 {
        2.0 * self.depth_mm * self.helix_deg.to_radians().tan() / self.diameter_mm
    }

    fn speed_m_per_min(&self, cut: &LabCut) -> f64 {
        PI * self.diameter_mm * cut.rpm / 1000.0
    }

    fn summary(&self) -> CuttingSummary {
        let speeds = || self.cuts.iter().map(|c| self.speed_m_per_min(c));
        let feeds = || self.cuts.iter().map(|c| c.feed_mm);
        CuttingSummary {
            process: Process::Milling,
            teeth: self.teeth,
            teeth_in_doubt: false,
            straight_edge: true,
            one_helix: true,
            even_pitch: true,
            engagements: 1,
            cuts: self.cuts.len(),
            sequence_length: self.cuts.len(),
            speed_m_per_min: [
                speeds().fold(f64::INFINITY, f64::min),
                speeds().fold(0.0, f64::max),
            ],
            feeds: 4,
            smallest_feed_mm: feeds().fold(f64::INFINITY, f64::min),
            largest_feed_mm: feeds().fold(0.0, f64::max),
            channels: [true, true, true, false],
            highest_hz: SAMPLE_RATE_HZ / 2.0,
            air_on_both_sides: true,
            full_holes: 0,
            pilot_holes: 0,
            has_edge: true,
            vibration_hz: None,
            longest_record_s: STRETCHES_S.iter().sum(),
            cutting_scale_n_per_mm2: self.coefficients[0],
        }
    }

    fn setting(&self, cut: &LabCut) -> CutSetting {
        let [slow, fast] = self.summary().speed_m_per_min;
        CutSetting {
            process: Process::Milling,
            progress: (cut.order - 1) as f64 / (self.cuts.len() - 1) as f64,
            speed_ratio: self.speed_m_per_min(cut) / (slow * fast).sqrt(),
            feed_mm: cut.feed_mm,
            teeth: self.teeth,
            has_vibration: false,
        }
    }

    fn physics(&self, cut: &LabCut, hidden: &[Hidden]) -> CutPhysics {
        let mut physics = CutPhysics::of(self.coefficients.map(Dual::constant).to_vec());
        let mut in_order: Vec<&Hidden> = hidden.iter().collect();
        in_order.sort_by_key(|h| h.instance.effect.order());
        for Hidden { instance, values, .. } in in_order {
            let values: Vec<Dual> = values.iter().map(|v| Dual::constant(*v)).collect();
            instance
                .effect
                .apply(instance.at(), &values, &self.setting(cut), &mut physics);
        }
        physics
    }

    /// Forces x, y, z on the tool frame when tooth 0 stands at `turn` (rad), by slices of `depth_mm`.
    fn forces(
        &self,
        cut: &LabCut,
        physics: &CutPhysics,
        places: &[ToothPlace],
        depth_mm: f64,
        turn: f64,
    ) -> [f64; 3] {
        let k: Vec<f64> = physics.coefficient.iter().map(|k| k.value).collect();
        let exponents = physics
            .size_exponent
            .as_ref()
            .map(|p| [0, 1, 2].map(|d| p[d].value));
        let runout = physics
            .runout
            .as_ref()
            .map_or([0.0; 2], |r| [r.offset_mm.value, r.angle_rad.value]);
        let pitch = TAU / self.teeth as f64;
        let [start, exit] = self.immersion_deg.map(f64::to_radians);
        let slice_mm = depth_mm / SLICES as f64;
        let mut sum = [0.0; 3];
        for slice in 0..SLICES {
            let height = (slice as f64 + 0.5) / SLICES as f64 * depth_mm / self.depth_mm;
            for (j, place) in places.iter().enumerate() {
                let phi = (turn + place.ahead_rad - height * place.lag_rad).rem_euclid(TAU);
                if !(start..exit).contains(&phi) {
                    continue;
                }
                let (sin, cos) = phi.sin_cos();
                // How far the pass of tooth m of the count reaches into the work here; passes ahead happened earlier.
                let reach = |m: usize| {
                    let other = places[m % self.teeth];
                    let ahead = other.ahead_rad + TAU * (m / self.teeth) as f64 - place.ahead_rad;
                    let eccentric = runout[0] * (runout[1] - other.ahead_rad + height * other.lag_rad).cos();
                    other.radius_mm + eccentric - ahead / pitch * cut.feed_mm * sin
                };
                let deepest = (j + 1..=j + self.teeth)
                    .map(reach)
                    .fold(f64::NEG_INFINITY, f64::max);
                let h = reach(j) - deepest;
                if h <= 0.0 {
                    continue;
                }
                let chip = match exponents {
                    None => [h; 3],
                    Some(p) => p.map(|p| h * (h / crate::cutting::waveform::ChipLaw::REFERENCE_MM).powf(-p)),
                };
                let [tangential, radial, axial] = [0, 1, 2].map(|d| (k[d] * chip[d] + k[d + 3]) * slice_mm);
                sum[0] += -tangential * cos - radial * sin;
                sum[1] += tangential * sin - radial * cos;
                sum[2] += axial;
            }
        }
        sum
    }

    /// Forces over a turn as Fourier coefficients up to what an anti-aliasing filter before the sampling leaves.
    fn orders(&self, cut: &LabCut, physics: &CutPhysics) -> Vec<[Complex64; 3]> {
        let places = self.places(physics);
        let depth_mm = self.depth_cut(cut, physics, &places);
        let matrix = |mixing: &Option<Mixing>, f: [f64; 3]| match mixing {
            None => f,
            Some(rows) => [0, 1, 2].map(|i| (0..3).map(|j| rows[i][j].value * f[j]).sum()),
        };
        let table: Vec<[f64; 3]> = (0..ANGLES)
            .map(|step| {
                let turn = TAU * step as f64 / ANGLES as f64;
                let force = self.forces(cut, physics, &places, depth_mm, turn);
                matrix(&physics.crosstalk, matrix(&physics.tilt, force))
            })
            .collect();
        let most = (PASSED * 0.5 * SAMPLE_RATE_HZ / (cut.rpm / 60.0)) as usize;
        let waves: Vec<Complex64> = (0..ANGLES)
            .map(|step| Complex64::from_polar(1.0 / ANGLES as f64, -TAU * step as f64 / ANGLES as f64))
            .collect();
        (0..=most.min(ANGLES / 4))
            .map(|n| {
                let mut sum = [Complex64::ZERO; 3];
                for (step, force) in table.iter().enumerate() {
                    let wave = waves[n * step % ANGLES] * if n == 0 { 1.0 } else { 2.0 };
                    for (sum, force) in sum.iter_mut().zip(force) {
                        *sum += wave * *force;
                    }
                }
                sum
            })
            .collect()
    }

    fn record(&self, cut: &LabCut, hidden: &[Hidden], draws: &mut Draws) -> String {
        use std::fmt::Write;
        let physics = self.physics(cut, hidden);
        let phase = draws.uniform(0.0, TAU);
        let lines: [[f64; 2]; 3] =
            std::array::from_fn(|_| [draws.uniform(-20.0, 20.0), draws.uniform(-4.0, 4.0)]);
        let orders = self.orders(cut, &physics);
        let [before, cutting, after] = STRETCHES_S;
        let count = ((before + cutting + after) * SAMPLE_RATE_HZ).round() as usize;
        let mut text = String::from("Sampling rate [Hz]:\t5000\nTime\tFx\tFy\tFz\ns\tN\tN\tN\n");
        for sample in 0..count {
            let time = sample as f64 / SAMPLE_RATE_HZ;
            let mut force = [0.0; 3];
            if (before..before + cutting).contains(&time) {
                let step = Complex64::from_polar(1.0, phase + TAU * cut.rpm / 60.0 * time);
                let mut wave = Complex64::ONE;
                for order in &orders {
                    for (force, order) in force.iter_mut().zip(order) {
                        *force += (order * wave).re;
                    }
                    wave *= step;
                }
            }
            let ((a, b), (c, _)) = (draws.normal_pair(), draws.normal_pair());
            let shown: [f64; 3] = std::array::from_fn(|i| {
                force[i] + lines[i][0] + lines[i][1] * time + self.noise_n * [a, b, c][i]
            });
            let [x, y, z] = shown;
            let _ = writeln!(text, "{time:.5}\t{x:.3}\t{y:.3}\t{z:.3}");
        }
        text
    }

    fn places(&self, physics: &CutPhysics) -> Vec<ToothPlace> {
        let mut places: Vec<ToothPlace> = (0..self.teeth)
            .map(|j| ToothPlace {
                ahead_rad: TAU * j as f64 / self.teeth as f64,
                lag_rad: self.lag_rad(),
                radius_mm: 0.0,
            })
            .collect();
        if let Some(own) = &physics.own_teeth {
            own.radii().for_each(|(j, by)| places[j].radius_mm += by.value);
            own.angles().for_each(|(j, by)| places[j].ahead_rad += by.value);
        }
        places
    }

    /// The depth at which the mean axial force pushes the tool off by what is missing of the stated one.
    fn depth_cut(&self, cut: &LabCut, physics: &CutPhysics, places: &[ToothPlace]) -> f64 {
        let Some(compliance) = &physics.axial_compliance_mm_per_n else {
            return self.depth_mm;
        };
        const STEPS: usize = 720;
        let mean = |depth: f64| -> f64 {
            let at =
                |step: usize| self.forces(cut, physics, places, depth, TAU * step as f64 / STEPS as f64)[2];
            (0..STEPS).map(at).sum::<f64>() / STEPS as f64
        };
        // Halving: what is cut less what the force leaves grows with the depth.
        let (mut low, mut high) = (0.0, 4.0 * self.depth_mm);
        for _ in 0..50 {
            let depth = 0.5 * (low + high);
            match depth + compliance.value * mean(depth) < self.depth_mm {
                true => low = depth,
                false => high = depth,
            }
        }
        0.5 * (low + high)
    }

    fn toml(&self) -> String {
        use std::fmt::Write;
        let Lab {
            teeth,
            diameter_mm,
            helix_deg,
            depth_mm,
            immersion_deg: [start, exit],
            ..
        } = self;
        let mut text = format!(
            "schema = \"lobestone/campaign/1\"\nname = \"force\"\n\n[tool]\nkind = \"endmill\"\ndiameter_mm = {diameter_mm:?}\n\
             teeth = {teeth}\nhelix_deg = {helix_deg:?}\n\n[material]\nname = \"simulated\"\n"
        );
        let immersion = match (*start, *exit) {
            (0.0, 180.0) => "immersion = \"slot\"".to_string(),
            (start, exit) => format!("start_deg = {start:?}\nexit_deg = {exit:?}"),
        };
        for (index, cut) in self.cuts.iter().enumerate() {
            let number = index + 1;
            let _ = write!(
                text,
                "\n[[cut]]\nid = \"c{number:02}\"\nfile = \"force/c{number:02}.txt\"\nprocess = \"milling\"\nspindle_rpm = {:?}\n\
                 feed_per_tooth_mm = {:?}\naxial_depth_mm = {depth_mm:?}\n{immersion}\norder = {}\n",
                cut.rpm, cut.feed_mm, cut.order
            );
        }
        text
    }

    fn truth(&self, scenario: &ForceScenario, hidden: &[Hidden]) -> Value {
        let described: Vec<Value> = hidden.iter().map(described).collect();
        let main = described
            .first()
            .cloned()
            .unwrap_or_else(|| json!({ "effect": "none", "parameters": {} }));
        let names = ["Ktc", "Krc", "Kac", "Kte", "Kre", "Kae"];
        let coefficients: Map<String, Value> = names
            .iter()
            .zip(self.coefficients)
            .map(|(name, value)| (name.to_string(), json!(value)))
            .collect();
        json!({
            "schema": "lobestone/truth/1",
            "domain": "cutting",
            "seed": scenario.seed,
            "effect": main["effect"],
            "site": null,
            "parameters": main["parameters"],
            "also": described.get(1..).unwrap_or_default(),
            "true_coefficients": coefficients,
            "noise_n": self.noise_n,
        })
    }
}

fn described(hidden: &Hidden) -> Value {
    let parameters = described_parameters(&hidden.instance, &hidden.parameters, &hidden.values);
    json!({ "effect": hidden.instance.effect.id(), "site": null, "parameters": parameters })
}

fn settle(
    request: &EffectRequest,
    summary: &CuttingSummary,
    strength: f64,
    draws: &mut Draws,
) -> Result<Hidden> {
    let error = |problem: String, remedy: String| {
        InputError::new(problem)
            .key(format!("--effect {}", request.effect))
            .remedy(remedy)
    };
    let known = Known::cuts(summary.clone());
    let made = || CUTTING.iter().map(|e| e.id()).filter(|id| !NOT_MADE.contains(id));
    let all: Vec<Instance<Cutting>> = Registry::cutting()
        .instances(&())
        .into_iter()
        .filter(|i| i.effect.id() == request.effect && i.site == Site::Everywhere)
        .filter(|i| i.effect.choice_obstacle(i.variant, &known).is_none())
        .collect();
    let Some(first) = all.first().filter(|i| !NOT_MADE.contains(&i.effect.id())) else {
        let ids: Vec<&str> = made().collect();
        let problem = "no record of milling is made with it".to_string();
        let remedy = match closest(&request.effect, ids.iter().copied()) {
            Some(id) if !is_on_forces(&request.effect) => format!("did you mean {id}?"),
            _ => format!("give one of {}", ids.join(", ")),
        };
        return Err(error(problem, remedy).into());
    };
    if request.site.is_some() {
        return Err(error("it has no site".into(), format!("write {} alone", request.effect)).into());
    }
    if let Some(obstacle) = first.effect.obstacle(&known) {
        let problem = format!("this campaign cannot show it: {obstacle}");
        return Err(error(problem, "give another --seed: it draws another tool".into()).into());
    }
    let drawn = *draws.pick(&all);
    let key_of = |i: &Instance<Cutting>| i.variant_label().map(|l| l.0);
    let asked = request
        .values
        .iter()
        .find(|(k, _)| Some(k.as_str()) == key_of(&drawn));
    let instance = match asked {
        None => drawn,
        Some((key, value)) => *all
            .iter()
            .find(|i| i.variant_label().map(|l| l.1) == Some(value.as_str()))
            .ok_or_else(|| {
                let known: Vec<&str> = all
                    .iter()
                    .filter_map(|i| i.variant_label().map(|l| l.1))
                    .collect();
                error(
                    format!("{key} cannot be {value:?} here"),
                    format!("give one of {}", known.join(", ")),
                )
            })?,
    };
    let parameters = instance.effect.parameters(instance.at(), &known);
    let mut values: Vec<f64> = parameters
        .iter()
        .map(|p| {
            let value = magnitude::drawn(instance.effect, p, draws);
            magnitude::at_size(instance.effect, p, value, strength)
        })
        .collect();
    for (key, text) in request
        .values
        .iter()
        .filter(|(k, _)| Some(k.as_str()) != key_of(&instance))
    {
        let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
        let Some(i) = names.iter().position(|n| n == key) else {
            return Err(error(
                format!("no parameter {key:?}"),
                format!("it has {}", names.join(", ")),
            )
            .into());
        };
        values[i] = text
            .parse::<f64>()
            .ok()
            .filter(|v| magnitude::in_bounds(&parameters[i], *v))
            .ok_or_else(|| {
                let [low, high] = parameters[i].bounds;
                error(
                    format!("{key} = {text} is no value it can have"),
                    format!("give a number from {low} to {high} ({})", parameters[i].unit),
                )
            })?;
    }
    Ok(Hidden {
        instance,
        parameters,
        values,
    })
}
