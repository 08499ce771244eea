//! Forces on the recorded channels, with derivatives: from the chip through frame, sensor and crosstalk.

use std::borrow::Cow;

use num_complex::Complex64;

use crate::cutting::waveform::{
    ChipLaw, DrillTerm, DrillingCut, LineForces, MillingCut, TeethSlopes, ToothPlace, UnitForces,
};
use crate::cutting::{EdgeBit, ForceAxis};
use crate::effects::cutting::{CutPhysics, Mixing, OwnTeeth};
use crate::identify::forces::asynchronous_lines::MOST_SHIFT;
use crate::identify::forces::cutting_data::CutData;
use crate::robot::Dual;

/// Forces on the recorded channels with their derivatives. Milling: `[mean, re 1, im 1, re 2, …]` over the orders of
/// rotation, at phase zero. Drilling: mean of each block. Turning: `[mean]`.
#[derive(Debug, Clone)]
pub struct Forces {
    pub value: [Vec<f64>; 4],
    /// One a parameter; empty where no derivatives were asked for.
    pub slope: Vec<[Vec<f64>; 4]>,
    /// By the time of first contact (drilling), per s.
    pub contact_slope: [Vec<f64>; 4],
}

impl Forces {
    fn zero(length: usize, parameters: usize) -> Forces {
        let channels = || std::array::from_fn(|_| vec![0.0; length]);
        Forces {
            value: channels(),
            slope: (0..parameters).map(|_| channels()).collect(),
            contact_slope: channels(),
        }
    }

    fn length(&self) -> usize {
        self.value[0].len()
    }

    /// Adds `weight` times what `unit` gives for a channel and an index.
    fn add(&mut self, channel: usize, weight: &Dual, unit: &[f64]) {
        add_scaled(&mut self.value[channel], weight.value, unit);
        for (slope, g) in self.slope.iter_mut().zip(&weight.gradient) {
            add_scaled(&mut slope[channel], *g, unit);
        }
    }

    /// x, y, z become mixtures of each other.
    fn mix(&mut self, mixing: &Mixing) {
        let length = self.length();
        let before: [Vec<f64>; 3] = std::array::from_fn(|i| self.value[i].clone());
        let turned = |set: &[Vec<f64>]| -> [Vec<f64>; 3] {
            std::array::from_fn(|i| {
                let mut sum = vec![0.0; length];
                for (j, part) in set.iter().take(3).enumerate() {
                    add_scaled(&mut sum, mixing[i][j].value, part);
                }
                sum
            })
        };
        let put = |set: &mut [Vec<f64>; 4], new: [Vec<f64>; 3]| {
            for (old, new) in set.iter_mut().zip(new) {
                *old = new;
            }
        };
        for (p, slope) in self.slope.iter_mut().enumerate() {
            let mut new = turned(slope);
            for (i, row) in mixing.iter().enumerate() {
                for (weight, part) in row.iter().zip(&before) {
                    add_scaled(&mut new[i], weight.derivative(p), part);
                }
            }
            put(slope, new);
        }
        let new = turned(&self.value);
        put(&mut self.value, new);
    }

    /// Second-order dynamics G = 1 / (1 − r² + 2iζr), r = f/f₀, on the orders of each channel.
    fn filter(&mut self, dynamics: &[[Dual; 2]; 3], spindle_hz: f64) {
        for (channel, [frequency, damping]) in dynamics.iter().enumerate() {
            for n in 1..=(self.length() - 1) / 2 {
                let r = n as f64 * spindle_hz / frequency.value;
                let g = Complex64::from(1.0) / Complex64::new(1.0 - r * r, 2.0 * damping.value * r);
                // dG = −G² d(1 − r² + 2iζr), dr = −r df₀/f₀
                let by_frequency =
                    g * g * Complex64::new(-2.0 * r, 2.0 * damping.value) * (r / frequency.value);
                let by_damping = -g * g * Complex64::new(0.0, 2.0 * r);
                let (re, im) = (2 * n - 1, 2 * n);
                let at = |set: &[Vec<f64>; 4]| Complex64::new(set[channel][re], set[channel][im]);
                let before = at(&self.value);
                for (p, slope) in self.slope.iter_mut().enumerate() {
                    let own = by_frequency * frequency.derivative(p) + by_damping * damping.derivative(p);
                    let new = g * at(slope) + own * before;
                    (slope[channel][re], slope[channel][im]) = (new.re, new.im);
                }
                let new = g * before;
                (self.value[channel][re], self.value[channel][im]) = (new.re, new.im);
            }
        }
    }
}

fn add_scaled(sum: &mut [f64], weight: f64, part: &[f64]) {
    if weight != 0.0 {
        for (s, p) in sum.iter_mut().zip(part) {
            *s += weight * p;
        }
    }
}

/// `[mean, re 1, im 1, …]` of the recorded channels for one unit force law, A⁻¹ applied.
fn recorded(unit: &[Vec<Complex64>; 3], dyno_from_tool: &[[f64; 3]; 3]) -> [Vec<f64>; 3] {
    std::array::from_fn(|i| {
        let count = unit[0].len();
        let mut flat = vec![0.0; 2 * count - 1];
        for (axis, orders) in unit.iter().enumerate() {
            let a = dyno_from_tool[i][axis];
            if a == 0.0 {
                continue;
            }
            flat[0] += a * orders[0].re;
            for (n, c) in orders.iter().enumerate().skip(1) {
                flat[2 * n - 1] += a * c.re;
                flat[2 * n] += a * c.im;
            }
        }
        flat
    })
}

