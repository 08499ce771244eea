//! Unit labels: `(m/s²)/N`, `g`, `in-lbf`, `N·m`. Dimension and factor to SI, or nothing where it is not understood.

use crate::data::{Channel, ChannelRole, Quantity};
pub use crate::text::figures;

/// Standard acceleration of free fall, m/s² (exact by definition, CGPM 1901).
pub const STANDARD_GRAVITY: f64 = 9.80665;
const LBF: f64 = 4.448_221_615_260_5;
const INCH: f64 = 0.0254;

/// A unit: `value in SI = value × factor`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Value in SI for one of the unit, greater than zero.
    pub factor: f64,
    /// What it is a unit of.
    pub dimension: Dimension,
}

/// Exponents of metre, second, kilogram and volt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dimension(pub [i32; 4]);

impl Dimension {
    /// Pure numbers: ratios, angles.
    pub const NONE: Dimension = Dimension([0; 4]);
    /// Second.
    pub const TIME: Dimension = Dimension([0, 1, 0, 0]);
    /// Hertz.
    pub const FREQUENCY: Dimension = Dimension([0, -1, 0, 0]);
    /// Metre.
    pub const LENGTH: Dimension = Dimension([1, 0, 0, 0]);
    /// Metre per second.
    pub const VELOCITY: Dimension = Dimension([1, -1, 0, 0]);
    /// Metre per second squared.
    pub const ACCELERATION: Dimension = Dimension([1, -2, 0, 0]);
    /// Newton.
    pub const FORCE: Dimension = Dimension([1, -2, 1, 0]);
    /// Newton metre.
    pub const MOMENT: Dimension = Dimension([2, -2, 1, 0]);
    /// Pascal.
    pub const PRESSURE: Dimension = Dimension([-1, -2, 1, 0]);
    /// Volt; charges of piezoelectric sensors count as voltages.
    pub const VOLTAGE: Dimension = Dimension([0, 0, 0, 1]);
    /// Watt.
    pub const POWER: Dimension = Dimension([2, -3, 1, 0]);
    /// Ampere: watt per volt.
    pub const CURRENT: Dimension = Dimension([2, -3, 1, -1]);

    /// Of this for one of `other`.
    pub fn over(self, other: Dimension) -> Dimension {
        self.times(other, -1)
    }

    fn times(self, other: Dimension, power: i32) -> Dimension {
        let mut product = self.0;
        for (a, b) in product.iter_mut().zip(other.0) {
            *a = a.saturating_add(b.saturating_mul(power));
        }
        Dimension(product)
    }

    /// The motion a numerator measures, as the FRF quantity it gives per newton.
    pub fn motion(self) -> Option<Quantity> {
        match self {
            Dimension::LENGTH => Some(Quantity::Receptance),
            Dimension::VELOCITY => Some(Quantity::Mobility),
            Dimension::ACCELERATION => Some(Quantity::Accelerance),
            _ => None,
        }
    }

    /// The FRF quantity that has this dimension itself (motion per force).
    pub fn frf(self) -> Option<Quantity> {
        self.times(Dimension::FORCE, 1).motion()
    }

    /// Name of the quantity and its SI unit, for people.
    pub fn describe(self) -> Option<(&'static str, &'static str)> {
        Some(match self {
            Dimension::TIME => ("time", "s"),
            Dimension::FREQUENCY => ("frequency", "Hz"),
            Dimension::LENGTH => ("displacement", "m"),
            Dimension::VELOCITY => ("velocity", "m/s"),
            Dimension::ACCELERATION => ("acceleration", "m/s²"),
            Dimension::FORCE => ("force", "N"),
            Dimension::MOMENT => ("moment", "N·m"),
            Dimension::PRESSURE => ("pressure", "Pa"),
            Dimension::VOLTAGE => ("voltage", "V"),
            Dimension::CURRENT => ("current", "A"),
            Dimension::POWER => ("power", "W"),
            _ => return None,
        })
    }
}

/// True where a label says nothing about the unit.
pub fn is_blank(label: &str) -> bool {
    let label = label.trim();
    label.is_empty()
        || label == "-"
        || label.eq_ignore_ascii_case("none")
        || label.eq_ignore_ascii_case("unknown")
}

