//! Channels that all records of a campaign name or scale wrongly: told by the waveforms, which fit one physics only with the
//! right axes and units.

use rayon::prelude::*;

use crate::campaign::Process;
use crate::cutting::{ForceGroup, USUAL};
use crate::identify::forces::cutting_study::{EXPLAINS_NRMS, calibrate_cutting, cutting_nrms};
use crate::identify::{CuttingData, CuttingModel};
use crate::text::figures;

/// Another reading of the recorded channels: true channel i is `factor[i]` times recorded channel `from[i]`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Reading {
    from: [usize; 3],
    factor: [f64; 3],
}

/// How a reading fits.
struct Trial {
    reading: Reading,
    chi2: f64,
    /// Error over the signal.
    nrms: f64,
    /// Ktc, Krc, Kac.
    cutting: [f64; 3],
}

/// Cuts that are looked at.
const CUTS: usize = 4;
/// Another reading is believed where it leaves this part of the misfit.
const MUCH_BETTER: f64 = 0.3;
/// Readings whose misfits are nearer than this are told apart by how little they change.
const ALIKE: f64 = 1.1;
/// Units that are mixed up: kN, lbf, kgf for N and the other way round.
const FACTORS: [(f64, &str); 5] = [
    (1000.0, "kN called N"),
    (4.448_221_6, "lbf called N"),
    (9.80665, "kgf called N"),
    (1.0 / 4.448_221_6, "N called lbf"),
    (1.0 / 9.80665, "N called kgf"),
];

/// Looks for a better reading of the channels where the mean forces give coefficients that no cut has (`groups`).
pub fn wrong_channels(data: &CuttingData, groups: &[ForceGroup]) -> Option<String> {
    let group = groups.iter().find(|g| g.process == Process::Milling)?;
    let value = |j: usize| group.coefficients[j].value;
    let cutting = [value(0)?, value(1)?, value(2)?];
    let noise = |j: usize| 3.0 * group.coefficients[j].std_error.unwrap_or(0.0);
    // A hair beyond the bounds may be noise.
    let doubtful = (0..3).any(|j| cutting[j] < -noise(j) && cutting[j] < -0.02 * cutting[0].abs())
        || cutting[1] > 1.5 * cutting[0];
    if data.process != Process::Milling || !doubtful || data.speed_is_contradicted {
        return None;
    }
    let step = data.cuts.len().div_ceil(CUTS).max(1);
    let some = data.filtered(|i| i % step == 0);
    let now = try_reading(&some, Reading::AS_RECORDED)?;
    // The same waveform seen from another side is another set of coefficients: then only these speak. One channel scaled anew is
    // another waveform, and has to fit markedly better.
    let speaks = |t: &Trial| {
        let from_another_side = !now.is_physical() && !t.reading.is_scaled() && t.chi2 < ALIKE * now.chi2;
        t.is_physical() && t.nrms < EXPLAINS_NRMS && (t.chi2 < MUCH_BETTER * now.chi2 || from_another_side)
    };
    let trials: Vec<Trial> = Reading::others()
        .into_par_iter()
        .filter_map(|reading| try_reading(&some, reading))
        .filter(speaks)
        .collect();
    let least = trials.iter().map(|t| t.chi2).fold(f64::INFINITY, f64::min);
    let best = trials.iter().filter(|t| t.chi2 <= ALIKE * least).min_by(|a, b| {
        a.reading
            .changes()
            .cmp(&b.reading.changes())
            .then(a.chi2.total_cmp(&b.chi2))
    })?;
    let [ktc, krc, kac] = best.cutting.map(|k| figures(k, 3));
    Some(format!(
        "{}: read so, the waveforms leave {} times the variance of the noise instead of {}, and Ktc, Krc, Kac are {ktc}, {krc}, {kac} \
         N/mm². Check plugs, column names, units and dynamometer.tool_from_dyno, for the coefficients above are wrong then",
        best.reading.describe(),
        figures(best.chi2, 2),
        figures(now.chi2, 2)
    ))
}

impl Trial {
    fn is_physical(&self) -> bool {
        let [ktc, krc, kac] = self.cutting;
        let [low, high] = USUAL;
        (low..high).contains(&ktc) && krc > 0.0 && krc < 1.5 * ktc && kac > -0.02 * ktc
    }
}

fn try_reading(data: &CuttingData, reading: Reading) -> Option<Trial> {
    let mut own = data.clone();
    for i in 0..3 {
        for j in 0..3 {
            // Recorded channel from[j] counts as factor[j] times channel j.
            own.tool_from_dyno[i][reading.from[j]] = data.tool_from_dyno[i][j] * reading.factor[j];
            own.dyno_from_tool[reading.from[j]][i] = data.dyno_from_tool[j][i] / reading.factor[j];
        }
    }
    let model = CuttingModel::new(&own, true).ok()?;
    let calibration = calibrate_cutting(&model, &own).ok()?;
    let find = |name: &str| Some(calibration.parameters.iter().find(|p| p.name == name)?.value);
    Some(Trial {
        reading,
        chi2: calibration.reduced_chi2,
        nrms: cutting_nrms(&model, &own, &calibration.theta).ok()?,
        cutting: [
            find("ktc_n_per_mm2")?,
            find("krc_n_per_mm2")?,
            find("kac_n_per_mm2")?,
        ],
    })
}

const NAMES: [&str; 3] = ["Fx", "Fy", "Fz"];

impl Reading {
    const AS_RECORDED: Reading = Reading {
        from: [0, 1, 2],
        factor: [1.0; 3],
    };

    /// Every order and sign of the channels, and every slip of units on one of them.
    fn others() -> Vec<Reading> {
        let mut all = Vec::new();
        for from in [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]] {
            for signs in 0..8 {
                let factor = std::array::from_fn(|i| if signs >> i & 1 == 1 { -1.0 } else { 1.0 });
                all.push(Reading { from, factor });
            }
        }
        for channel in 0..3 {
            for (factor, _) in FACTORS {
                let mut reading = Reading::AS_RECORDED;
                reading.factor[channel] = factor;
                all.push(reading);
            }
        }
        all.retain(|r| *r != Reading::AS_RECORDED);
        all
    }

    /// Channels that are not what they are called.
    fn changes(&self) -> usize {
        let moved = (0..3).filter(|i| self.from[*i] != *i).count();
        moved + self.factor.iter().filter(|f| **f != 1.0).count()
    }

    fn is_scaled(&self) -> bool {
        self.factor.iter().any(|f| f.abs() != 1.0)
    }

    fn describe(&self) -> String {
        let is = |i: usize| {
            let sign = if self.factor[i] < 0.0 { "−" } else { "" };
            format!("{} is in truth {sign}{}", NAMES[self.from[i]], NAMES[i])
        };
        let scaled = self.factor.iter().position(|f| f.abs() != 1.0);
        if let Some(i) = scaled {
            let unit = FACTORS.iter().find(|u| u.0 == self.factor[i]).map_or("", |u| u.1);
            return format!("{} looks mis-scaled in all cuts ({unit}?)", NAMES[i]);
        }
        let changed = (0..3).filter(|i| self.from[*i] != *i || self.factor[*i] != 1.0);
        let list: Vec<String> = changed.map(is).collect();
        let what = if self.from == [0, 1, 2] {
            "of the wrong sign"
        } else {
            "swapped"
        };
        format!(
            "the channels look {what} in all cuts (what is called {})",
            list.join(", what is called ")
        )
    }
}
