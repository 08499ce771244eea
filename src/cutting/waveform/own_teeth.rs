//! Teeth that are not all alike, in closed form: angles and radii of their own, a force linear in the chip thickness.
//!
//! Tooth j leads tooth 0 by a_j and stands r_j beyond the tool's radius. At the angle of immersion φ it cuts what the deepest of
//! the passes before it left, h_j(φ) = min_m [ (a_{j+m} − a_j)/(2π/N) · c sin φ + r_j − r_{j+m} ], m = 1..N, and nothing where that
//! is negative (Kline & DeVor 1983 for radii; Altintas, Engin, Budak 1999 for angles). As a function of sin φ this is a minimum of
//! straight lines, so the immersion falls into stretches on which the forces have the closed forms of alike teeth. Radii and angles
//! hold over the whole depth: a helix of one angle is a factor, as there. An edge of another shape is summed up part by part, on each of
//! which the offset of the tool's axis is a radius of each tooth.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::milling::{EdgePart, ImmersionWindow, MillingCut, Turns, UnitForces, put};
use super::tooth_place::{TeethSlopes, ToothPlace};
use crate::data::Immersion;

/// Forces with their derivatives by what belongs to each tooth.
#[derive(Debug, Clone)]
pub struct OwnTeethForces {
    /// The forces themselves.
    pub unit: UnitForces,
    /// By the radius of each tooth, per mm; empty where none were asked for.
    pub by_radius: Vec<UnitForces>,
    /// By the angle of each tooth ahead of tooth 0, per rad; empty where none were asked for.
    pub by_angle: Vec<UnitForces>,
    /// By the offset of the tool's axis, per mm, and its direction, per rad; empty where none were asked for.
    pub by_runout: Vec<UnitForces>,
}

/// A part of the immersion on which a tooth cuts what one and the same earlier pass left: h = `slope` sin φ + `offset`.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    immersion: Immersion,
    /// Teeth ahead of it the earlier pass was.
    passes: usize,
    slope_mm: f64,
    offset_mm: f64,
    /// Whether the chip begins, and ends, from nothing there.
    from_nothing: [bool; 2],
}

/// Share of the feed below which a chip has no thickness.
const NOTHING: f64 = 1e-9;

impl MillingCut {
    /// Places of the teeth as they are: alike and evenly spaced where no others are given.
    pub fn places_or_even(&self) -> Vec<ToothPlace> {
        if !self.places.is_empty() {
            return self.places.clone();
        }
        (0..self.teeth)
            .map(|j| ToothPlace {
                ahead_rad: TAU * j as f64 / self.teeth as f64,
                lag_rad: self.lag_rad,
                radius_mm: 0.0,
            })
            .collect()
    }

    /// Whether all teeth have the helix of the tool: what [`Self::own_teeth`] is made for.
    pub fn has_one_helix(&self) -> bool {
        self.places.iter().all(|p| p.lag_rad == self.lag_rad)
    }

    /// Forces of the teeth as [`Self::places`] has them (one helix), linear in the chip thickness. `runout`: offset of the tool's axis,
    /// mm, and its direction from tooth 0, rad; on a straight edge, where it changes along the edge, [`Self::sampled`] has it.
    pub fn own_teeth(&self, orders: usize, runout: Option<[f64; 2]>, wanted: TeethSlopes) -> OwnTeethForces {
        let places = self.places_or_even();
        let slopes = |count: usize, wanted: bool| -> Vec<UnitForces> {
            let count = if wanted { count } else { 0 };
            (0..count).map(|_| Self::nothing(orders)).collect()
        };
        let of_teeth = wanted == TeethSlopes::All;
        let mut all = OwnTeethForces {
            unit: Self::nothing(orders),
            by_radius: slopes(places.len(), of_teeth),
            by_angle: slopes(places.len(), of_teeth),
            by_runout: slopes(2, runout.is_some() && wanted != TeethSlopes::None),
        };
        for part in self.edge_parts(orders, 1) {
            let Some([offset_mm, angle_rad]) = runout else {
                self.add_teeth(&mut all, &part, &places, None);
                continue;
            };
            let from_offset = |place: &ToothPlace| angle_rad - place.ahead_rad + self.lag_rad * part.height;
            let mut eccentric = places.clone();
            for place in &mut eccentric {
                place.radius_mm += offset_mm * from_offset(place).cos();
            }
            let by_runout: Vec<[f64; 2]> = places
                .iter()
                .map(|place| {
                    let (sin, cos) = from_offset(place).sin_cos();
                    [cos, -offset_mm * sin]
                })
                .collect();
            self.add_teeth(&mut all, &part, &eccentric, Some(&by_runout));
        }
        all
    }