/// Reads a unit label; `None` where it is blank or not understood (which is never an error).
pub fn parse(label: &str) -> Option<Unit> {
    let label = label.trim();
    if is_blank(label) || label.len() > 60 {
        return None;
    }
    // "lbf in", "[N]" and "(Sec)" mean what they say.
    let bare = label
        .strip_prefix('[')
        .and_then(|l| l.strip_suffix(']'))
        .unwrap_or(label);
    let characters: Vec<char> = bare.trim().chars().collect();
    let mut reader = Reader {
        characters: &characters,
        at: 0,
        depth: 0,
    };
    let unit = reader.product()?;
    (reader.at == characters.len() && unit.factor.is_finite() && unit.factor > 0.0).then_some(unit)
}

/// What to say of an FRF whose unit is understood and is none of a motion per force: volts (a sensor's sensitivity was not entered),
/// or like per like (`/` is what Testlab writes there).
pub fn no_motion_per_force(label: &str) -> Option<String> {
    let (above, below) = above_and_below(label.trim())?;
    let volts = |part: &str| parse(part).is_some_and(|u| u.dimension == Dimension::VOLTAGE);
    if volts(above) || volts(below) {
        return Some(format!(
            "the unit {label} counts in volts: not calibrated, its size and its part of a shape are off by the sensor's \
             sensitivity; frequencies and damping are not"
        ));
    }
    let like = label.trim() == "/" || parse(label)?.dimension == Dimension::NONE;
    like.then(|| {
        format!(
            "the unit {label} is a ratio of like quantities, not a motion per force: where both are motions \
             (transmissibility), its resonances are those of the structure held at the reference, and it has no modal masses"
        )
    })
}

/// The parts of a quotient: above and below its last stroke that is in no brackets.
fn above_and_below(label: &str) -> Option<(&str, &str)> {
    let mut depth = 0;
    let mut stroke = None;
    for (at, c) in label.char_indices() {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            '/' if depth == 0 => stroke = Some(at),
            _ => {}
        }
    }
    stroke.map(|at| (&label[..at], &label[at + 1..]))
}

/// As [`parse`], and for labels that are names with a unit at their end: `acc_m_s2`, `acc_m/s2`, `force_n`; and for such an end
/// alone: `mm_s2`.
pub fn parse_named(label: &str) -> Option<Unit> {
    let end_alone = || label.contains('_').then(|| parse_suffix(label)).flatten();
    parse(label).or_else(end_alone).or_else(|| {
        label
            .match_indices('_')
            .find_map(|(at, _)| parse_suffix(&label[at + 1..]))
    })
}

/// product = power { ('*' | '·' | '.' | '-' | ' ' | '/') power }, power = atom [exponent], atom = name | 1 | '(' product ')'
struct Reader<'a> {
    characters: &'a [char],
    at: usize,
    depth: usize,
}

impl Reader<'_> {
    fn peek(&self) -> Option<char> {
        self.characters.get(self.at).copied()
    }

    fn product(&mut self) -> Option<Unit> {
        let mut unit = self.power()?;
        while let Some(c) = self.peek() {
            let mut sign = 1;
            match c {
                ')' => break,
                '*' | '·' | '•' | '⋅' | '×' | '.' | '-' | ' ' | '/' => {
                    while let Some(c) = self.peek().filter(|c| " */·•⋅×.-".contains(*c)) {
                        if c == '/' {
                            sign = -sign;
                        }
                        self.at += 1;
                    }
                }
                '(' => {}
                _ => return None,
            }
            let next = self.power()?;
            unit.factor *= next.factor.powi(sign);
            unit.dimension = unit.dimension.times(next.dimension, sign);
        }
        Some(unit)
    }

    fn power(&mut self) -> Option<Unit> {
        let unit = self.atom()?;
        let exponent = self.exponent()?;
        Some(Unit {
            factor: unit.factor.powi(exponent),
            dimension: Dimension::NONE.times(unit.dimension, exponent),
        })
    }

    fn atom(&mut self) -> Option<Unit> {
        if self.peek() == Some('(') {
            self.depth += 1;
            if self.depth > 8 {
                return None;
            }
            self.at += 1;
            let unit = self.product()?;
            (self.peek() == Some(')')).then(|| self.at += 1)?;
            self.depth -= 1;
            return Some(unit);
        }
        if self.peek() == Some('1') {
            self.at += 1;
            return Some(Unit {
                factor: 1.0,
                dimension: Dimension::NONE,
            });
        }
        let start = self.at;
        while self
            .peek()
            .is_some_and(|c| c.is_alphabetic() || c == '%' || c == '°')
        {
            self.at += 1;
        }
        let name: String = self.characters[start..self.at].iter().collect();
        named(&name).map(|(factor, dimension)| Unit { factor, dimension })
    }

    /// `²`, `³`, `^2`, `^-1`, `**2`, `2`, `-2`; 1 where there is none.
    fn exponent(&mut self) -> Option<i32> {
        let superscript = match self.peek() {
            // A Latin-1 ² (0xB2) once read as Mac Roman becomes ≤.
            Some('²' | '≤') => 2,
            Some('³') => 3,
            _ => 0,
        };
        if superscript != 0 {
            self.at += 1;
            return Some(superscript);
        }
        let start = self.at;
        while self.peek().is_some_and(|c| c == '^' || c == '*') {
            self.at += 1;
        }
        let marked = self.at > start && self.characters[start..self.at] != ['*'];
        if !marked {
            self.at = start;
        }
        let sign = if self.peek() == Some('-') { -1 } else { 1 };
        let digit_at = self.at + usize::from(sign < 0);
        match self.characters.get(digit_at).and_then(|c| c.to_digit(10)) {
            Some(digit) => {
                self.at = digit_at + 1;
                Some(sign * digit as i32)
            }
            None => (!marked).then_some(1),
        }
    }
}

