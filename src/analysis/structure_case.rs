//! A campaign's structural side loaded: robot file, FRF files and the revisions of its model.

use super::grown::with_revision;
use super::workbench::Workbench;
use crate::campaign::{Campaign, FrfSet, LinkGroup, RobotSection};
use crate::effects::Registry;
use crate::identify::model_history::{Revision, Side};
use crate::identify::{FrfData, StructureCase, StructureModel};
use crate::robot::{RobotModel, RobotSpec};
use crate::{InputError, Result};

/// The robot section of a campaign, or an error that says what is missing.
pub fn robot_section(campaign: &Campaign) -> Result<&RobotSection> {
    campaign.robot.as_ref().ok_or_else(|| {
        InputError::new("the campaign has no [robot]")
            .file(campaign.dir.join("campaign.toml"))
            .key("robot")
            .remedy(
                "add [robot] with model = the path of your robot's file (`lobestone init DIR --robot FILE.urdf` makes one of a \
                 URDF), or \"irb6640\" if it is that robot",
            )
            .into()
    })
}

/// The robot model of a campaign, uncalibrated and without effects.
///
/// # Errors
/// No robot, or a robot file that cannot be read.
pub fn structure_model(campaign: &Campaign) -> Result<StructureModel> {
    structure_model_freeing(campaign, &Freed::default())
}

/// Link parameters that are free besides those that the campaign frees itself.
#[derive(Debug, Clone, Default)]
pub struct Freed<'a> {
    /// Groups that are free, within their usual tolerance where the campaign gives none.
    pub groups: &'a [LinkGroup],
    /// Only these of all link parameters, by name; `None`: all of the groups.
    pub only: Option<&'a [String]>,
}

fn structure_model_freeing(campaign: &Campaign, freed: &Freed) -> Result<StructureModel> {
    let section = &robot_section(campaign)?.freeing(freed.groups);
    let robot = RobotModel::new(RobotSpec::load(&section.model, &campaign.dir)?);
    if let Some(link) = robot.link_with_lost_section() {
        return Err(InputError::new("points along the link, so that nobody knows how its section is turned")
            .file(campaign.dir.join(&section.model))
            .key(format!("link[{}].section_height_axis", link - 1))
            .remedy(
                "give a direction across the straight line from the link's joint to the next one, in the link's frame",
            )
            .into());
    }
    let kept = |name: &str| freed.only.is_none_or(|only| only.iter().any(|o| o == name));
    Ok(StructureModel::freeing(
        robot,
        campaign.points.clone(),
        section,
        kept,
    ))
}

/// The FRFs of a campaign arranged for fitting, with the noise that they show.
///
/// # Errors
/// No FRFs, or a posture that does not fit the robot.
pub fn frf_data(campaign: &Campaign, model: &RobotModel, set: FrfSet) -> Result<FrfData> {
    if set.frfs.is_empty() {
        return Err(InputError::new("the campaign has no FRFs")
            .file(campaign.dir.join("campaign.toml"))
            .key("frf")
            .remedy("add [[frf]] tables that name the measured FRF files")
            .into());
    }
    FrfData::new(&campaign.postures, model, set.frfs)
}

impl StructureCase {
    /// # Errors
    /// FRFs or robot file that cannot be read, a broken revision log, or one with effects that are none of this robot.
    pub fn load(campaign: &Campaign) -> Result<Self> {
        Self::on(&Workbench::new(campaign))
    }

