//! The advised measurement, taken: simulated with the same truth, added to the campaign, diagnosed again.

use std::fmt::Write as _;
use std::path::Path;

use lobestone::campaign::{AxesRef, BodyRef, Campaign, MeasuredDof, MeasuredFrf, Point, Posture};
use lobestone::discrepancy::outlook::next_measurement::advise;
use lobestone::discrepancy::{Diagnosis, DiagnosisVerdict, NextMeasurement, diagnose};
use lobestone::effects::{Registry, Structure};
use lobestone::identify::{FrfData, Options, StructureCase, StructureModel, StructureStudy};
use lobestone::ingest::Dof;
use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::support::*;

/// A campaign in the laboratory: what was measured so far, and what is true.
struct Bench {
    campaign: Campaign,
    case: StructureCase,
    frfs: Vec<MeasuredFrf>,
    truth: Value,
    rng: ChaCha8Rng,
}

type Found = Diagnosis<Structure>;

impl Bench {
    fn simulate(folder: &Path, seed: u64, options: &[&str]) -> Self {
        let dir = folder.join(format!("cell{seed}"));
        let out = dir.to_str().unwrap().to_string();
        let seed_text = seed.to_string();
        document(&[&["simulate", "--out", &out, "--seed", &seed_text], options].concat());
        let truth = std::fs::read(folder.join(format!("cell{seed}.truth.json"))).unwrap();
        let campaign = Campaign::load(&dir).unwrap();
        Bench {
            case: StructureCase::load(&campaign).unwrap(),
            frfs: campaign.load_frfs().unwrap().0.frfs,
            truth: serde_json::from_slice(&truth).unwrap(),
            rng: ChaCha8Rng::seed_from_u64(seed),
            campaign,
        }
    }

    fn diagnose(&self) -> Found {
        let study = StructureStudy::new(self.case.data.clone(), Options::default());
        diagnose(&study, &self.case.model).unwrap()
    }

    fn advice(&self, found: &Found) -> NextMeasurement {
        advise(&self.case.data, &self.campaign.postures, found).unwrap()
    }

    /// `effect@site`.
    fn true_effect(&self) -> String {
        let effect = self.truth["effect"].as_str().unwrap();
        match self.truth["site"].as_str() {
            Some(site) => format!("{effect}@{site}"),
            None => effect.into(),
        }
    }

    /// Model and parameters (solver's scale) that the data were made with.
    fn true_model(&self) -> (StructureModel, Vec<f64>) {
        let label = self.true_effect();
        let bare = &self.case.baseline;
        let given = &self.truth["parameters"];
        let instance = Registry::structure()
            .find(&bare.robot.spec, &label)
            .into_iter()
            .find(|i| {
                let choice = i.variant_label();
                choice.is_none_or(|(key, value)| given[key] == value)
            })
            .unwrap();
        let model = bare.with_effect(instance, &bare.known(&self.case.data.summary()));
        let theta = model
            .parameters
            .iter()
            .map(|p| {
                let name = p.name.strip_prefix(&format!("{label}.")).unwrap_or(&p.name);
                let index = |text: &str| text.parse::<usize>().unwrap();
                let value = match (name.strip_suffix(".stiffness"), name.split_once('[')) {
                    (Some(joint), _) => self.truth["joint_stiffness"]
                        [index(joint.strip_prefix("joint-").unwrap()) - 1]
                        .as_f64(),
                    (None, Some((list, i))) => given[list][index(i.trim_end_matches(']'))].as_f64(),
                    _ if name == "damping-ratio" => self.truth["zeta"].as_f64(),
                    _ => given[name].as_f64(),
                };
                p.internal(value.unwrap_or_else(|| panic!("the truth says nothing of {}", p.name)))
            })
            .collect();
        (model, theta)
    }

    /// Takes the advice: measures what it names, with the noise that all was measured with.
    fn take(&mut self, advice: &NextMeasurement) {
        let (model, theta) = self.true_model();
        for new in &advice.new_points {
            let body = match new.body.strip_prefix("link") {
                Some(link) => BodyRef::Link(link.parse().unwrap()),
                None => BodyRef::Tool,
            };
            self.campaign.points.push(Point {
                node: new.node,
                body,
                position_m: new.position_m,
                axes: AxesRef::Base,
            });
        }
        let points = self.campaign.points.clone();
        let model = model.with_fixed(|fixed| fixed.points.clone_from(&points));
        let dof = |text: &str| {
            let dof: Dof = text.parse().unwrap();
            MeasuredDof {
                point: points.iter().position(|p| p.node == dof.node).unwrap(),
                axis: dof.axis,
                negative: dof.negative,
            }
        };
        let lines = self.frfs[0].frequency_hz.clone();
        for (k, setup) in advice.setups.iter().enumerate() {
            let id = setup.posture.clone().unwrap_or_else(|| format!("new{k}"));
            let known = self.campaign.postures.iter().position(|p| p.id == id);
            let posture = known.unwrap_or_else(|| {
                self.campaign.postures.push(Posture {
                    id,
                    joints_deg: setup.joints_deg.clone(),
                });
                self.campaign.postures.len() - 1
            });
            for _ in 0..setup.times as usize {
                let mut frfs: Vec<MeasuredFrf> = setup
                    .frfs
                    .iter()
                    .map(|name| {
                        let (response, reference) = name.split_once('/').unwrap();
                        MeasuredFrf {
                            posture,
                            response: dof(response),
                            reference: dof(reference),
                            name: name.clone(),
                            frequency_hz: lines.clone(),
                            receptance_m_per_n: vec![Complex64::ZERO; lines.len()],
                            coherence: None,
                            force_level_n: None,
                            file: Default::default(),
                        }
                    })
                    .collect();
                let arranged = FrfData::arrange(&self.campaign.postures, &model.robot, frfs.clone()).unwrap();
                let exact = model.predict(&theta, &arranged).unwrap();
                for (frf, exact) in frfs.iter_mut().zip(exact) {
                    frf.receptance_m_per_n = exact
                        .iter()
                        .map(|h| h + self.noise(h.norm(), setup.harder))
                        .collect();
                }
                self.frfs.extend(frfs);
            }
        }
        let frfs = self.frfs.clone();
        self.case.data = FrfData::new(&self.campaign.postures, &model.robot, frfs).unwrap();
        let points = &self.campaign.points;
        self.case.model = self
            .case
            .model
            .with_fixed(|fixed| fixed.points.clone_from(points));
    }