/// A unit name: as written first, then whatever its case where that leaves no doubt.
fn named(name: &str) -> Option<(f64, Dimension)> {
    use Dimension as D;
    let exact = match name {
        "m" => (1.0, D::LENGTH),
        "mm" => (1e-3, D::LENGTH),
        "cm" => (1e-2, D::LENGTH),
        "um" | "µm" | "μm" => (1e-6, D::LENGTH),
        "in" => (INCH, D::LENGTH),
        "ft" => (12.0 * INCH, D::LENGTH),
        "s" => (1.0, D::TIME),
        "ms" => (1e-3, D::TIME),
        "us" | "µs" | "μs" => (1e-6, D::TIME),
        "kg" => (1.0, Dimension([0, 0, 1, 0])),
        "g" | "gn" | "G" => (STANDARD_GRAVITY, D::ACCELERATION),
        "A" => (1.0, D::CURRENT),
        "W" => (1.0, D::POWER),
        "kW" => (1e3, D::POWER),
        "mA" => (1e-3, D::CURRENT),
        "N" => (1.0, D::FORCE),
        "mN" => (1e-3, D::FORCE),
        "MN" => (1e6, D::FORCE),
        "Nm" => (1.0, D::MOMENT),
        "kNm" => (1e3, D::MOMENT),
        "mNm" => (1e-3, D::MOMENT),
        "MNm" => (1e6, D::MOMENT),
        "Pa" => (1.0, D::PRESSURE),
        "MPa" => (1e6, D::PRESSURE),
        "rad" => (1.0, D::NONE),
        "deg" | "°" => (std::f64::consts::PI / 180.0, D::NONE),
        "%" => (0.01, D::NONE),
        _ => return named_in_any_case(name),
    };
    Some(exact)
}

fn named_in_any_case(name: &str) -> Option<(f64, Dimension)> {
    use Dimension as D;
    Some(match name.to_lowercase().as_str() {
        "sec" | "second" | "seconds" => (1.0, D::TIME),
        "msec" | "millisecond" | "milliseconds" => (1e-3, D::TIME),
        "usec" | "µsec" | "μsec" | "microsecond" | "microseconds" => (1e-6, D::TIME),
        "micron" => (1e-6, D::LENGTH),
        "inch" => (INCH, D::LENGTH),
        "n" | "newton" | "newtons" => (1.0, D::FORCE),
        "kn" => (1e3, D::FORCE),
        "dan" => (10.0, D::FORCE),
        "lb" | "lbs" | "lbf" | "pound" | "pounds" => (LBF, D::FORCE),
        "kgf" | "kp" => (STANDARD_GRAVITY, D::FORCE),
        "ncm" => (1e-2, D::MOMENT),
        "nmm" => (1e-3, D::MOMENT),
        "inlb" | "inlbf" | "lbfin" | "lbin" => (LBF * INCH, D::MOMENT),
        "ftlb" | "ftlbf" | "lbfft" | "lbft" => (LBF * 12.0 * INCH, D::MOMENT),
        "v" | "volt" | "volts" => (1.0, D::VOLTAGE),
        "mv" => (1e-3, D::VOLTAGE),
        "hz" => (1.0, D::FREQUENCY),
        "khz" => (1e3, D::FREQUENCY),
        _ => return None,
    })
}