/// Adds what unit forces make of the coefficients.
fn add_units(forces: &mut Forces, unit: &UnitForces, physics: &CutPhysics, dyno_from_tool: &[[f64; 3]; 3]) {
    for (k, unit) in unit.iter().enumerate() {
        for (channel, part) in recorded(unit, dyno_from_tool).iter().enumerate() {
            forces.add(channel, &physics.coefficient[k], part);
        }
    }
}

/// Adds the derivative by something that the unit forces depend on, in each direction of the force by its own: only a slope, the
/// value does not change with it.
fn add_slopes(
    forces: &mut Forces,
    slope: &UnitForces,
    by: [&Dual; 3],
    physics: &CutPhysics,
    dyno_from_tool: &[[f64; 3]; 3],
) {
    for (k, unit) in slope.iter().enumerate() {
        let weight = Dual {
            value: 0.0,
            gradient: by[k % 3]
                .gradient
                .iter()
                .map(|g| g * physics.coefficient[k].value)
                .collect(),
        };
        for (channel, part) in recorded(unit, dyno_from_tool).iter().enumerate() {
            forces.add(channel, &weight, part);
        }
    }
}

/// Forces of a cut that vibrates, and the amplitudes of its lines. `change`: of the chip's boundary, as [`chip_change`] gives it.
fn vibrating_forces(
    physics: &CutPhysics,
    cut: &CutData,
    milling: &MillingCut,
    change: &[Dual; 2],
    dyno_from_tool: &[[f64; 3]; 3],
    parameters: usize,
) -> (Forces, LineAmplitudes) {
    let mut forces = Forces::zero(2 * cut.orders + 1, parameters);
    let vibrating = by_direction(
        physics,
        |exponent| {
            let change_mm = [change[0].value, change[1].value];
            milling.vibrating(cut.orders, exponent, change_mm, MOST_SHIFT as usize)
        },
        |all, own, k| {
            all.unit[k] = own.unit[k].clone();
            for (all, own) in all.slopes.iter_mut().zip(&*own.slopes) {
                all[k] = own[k].clone();
            }
            let lines = all.lines.iter_mut().chain(all.line_slopes.iter_mut().flatten());
            for (all, own) in lines.zip(own.lines.iter().chain(own.line_slopes.iter().flatten())) {
                all[k] = own[k];
            }
        },
    );
    add_units(&mut forces, &vibrating.unit, physics, dyno_from_tool);
    if parameters > 0 {
        let own = [exponents(physics), Some([&change[0]; 3]), Some([&change[1]; 3])];
        for (slope, by) in vibrating.slopes.iter().zip(own) {
            if let Some(by) = by {
                add_slopes(&mut forces, slope, by, physics, dyno_from_tool);
            }
        }
    }
    let lines = (0..vibrating.lines.len())
        .map(|r| {
            let slopes = [&vibrating.line_slopes[0][r], &vibrating.line_slopes[1][r]];
            line_amplitudes(physics, &vibrating.lines[r], slopes, change, dyno_from_tool)
        })
        .collect();
    (forces, lines)
}

/// Forces of the chip as `milling` has it. `unit`: its linear forces, where they are worked out already.
fn chip_forces(
    physics: &CutPhysics,
    cut: &CutData,
    milling: &MillingCut,
    unit: Option<&UnitForces>,
    dyno_from_tool: &[[f64; 3]; 3],
    parameters: usize,
) -> Forces {
    let mut forces = Forces::zero(2 * cut.orders + 1, parameters);
    let is_linear = physics.size_exponent.is_none() && physics.runout.is_none();
    let own = physics.own_teeth.as_ref().filter(|_| parameters > 0);
    let differ = physics.own_teeth.is_some() || physics.runout.is_some();
    let is_closed = match milling.shape {
        None => is_linear,
        Some(_) => physics.size_exponent.is_none(),
    };
    if differ && is_closed && milling.has_one_helix() {
        let runout = physics.runout.as_ref();
        let values = runout.map(|r| [r.offset_mm.value, r.angle_rad.value]);
        let wanted = match (parameters, own) {
            (0, _) => TeethSlopes::None,
            (_, None) => TeethSlopes::OfRunout,
            (_, Some(_)) => TeethSlopes::All,
        };
        let teeth = milling.own_teeth(cut.orders, values, wanted);
        add_units(&mut forces, &teeth.unit, physics, dyno_from_tool);
        let by_runout = runout.into_iter().flat_map(|r| [&r.offset_mm, &r.angle_rad]);
        for (slope, by) in teeth.by_runout.iter().zip(by_runout) {
            add_slopes(&mut forces, slope, [by; 3], physics, dyno_from_tool);
        }
        for (index, by) in own.into_iter().flat_map(OwnTeeth::radii) {
            add_slopes(
                &mut forces,
                &teeth.by_radius[index],
                [by; 3],
                physics,
                dyno_from_tool,
            );
        }
        for (index, by) in own.into_iter().flat_map(OwnTeeth::angles) {
            add_slopes(
                &mut forces,
                &teeth.by_angle[index],
                [by; 3],
                physics,
                dyno_from_tool,
            );
        }
        return forces;
    }
    let sampled_of = |milling: &MillingCut, derivatives: bool| {
        by_direction(
            physics,
            |exponent| milling.sampled(cut.orders, chip_law(physics, exponent), derivatives),
            |all, own, k| {
                all.unit[k] = own.unit[k].clone();
                for (all, own) in all.slopes.iter_mut().zip(&own.slopes) {
                    if let (Some(all), Some(own)) = (all, own) {
                        all[k] = own[k].clone();
                    }
                }
            },
        )
    };
    let sampled = (!is_linear).then(|| sampled_of(milling, parameters > 0));
    let unmoved = match (&sampled, unit) {
        (Some(sampled), _) => Cow::Borrowed(&sampled.unit),
        (None, Some(unit)) => Cow::Borrowed(unit),
        (None, None) => Cow::Owned(milling.linear(cut.orders)),
    };
    add_units(&mut forces, &unmoved, physics, dyno_from_tool);
    let of_the_law = [
        exponents(physics),
        physics.runout.as_ref().map(|r| [&r.offset_mm; 3]),
        physics.runout.as_ref().map(|r| [&r.angle_rad; 3]),
    ];
    let slopes = sampled.iter().flat_map(|s| &s.slopes);
    for (slope, by) in slopes.zip(of_the_law) {
        if let (Some(slope), Some(by)) = (slope, by) {
            add_slopes(&mut forces, slope, by, physics, dyno_from_tool);
        }
    }
    // Own teeth together with another law of the chip, or of several helix angles, have no closed form: differences, mm or rad.
    const STEP: f64 = 1e-7;
    let tooth_slope = |change: &dyn Fn(&mut ToothPlace), index: usize| {
        let mut moved = milling.clone();
        change(&mut moved.places[index]);
        let mut slope = sampled_of(&moved, false).unit;
        let values = slope.iter_mut().flatten().flatten();
        let from = unmoved.iter().flatten().flatten();
        values
            .zip(from)
            .for_each(|(value, from)| *value = (*value - from) / STEP);
        slope
    };
    for (index, by) in own.into_iter().flat_map(OwnTeeth::radii) {
        let slope = tooth_slope(&|place| place.radius_mm += STEP, index);
        add_slopes(&mut forces, &slope, [by; 3], physics, dyno_from_tool);
    }
    for (index, by) in own.into_iter().flat_map(OwnTeeth::angles) {
        let slope = tooth_slope(&|place| place.ahead_rad += STEP, index);
        add_slopes(&mut forces, &slope, [by; 3], physics, dyno_from_tool);
    }
    forces
}

