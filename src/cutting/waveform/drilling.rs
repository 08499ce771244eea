//! Drilling: thrust and torque while the drill enters and bores, averaged over stretches of time (docs/physics.md, "Cutting forces").

use crate::cutting::DrillGeometry;
use crate::cutting::force_model::drill_geometry::feed_and_pilot_mm;
use crate::data::{CutGeometry, Tool};
use crate::{Error, Result};

/// What a drilled hole's forces depend on besides its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct DrillingCut {
    /// What of the drill cuts.
    pub geometry: DrillGeometry,
    /// Speed of the drill into the hole.
    pub feed_mm_per_s: f64,
    /// Drilled into the full: the chisel cuts too.
    pub full_hole: bool,
}

/// A part of thrust or torque with a coefficient of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrillTerm {
    /// Thrust for Kfe = 1 N/mm (times the chip thickness: for Kfc = 1 N/mm²), N.
    Thrust,
    /// Torque for Kte = 1 N/mm (times the chip thickness: for Ktc = 1 N/mm²), N·m.
    Torque,
    /// 1 from first contact on where the chisel cuts.
    Chisel,
    /// Torque of a friction force of 1 N on the circumference for each mm of depth at full diameter, N·m.
    Margin,
}

impl DrillingCut {
    /// # Errors
    /// As [`DrillGeometry::new`]; a feed that is not positive.
    pub fn new(tool: &Tool, geometry: &CutGeometry, spindle_rpm: f64) -> Result<DrillingCut> {
        let drill = DrillGeometry::new(tool, geometry)?;
        let [_, pilot_diameter_mm] = feed_and_pilot_mm(geometry)?;
        let feed_mm_per_s = drill.feed_per_rev_mm * spindle_rpm / 60.0;
        if !(feed_mm_per_s > 0.0 && feed_mm_per_s.is_finite()) {
            return Err(Error::computation("a drilled hole needs a feed above zero"));
        }
        Ok(DrillingCut {
            geometry: drill,
            feed_mm_per_s,
            full_hole: pilot_diameter_mm <= 0.0,
        })
    }

    /// From first contact to full diameter, s.
    pub fn entry_s(&self) -> f64 {
        self.geometry.entry_travel_mm() / self.feed_mm_per_s
    }

    /// Mean of `term` from `from_s` to `to_s` with the first contact at `contact_s`, and its derivative by `contact_s`.
    pub fn mean(&self, term: DrillTerm, from_s: f64, to_s: f64, contact_s: f64) -> (f64, f64) {
        let travel = |t: f64| self.feed_mm_per_s * (t - contact_s);
        let (from, to) = (travel(from_s), travel(to_s));
        let length = (to - from).max(1e-12);
        let mean = (self.integral(term, to) - self.integral(term, from)) / length;
        let slope = (self.at(term, to) - self.at(term, from)) / length;
        (mean, -self.feed_mm_per_s * slope)
    }

    /// `term` at travel `s` since first contact, mm.
    pub fn at(&self, term: DrillTerm, s: f64) -> f64 {
        let g = &self.geometry;
        if s <= 0.0 {
            return 0.0;
        }
        let engaged = (s * g.half_point_rad.tan()).min(g.radius_mm - g.inner_radius_mm);
        match term {
            DrillTerm::Thrust => g.lips * engaged,
            DrillTerm::Torque => {
                let reach = g.inner_radius_mm + engaged;
                g.lips * (reach * reach - g.inner_radius_mm.powi(2)) / (2.0 * g.half_point_rad.sin()) / 1000.0
            }
            DrillTerm::Chisel => f64::from(self.full_hole),
            DrillTerm::Margin => (s - g.entry_travel_mm()).max(0.0) * g.radius_mm / 1000.0,
        }
    }

    /// ∫ from first contact to travel `s`.
    fn integral(&self, term: DrillTerm, s: f64) -> f64 {
        let g = &self.geometry;
        if s <= 0.0 {
            return 0.0;
        }
        let full = g.entry_travel_mm();
        let entering = s.min(full);
        let beyond = s - entering;
        let tan = g.half_point_rad.tan();
        match term {
            DrillTerm::Thrust => g.lips * tan * entering * entering / 2.0 + beyond * self.at(term, full),
            DrillTerm::Torque => {
                // (r0 + s tan κ)² − r0² = 2 r0 s tan κ + s² tan² κ
                let swept = g.inner_radius_mm * tan * entering.powi(2) + tan * tan * entering.powi(3) / 3.0;
                g.lips * swept / (2.0 * g.half_point_rad.sin()) / 1000.0 + beyond * self.at(term, full)
            }
            DrillTerm::Chisel => s * self.at(term, s),
            DrillTerm::Margin => 0.5 * beyond * beyond * g.radius_mm / 1000.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hole(pilot_diameter_mm: f64) -> DrillingCut {
        let tool = crate::cutting::made_tools::drill();
        let geometry = CutGeometry::Drilling {
            feed_per_rev_mm: 0.2,
            pilot_diameter_mm,
            hole_depth_mm: None,
        };
        DrillingCut::new(&tool, &geometry, 1200.0).unwrap()
    }

    #[test]
    fn means_are_the_integrals_and_slopes_their_differences() {
        let hole = hole(0.0);
        let entry = hole.entry_s();
        for term in [
            DrillTerm::Thrust,
            DrillTerm::Torque,
            DrillTerm::Chisel,
            DrillTerm::Margin,
        ] {
            for (from, to) in [
                (0.1, 0.3),
                (0.45, 0.55),
                (0.4 + 0.8 * entry, 0.4 + 1.3 * entry),
                (2.0, 2.2),
            ] {
                let contact = 0.4;
                let steps = 20_000;
                let numeric: f64 = (0..steps)
                    .map(|i| {
                        let t = from + (to - from) * (i as f64 + 0.5) / steps as f64;
                        hole.at(term, hole.feed_mm_per_s * (t - contact))
                    })
                    .sum::<f64>()
                    / steps as f64;
                let (mean, slope) = hole.mean(term, from, to, contact);
                assert!(
                    (mean - numeric).abs() < 1e-4 * (1.0 + numeric.abs()),
                    "{term:?}: {mean} {numeric}"
                );
                let h = 1e-6;
                let difference = (hole.mean(term, from, to, contact + h).0
                    - hole.mean(term, from, to, contact - h).0)
                    / (2.0 * h);
                assert!(
                    (slope - difference).abs() < 1e-5 * (1.0 + difference.abs()),
                    "{term:?}: {slope} {difference}"
                );
            }
        }
    }

    #[test]
    fn the_full_diameter_is_the_average_force_row() {
        let hole = hole(3.5);
        let g = &hole.geometry;
        assert!((hole.at(DrillTerm::Thrust, 50.0) - 2.0 * (g.radius_mm - 1.75)).abs() < 1e-12);
        assert_eq!(hole.at(DrillTerm::Chisel, 50.0), 0.0);
    }
}
