//! A campaign's cutting side loaded: force records and the revisions of their model.

use crate::analysis::forces::force_records::{ForceRecords, in_campaign_file};
use crate::analysis::grown::with_revision;
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, Process};
use crate::cutting::{contradicts_speed, none_usable, of_notices};
use crate::effects::Registry;
use crate::identify::forces::cutting_data::processes;
use crate::identify::model_history::Side;
use crate::identify::{Case, CuttingCase, CuttingData, CuttingModel};
use crate::{InputError, Result};

fn material(campaign: &Campaign, cut: usize) -> &str {
    campaign.cuts[cut].material.as_deref().unwrap_or("no material")
}

/// The material of most cuts (the first of equals) and the names of the others; `None` where there is one only.
fn materials(campaign: &Campaign, data: &CuttingData) -> Option<(String, String)> {
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for cut in &data.cuts {
        let material = material(campaign, cut.cut);
        match counts.iter_mut().find(|c| c.0 == material) {
            Some(one) => one.1 += 1,
            None => counts.push((material, 1)),
        }
    }
    let most = counts.iter().map(|c| c.1).max()?;
    let main = counts.iter().position(|c| c.1 == most)?;
    let (name, _) = counts.remove(main);
    let others: Vec<&str> = counts.iter().map(|c| c.0).collect();
    (!others.is_empty()).then(|| (name.to_string(), others.join(", ")))
}

impl CuttingCase {
    /// The cuts of the campaign's main process.
    ///
    /// # Errors
    /// No cuts, records that cannot be read, a broken revision log.
    pub fn load(campaign: &Campaign) -> Result<Self> {
        Self::on(&Workbench::new(campaign))
    }

    /// As [`load`](Self::load), of files that other analyses read as well.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn on(campaign: &Workbench) -> Result<Self> {
        let processes = processes(&campaign.cuts);
        let Some(&process) = processes.first() else {
            return Err(
                InputError::new("the campaign has no [[cut]]: no force records to compare")
                    .file(campaign.dir.join("campaign.toml"))
                    .key("cut")
                    .remedy("add [[cut]] tables that name the force records")
                    .into(),
            );
        };
        let mut data = CuttingData::on(campaign, process)?;
        let mut warnings = Vec::from_iter(campaign.guesses.of_cutting_told());
        warnings.extend(data.warnings.iter().cloned());
        if let Some((main, others)) = materials(campaign, &data) {
            warnings.push(format!(
                "the cuts of {others} are not compared: one material at a time, here {main}, of which most cuts are"
            ));
            data = data.filtered(|i| material(campaign, data.cuts[i].cut) == main);
        }
        if let Some(other) = processes.get(1) {
            let name = other.name();
            warnings.push(format!("the {name} cuts are not compared: one process at a time"));
        }
        let baseline = CuttingModel::new(&data, true)?;
        let mut case = Case::without_history(baseline, data, warnings);
        let log = campaign.revisions()?;
        case.revisions = log.revisions(Side::Cutting).cloned().collect();
        if let Some(current) = case.revisions.last() {
            let known = case.baseline.known(&case.data);
            case.model = with_revision(campaign, &Registry::cutting(), &case.baseline, &known, current)?;
        }
        Ok(case)
    }
}

impl CuttingData {
    /// The records of the campaign's cuts of `process`. A cut that cannot be used is left out with a warning.
    ///
    /// # Errors
    /// No usable cut; no tool; a `tool_from_dyno` that cannot be inverted.
    pub fn on(campaign: &Workbench, process: Process) -> Result<Self> {
        let indices: Vec<usize> = (0..campaign.cuts.len())
            .filter(|i| campaign.cuts[*i].geometry.process() == process)
            .collect();
        if indices.is_empty() {
            return Err(InputError::new(
                "the campaign has no [[cut]] of this process: no force records to compare",
            )
            .file(campaign.dir.join("campaign.toml"))
            .key("cut")
            .remedy("add [[cut]] tables that name the force records")
            .into());
        }
        let records = ForceRecords::of(campaign);
        let (mut cuts, mut warnings, mut noticed) = (Vec::new(), Vec::new(), Vec::new());
        let mut first_error = None;
        for &i in &indices {
            match &records.waveforms[i] {
                Ok((cut, notices)) => {
                    noticed.extend(notices.iter().map(|n| (cut.id.clone(), n.clone())));
                    cuts.push(cut.clone());
                }
                Err(error) => {
                    warnings.push(format!("cut {} is left out: {error}", campaign.cuts[i].id));
                    first_error.get_or_insert_with(|| error.clone());
                }
            }
        }
        if cuts.is_empty() {
            return Err(in_campaign_file(
                none_usable(indices.len(), first_error),
                campaign,
            ));
        }
        let contradicting = cuts
            .iter()
            .filter(|cut| {
                noticed
                    .iter()
                    .any(|(id, n)| *id == cut.id && contradicts_speed(n))
            })
            .count();
        let speed_is_contradicted = 2 * contradicting >= cuts.len();
        warnings.extend(of_notices(&noticed, indices.len()));
        let teeth = campaign.tool.as_ref().map_or(1, |t| t.teeth);
        let data = CuttingData::new(process, teeth, campaign.dynamometer.tool_from_dyno, cuts);
        let data = data.map_err(|error| in_campaign_file(error, campaign))?;
        let id = |i: usize| campaign.cuts[i].id.clone();
        let copies = records.copies.iter().filter(|c| indices.contains(&c.cuts[0]));
        Ok(CuttingData {
            warnings,
            speed_is_contradicted,
            slips: records.slips(process),
            copies: copies.map(|c| (c.cuts.map(id), c.not_of.map(id))).collect(),
            ..data
        })
    }
}