/// Those of the size effect in the three directions of the force.
fn exponents(physics: &CutPhysics) -> Option<[&Dual; 3]> {
    physics.size_exponent.as_ref().map(|p| [&p[0], &p[1], &p[2]])
}

/// Forces by the size exponent of each direction: `sample` gives all directions for one exponent, `take` puts direction k of another
/// sample in the place of what is there.
fn by_direction<T>(
    physics: &CutPhysics,
    sample: impl Fn(Option<f64>) -> T,
    take: impl Fn(&mut T, &T, usize),
) -> T {
    let Some(exponents) = exponents(physics) else {
        return sample(None);
    };
    let [tangential, others @ ..] = exponents.map(|p| p.value);
    let mut all = sample(Some(tangential));
    for (k, exponent) in (1..).zip(others) {
        if exponent != tangential {
            take(&mut all, &sample(Some(exponent)), k);
        }
    }
    all
}

fn chip_law(physics: &CutPhysics, exponent: Option<f64>) -> ChipLaw {
    ChipLaw {
        exponent,
        runout: physics
            .runout
            .as_ref()
            .map(|r| [r.offset_mm.value, r.angle_rad.value]),
    }
}

/// Smallest and largest share of the stated depth that a tool pushed off (or drawn in) cuts.
const DEPTH_SHARES: [f64; 2] = [0.05, 4.0];

/// Share of the stated depth a that is cut where the mean axial force pushes the tool off by `compliance` (mm/N): the mean force is
/// proportional to the depth, F = F₀ s, so a (1 − s) = C F₀ s and s = 1 / (1 + C F₀ / a). `at_full`: forces at the stated depth.
fn depth_share(
    at_full: &Forces,
    compliance: &Dual,
    axial_depth_mm: f64,
    dyno_from_tool: &[[f64; 3]; 3],
) -> Dual {
    let matrix = nalgebra::Matrix3::from_fn(|i, j| dyno_from_tool[i][j]);
    let row = matrix
        .try_inverse()
        .map_or([0.0, 0.0, 1.0], |m| [m[(2, 0)], m[(2, 1)], m[(2, 2)]]);
    let axial = |set: &[Vec<f64>; 4]| (0..3).map(|i| row[i] * set[i][0]).sum::<f64>();
    let force = Dual {
        value: axial(&at_full.value),
        gradient: at_full.slope.iter().map(axial).collect(),
    };
    let share = (&Dual::constant(1.0) + &(compliance * &force).scale(1.0 / axial_depth_mm)).recip();
    match share.value {
        s if s > DEPTH_SHARES[0] && s < DEPTH_SHARES[1] => share,
        s if s > 0.0 => Dual::constant(s.clamp(DEPTH_SHARES[0], DEPTH_SHARES[1])),
        // Drawn in without end.
        _ => Dual::constant(DEPTH_SHARES[1]),
    }
}

