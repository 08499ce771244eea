//! Where the FRFs by themselves put a mode. A common fit of a whole band describes hundreds of lines that are no mode's, and what
//! it lacks far away can move a mode; the fit of each FRF around its own peak knows nothing of that.

use num_complex::Complex64;

use crate::modal::settings::SET;
use crate::modal::single::curve::reach;
use crate::modal::single::frf_modes::FrfMode;
use crate::modal::single::local_fit::Pole;
use crate::modal::together::global_modes::GlobalMode;
use crate::modal::together::set_member::SetMember;
use crate::modal::together::verify::mean_pole;

/// A neighbour nearer than so many sums of the half-widths may stand in the same peak …
const ISOLATED_WIDTHS: f64 = 3.0;
/// … unless it is so many times as wide: it is the ground on which the peak stands.
const GROUND: f64 = 5.0;
/// An FRF that knows its own place only to this share of the half-width does not take part.
const KNOWN_WIDTHS: f64 = 0.3;
/// Damping ratios of one mode are within this factor of each other.
const SAME_DAMPING: f64 = 2.0;
/// Two fits of the same lines contradict each other from so many standard deviations on, and from this share of the half-width.
const APART: f64 = 4.0;
const APART_WIDTHS: f64 = 0.1;
/// A peak at least this share as high as the highest of its FRF must not be missing.
const HIGH: f64 = 0.02;

/// A mode as the FRFs have it by themselves: means over them.
#[derive(Debug)]
pub(super) struct OwnPlace {
    pub pole: Pole,
    /// Standard deviations of frequency (Hz) and damping ratio, from how the FRFs scatter.
    pub std: [f64; 2],
}

/// Where the FRFs put a mode by themselves, if that is elsewhere than the `common` pole (`std`: its standard deviations of
/// frequency, Hz, and damping ratio). `None` where it is not, where fewer than half of them (and four) tell, or where one of
/// the `others` stands so near that a single FRF may take two modes for one.
pub(super) fn elsewhere(
    members: &[&SetMember],
    common: Pole,
    std: [f64; 2],
    others: &[Pole],
) -> Option<OwnPlace> {
    let width_hz = |p: &Pole| p.damping_ratio * p.frequency_hz;
    let own_width_hz = width_hz(&common);
    let shares_the_peak = |p: &Pole| {
        width_hz(p) < GROUND * own_width_hz
            && (p.frequency_hz - common.frequency_hz).abs() < ISOLATED_WIDTHS * (width_hz(p) + own_width_hz)
    };
    if others.iter().any(shares_the_peak) {
        return None;
    }
    let own: Vec<(Pole, [f64; 2])> = members
        .iter()
        .filter_map(|member| {
            let nearest_mode = member.modes.modes.iter().min_by(|a, b| {
                let away = |mode: &FrfMode| (mode.best().frequency_hz - common.frequency_hz).abs();
                away(a).total_cmp(&away(b))
            })?;
            let nearest = nearest_mode.best();
            let pole = Pole {
                frequency_hz: nearest.frequency_hz,
                damping_ratio: nearest.damping_ratio,
            };
            let std = [nearest.frequency_std_hz?, nearest.damping_std?];
            // Between two lines a fit that does not know its place may be anywhere.
            let reach_hz = width_or_line_hz(nearest_mode, own_width_hz);
            let same = (pole.frequency_hz - common.frequency_hz).abs() < reach_hz
                && (SAME_DAMPING.recip()..SAME_DAMPING)
                    .contains(&(pole.damping_ratio / common.damping_ratio));
            (same && std[0] < KNOWN_WIDTHS * own_width_hz).then_some((pole, std))
        })
        .collect();
    if own.len() < SET || 2 * own.len() < members.len() {
        return None;
    }
    let (pole, own_std) = mean_pole(&own);
    let apart = |difference: f64, stds: [f64; 2], width: f64| {
        difference.abs() > (APART * stds[0].hypot(stds[1])).max(APART_WIDTHS * width)
    };
    let contradicts = apart(
        pole.frequency_hz - common.frequency_hz,
        [own_std[0], std[0]],
        own_width_hz,
    ) || apart(
        pole.damping_ratio - common.damping_ratio,
        [own_std[1], std[1]],
        common.damping_ratio,
    );
    contradicts.then_some(OwnPlace { pole, std: own_std })
}

/// A half-width, or a line of the FRF of `mode` where that is more, Hz.
fn width_or_line_hz(mode: &FrfMode, half_width_hz: f64) -> f64 {
    half_width_hz * (2.0 / mode.lines_in_half_power_band).max(1.0)
}

/// A mode that FRFs have by themselves and that no common mode accounts for.
#[derive(Debug)]
pub(super) struct MissedMode {
    pub own: OwnPlace,
    /// Of the FRF that resolves it least.
    pub lines_in_half_power_band: f64,
    /// By FRF that has it (its number, ascending): modal constant, 1/kg, and the standard deviation of its parts.
    pub constants: Vec<(usize, Complex64, f64)>,
    /// Its height over that of the highest mode of an FRF (as mobility), at most.
    pub height: f64,
}