    /// One part of the edge. `by_runout`: change of each tooth's radius by the offset of the axis and by its direction.
    fn add_teeth(
        &self,
        all: &mut OwnTeethForces,
        part: &EdgePart,
        places: &[ToothPlace],
        by_runout: Option<&[[f64; 2]]>,
    ) {
        let teeth = places.len();
        let orders = part.factors.len() - 1;
        let feed_per_rad = self.feed_per_tooth_mm * teeth as f64 / TAU;
        let add = |unit: &mut UnitForces, n: usize, cutting: [Complex64; 3], edge: [Complex64; 3]| {
            let [depth, length] = part.factors[n];
            let (cutting, edge) = (cutting.map(|v| v * depth), edge.map(|v| v * length));
            put(unit, n, &cutting, &edge, part.kappa);
        };
        let times = |set: [Complex64; 3], factor: f64| set.map(|v| v * factor);
        let of_teeth = !all.by_radius.is_empty();
        for (j, place) in places.iter().enumerate() {
            let ahead = Turns::new(-place.ahead_rad, orders);
            for stretch in self.stretches(part.immersion, places, j) {
                let before = (j + stretch.passes) % teeth;
                let Immersion { start_rad, exit_rad } = stretch.immersion;
                let window = ImmersionWindow::new(stretch.immersion, orders);
                for n in 0..=orders {
                    let turn = ahead.at(n as i64);
                    let integral = window.integrals(n);
                    let cutting: [Complex64; 3] = std::array::from_fn(|d| {
                        turn * (integral.by_sine[d] * stretch.slope_mm
                            + integral.plain[d] * stretch.offset_mm)
                    });
                    let edge = integral.plain.map(|v| turn * v);
                    add(&mut all.unit, n, cutting, edge);
                    if !of_teeth && all.by_runout.is_empty() {
                        continue;
                    }
                    // Where the chip begins or ends from nothing the stretch grows with the chip: only the edge notices.
                    let mut grows = [[Complex64::ZERO; 3]; 2];
                    let free = [start_rad, exit_rad]
                        .into_iter()
                        .zip(&window.ends)
                        .zip(stretch.from_nothing);
                    for ((at, end), is_free) in free {
                        let rise = (stretch.slope_mm * at.cos()).abs();
                        if is_free && rise > NOTHING * self.feed_per_tooth_mm {
                            let value = turn * end.at(n as i64) / (TAU * rise);
                            for (d, factor) in [at.cos(), at.sin(), 1.0].into_iter().enumerate() {
                                grows[0][d] += value * factor;
                                grows[1][d] += value * (factor * at.sin());
                            }
                        }
                    }
                    // By the offset (radius of this tooth less that of the one before) and by the slope of the chip.
                    let by_offset = edge;
                    let by_slope = integral.by_sine.map(|v| turn * v * feed_per_rad);
                    let edge_by_slope = grows[1].map(|v| v * feed_per_rad);
                    if before != j {
                        for (i, unit) in all.by_runout.iter_mut().enumerate() {
                            let weight = by_runout.map_or(0.0, |by| by[j][i] - by[before][i]);
                            add(unit, n, times(by_offset, weight), times(grows[0], weight));
                        }
                    }
                    if !of_teeth {
                        continue;
                    }
                    for (tooth, sign) in [(j, 1.0), (before, -1.0)].into_iter().filter(|_| before != j) {
                        let (cutting, edge) = (times(by_offset, sign), times(grows[0], sign));
                        add(&mut all.by_radius[tooth], n, cutting, edge);
                        // Further ahead it stands elsewhere against the offset, and leaves more for the one that follows.
                        let turned = by_runout.map_or(0.0, |by| -by[tooth][1]);
                        add(
                            &mut all.by_angle[tooth],
                            n,
                            times(cutting, turned),
                            times(edge, turned),
                        );
                        add(
                            &mut all.by_angle[tooth],
                            n,
                            times(by_slope, -sign),
                            times(edge_by_slope, -sign),
                        );
                    }
                    let turning = Complex64::new(0.0, n as f64);
                    let moved = |set: [Complex64; 3]| set.map(|v| v * turning);
                    add(&mut all.by_angle[j], n, moved(cutting), moved(edge));
                }
            }
        }
    }