    /// As [`load`](Self::load), of files that other analyses read as well.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn on(campaign: &Workbench) -> Result<Self> {
        let baseline = structure_model(campaign)?;
        let log = campaign.revisions()?;
        let revisions: Vec<Revision> = log.revisions(Side::Structure).cloned().collect();
        let (set, noticed) = campaign.load_frfs()?;
        let mut warnings = Vec::from_iter(campaign.guesses.of_robot_told());
        warnings.extend(campaign.beyond_limits.iter().cloned());
        warnings.extend(noticed);
        warnings.extend(baseline.robot.spec.guesses_told());
        let data = frf_data(campaign, &baseline.robot, set)?;
        warnings.extend(drowned(&data));
        let mut settled = false;
        let model = match revisions.last() {
            Some(current) => {
                settled = current.data == campaign.fingerprint(Side::Structure)?;
                // Of a baseline only the starting point is taken; whose data it was fitted to does not matter.
                if current.revision > 0 && !settled {
                    warnings.push(format!(
                        "revision {} was made with other data (robot, postures, points or FRF files changed since): its \
                         effects stay in the model and are fitted anew, but the errors in its history no longer compare; \
                         `lobestone undo {dir}` takes it back, `lobestone add {dir} …` adds it again",
                        current.revision,
                        dir = campaign.dir.display()
                    ));
                }
                with_revision(
                    campaign,
                    &Registry::structure(),
                    &baseline,
                    &baseline.known(&data.summary()),
                    current,
                )?
            }
            None => baseline.clone(),
        };
        Ok(StructureCase {
            model,
            baseline,
            data,
            revisions,
            settled,
            warnings,
        })
    }

    /// The same data and revision, with link parameters free that the campaign may take for exact.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn freeing(&self, campaign: &Campaign, freed: &Freed) -> Result<Self> {
        let baseline = structure_model_freeing(campaign, freed)?;
        let model = match self.revisions.last() {
            Some(current) => with_revision(
                campaign,
                &Registry::structure(),
                &baseline,
                &baseline.known(&self.data.summary()),
                current,
            )?,
            None => baseline.clone(),
        };
        Ok(StructureCase {
            model,
            baseline,
            settled: false,
            ..self.clone()
        })
    }

    /// The model without the effects that were added, starting from where it stood when the first of them was; `None`
    /// where the model has no effects.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn before_effects(&self, campaign: &Campaign) -> Result<Option<StructureModel>> {
        match self.revisions.first() {
            Some(first) if !self.model.effects().is_empty() => self.model_of(campaign, first).map(Some),
            _ => Ok(None),
        }
    }

    /// The model of one of the [`revisions`](Self::revisions), starting from where that stood.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn model_of(&self, campaign: &Campaign, revision: &Revision) -> Result<StructureModel> {
        with_revision(
            campaign,
            &Registry::structure(),
            &self.baseline,
            &self.baseline.known(&self.data.summary()),
            revision,
        )
    }
}

/// Noise over what was measured from which on hardly anything of the robot can be in it: scatter without a response gives 1.
const DROWNED: f64 = 0.9;