/// A peak that an FRF has by itself.
#[derive(Clone, Copy)]
struct Peak<'a> {
    /// Number of its FRF.
    member: usize,
    mode: &'a FrfMode,
    /// Its height over that of the highest of its FRF (as mobility).
    height: f64,
}

impl Peak<'_> {
    fn frequency_hz(&self) -> f64 {
        self.mode.best().frequency_hz
    }

    /// Half-width, or a line where that is more, Hz.
    fn width_hz(&self) -> f64 {
        let best = self.mode.best();
        width_or_line_hz(self.mode, best.damping_ratio * best.frequency_hz)
    }
}

/// Peaks that are known well and among the highest of their FRFs, ascending in frequency.
fn clear_peaks<'a>(members: &[&'a SetMember]) -> Vec<Peak<'a>> {
    let mut peaks = Vec::new();
    for (m, member) in members.iter().enumerate() {
        let known = |mode: &&FrfMode| {
            let own = mode.best();
            let width_hz = own.damping_ratio * own.frequency_hz;
            own.frequency_std_hz.is_some_and(|s| s < KNOWN_WIDTHS * width_hz)
                && own
                    .damping_std
                    .is_some_and(|s| s < KNOWN_WIDTHS * own.damping_ratio)
        };
        let height = |mode: &FrfMode| {
            let own = mode.best();
            own.modal_constant
                .map_or(0.0, |c| c.norm() / (own.damping_ratio * own.frequency_hz))
        };
        let highest = member.modes.modes.iter().map(height).fold(0.0, f64::max);
        let clear = member.modes.modes.iter().filter(known).map(|mode| Peak {
            member: m,
            mode,
            height: height(mode) / highest,
        });
        peaks.extend(clear.filter(|peak| peak.height >= HIGH));
    }
    peaks.sort_by(|a: &Peak, b: &Peak| a.frequency_hz().total_cmp(&b.frequency_hz()));
    peaks
}

/// Peaks (ascending) by place. A mode that moves from FRF to FRF by more than its width has one peak in each, each near the next; where
/// an FRF has several of such a row they are several modes, and a place reaches as far as the widths.
fn places<'a>(peaks: &[Peak<'a>]) -> Vec<Vec<Peak<'a>>> {
    let near = |a: &Peak, b: &Peak| (a.frequency_hz() - b.frequency_hz()).abs() < a.width_hz() + b.width_hz();
    let mut places = Vec::new();
    for row in peaks.chunk_by(near) {
        let mut frfs: Vec<usize> = row.iter().map(|p| p.member).collect();
        frfs.sort_unstable();
        frfs.dedup();
        if frfs.len() == row.len() {
            places.push(row.to_vec());
            continue;
        }
        let mut left = row.to_vec();
        left.sort_by_key(|p| p.member);
        while let Some(&first) = left.first() {
            let (here, elsewhere) = left.into_iter().partition(|p| near(&first, p));
            let mut here: Vec<Peak> = here;
            here.dedup_by_key(|p| p.member);
            places.push(here);
            left = elsewhere;
        }
    }
    places
}

/// Peaks that most of the FRFs know well by themselves, that are among the highest of each (as mobility), and that no common mode
/// accounts for, ascending in frequency.
pub(super) fn missed(members: &[&SetMember], found: &[GlobalMode]) -> Vec<MissedMode> {
    let is_missed = |place: &Vec<Peak>| {
        let at: Vec<f64> = place.iter().map(|p| p.frequency_hz()).collect();
        let from_hz = at.iter().copied().fold(f64::INFINITY, f64::min);
        let to_hz = at.iter().copied().fold(0.0, f64::max);
        let width_hz = place.iter().map(|p| p.width_hz()).fold(0.0, f64::max);
        let reaching = members
            .iter()
            .filter(|m| reach(m.frequency_hz, 0.5 * (from_hz + to_hz)));
        let accounts = |mode: &GlobalMode| {
            let near_hz = width_hz + mode.damping_ratio * mode.frequency_hz + mode.frequency_std_hz;
            (from_hz - near_hz..to_hz + near_hz).contains(&mode.frequency_hz)
        };
        2 * place.len() > reaching.count() && !found.iter().any(accounts)
    };
    let mut missed: Vec<MissedMode> = places(&clear_peaks(members))
        .into_iter()
        .filter(is_missed)
        .map(|place| MissedMode::of(&place))
        .collect();
    missed.sort_by(|a, b| a.own.pole.frequency_hz.total_cmp(&b.own.pole.frequency_hz));
    missed
}

impl MissedMode {
    fn of(place: &[Peak]) -> MissedMode {
        let own: Vec<(Pole, [f64; 2])> = place.iter().filter_map(|p| with_std(p.mode)).collect();
        let (pole, std) = match own.as_slice() {
            [one] => *one,
            several => mean_pole(several),
        };
        let constant = |peak: &Peak| {
            let best = peak.mode.best();
            let constant = best.modal_constant?;
            Some((
                peak.member,
                constant,
                constant.norm() * best.damping_std? / best.damping_ratio,
            ))
        };
        let mut constants: Vec<_> = place.iter().filter_map(constant).collect();
        constants.sort_by_key(|(m, ..)| *m);
        MissedMode {
            own: OwnPlace { pole, std },
            lines_in_half_power_band: place
                .iter()
                .map(|p| p.mode.lines_in_half_power_band)
                .fold(f64::INFINITY, f64::min),
            constants,
            height: place.iter().map(|p| p.height).fold(0.0, f64::max),
        }
    }
}