    /// What tooth `j` cuts over the immersion, stretch by stretch.
    fn stretches(&self, immersion: Immersion, places: &[ToothPlace], j: usize) -> Vec<Stretch> {
        let teeth = places.len();
        let pitch = TAU / teeth as f64;
        let here = places[j];
        let lines: Vec<(f64, f64)> = (1..=teeth)
            .map(|m| {
                let before = places[(j + m) % teeth];
                let turns = ((j + m) / teeth) as f64;
                let ahead = before.ahead_rad + TAU * turns - here.ahead_rad;
                let offset = here.radius_mm - before.radius_mm;
                (ahead / pitch * self.feed_per_tooth_mm, offset)
            })
            .collect();
        let Immersion { start_rad, exit_rad } = immersion;
        let mut ends = vec![start_rad, exit_rad];
        let mut at_sine = |sine: f64| {
            if (0.0..=1.0).contains(&sine) {
                let angle = sine.asin();
                ends.extend(
                    [angle, PI - angle]
                        .into_iter()
                        .filter(|a| (start_rad..exit_rad).contains(a)),
                );
            }
        };
        for (m, (slope, offset)) in lines.iter().enumerate() {
            at_sine(-offset / slope);
            for (other_slope, other_offset) in &lines[m + 1..] {
                at_sine((other_offset - offset) / (slope - other_slope));
            }
        }
        ends.sort_by(f64::total_cmp);
        let mut all: Vec<Stretch> = Vec::new();
        for pair in ends.windows(2) {
            let middle = (0.5 * (pair[0] + pair[1])).sin();
            let left = |m: usize| lines[m].0 * middle + lines[m].1;
            let least = (1..teeth).fold(0, |least, m| if left(m) < left(least) { m } else { least });
            if pair[1] <= pair[0] || left(least) <= 0.0 {
                continue;
            }
            match all.last_mut() {
                Some(last) if last.passes == least + 1 && last.immersion.exit_rad == pair[0] => {
                    last.immersion.exit_rad = pair[1];
                }
                _ => all.push(Stretch {
                    immersion: Immersion {
                        start_rad: pair[0],
                        exit_rad: pair[1],
                    },
                    passes: least + 1,
                    slope_mm: lines[least].0,
                    offset_mm: lines[least].1,
                    from_nothing: [false; 2],
                }),
            }
        }
        for stretch in &mut all {
            let Immersion {
                start_rad: from,
                exit_rad: to,
            } = stretch.immersion;
            let is_nothing = |at: f64| {
                (stretch.slope_mm * at.sin() + stretch.offset_mm).abs() < NOTHING * self.feed_per_tooth_mm
            };
            stretch.from_nothing = [
                from > start_rad && is_nothing(from),
                to < exit_rad && is_nothing(to),
            ];
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::waveform::{ChipLaw, EdgeShape};

    fn cut(immersion_deg: [f64; 2], pitches_deg: &[f64], radii_mm: &[f64]) -> MillingCut {
        let mut ahead = 0.0;
        let places = pitches_deg.iter().zip(radii_mm).map(|(pitch, radius_mm)| {
            let place = ToothPlace {
                ahead_rad: ahead,
                lag_rad: 0.3,
                radius_mm: *radius_mm,
            };
            ahead += pitch.to_radians();
            place
        });
        MillingCut {
            teeth: pitches_deg.len(),
            feed_per_tooth_mm: 0.1,
            axial_depth_mm: 2.0,
            immersion: Immersion {
                start_rad: immersion_deg[0].to_radians(),
                exit_rad: immersion_deg[1].to_radians(),
            },
            lag_rad: 0.3,
            shape: None,
            places: places.collect(),
        }
    }

    fn cases() -> Vec<MillingCut> {
        vec![
            cut([0.0, 180.0], &[90.0; 4], &[0.0, -0.02, 0.0, 0.0]),
            cut([0.0, 180.0], &[90.0; 4], &[0.0, -1.0, 0.0, 0.0]),
            cut([60.0, 180.0], &[120.0; 3], &[0.01, -0.03, 0.0]),
            cut([0.0, 110.0], &[84.0, 98.0, 84.0, 94.0], &[0.0; 4]),
            cut([20.0, 160.0], &[100.0, 110.0, 150.0], &[0.0, -0.02, 0.015]),
            cut([0.0, 180.0], &[90.0; 4], &[0.0, -0.02, 0.004, 0.011]),
            cut([10.0, 110.0], &[84.0, 98.0, 84.0, 94.0], &[0.0; 4]),
        ]
    }

    fn worst(a: &UnitForces, b: &UnitForces) -> f64 {
        let pairs = a.iter().flatten().flatten().zip(b.iter().flatten().flatten());
        pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }

    /// A count pass by pass on a fine grid of angles, which knows nothing of stretches.
    #[test]
    fn closed_form_equals_a_fine_sum_over_the_angle() {
        for cut in cases() {
            let (orders, steps) = (12, 40_000);
            let Immersion { start_rad, exit_rad } = cut.immersion;
            let mut sum = MillingCut::nothing(orders);
            let teeth = cut.teeth;
            for j in 0..teeth {
                for step in 0..steps {
                    let phi = start_rad + (step as f64 + 0.5) / steps as f64 * (exit_rad - start_rad);
                    let reach = |k: usize| {
                        let place = cut.places[k % teeth];
                        let ahead = place.ahead_rad + TAU * (k / teeth) as f64;
                        place.radius_mm - ahead / TAU * teeth as f64 * cut.feed_per_tooth_mm * phi.sin()
                    };
                    let deepest = (j + 1..=j + teeth).map(reach).fold(f64::NEG_INFINITY, f64::max);
                    let h = reach(j) - deepest;
                    if h <= 0.0 {
                        continue;
                    }
                    let share = (exit_rad - start_rad) / steps as f64 / TAU;
                    for n in 0..=orders {
                        let turn = cut.helix_at(n as i64)
                            * Complex64::from_polar(share, n as f64 * (cut.places[j].ahead_rad - phi));
                        let edge = [phi.cos(), phi.sin(), 1.0].map(|d| turn * d);
                        put(&mut sum, n, &edge.map(|v| v * h), &edge, (1.0, 0.0));
                    }
                }
            }
            let off = worst(&sum, &cut.own_teeth(orders, None, TeethSlopes::None).unit);
            assert!(off < 2e-4, "{:?}: {off}", cut.places);
        }
    }

    /// The quadrature of the same cut, and teeth that are alike.
    #[test]
    fn closed_form_equals_quadrature_and_alike_teeth() {
        for cut in cases() {
            let sampled = cut.sampled(24, ChipLaw::default(), false).unit;
            let off = worst(&sampled, &cut.own_teeth(24, None, TeethSlopes::None).unit);
            assert!(off < 3e-3, "{:?}: {off}", cut.places);
        }
        let mut alike = cut([0.0, 180.0], &[90.0; 4], &[0.0; 4]);
        let own = alike.own_teeth(24, None, TeethSlopes::None).unit;
        alike.places.clear();
        assert!(worst(&alike.closed_form(24), &own) < 1e-12);
        assert!(worst(&alike.own_teeth(24, None, TeethSlopes::None).unit, &own) < 1e-12);
    }

    /// Teeth of one radius come into a slot with chips of no thickness: there a longer tooth changes what a shorter one does not, and no
    /// derivative exists.
    fn has_derivatives(cut: &MillingCut) -> bool {
        let next = cut.places.iter().cycle().skip(1);
        let alike = cut
            .places
            .iter()
            .zip(next)
            .any(|(a, b)| a.radius_mm == b.radius_mm);
        !alike || (cut.immersion.start_rad > 0.0 && cut.immersion.exit_rad < PI)
    }

    fn by_difference(high: UnitForces, low: &UnitForces, step: f64) -> UnitForces {
        let mut difference = high;
        let values = difference.iter_mut().flatten().flatten();
        for (a, b) in values.zip(low.iter().flatten().flatten()) {
            *a = (*a - b) / (2.0 * step);
        }
        difference
    }

    fn relative(difference: &UnitForces, analytic: &UnitForces) -> f64 {
        let values = analytic.iter().flatten().flatten();
        worst(difference, analytic) / values.map(|v| v.norm()).fold(1.0, f64::max)
    }

    /// A bull nose whose axis stands off: by the offset, its direction and the angle of a tooth.
    #[test]
    fn runout_on_a_shaped_edge_has_the_derivatives_of_its_differences() {
        let tool = crate::cutting::made_tools::endmill(1.0, 90.0);
        let bull = MillingCut {
            shape: EdgeShape::of(&tool),
            ..cut(
                [20.0, 160.0],
                &[84.0, 98.0, 84.0, 94.0],
                &[0.0, -0.02, 0.004, 0.011],
            )
        };
        let own = bull.own_teeth(12, Some([0.01, 0.7]), TeethSlopes::All);
        for (i, step) in [(0, 1e-7), (1, 1e-6)] {
            let moved = |sign: f64| {
                let mut runout = [0.01, 0.7];
                runout[i] += sign * step;
                bull.own_teeth(12, Some(runout), TeethSlopes::None).unit
            };
            let off = relative(&by_difference(moved(1.0), &moved(-1.0), step), &own.by_runout[i]);
            assert!(off < 1e-3, "{i}: {off}");
        }
        for j in 0..4 {
            let moved = |step: f64| {
                let mut other = bull.clone();
                other.places[j].ahead_rad += step;
                other.own_teeth(12, Some([0.01, 0.7]), TeethSlopes::None).unit
            };
            let off = relative(&by_difference(moved(1e-6), &moved(-1e-6), 1e-6), &own.by_angle[j]);
            assert!(off < 1e-3, "tooth {j}: {off}");
        }
    }

    #[test]
    fn derivatives_equal_differences() {
        let smooth: Vec<MillingCut> = cases().into_iter().filter(has_derivatives).collect();
        assert_eq!(smooth.len(), 4);
        for cut in smooth {
            let own = cut.own_teeth(24, None, TeethSlopes::All);
            for j in 0..cut.teeth {
                // A missing tooth's radius changes nothing, a tooth on the verge of missing is not among the cases.
                for (analytic, change) in [
                    (
                        &own.by_radius[j],
                        (|p, d| p.radius_mm += d) as fn(&mut ToothPlace, f64),
                    ),
                    (&own.by_angle[j], |p, d| p.ahead_rad += d),
                ] {
                    let moved = |step: f64| {
                        let mut other = cut.clone();
                        change(&mut other.places[j], step);
                        other.own_teeth(24, None, TeethSlopes::None).unit
                    };
                    let off = relative(&by_difference(moved(1e-6), &moved(-1e-6), 1e-6), analytic);
                    assert!(off < 1e-4, "tooth {j} of {:?}: {off}", cut.places);
                }
            }
        }
    }
}