/// Which postures' FRFs are hardly more than noise; `None` where none are.
fn drowned(data: &FrfData) -> Option<String> {
    let postures = data.measured_postures();
    let noise = |posture: usize| data.filtered(|p| p == posture).noise_floor_nrms();
    let told: Vec<String> = postures
        .iter()
        .map(|posture| (*posture, noise(*posture)))
        .filter(|(_, noise)| *noise > DROWNED)
        .map(|(posture, noise)| format!("{} ({:.0} %)", data.posture_ids[posture], 100.0 * noise))
        .collect();
    let which = match told.len() {
        0 => return None,
        all if all == postures.len() => "all postures".to_string(),
        1 => format!("posture {}", told[0]),
        _ => format!("postures {}", told.join(", ")),
    };
    Some(format!(
        "the FRFs of {which} are hardly more than noise: nothing of the robot can be told from them; check their unit and \
         quantity (`lobestone inspect`), or hit harder and average more hits"
    ))
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::analysis::StructureAnalysis;
    use crate::campaign::{AxesRef, BodyRef, MeasuredDof, MeasuredFrf, Point, Posture};
    use crate::discrepancy::{DiagnosisVerdict, diagnose};
    use crate::identify::Options;
    use crate::ingest::Axis;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    /// FRFs of the tool point, 1 % noise, of a robot whose second joint is more compliant than its file says.
    fn measured(postures: &[Posture], points: &[Point]) -> Vec<MeasuredFrf> {
        let mut robot = irb6640();
        robot.joints[1].compliance_rad_per_nm *= 1.4;
        let lines: Vec<f64> = (0..120).map(|i| 5.0 + 0.4 * f64::from(i)).collect();
        let mut frfs = Vec::new();
        for posture in 0..postures.len() {
            for response in Axis::ALL.map(|axis| MeasuredDof::new(0, axis)) {
                for reference in [Axis::X, Axis::Y].map(|axis| MeasuredDof::new(0, axis)) {
                    let unknown = vec![Complex64::ZERO; lines.len()];
                    frfs.push(MeasuredFrf::new(
                        posture,
                        response,
                        reference,
                        lines.clone(),
                        unknown,
                    ));
                }
            }
        }
        let truth = StructureCase::new(robot, postures, points.to_vec(), frfs.clone()).unwrap();
        let exact = truth.model.predict(&truth.model.nominal_theta(), &truth.data);
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for (frf, exact) in frfs.iter_mut().zip(exact.unwrap()) {
            let size = exact.iter().map(|h| h.norm()).sum::<f64>() / exact.len() as f64;
            let mut noise = || 0.017 * size * random.random_range(-1.0..1.0);
            let noisy = |h: &Complex64| h + Complex64::new(noise(), noise());
            frf.receptance_m_per_n = exact.iter().map(noisy).collect();
        }
        frfs
    }

    /// Scatter without a response, as a wrong unit leaves it where the signal ends below the noise.
    #[test]
    fn postures_of_noise_alone_are_told() {
        let postures: Vec<Posture> = [0, 1]
            .map(|i| Posture {
                id: format!("p{i}"),
                joints_deg: TAP_POSTURES[i].to_vec(),
            })
            .into();
        let points = [Point {
            node: 1,
            body: BodyRef::Tool,
            position_m: [0.0; 3],
            axes: AxesRef::Base,
        }];
        let mut frfs = measured(&postures, &points);
        let told = |frfs: &[MeasuredFrf]| {
            let case = StructureCase::new(irb6640(), &postures, points.to_vec(), frfs.to_vec()).unwrap();
            drowned(&case.data)
        };
        assert_eq!(told(&frfs), None);
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut drown = |frf: &mut MeasuredFrf| {
            let mut noise = || 1e-8 * random.random_range(-1.0..1.0);
            let lines = frf.receptance_m_per_n.iter_mut();
            lines.for_each(|h| *h = Complex64::new(noise(), noise()));
        };
        frfs[6..].iter_mut().for_each(&mut drown);
        let one = told(&frfs).unwrap();
        assert!(one.starts_with("the FRFs of posture p1 ("), "{one}");
        frfs[..6].iter_mut().for_each(&mut drown);
        let all = told(&frfs).unwrap();
        assert!(all.starts_with("the FRFs of all postures are"), "{all}");
    }

    #[test]
    fn a_robot_and_frfs_in_memory_are_enough_for_a_calibration_and_a_verdict() {
        let posture = |(i, q): (usize, &[f64; 6])| Posture {
            id: format!("p{i}"),
            joints_deg: q.to_vec(),
        };
        let postures: Vec<Posture> = TAP_POSTURES.iter().enumerate().map(posture).collect();
        let points = vec![Point {
            node: 1,
            body: BodyRef::Tool,
            position_m: [0.0; 3],
            axes: AxesRef::Base,
        }];
        let frfs = measured(&postures, &points);

        let case = StructureCase::new(irb6640(), &postures, points, frfs).unwrap();
        let found = StructureAnalysis::of_case(case, Options::default()).unwrap();
        let (before, after) = (found.before.totals.nrms, found.after.totals.nrms);
        assert!(after < 0.2 * before, "{before} {after}");
        let compliance = 1.0 / found.calibration.parameters[1].value;
        assert!((compliance / (1.4 * 0.51e-6) - 1.0).abs() < 0.05, "{compliance}");

        let case = found.settled_case();
        let study = case.study(Options::default());
        let verdict = diagnose(&study, &case.model).unwrap().verdict;
        assert_eq!(verdict, DiagnosisVerdict::None);
    }
}
