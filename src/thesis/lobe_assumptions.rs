//! Which assumption could explain that the commercial program's lobes (table 30) are not ours: each switched by itself.
//!
//! Near a lightly damped mode the phase of every eigenvalue runs through half a turn at nearly one frequency f, so that
//! two neighbouring lobes meet near n = 60 f/(N w), w = 1, 2, … whole waves between two teeth, whatever the directional
//! factors. Only the tooth number, the frequency or the phase of the delay can move the tips far; the table shows it.

use rayon::prelude::*;
use serde::Serialize;

use super::measured_lobes::{ThesisLobes, conditions, thesis_force, thesis_modes, tip_near};
use crate::Result;
use crate::campaign::Immersion;
use crate::lobes::{
    AxisMode, ModalFrf, Mode, Peak, RegenerativeForce, SampledFrf, SpeedLimit, StabilitySolver, ToolPointFrf,
    speed_grid,
};

const SPINDLE_RPM: [f64; 3] = [100.0, 1500.0, 1.0];
/// Lines of the thesis's tap tests, Hz.
const LINE_SPACING_HZ: f64 = 0.1;
/// Factors whose ratio is less than this are not told apart.
const ALIKE: f64 = 1.03;
/// Angle that stands for an unknown cross FRF.
const TURN_RAD: f64 = std::f64::consts::FRAC_PI_6;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Switch {
    None,
    StrongestModeOnly,
    OneAxis(usize),
    Damping(f64),
    RadialCoefficient(f64),
    AllCoefficients(f64),
    MillingSlot,
    Teeth(usize),
    OneToothTipPassedOver,
    ModesTurned,
    MeasuredLines,
    CoarseSpeeds,
    LobeZeroLeftOut,
    DelayedTermReversed,
}

const SWITCHES: [(Switch, &str); 18] = [
    (Switch::None, "as here: nothing switched"),
    (Switch::StrongestModeOnly, "only the strongest mode of each axis"),
    (Switch::OneAxis(0), "compliant in X only"),
    (Switch::OneAxis(1), "compliant in Y only"),
    (
        Switch::ModesTurned,
        "modes of X turned by 30° in the plane (cross FRFs)",
    ),
    (Switch::Damping(0.5), "damping ratios halved, same minima"),
    (Switch::Damping(2.0), "damping ratios doubled, same minima"),
    (Switch::AllCoefficients(0.5), "cutting coefficients halved"),
    (Switch::RadialCoefficient(0.0), "no radial coefficient"),
    (
        Switch::RadialCoefficient(-1.0),
        "radial coefficient with the other sign",
    ),
    (Switch::MillingSlot, "milling in a slot for the drilling matrix"),
    (Switch::Teeth(1), "1 tooth"),
    (
        Switch::OneToothTipPassedOver,
        "1 tooth, the tips of 3 and 1 waves (that of 2 passed over)",
    ),
    (Switch::Teeth(4), "4 teeth"),
    (Switch::MeasuredLines, "FRF known on lines 0.1 Hz apart"),
    (Switch::CoarseSpeeds, "speeds in the thesis's steps of 6 rpm"),
    (Switch::LobeZeroLeftOut, "lobe 0 left out"),
    (
        Switch::DelayedTermReversed,
        "delayed term with the wrong sign (half a wave)",
    ),
];

/// The tips of one configuration under one assumption.
#[derive(Debug, Clone, Serialize)]
pub struct SwitchedTips {
    /// 1..4, as in the thesis.
    pub configuration: u32,
    /// `None`: no tip within 10 % of where that assumption puts it, 60 f/(N w).
    pub second_region: Option<Peak>,
    /// Likewise, first region.
    pub first_region: Option<Peak>,
}

/// All of table 30 under one assumption.
#[derive(Debug, Clone, Serialize)]
pub struct AssumptionSwitched {
    /// The assumption, in words.
    pub assumption: &'static str,
    /// One entry a configuration.
    pub tips: Vec<SwitchedTips>,
    /// The commercial program's tip over ours, geometric mean over the configurations that have one: second and first
    /// region. `None` where none has.
    pub speed_ratio: [Option<f64>; 2],
    /// The same of the depths.
    pub depth_ratio: [Option<f64>; 2],
    /// Configurations with a tip: second and first region.
    pub found: [usize; 2],
}

