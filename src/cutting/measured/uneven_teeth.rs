//! What an average force owes to teeth that cut unequally: near the ends of the immersion the lower ones do not cut, and what they leave
//! the next one takes with one edge less.

use std::f64::consts::TAU;

use crate::cutting::waveform::{MillingCut, TeethSlopes};

/// Teeth that differ in radius, as an offset of the tool's axis makes them, and what that does to the averages.
#[derive(Debug, Clone, PartialEq)]
pub struct UnevenTeeth {
    /// Root mean square by which the chips of the teeth differ from the common one, mm.
    pub chip_mm: f64,
    /// Offset of the tool's axis that makes them differ so, mm.
    pub offset_mm: f64,
    /// By what the averages in tool axes x, y, z change, for one unit of each coefficient (mm² for cutting, mm for edge coefficients): of
    /// such teeth less those of teeth that are alike.
    pub change: [[f64; 6]; 3],
}

impl UnevenTeeth {
    /// Of a `cut` whose teeth are taken for alike.
    pub(crate) fn new(cut: &MillingCut, chip_mm: f64) -> UnevenTeeth {
        let n = cut.teeth as f64;
        let radius = |j: usize| (TAU * j as f64 / n).cos();
        let squares: f64 = (0..cut.teeth).map(|j| (radius(j + 1) - radius(j)).powi(2)).sum();
        let offset_mm = chip_mm / (squares / n).sqrt();
        let of = |runout: Option<[f64; 2]>| cut.own_teeth(0, runout, TeethSlopes::None).unit;
        let (alike, uneven) = (of(None), of(Some([offset_mm, 0.0])));
        let change = |axis: usize, k: usize| uneven[k][axis][0].re - alike[k][axis][0].re;
        UnevenTeeth {
            chip_mm,
            offset_mm,
            change: std::array::from_fn(|axis| std::array::from_fn(|k| change(axis, k))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::made_tools::milling_cut;
    use approx::assert_relative_eq;

    fn cut(teeth: usize, start_deg: f64, exit_deg: f64) -> MillingCut {
        MillingCut {
            lag_rad: 0.0,
            ..milling_cut(teeth, start_deg, exit_deg)
        }
    }

    /// Two teeth ±e: the lower one does not cut while 0.1 mm sin φ < 2 e, at either end of a slot, and the mean axial force of an edge
    /// (1 N/mm over 2 mm) is by that share of one tooth of two, times the share of the turn in which a tooth cuts, less.
    #[test]
    fn the_edge_of_the_lower_tooth_is_missing_at_the_ends() {
        let own = UnevenTeeth::new(&cut(2, 0.0, 180.0), 0.02);
        assert_relative_eq!(own.offset_mm, 0.01, max_relative = 1e-12);
        let idle_rad = 2.0 * (0.02f64 / 0.1).asin();
        assert_relative_eq!(own.change[2][5], -2.0 * idle_rad / TAU, max_relative = 2e-3);
        // Away from the ends every tooth cuts all the time, and on average nothing changes.
        let inside = UnevenTeeth::new(&cut(2, 40.0, 140.0), 0.02);
        assert!(
            inside.change.iter().flatten().all(|c| c.abs() < 1e-9),
            "{inside:?}"
        );
        // Four teeth: neighbours differ by e √2 at most.
        let four = UnevenTeeth::new(&cut(4, 0.0, 90.0), 0.01);
        assert_relative_eq!(four.offset_mm, 0.01, max_relative = 1e-12);
        assert!(four.change[2][5] < 0.0);
    }
}