/// Units as column names carry them: the `n` of `fx_n`, the `nm` of `mz_nm`, the `m_per_s2` of `ax_m_per_s2`.
pub fn parse_suffix(suffix: &str) -> Option<Unit> {
    let suffix = suffix.to_lowercase();
    match suffix.as_str() {
        // Only torque columns end in nm; nobody exports nanometres from a dynamometer.
        "nm" => parse("Nm"),
        "ms2" => parse("m/s2"),
        // `acc_m_s2` and `acc_m/s2`, as Python programs name their columns.
        "m_s2" | "m_s^2" | "m_s-2" | "m_s_2" => parse("m/s2"),
        "mm_s2" | "mm_s^2" => parse("mm/s2"),
        "m_s" => parse("m/s"),
        "mm_s" => parse("mm/s"),
        other if other.contains('/') => parse(other),
        "mm" | "um" | "m" | "s" | "ms" | "us" | "µs" | "μs" | "g" | "n" | "kn" | "lbf" | "v" | "mv"
        | "ncm" | "nmm" | "kgf" => parse(&suffix),
        other if other.contains("_per_") => parse(&other.replace("_per_", "/")),
        _ => None,
    }
}

/// Factor from a frequency label to Hz; `None` where the label is not understood.
pub fn frequency_factor(label: &str) -> Option<f64> {
    match label.trim().to_lowercase().replace(' ', "").as_str() {
        "hz" | "1/s" | "cps" => Some(1.0),
        "khz" => Some(1e3),
        "rad/s" | "rad/sec" => Some(0.5 / std::f64::consts::PI),
        "cpm" | "1/min" => Some(1.0 / 60.0),
        _ => None,
    }
}

/// Unit of an FRF quantity, for people.
pub fn frf_unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Receptance => "m/N",
        Quantity::Mobility => "(m/s)/N",
        Quantity::Accelerance => "(m/s²)/N",
    }
}

impl Channel {
    /// What the samples are and their SI unit; the file's own label where it is not understood.
    pub fn quantity_and_unit(&self) -> (&'static str, &str) {
        let by_role = match self.role {
            ChannelRole::ForceX | ChannelRole::ForceY | ChannelRole::ForceZ => Some(("force", "N")),
            ChannelRole::TorqueZ => Some(("moment", "N·m")),
            ChannelRole::Other => None,
        };
        let by_unit = parse_named(&self.file_unit).and_then(|u| u.dimension.describe());
        by_unit.or(by_role).unwrap_or(("unknown", &self.file_unit))
    }
}