/// Forces at a share of the stated depth; the lag of the helix follows the depth.
fn at_depth_share(
    physics: &CutPhysics,
    cut: &CutData,
    milling: &MillingCut,
    share: &Dual,
    dyno_from_tool: &[[f64; 3]; 3],
    parameters: usize,
) -> Forces {
    const STEP: f64 = 1e-4;
    let at = |share: f64, parameters: usize| {
        let deeper = milling.deeper(share);
        chip_forces(physics, cut, &deeper, None, dyno_from_tool, parameters)
    };
    let mut forces = at(share.value, parameters);
    if parameters > 0 {
        let (high, low) = (at(share.value + STEP, 0), at(share.value - STEP, 0));
        for channel in 0..3 {
            let pairs = high.value[channel].iter().zip(&low.value[channel]);
            let by_share: Vec<f64> = pairs.map(|(h, l)| (h - l) / (2.0 * STEP)).collect();
            for (p, slope) in forces.slope.iter_mut().enumerate() {
                add_scaled(&mut slope[channel], share.derivative(p), &by_share);
            }
        }
    }
    forces
}

/// Amplitude (N) that a vibration puts on each recorded channel at the lines shifted by −2..2 tooth-passing frequencies.
pub(crate) type LineAmplitudes = Vec<[Dual; 3]>;

/// Forces of a milling cut on the recorded channels, phase zero, up to and with crosstalk; and the lines of a vibration
/// where the cut has one. (Runout, teeth that differ and push-off are left out of a
/// vibrating cut.)
pub(crate) fn milling_forces(
    physics: &CutPhysics,
    cut: &CutData,
    milling: &MillingCut,
    unit: &UnitForces,
    dyno_from_tool: &[[f64; 3]; 3],
    parameters: usize,
) -> (Forces, Option<LineAmplitudes>) {
    let own_teeth = physics.own_teeth.as_ref().map(|own| own.on(milling));
    let milling = own_teeth.as_ref().unwrap_or(milling);
    let (mut forces, lines) = match chip_change(physics, cut, milling) {
        Some(change) => {
            let (forces, lines) =
                vibrating_forces(physics, cut, milling, &change, dyno_from_tool, parameters);
            (forces, Some(lines))
        }
        None => {
            let unit = own_teeth.is_none().then_some(unit);
            let forces = chip_forces(physics, cut, milling, unit, dyno_from_tool, parameters);
            let forces = match &physics.axial_compliance_mm_per_n {
                Some(compliance) => {
                    let depth = depth_share(&forces, compliance, milling.axial_depth_mm, dyno_from_tool);
                    at_depth_share(physics, cut, milling, &depth, dyno_from_tool, parameters)
                }
                None => forces,
            };
            (forces, None)
        }
    };
    if let Some(tilt) = &physics.tilt {
        forces.mix(tilt);
    }
    if let Some(dynamics) = &physics.dynamics {
        forces.filter(dynamics, cut.spindle_hz());
    }
    if let Some(crosstalk) = &physics.crosstalk {
        forces.mix(crosstalk);
    }
    (forces, lines)
}

/// Thrust and torque of each block with the first contact at `contact_s`.
pub(crate) fn drilling_forces(
    physics: &CutPhysics,
    cut: &CutData,
    drill: &DrillingCut,
    contact_s: f64,
    parameters: usize,
) -> Forces {
    let mut forces = Forces::zero(cut.block_s.len(), parameters);
    let [h_of_torque, h_of_thrust, _] = counts_as(physics, drill.geometry.chip_thickness_mm());
    let k = &physics.coefficient;
    let (thrust, torque) = (ForceAxis::Z.index(), ForceAxis::Mz.index());
    let mut terms = vec![
        (torque, DrillTerm::Torque, &(&k[0] * &h_of_torque) + &k[1]),
        (thrust, DrillTerm::Thrust, &(&k[2] * &h_of_thrust) + &k[3]),
    ];
    if let Some(chisel) = physics.chisel_thrust_n.as_ref().filter(|_| drill.full_hole) {
        terms.push((thrust, DrillTerm::Chisel, chisel.clone()));
    }
    if let Some(margin) = &physics.margin_n_per_mm {
        terms.push((torque, DrillTerm::Margin, margin.clone()));
    }
    for (channel, term, weight) in terms {
        // Air after the cut has no force.
        let cutting = |b: usize| b < cut.steady.end;
        let (unit, by_contact): (Vec<f64>, Vec<f64>) = cut
            .block_s
            .iter()
            .enumerate()
            .map(|(b, [from, to])| {
                if cutting(b) {
                    drill.mean(term, *from, *to, contact_s)
                } else {
                    (0.0, 0.0)
                }
            })
            .unzip();
        forces.add(channel, &weight, &unit);
        add_scaled(&mut forces.contact_slope[channel], weight.value, &by_contact);
    }
    forces
}

/// Thickness that a chip of `h_mm` counts as for the force in each direction, mm: h (h / reference)^−p.
fn counts_as(physics: &CutPhysics, h_mm: f64) -> [Dual; 3] {
    match exponents(physics) {
        Some(exponents) if h_mm > 0.0 => {
            let log = (h_mm / ChipLaw::REFERENCE_MM).ln();
            exponents.map(|p| p.scale(-log).exp().scale(h_mm))
        }
        _ => std::array::from_fn(|_| Dual::constant(h_mm)),
    }
}

/// Force of a turned cut on the recorded channels, the same over the whole turn, up to and with crosstalk.
pub(crate) fn turning_forces(
    physics: &CutPhysics,
    edge: &[EdgeBit],
    dyno_from_tool: &[[f64; 3]; 3],
    parameters: usize,
) -> Forces {
    let mut forces = Forces::zero(1, parameters);
    let k = &physics.coefficient;
    for bit in edge {
        let chip = counts_as(physics, bit.chip_mm);
        for direction in 0..3 {
            let along =
                [ForceAxis::X, ForceAxis::Y, ForceAxis::Z].map(|axis| bit.directions(axis)[direction]);
            let force = (&(&k[direction] * &chip[direction]) + &k[direction + 3]).scale(bit.length_mm);
            for (channel, row) in dyno_from_tool.iter().enumerate() {
                let share: f64 = row.iter().zip(along).map(|(a, d)| a * d).sum();
                forces.add(channel, &force.scale(share), &[1.0]);
            }
        }
    }
    if let Some(tilt) = &physics.tilt {
        forces.mix(tilt);
    }
    if let Some(crosstalk) = &physics.crosstalk {
        forces.mix(crosstalk);
    }
    forces
}