    fn noise(&mut self, magnitude: f64, harder: f64) -> Complex64 {
        let [relative, floor] = [0, 1].map(|i| self.truth["noise"][i].as_f64().unwrap());
        let std = (relative * magnitude).hypot(floor / harder) * std::f64::consts::FRAC_1_SQRT_2;
        // Box and Muller (1958).
        let radius = (-2.0 * (1.0 - self.rng.random::<f64>()).ln()).sqrt();
        Complex64::from_polar(std * radius, std::f64::consts::TAU * self.rng.random::<f64>())
    }
}

/// What became of one pair.
struct Outcome {
    seed: u64,
    truth: String,
    before: Found,
    advice: NextMeasurement,
    after: Found,
}

impl Outcome {
    fn resolved(&self) -> bool {
        let rivals = self.advice.between.as_ref().unwrap();
        self.after.verdict == DiagnosisVerdict::Effect
            && self.after.winner().is_some_and(|w| w.label() == self.truth)
            && !rivals.iter().any(|r| self.after.indistinguishable.contains(r))
    }
}

/// Few FRFs at one or two postures and faint effects, so that they are mistaken for each other. `None` where the data tell
/// all apart.
fn try_seed(folder: &Path, seed: u64) -> Option<Outcome> {
    let effect = EFFECTS[seed as usize % EFFECTS.len()];
    let postures = ["1", "2"][seed as usize / EFFECTS.len() % 2];
    let visibility = ["8", "12"][seed as usize % 2];
    let options = [
        "--kind",
        "direct",
        "--postures",
        postures,
        "--effect",
        effect,
        "--visibility",
        visibility,
    ];
    let mut bench = Bench::simulate(folder, seed, &options);
    let before = bench.diagnose();
    if before.verdict != DiagnosisVerdict::Effect || before.indistinguishable.is_empty() {
        return None;
    }
    let advice = bench.advice(&before);
    bench.take(&advice);
    Some(Outcome {
        seed,
        truth: bench.true_effect(),
        after: bench.diagnose(),
        before,
        advice,
    })
}

/// One pair: the advice names what a program can measure, and what is measured then speaks against the rival.
#[test]
fn what_is_advised_moves_the_rivals_apart() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = try_seed(folder.path(), 8017).expect("seed 8017 leaves rivals");
    let advice = &outcome.advice;
    assert!(advice.expected_sigmas.unwrap() > 4.0, "{advice}");
    assert!(
        !advice.setups.is_empty() && advice.cost.unwrap() > 0.0,
        "{advice}"
    );
    let names = advice.between.as_ref().unwrap();
    let rival = names.iter().find(|n| **n != outcome.truth).unwrap();
    let gap = |found: &Found| {
        let of = |label: &str| {
            found
                .candidates
                .iter()
                .find(|c| c.label() == label)
                .unwrap()
                .delta_bic
        };
        of(rival) - of(&outcome.truth)
    };
    assert!(gap(&outcome.after) > gap(&outcome.before), "{advice}");
}

const EFFECTS: [&str; 6] = [
    "joint-transverse-compliance",
    "base-compliance",
    "link-flexibility",
    "payload",
    "local-resonator",
    "tool-flexibility",
];

/// The first ten pairs that few FRFs cannot tell apart, whatever they are:
/// `LOBESTONE_ADVICE_CSV=reports/next_measurement.csv cargo test --release --test integration advice_is_worth -- --ignored`.
#[test]
#[ignore = "takes minutes"]
fn the_advice_is_worth_taking() {
    let folder = tempfile::tempdir().unwrap();
    let mut outcomes: Vec<Outcome> = Vec::new();
    for seed in 8000..8200 {
        outcomes.extend(try_seed(folder.path(), seed));
        if outcomes.len() == 10 {
            break;
        }
    }
    let mut csv = "seed,truth,verdict_before,indistinguishable,advice,effort,expected_sigmas,verdict_after,\
                   confidence_after,resolved\n"
        .to_string();
    let label = |found: &Found| found.winner().map_or("none".into(), |w| w.label());
    for o in &outcomes {
        writeln!(
            csv,
            "{},{},{},{},\"{}\",{},{:.2},{},{:.2},{}",
            o.seed,
            o.truth,
            label(&o.before),
            o.before.indistinguishable.join(" "),
            o.advice.what,
            o.advice.cost.unwrap(),
            o.advice.expected_sigmas.unwrap(),
            label(&o.after),
            o.after.confidence,
            o.resolved()
        )
        .unwrap();
    }
    println!("{csv}");
    if let Ok(file) = std::env::var("LOBESTONE_ADVICE_CSV") {
        std::fs::write(file, &csv).unwrap();
    }
    assert_eq!(outcomes.len(), 10);
    let resolved = outcomes.iter().filter(|o| o.resolved()).count();
    assert!(resolved >= 8, "{resolved} of 10 resolved:\n{csv}");
}