/// The pole of a mode with the standard deviations of its frequency (Hz) and damping ratio.
fn with_std(mode: &FrfMode) -> Option<(Pole, [f64; 2])> {
    let best = mode.best();
    let pole = Pole {
        frequency_hz: best.frequency_hz,
        damping_ratio: best.damping_ratio,
    };
    Some((pole, [best.frequency_std_hz?, best.damping_std?]))
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::modal::settings::Settings;
    use crate::modal::single::analysis::analyse_frf;
    use crate::modal::single::frf_modes::FrfModes;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    type Curves = Vec<(Vec<f64>, Vec<Complex64>)>;

    /// Six FRFs of one mode on lines `step_hz` apart, with noise in proportion to them, and what each says by itself.
    fn set(step_hz: f64, noise: f64, mode: SyntheticMode) -> (Curves, Vec<FrfModes>) {
        let frfs: Curves = [1.0, -0.6, 0.8, 0.5, -0.9, 0.7]
            .iter()
            .enumerate()
            .map(|(k, constant)| {
                let own = SyntheticMode {
                    constant: *constant,
                    ..mode
                };
                Synthetic::new(60.0, 140.0, step_hz, &[own])
                    .with_noise(0.0, noise, k as u64)
                    .frf()
            })
            .collect();
        let alone = |(f, h): &(Vec<f64>, Vec<Complex64>)| analyse_frf(f, h, &Settings::default()).unwrap();
        let modes = frfs.iter().map(alone).collect();
        (frfs, modes)
    }

    fn members<'a>(frfs: &'a Curves, modes: &'a [FrfModes]) -> Vec<SetMember<'a>> {
        let each = frfs.iter().zip(modes);
        each.map(|((frequency_hz, receptance_m_per_n), modes)| SetMember {
            frequency_hz,
            receptance_m_per_n,
            modes,
            dofs: None,
        })
        .collect()
    }

    #[test]
    fn frfs_that_agree_by_themselves_outvote_a_common_pole_that_left_them() {
        let (frfs, modes) = set(0.1, 0.01, SyntheticMode::new(100.0, 0.006, 1.0));
        let members = members(&frfs, &modes);
        let members: Vec<&SetMember> = members.iter().collect();
        let pole = |frequency_hz, damping_ratio| Pole {
            frequency_hz,
            damping_ratio,
        };
        let std = [0.02, 1e-4];
        assert!(elsewhere(&members, pole(100.0, 0.006), std, &[]).is_none());
        for left in [pole(99.8, 0.006), pole(100.0, 0.0045)] {
            let own = elsewhere(&members, left, std, &[]).unwrap();
            assert!(
                (own.pole.frequency_hz - 100.0).abs() < 3.0 * own.std[0].max(1e-3),
                "{own:?}"
            );
            assert!(
                (own.pole.damping_ratio - 0.006).abs() < 3.0 * own.std[1].max(1e-5),
                "{own:?}"
            );
        }
        // Uncertain enough to allow for it; one more mode in the peak; the ground under it; too few FRFs.
        let left = pole(99.8, 0.006);
        assert!(elsewhere(&members, left, [0.1, 1e-3], &[]).is_none());
        assert!(elsewhere(&members, left, std, &[pole(101.5, 0.006)]).is_none());
        assert!(elsewhere(&members, left, std, &[pole(95.0, 0.15)]).is_some());
        assert!(elsewhere(&members[..3], left, std, &[]).is_none());
        // Where a line is as wide as the mode, a fit that lost its hold goes to the next line.
        let (coarse, modes) = set(1.0, 0.005, SyntheticMode::new(100.2, 0.005, 1.0));
        let on_coarse = self::members(&coarse, &modes);
        let own = elsewhere(
            &on_coarse.iter().collect::<Vec<_>>(),
            pole(100.9, 0.005),
            std,
            &[],
        )
        .unwrap();
        assert!((own.pole.frequency_hz - 100.2).abs() < 0.05, "{own:?}");
        // Not among the common modes: missed, unless one of these is at the place.
        let missing = missed(&members, &[]);
        assert!(
            missing.len() == 1 && (missing[0].own.pole.frequency_hz - 100.0).abs() < 0.05,
            "{missing:?}"
        );
        assert_eq!(missing[0].constants.len(), members.len());
        let found = |frequency_hz| GlobalMode {
            frequency_hz,
            damping_ratio: 0.006,
            frequency_std_hz: 0.01,
            damping_std: 1e-4,
            found_in: 6,
            lines_in_half_power_band: 12.0,
            complexity: None,
            shape: Vec::new(),
            constants: Vec::new(),
        };
        assert!(missed(&members, &[found(100.1)]).is_empty());
        assert_eq!(missed(&members, &[found(103.0)]).len(), 1);
    }
}