/// Change of the chip's boundary from one tooth to the next in a vibrating cut, along x and y, mm: d (1 − e^{−iωT}).
fn chip_change(physics: &CutPhysics, cut: &CutData, milling: &MillingCut) -> Option<[Dual; 2]> {
    let vibration = physics.vibration.as_ref()?;
    let tooth_hz = cut.spindle_hz() * milling.teeth as f64;
    let seen = cut
        .vibration
        .as_ref()
        .map_or(vibration.frequency_hz.value, |v| v.frequency_hz);
    let regeneration = 2.0 * (std::f64::consts::PI * seen / tooth_hz).sin().abs();
    let angle = &vibration.direction_rad;
    let (s, c) = angle.value.sin_cos();
    let amplitude = vibration.amplitude_mm.scale(regeneration);
    Some([&amplitude * &angle.chain(c, -s), &amplitude * &angle.chain(s, c)])
}

/// Amplitudes of one line on the recorded x, y, z. `slopes`: of the unit forces by the change of the chip along x and y.
fn line_amplitudes(
    physics: &CutPhysics,
    line: &LineForces,
    slopes: [&LineForces; 2],
    change: &[Dual; 2],
    dyno_from_tool: &[[f64; 3]; 3],
) -> [Dual; 3] {
    let seen = |forces: &LineForces, k: usize, channel: usize| -> Complex64 {
        (0..3)
            .map(|axis| forces[k][axis] * dyno_from_tool[channel][axis])
            .sum()
    };
    std::array::from_fn(|channel| {
        // Real and imaginary part, with derivatives by the coefficients and by the change of the chip.
        let mut parts = [Dual::constant(0.0), Dual::constant(0.0)];
        for (k, coefficient) in physics.coefficient.iter().enumerate() {
            let mut terms = vec![(coefficient.clone(), seen(line, k, channel))];
            for (slope, by) in slopes.iter().zip(change) {
                let weight = Dual {
                    value: 0.0,
                    gradient: by.gradient.iter().map(|g| g * coefficient.value).collect(),
                };
                terms.push((weight, seen(slope, k, channel)));
            }
            for (weight, unit) in terms {
                parts[0] = &parts[0] + &weight.scale(unit.re);
                parts[1] = &parts[1] + &weight.scale(unit.im);
            }
        }
        let square = &(&parts[0] * &parts[0]) + &(&parts[1] * &parts[1]);
        if square.value > 0.0 {
            square.sqrt()
        } else {
            Dual::constant(0.0)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second harmonic of 25 Hz through a dynamometer of 100 Hz: r = 1/2, G = 1 / (3/4 + iζ). Means pass as they are.
    #[test]
    fn a_dynamometer_amplifies_by_its_second_order_response() {
        let mut forces = Forces::zero(5, 2);
        forces.value[0] = vec![7.0, 0.0, 0.0, 3.0, -2.0];
        let zeta = 0.1;
        let frequency = Dual::variable(100.0, 0, 2);
        let damping = Dual::variable(zeta, 1, 2);
        let own = || [frequency.clone(), damping.clone()];
        forces.filter(&[own(), own(), own()], 25.0);
        let expected = Complex64::new(3.0, -2.0) / Complex64::new(0.75, zeta);
        approx::assert_relative_eq!(forces.value[0][0], 7.0);
        approx::assert_relative_eq!(forces.value[0][3], expected.re, max_relative = 1e-12);
        approx::assert_relative_eq!(forces.value[0][4], expected.im, max_relative = 1e-12);
        // ∂G/∂ζ = −G² i 2r
        let slope = -expected / Complex64::new(0.75, zeta) * Complex64::i();
        approx::assert_relative_eq!(forces.slope[1][0][3], slope.re, max_relative = 1e-12);
        approx::assert_relative_eq!(forces.slope[1][0][4], slope.im, max_relative = 1e-12);
    }

    use crate::effects::cutting::{Runout, Vibration};
    use crate::identify::forces::cutting_data::{CutKind, CuttingData};
    use crate::identify::forces::made_cuts::{AS_IT_IS, METAL, MILLED, drilled, milled, turned};
    use approx::assert_relative_eq;

    fn constants(values: &[f64]) -> Vec<Dual> {
        values.iter().map(|v| Dual::constant(*v)).collect()
    }

    fn mill(data: &CuttingData) -> (&CutData, &MillingCut, &UnitForces) {
        let cut = &*data.cuts[0];
        match &cut.kind {
            CutKind::Milling { cut: milling, unit } => (cut, milling, unit),
            _ => unreachable!("a milled cut"),
        }
    }

    /// Turned by 90° about z and a hundredth of z let into x: forces are mixed as vectors, slopes by the rule of products.
    #[test]
    fn mixed_channels_are_sums_of_what_went_in() {
        let mut forces = Forces::zero(1, 1);
        forces.value = [vec![2.0], vec![3.0], vec![5.0], vec![7.0]];
        forces.slope[0] = [vec![0.2], vec![0.3], vec![0.5], vec![0.7]];
        let mut mixing = [(); 3].map(|()| [(); 3].map(|()| Dual::constant(0.0)));
        mixing[0][1] = Dual::constant(-1.0);
        mixing[0][2] = Dual::variable(0.01, 0, 1);
        mixing[1][0] = Dual::constant(1.0);
        mixing[2][2] = Dual::constant(1.0);
        forces.mix(&mixing);
        let values: Vec<f64> = forces.value.iter().map(|v| v[0]).collect();
        assert_eq!(values, [-3.0 + 0.05, 2.0, 5.0, 7.0]);
        let slopes: Vec<f64> = forces.slope[0].iter().map(|v| v[0]).collect();
        // A further N of z in x for each unit of the crosstalk: 5 N.
        assert_eq!(slopes, [-0.3 + 0.005 + 5.0, 0.2, 0.5, 0.7]);
    }

    /// A tool that 100 N push off by 1 µm/N: of 0.5 mm, s is cut with 0.5 (1 − s) = 0.001 · 100 s.
    #[test]
    fn what_is_pushed_off_is_not_cut() {
        let mut forces = Forces::zero(1, 1);
        forces.value[2] = vec![100.0];
        let share = |compliance: f64, forces: &Forces| {
            depth_share(forces, &Dual::variable(compliance, 0, 1), 0.5, &AS_IT_IS)
        };
        let s = share(1e-3, &forces);
        assert_relative_eq!(
            0.5 * (1.0 - s.value),
            1e-3 * 100.0 * s.value,
            max_relative = 1e-12
        );
        let h = 1e-9;
        let difference = (share(1e-3 + h, &forces).value - share(1e-3 - h, &forces).value) / (2.0 * h);
        assert_relative_eq!(s.derivative(0), difference, max_relative = 1e-6);
        // The axial force of the tool, where the dynamometer's y shows it with the sign turned.
        let turned = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
        let mut recorded = Forces::zero(1, 1);
        recorded.value[1] = vec![-100.0];
        let same = depth_share(&recorded, &Dual::constant(1e-3), 0.5, &turned);
        assert_relative_eq!(same.value, s.value, max_relative = 1e-12);
        // Drawn in by as much as it cuts there is no end to it, and pushed out of the work it still rubs.
        assert_eq!(share(-6e-3, &forces).value, DEPTH_SHARES[1]);
        assert_eq!(share(-4.9e-3, &forces).value, DEPTH_SHARES[1]);
        assert_eq!(share(1.0, &forces).value, DEPTH_SHARES[0]);
        assert_eq!(share(0.0, &forces).value, 1.0);
    }

    /// Axial force of the whole cut, 1 − s of the depth given up, at the depth that is left.
    #[test]
    fn a_pushed_off_mill_cuts_the_force_of_the_depth_that_is_left() {
        let data = milled(METAL, &MILLED[..1]);
        let (cut, milling, unit) = mill(&data);
        let of = |compliance: Option<f64>| {
            let mut physics = CutPhysics::of(constants(&METAL));
            physics.axial_compliance_mm_per_n = compliance.map(Dual::constant);
            milling_forces(&physics, cut, milling, unit, &AS_IT_IS, 0).0.value
        };
        let (full, pushed) = (of(None), of(Some(2e-3)));
        // The mean force goes with the depth.
        let s = pushed[2][0] / full[2][0];
        assert_relative_eq!(1.0 - s, 2e-3 * pushed[2][0], max_relative = 1e-9);
        for axis in 0..3 {
            assert_relative_eq!(pushed[axis][0], s * full[axis][0], max_relative = 1e-9);
        }
    }

    /// Everything that an effect can do to a milled cut, alone and together, by its parameters: against differences.
    #[test]
    fn slopes_of_milling_forces_are_their_differences() {
        type Change = fn(&mut CutPhysics, &[Dual]);
        let changes: [(&str, Change); 8] = [
            ("size", |p, d| {
                p.size_exponent = Some([d[6].clone(), d[6].clone(), d[6].clone()])
            }),
            ("runout", |p, d| {
                let (offset_mm, angle_rad) = (d[7].clone(), d[8].clone());
                p.runout = Some(Runout { offset_mm, angle_rad });
            }),
            ("radius", |p, d| {
                let mut own = p.own_teeth.take().unwrap_or_default();
                own.add_radius(1, 2, d[9].clone());
                p.own_teeth = Some(own);
            }),
            ("angle", |p, d| {
                let mut own = p.own_teeth.take().unwrap_or_default();
                own.add_delay(1, 2, &d[10]);
                p.own_teeth = Some(own);
            }),
            ("push-off", |p, d| {
                p.axial_compliance_mm_per_n = Some(d[11].clone())
            }),
            ("resonance", |p, d| {
                let own = || [d[12].clone(), d[13].clone()];
                p.dynamics = Some([own(), own(), own()]);
            }),
            ("crosstalk", |p, d| {
                let mut mixing = Dual::unit_matrix();
                mixing[0][2] = d[14].clone();
                p.crosstalk = Some(mixing.clone());
                mixing[1][0] = d[14].clone();
                p.tilt = Some(mixing);
            }),
            ("sizes", |p, d| {
                p.size_exponent = Some([d[6].clone(), d[15].clone(), d[16].clone()])
            }),
        ];
        let mut theta = METAL.to_vec();
        theta.extend([0.25, 0.006, 0.5, 0.004, 0.05, 1e-4, 900.0, 0.05, 0.03, 0.4, 0.1]);
        let data = milled(METAL, &MILLED[1..2]);
        let (cut, milling, unit) = mill(&data);
        let together = [
            vec![0, 2],
            vec![1, 3],
            vec![1, 7],
            vec![4, 5, 6],
            vec![0, 1, 2, 3, 4, 5, 6],
        ];
        let alone = (0..changes.len()).map(|i| vec![i]);
        for which in alone.chain(together) {
            let forces = |theta: &[f64], count: usize| {
                let duals: Vec<Dual> = theta
                    .iter()
                    .enumerate()
                    .map(|(i, v)| {
                        if count > 0 {
                            Dual::variable(*v, i, count)
                        } else {
                            Dual::constant(*v)
                        }
                    })
                    .collect();
                let mut physics = CutPhysics::of(duals[..6].to_vec());
                which.iter().for_each(|i| changes[*i].1(&mut physics, &duals));
                milling_forces(&physics, cut, milling, unit, &AS_IT_IS, count).0
            };
            let here = forces(&theta, theta.len());
            let names: Vec<&str> = which.iter().map(|i| changes[*i].0).collect();
            for p in 0..theta.len() {
                let h = 1e-4 * theta[p];
                let at = |sign: f64| {
                    let mut moved = theta.clone();
                    moved[p] += sign * h;
                    forces(&moved, 0).value
                };
                let (high, low) = (at(1.0), at(-1.0));
                for axis in 0..3 {
                    let largest = here.slope[p][axis].iter().fold(1e-3f64, |m, v| m.max(v.abs()));
                    for (n, slope) in here.slope[p][axis].iter().enumerate() {
                        let difference = (high[axis][n] - low[axis][n]) / (2.0 * h);
                        assert!(
                            (slope - difference).abs() < 0.01 * largest,
                            "{names:?} {p} axis {axis} at {n}: {slope} {difference}"
                        );
                    }
                }
            }
        }
    }

    /// What the surface of the tooth before puts on the chip: nothing where it left in step, twice the amplitude where it left in
    /// counter-phase (Altintas 2012, §3.3), along the direction of the vibration.
    #[test]
    fn a_tooth_in_step_with_the_one_before_sees_an_even_chip() {
        let data = milled(METAL, &MILLED[..1]);
        let (cut, milling, _) = mill(&data);
        let mut physics = CutPhysics::of(constants(&METAL));
        let change = |physics: &CutPhysics| chip_change(physics, cut, milling).map(|c| c.map(|d| d.value));
        assert_eq!(change(&physics), None);
        // Two teeth at 50 Hz pass at 100 Hz.
        for (hz, factor) in [
            (400.0, 0.0),
            (450.0, 2.0),
            (425.0, 2f64.sqrt()),
            (25.0, 2f64.sqrt()),
        ] {
            physics.vibration = Some(Vibration {
                frequency_hz: Dual::constant(hz),
                amplitude_mm: Dual::constant(0.01),
                direction_rad: Dual::constant(std::f64::consts::FRAC_PI_6),
            });
            let [x, y] = change(&physics).unwrap();
            assert_relative_eq!(x, 0.01 * factor * 0.75f64.sqrt(), epsilon = 1e-12);
            assert_relative_eq!(y, 0.01 * factor * 0.5, epsilon = 1e-12);
        }
    }

    /// A little vibration puts on its own line, for each mm of change of the chip, what the directional factors of a slot say.
    #[test]
    fn lines_of_a_vibration_have_slopes_by_its_size_and_direction() {
        let data = milled(METAL, &MILLED[..1]);
        let (cut, milling, unit) = mill(&data);
        let lines = |theta: &[f64; 3], count: usize| {
            let dual = |i: usize| {
                if count > 0 {
                    Dual::variable(theta[i], i, count)
                } else {
                    Dual::constant(theta[i])
                }
            };
            let mut coefficients = constants(&METAL);
            coefficients[0] = dual(2);
            let mut physics = CutPhysics::of(coefficients);
            physics.vibration = Some(Vibration {
                frequency_hz: Dual::constant(430.0),
                amplitude_mm: dual(0),
                direction_rad: dual(1),
            });
            let (forces, lines) = milling_forces(&physics, cut, milling, unit, &AS_IT_IS, count);
            (forces, lines.unwrap())
        };
        let theta = [0.004, 0.7, METAL[0]];
        let (forces, here) = lines(&theta, 3);
        assert_eq!(here.len(), 5);
        for p in 0..3 {
            let h = 1e-5 * theta[p];
            let at = |sign: f64| {
                let mut moved = theta;
                moved[p] += sign * h;
                lines(&moved, 0)
            };
            let (high, low) = (at(1.0), at(-1.0));
            for (line, (high, low)) in here.iter().zip(high.1.iter().zip(&low.1)) {
                for axis in 0..3 {
                    let difference = (high[axis].value - low[axis].value) / (2.0 * h);
                    let scale = line[axis].value / theta[p];
                    assert!(
                        (line[axis].derivative(p) - difference).abs() < 0.03 * scale,
                        "{p} {axis}"
                    );
                }
            }
            let difference = (high.0.value[1][0] - low.0.value[1][0]) / (2.0 * h);
            let scale = forces.value[1][0].abs() / theta[p];
            assert!(
                (forces.slope[p][1][0] - difference).abs() < 0.01 * scale,
                "mean {p}"
            );
        }
    }

    /// K ∝ (h / 0.1 mm)^−p: of 0.2 mm, a chip counts as 0.2 · 2^−p. At 0.1 mm nothing changes.
    #[test]
    fn thin_chips_are_harder_in_turning_and_drilling() {
        let exponent = [0; 3].map(|_| Dual::variable(0.3, 0, 1));
        for (feed, factor) in [(0.1, 1.0), (0.2, 2f64.powf(-0.3))] {
            let data = turned(METAL, &[feed]);
            let CutKind::Turning { edge } = &data.cuts[0].kind else {
                unreachable!()
            };
            let mut physics = CutPhysics::of(constants(&METAL));
            physics.size_exponent = Some(exponent.clone());
            let forces = turning_forces(&physics, edge, &AS_IT_IS, 1);
            // Against the feed the radial, out of the work the axial, along the speed the tangential force; 1.5 mm deep.
            for (axis, k) in [(0, 1), (1, 2), (2, 0)] {
                let chip = feed * factor;
                assert_relative_eq!(
                    forces.value[axis][0],
                    1.5 * (METAL[k] * chip + METAL[k + 3]),
                    max_relative = 1e-12
                );
                assert_relative_eq!(
                    forces.slope[0][axis][0],
                    -1.5 * METAL[k] * chip * (feed / 0.1f64).ln(),
                    epsilon = 1e-9
                );
            }
        }
        let data = drilled([900.0, 30.0, 700.0, 45.0], &[[0.2, 3.0]]);
        let (cut, CutKind::Drilling { cut: hole, .. }) = (&*data.cuts[0], &data.cuts[0].kind) else {
            unreachable!()
        };
        let mut physics = CutPhysics::of(constants(&[900.0, 30.0, 700.0, 45.0]));
        physics.size_exponent = Some(exponent);
        let chip = 0.1 * f64::to_radians(67.5).sin();
        let counts_as = chip * (chip / 0.1f64).powf(-0.3);
        let forces = drilling_forces(&physics, cut, hole, -10.0, 1);
        // At full diameter: two lips from 1.5 mm to 4.75 mm.
        let thrust = 2.0 * (4.75 - 1.5) * (700.0 * counts_as + 45.0);
        assert_relative_eq!(forces.value[2][5], thrust, max_relative = 1e-9);
        let lever = (4.75f64.powi(2) - 1.5f64.powi(2)) / f64::to_radians(67.5).sin() / 1000.0;
        assert_relative_eq!(
            forces.value[3][5],
            lever * (900.0 * counts_as + 30.0),
            max_relative = 1e-9
        );
        // Beyond the hole there is air.
        assert_eq!(forces.value[2][12], 0.0);
        let slope = 2.0 * (4.75 - 1.5) * 700.0 * counts_as * -(chip / 0.1f64).ln();
        assert_relative_eq!(forces.slope[0][2][5], slope, max_relative = 1e-9);
    }

    /// The chisel pushes in a hole drilled into the full alone; the margins rub on the wall that has been bored.
    #[test]
    fn chisel_and_margins_act_where_they_touch() {
        let mut physics = CutPhysics::of(constants(&[0.0; 4]));
        physics.chisel_thrust_n = Some(Dual::constant(80.0));
        physics.margin_n_per_mm = Some(Dual::constant(2.0));
        for (pilot, thrust) in [(0.0, 80.0), (3.0, 0.0)] {
            let data = drilled([900.0, 30.0, 700.0, 45.0], &[[0.2, pilot]]);
            let (cut, CutKind::Drilling { cut: hole, .. }) = (&*data.cuts[0], &data.cuts[0].kind) else {
                unreachable!()
            };
            let forces = drilling_forces(&physics, cut, hole, -1.0, 0);
            assert_relative_eq!(forces.value[2][5], thrust, epsilon = 1e-12);
            // 10 mm/s: one second before the middle of the record, and block 5 lies from −0.2 s to −0.1 s.
            let inner = if pilot > 0.0 {
                1.5
            } else {
                0.5 * 1.425 / f64::to_radians(125.0).sin()
            };
            let bored = 10.0 * 0.85 - (4.75 - inner) / f64::to_radians(67.5).tan();
            assert_relative_eq!(
                forces.value[3][5],
                2.0 * bored * 4.75 / 1000.0,
                max_relative = 1e-9
            );
        }
    }

    /// Radius and angle of a tooth are told by the closed form where the chip is linear, and by quadrature where the helix differs.
    #[test]
    fn teeth_of_two_helix_angles_have_slopes_too() {
        let data = milled(METAL, &MILLED[1..2]);
        let (cut, plain, _) = mill(&data);
        let mut milling = plain.clone();
        milling.places = plain.places_or_even();
        milling.places[1].lag_rad *= 1.2;
        let unit = milling.linear(cut.orders);
        let forces = |radius: f64, count: usize| {
            let mut physics = CutPhysics::of(constants(&METAL));
            let mut own = OwnTeeth::default();
            own.add_radius(
                1,
                2,
                if count > 0 {
                    Dual::variable(radius, 0, 1)
                } else {
                    Dual::constant(radius)
                },
            );
            physics.own_teeth = Some(own);
            milling_forces(&physics, cut, &milling, &unit, &AS_IT_IS, count).0
        };
        let here = forces(0.004, 1);
        let (high, low) = (forces(0.0041, 0), forces(0.0039, 0));
        for axis in 0..3 {
            let largest = here.slope[0][axis].iter().fold(0.0f64, |m, v| m.max(v.abs()));
            for n in 0..here.slope[0][axis].len() {
                let difference = (high.value[axis][n] - low.value[axis][n]) / 2e-4;
                assert!(
                    (here.slope[0][axis][n] - difference).abs() < 0.02 * largest,
                    "{axis} {n}"
                );
            }
        }
    }
}