impl AssumptionSwitched {
    /// How far the speeds are off overall: root mean square of the logarithms of both ratios, as a factor. `None`
    /// where a region has fewer tips than table 30 has configurations.
    pub fn speed_factor(&self) -> Option<f64> {
        let complete = self.found.iter().all(|f| *f == self.tips.len());
        let [second, first] = self.speed_ratio;
        let (second, first) = (second?.ln(), first?.ln());
        complete.then(|| (0.5 * (second * second + first * first)).sqrt().exp())
    }
}

/// Every assumption switched by itself; the first entry switches nothing.
///
/// # Errors
/// Only where the built-in tables are damaged.
pub fn assumptions_switched(lobes: &[ThesisLobes]) -> Result<Vec<AssumptionSwitched>> {
    SWITCHES
        .par_iter()
        .map(|(switch, assumption)| {
            let tips = lobes
                .iter()
                .map(|row| switched(*switch, row))
                .collect::<Result<Vec<_>>>()?;
            let pairs = |region: usize| -> Vec<(Peak, Peak)> {
                let of = |t: &SwitchedTips| [t.second_region, t.first_region][region];
                let both = lobes.iter().zip(&tips);
                both.filter_map(|(row, t)| Some((*row.commercial.get(region)?, of(t)?)))
                    .collect()
            };
            let ratio = |region, of: &dyn Fn(&Peak) -> Option<f64>| {
                let logs: Vec<f64> = pairs(region)
                    .iter()
                    .filter_map(|(theirs, ours)| Some((of(theirs)? / of(ours)?).ln()))
                    .collect();
                (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
            };
            Ok(AssumptionSwitched {
                assumption,
                speed_ratio: [0, 1].map(|region| ratio(region, &|p| Some(p.spindle_rpm))),
                depth_ratio: [0, 1].map(|region| ratio(region, &|p| p.depth_mm)),
                found: [0, 1].map(|region| pairs(region).len()),
                tips,
            })
        })
        .collect()
}

fn switched(switch: Switch, row: &ThesisLobes) -> Result<SwitchedTips> {
    let frf = frf(switch, row.configuration)?;
    let force = force(switch)?;
    let mut speeds = speed_grid(SPINDLE_RPM)?;
    if switch == Switch::CoarseSpeeds {
        let [from, to, _] = SPINDLE_RPM;
        speeds = speed_grid([from, to, conditions()?.speed_step_rpm])?;
    }
    let solver = StabilitySolver::new(force, frf.as_ref());
    let (solver, waves) = match switch {
        Switch::LobeZeroLeftOut => (solver.with_lobes(1.0, 0.0), [2.0, 1.0]),
        Switch::DelayedTermReversed => (solver.with_lobes(f64::NEG_INFINITY, 0.5), [1.5, 0.5]),
        Switch::OneToothTipPassedOver => (solver, [3.0, 1.0]),
        _ => (solver, [2.0, 1.0]),
    };
    let curve = solver.curve(&speeds);
    let [second_region, first_region] = waves.map(|w| {
        let expected = 60.0 * row.dominant_hz / (force.teeth as f64 * w);
        tip_near(&curve, expected)
    });
    Ok(SwitchedTips {
        configuration: row.configuration,
        second_region,
        first_region,
    })
}

fn force(switch: Switch) -> Result<RegenerativeForce> {
    let as_here = thesis_force()?;
    let c = conditions()?;
    let drilling =
        |ktc, krc, teeth| RegenerativeForce::drilling_lateral(ktc, krc, c.half_tip_angle_rad, teeth);
    let (ktc, krc) = (c.ktc_n_per_mm2, c.krc_n_per_mm2);
    match switch {
        Switch::RadialCoefficient(factor) => drilling(ktc, factor * krc, c.flutes),
        Switch::AllCoefficients(factor) => drilling(factor * ktc, factor * krc, c.flutes),
        Switch::Teeth(teeth) => drilling(ktc, krc, teeth),
        Switch::OneToothTipPassedOver => drilling(ktc, krc, 1),
        Switch::MillingSlot => RegenerativeForce::milling_zero_order(ktc, krc, c.flutes, Immersion::SLOT),
        _ => Ok(as_here),
    }
}

fn frf(switch: Switch, configuration: u32) -> Result<Box<dyn ToolPointFrf>> {
    let mut modes = thesis_modes(configuration)?;
    match switch {
        Switch::StrongestModeOnly => {
            // Least kζ: highest resonance.
            let height = |m: &AxisMode| m.stiffness_n_per_m * m.damping_ratio;
            modes.sort_by(|a, b| height(a).total_cmp(&height(b)));
            let strongest = |axis| modes.iter().find(|m| m.axis == axis).copied();
            modes = [0, 1].into_iter().filter_map(strongest).collect();
        }
        Switch::OneAxis(axis) => modes.retain(|m| m.axis == axis),
        Switch::Damping(factor) => {
            for mode in &mut modes {
                // The minimum of the real part, −1/(4kζ(1 + ζ)) at f_n √(1 + 2ζ), stays where it was measured.
                let (old, new) = (mode.damping_ratio, factor * mode.damping_ratio);
                mode.stiffness_n_per_m *= old * (1.0 + old) / (new * (1.0 + new));
                mode.frequency_hz *= ((1.0 + 2.0 * old) / (1.0 + 2.0 * new)).sqrt();
                mode.damping_ratio = new;
            }
        }
        _ => {}
    }
    let modal = ModalFrf::from_axis_modes(&modes)?;
    Ok(match switch {
        Switch::ModesTurned => {
            let (sin, cos) = TURN_RAD.sin_cos();
            // The drilling matrix is the same in all directions: turning all modes together would change nothing.
            let turned = |m: &Mode| match m.shape {
                [x, 0.0] => Mode {
                    shape: [cos * x, sin * x],
                    ..*m
                },
                _ => *m,
            };
            let turned = modal.modes().iter().map(turned).collect();
            Box::new(ModalFrf::from_mode_shapes(turned, *modal.residual_m_per_n())?)
        }
        Switch::MeasuredLines => {
            let (low, high) = (modal.band_hz().0.max(1.0), modal.band_hz().1.min(100.0));
            let lines: Vec<f64> = (0..)
                .map(|i| low + LINE_SPACING_HZ * f64::from(i))
                .take_while(|f| *f <= high)
                .collect();
            let values = lines.iter().map(|f| modal.receptance(*f)).collect();
            Box::new(SampledFrf::new(lines, values)?)
        }
        _ => Box::new(modal),
    })
}

/// What the table comes to, in sentences for people.
pub fn reading(table: &[AssumptionSwitched]) -> Vec<String> {
    let Some((here, others)) = table.split_first() else {
        return Vec::new();
    };
    let (Some(ours), [Some(second), Some(first)]) = (here.speed_factor(), here.speed_ratio) else {
        return Vec::new();
    };
    let mut text = vec![format!(
        "As computed here the commercial program's tips lie at {second:.2} and {first:.2} times our speeds (second and first \
         region)."
    )];
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.05;
    let idle: Vec<&str> = others
        .iter()
        .filter(|o| {
            let pairs = o.speed_ratio.into_iter().zip([second, first]);
            pairs
                .into_iter()
                .all(|(ratio, base)| ratio.is_some_and(|r| near(r, base)))
        })
        .map(|o| o.assumption)
        .collect();
    if !idle.is_empty() {
        text.push(format!(
            "These assumptions move neither tip by 5 % and cannot explain that: {}. The tips of a lightly damped mode lie near \
             60 f/(N w) with w whole waves between two teeth, whatever the forces.",
            idle.join("; ")
        ));
    }
    let mut nearer: Vec<(f64, &AssumptionSwitched)> = others
        .iter()
        .filter_map(|o| Some((o.speed_factor()?, o)))
        .filter(|(factor, _)| *factor < ours)
        .collect();
    nearer.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some((least, _)) = nearer.first().copied() else {
        return text;
    };
    // What comes as near as makes no difference counts, too.
    for (factor, o) in nearer
        .into_iter()
        .take_while(|(factor, _)| *factor < ALIKE * least)
    {
        if let ([Some(second), Some(first)], [Some(deep2), Some(deep1)]) = (o.speed_ratio, o.depth_ratio) {
            text.push(format!(
                "Nearest in speed: \"{}\", ratios {second:.2} and {first:.2}, off by a factor of {factor:.2} on the whole \
                 against {ours:.2} as here. The commercial program's depths are {deep2:.2} and {deep1:.2} times those{}.",
                o.assumption,
                if [deep2, deep1].iter().any(|d| !(0.8..1.25).contains(d)) {
                    ", so it does not explain them as well: a hint, no proof"
                } else {
                    ", so depths agree, too"
                }
            ));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thesis::measured_lobes::thesis_lobes;
    use approx::assert_relative_eq;

    fn of<'a>(table: &'a [AssumptionSwitched], name: &str) -> &'a AssumptionSwitched {
        table.iter().find(|a| a.assumption.contains(name)).unwrap()
    }

    #[test]
    fn switching_assumptions_moves_the_tips_as_it_must() {
        let lobes = thesis_lobes().unwrap();
        let table = assumptions_switched(&lobes).unwrap();
        assert_eq!(table.len(), SWITCHES.len());
        let here = &table[0];
        for (tips, row) in here.tips.iter().zip(&lobes) {
            assert_eq!(tips.first_region, Some(row.first_region));
            assert_eq!(tips.second_region, Some(row.second_region));
        }
        // Depths go with one over the coefficients, speeds not at all.
        let halved = of(&table, "coefficients halved");
        for region in 0..2 {
            let [a, b] = [here, halved].map(|t| t.depth_ratio[region].unwrap());
            assert_relative_eq!(a / b, 2.0, max_relative = 1e-6);
            assert_relative_eq!(
                here.speed_ratio[region].unwrap(),
                halved.speed_ratio[region].unwrap(),
                max_relative = 1e-9
            );
        }
        // Finely enough sampled, measured lines are the modes.
        let lines = of(&table, "0.1 Hz");
        for region in 0..2 {
            assert_relative_eq!(
                lines.speed_ratio[region].unwrap(),
                here.speed_ratio[region].unwrap(),
                max_relative = 0.01
            );
        }
        // Tips at half waves instead of whole ones: 4/3 and 2 times the speed, to the shift by damping.
        let reversed = of(&table, "wrong sign");
        for (region, factor) in [(0, 4.0 / 3.0), (1, 2.0)] {
            let moved = here.speed_ratio[region].unwrap() / reversed.speed_ratio[region].unwrap();
            assert_relative_eq!(moved, factor, max_relative = 0.08);
        }
        assert!(reading(&table).len() >= 2);
    }

    /// A reversed delayed term on one mode: the characteristic equation 1 − b (1 + e^{−iωT}) λ holds at the limit.
    #[test]
    fn half_a_wave_solves_its_own_equation() {
        use num_complex::Complex64;
        let modes = [0, 1].map(|axis| AxisMode {
            axis,
            frequency_hz: 12.0 + axis as f64,
            damping_ratio: 0.03,
            stiffness_n_per_m: 5e5,
        });
        let frf = ModalFrf::from_axis_modes(&modes).unwrap();
        let force = thesis_force().unwrap();
        let solver = StabilitySolver::new(force, &frf).with_lobes(f64::NEG_INFINITY, 0.5);
        for rpm in [150.0, 333.0, 700.0] {
            let limit = solver.limit_at(rpm).unwrap();
            let period = 60.0 / (force.teeth as f64 * rpm);
            let delayed = Complex64::from_polar(1.0, -std::f64::consts::TAU * limit.chatter_hz * period);
            let factor = (1.0 + delayed) * (1e-3 * limit.depth_mm);
            let (d, phi) = (force.matrix_n_per_m2, frf.receptance(limit.chatter_hz));
            let m: [[Complex64; 2]; 2] = [0, 1]
                .map(|i| [0, 1].map(|j| (0..2).map(|k| phi[k][j] * d[i][k]).sum::<Complex64>() * factor));
            let determinant = (1.0 - m[0][0]) * (1.0 - m[1][1]) - m[0][1] * m[1][0];
            assert!(determinant.norm() < 1e-6, "{rpm}: {determinant}");
        }
    }
}