/// Reads a unit in which a charge counts as a voltage: `pC` → 10⁻¹² V.
pub fn unit_of_charge_or_other(label: &str) -> Option<Unit> {
    let charges = [("pC", 1e-12), ("nC", 1e-9), ("µC", 1e-6)];
    let Some((name, factor)) = charges.into_iter().find(|(name, _)| label.contains(name)) else {
        return parse(label);
    };
    let unit = parse(&label.replace(name, "V"))?;
    let is_below = label
        .split_once('/')
        .is_some_and(|(_, below)| below.contains(name));
    let factor = if is_below { 1.0 / factor } else { factor };
    Some(Unit {
        factor: unit.factor * factor,
        ..unit
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    #[test]
    fn units_of_frfs_that_are_no_motion_per_force() {
        let said = |label: &str| no_motion_per_force(label).unwrap_or_default();
        // Volts per volt: two sensors without their sensitivities, as likely a hammer and a sensor as two motions.
        for volts in ["V/N", "mV/N", "V/lbf", "V/V", "(m/s²)/V", "m/s/V"] {
            assert!(said(volts).contains("counts in volts"), "{volts}");
        }
        for ratio in ["/", "g/g", "(m/s²)/(m/s²)"] {
            assert!(
                said(ratio).contains("held at the reference"),
                "{ratio}: {}",
                said(ratio)
            );
        }
        for fine in ["(m/s²)/N", "m/N", "g/lbf", "", "-", "1", "dB", "a.u./N"] {
            assert_eq!(no_motion_per_force(fine), None, "{fine}");
        }
    }

    #[test]
    fn labels_seen_in_the_field() {
        for (label, factor, dimension) in [
            ("N", 1.0, Dimension::FORCE),
            ("kN", 1e3, Dimension::FORCE),
            ("lbf", 4.448_221_615_260_5, Dimension::FORCE),
            ("Pounds", 4.448_221_615_260_5, Dimension::FORCE),
            ("in-lbf", 0.112_984_829_027_616_7, Dimension::MOMENT),
            ("in·lbf", 0.112_984_829_027_616_7, Dimension::MOMENT),
            ("ft lb", 1.355_817_948_331_400_4, Dimension::MOMENT),
            ("N·m", 1.0, Dimension::MOMENT),
            ("N*m", 1.0, Dimension::MOMENT),
            ("Nm", 1.0, Dimension::MOMENT),
            ("Ncm", 0.01, Dimension::MOMENT),
            ("g", 9.80665, Dimension::ACCELERATION),
            ("m/s^2", 1.0, Dimension::ACCELERATION),
            ("m/s²", 1.0, Dimension::ACCELERATION),
            ("m/s≤", 1.0, Dimension::ACCELERATION),
            ("m/s**2", 1.0, Dimension::ACCELERATION),
            ("m.s-2", 1.0, Dimension::ACCELERATION),
            ("m/sec2", 1.0, Dimension::ACCELERATION),
            ("mm/s/s", 1e-3, Dimension::ACCELERATION),
            ("(Sec)", 1.0, Dimension::TIME),
            ("[mV]", 1e-3, Dimension::VOLTAGE),
            ("µm", 1e-6, Dimension::LENGTH),
        ] {
            let unit = parse(label).unwrap_or_else(|| panic!("{label}"));
            assert_eq!(unit.dimension, dimension, "{label}");
            assert_relative_eq!(unit.factor, factor, max_relative = 1e-12);
        }
        for label in ["", "NONE", "furlong", "m/", "(m", "m)", "^2", "acc (g", "m^"] {
            assert_eq!(parse(label), None, "{label}");
        }
    }

    #[test]
    fn frf_labels_give_the_quantity() {
        let quantity = |label| parse(label).and_then(|u| u.dimension.frf());
        assert_eq!(quantity("(m/s)/N"), Some(Quantity::Mobility));
        assert_eq!(quantity("(1/N)*(m/s²)"), Some(Quantity::Accelerance));
        assert_eq!(quantity("m/s^2/N"), Some(Quantity::Accelerance));
        assert_eq!(quantity("mm/N"), Some(Quantity::Receptance));
        assert_eq!(quantity("1/kg"), Some(Quantity::Accelerance));
        assert_eq!(quantity("m"), None);
        assert_relative_eq!(parse("g/lbf").unwrap().factor, 9.80665 / 4.448_221_615_260_5);
    }

    #[test]
    fn suffixes_of_column_names() {
        assert_eq!(parse_suffix("n").unwrap().dimension, Dimension::FORCE);
        assert_eq!(parse_suffix("nm").unwrap().dimension, Dimension::MOMENT);
        assert_eq!(
            parse_suffix("m_per_s2").unwrap().dimension,
            Dimension::ACCELERATION
        );
        for suffix in ["m_s2", "m/s2", "M/S2", "m_s^2"] {
            assert_eq!(
                parse_suffix(suffix).unwrap().dimension,
                Dimension::ACCELERATION,
                "{suffix}"
            );
            assert_eq!(
                parse_named(&format!("acc_{suffix}")).unwrap().dimension,
                Dimension::ACCELERATION
            );
        }
        assert_relative_eq!(parse_named("acc_mm_s2").unwrap().factor, 1e-3);
        // Loggers of microcontrollers count microseconds.
        for label in ["time_us", "time_µs", "usec", "microseconds"] {
            let unit = parse_named(label).unwrap();
            assert_eq!((unit.dimension, unit.factor), (Dimension::TIME, 1e-6), "{label}");
        }
        assert_eq!(parse_suffix("x"), None);
        assert_eq!(parse_suffix("left"), None);
    }

    proptest! {
        #[test]
        fn never_panics(label in "\\PC{0,24}", unitish in "[mNsg1()/*^ ².-]{0,24}") {
            for text in [label, unitish] {
                if let Some(unit) = parse(&text) {
                    prop_assert!(unit.factor.is_finite());
                }
                let _ = parse_suffix(&text);
            }
        }
    }
}
