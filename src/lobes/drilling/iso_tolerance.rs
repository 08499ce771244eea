//! Tolerances of a hole's diameter: the standard tolerances of ISO 286-1 (2010), table 1.

/// A hole basis tolerance: the diameter may be larger than nominal by up to `width_mm`, and not smaller (position H).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiameterTolerance {
    /// 8 for H8.
    pub grade: u32,
    /// Standard tolerance IT of that grade at the hole's nominal diameter, mm.
    pub width_mm: f64,
}

/// Upper ends of the ranges of nominal size, mm; the first begins at 0.
const UP_TO_MM: [f64; 13] = [
    3.0, 6.0, 10.0, 18.0, 30.0, 50.0, 80.0, 120.0, 180.0, 250.0, 315.0, 400.0, 500.0,
];
/// Lowest grade of [`WIDTH_UM`].
const FIRST_GRADE: u32 = 6;
/// IT6 … IT13 in µm, a column a range.
const WIDTH_UM: [[u32; 13]; 8] = [
    [6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40],
    [10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63],
    [14, 18, 22, 27, 33, 39, 46, 54, 63, 72, 81, 89, 97],
    [25, 30, 36, 43, 52, 62, 74, 87, 100, 115, 130, 140, 155],
    [40, 48, 58, 70, 84, 100, 120, 140, 160, 185, 210, 230, 250],
    [60, 75, 90, 110, 130, 160, 190, 220, 250, 290, 320, 360, 400],
    [100, 120, 150, 180, 210, 250, 300, 350, 400, 460, 520, 570, 630],
    [140, 180, 220, 270, 330, 390, 460, 540, 630, 720, 810, 890, 970],
];

impl DiameterTolerance {
    /// H`grade` at a nominal diameter; `None` for a diameter beyond 500 mm or a grade other than 6 to 13.
    pub fn h(grade: u32, diameter_mm: f64) -> Option<Self> {
        let range = UP_TO_MM.iter().position(|end| diameter_mm <= *end)?;
        let row = grade.checked_sub(FIRST_GRADE)? as usize;
        let width_um = WIDTH_UM.get(row).filter(|_| diameter_mm > 0.0)?[range];
        Some(DiameterTolerance {
            grade,
            width_mm: 1e-3 * f64::from(width_um),
        })
    }

    /// `H8`.
    pub fn name(&self) -> String {
        format!("H{}", self.grade)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_every_table_book_has_them() {
        let um =
            |grade, diameter_mm| (1e3 * DiameterTolerance::h(grade, diameter_mm).unwrap().width_mm).round();
        // 6.35 mm of the industrial case; a range ends with its upper bound.
        assert_eq!((um(8, 6.35), um(11, 6.35)), (22.0, 90.0));
        assert_eq!((um(7, 20.0), um(9, 50.0), um(9, 50.001)), (21.0, 62.0, 74.0));
        assert_eq!(DiameterTolerance::h(8, 501.0), None);
        assert_eq!(DiameterTolerance::h(5, 10.0), None);
        assert_eq!(DiameterTolerance::h(14, 10.0), None);
        assert_eq!(DiameterTolerance::h(8, 0.0), None);
        assert_eq!(DiameterTolerance::h(8, 6.0).unwrap().name(), "H8");
    }

    /// The table against the formula that it was made by: i = 0.45 ∛D + 0.001 D µm, D the geometric mean of the range, and
    /// 10, 16, 25, 40, 64, 100, 160, 250 i for IT6 to IT13 (ISO 286-1:1988, annex A). Rounding leaves less than 10 %, in the
    /// first range, whose values the standard rounds up, 16 %.
    #[test]
    fn the_table_follows_the_tolerance_unit() {
        let units = [10.0, 16.0, 25.0, 40.0, 64.0, 100.0, 160.0, 250.0];
        for (row, factor) in WIDTH_UM.iter().zip(units) {
            let mut from: f64 = 1.0;
            for (width, to) in row.iter().zip(UP_TO_MM) {
                let mean = (from * to).sqrt();
                let formula = factor * (0.45 * mean.cbrt() + 0.001 * mean);
                let off = f64::from(*width) / formula - 1.0;
                assert!(
                    off.abs() < if to == 3.0 { 0.16 } else { 0.10 },
                    "{factor} i to {to} mm: {width} {formula}"
                );
                from = to;
            }
        }
    }
}
