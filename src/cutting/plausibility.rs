//! Units and scales that the physics of cutting forbids: the specific cutting energy is that of some material.

use super::cutting_trials::CuttingTrials;
use crate::cutting::force_model::average_force::average_row;
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::{ChannelAnalysis, CutAnalysis};
use crate::cutting::measured::leak::HIGH_PASS;
use crate::data::{CutGeometry, Process};
use crate::signal::median;
use crate::text::figures;

/// Force per chip cross-section of one cut, edge forces included, N/mm².
struct Specific {
    /// Milling: of the force in the plane of cutting, whatever its direction; drilling: from the torque; turning: of the
    /// whole force.
    cutting: Option<f64>,
    /// Milling: of the axial force; drilling: of the thrust.
    axial: Option<f64>,
}

fn specific(trials: &CuttingTrials, cut: &CutAnalysis) -> Option<Specific> {
    let row = |axis| average_row(trials.tool, &trials.cuts[cut.cut].geometry, axis).ok();
    let force = |axis: ForceAxis| cut.averages[axis.index()].map(|a| a.value);
    let ratio = |axis: ForceAxis, column: usize| {
        let per = row(axis)?[column];
        Some(force(axis)? / per).filter(|k| k.is_finite())
    };
    Some(match cut.process {
        Process::Milling => {
            let (x, y) = (row(ForceAxis::X)?, row(ForceAxis::Y)?);
            // Fx = a Kt + b Kr, Fy = −b Kt + a Kr: turned and stretched.
            let stretch = (x[0].powi(2) + x[1].powi(2))
                .max(y[0].powi(2) + y[1].powi(2))
                .sqrt();
            let plane = force(ForceAxis::X)
                .zip(force(ForceAxis::Y))
                .map(|(x, y)| x.hypot(y) / stretch);
            // On an edge that is not straight the radial force has an axial part.
            let upward = row(ForceAxis::Z).map(|z| z[1].hypot(z[2]));
            let axial = force(ForceAxis::Z).zip(upward).map(|(z, upward)| z / upward);
            Specific {
                cutting: plane.filter(|k| k.is_finite()),
                axial: axial.filter(|k| k.is_finite()),
            }
        }
        Process::Drilling => Specific {
            cutting: ratio(ForceAxis::Mz, 0),
            axial: ratio(ForceAxis::Z, 2),
        },
        // Whichever channel it is on: the axes are looked at by themselves.
        Process::Turning => {
            let squares: f64 = [ForceAxis::X, ForceAxis::Y, ForceAxis::Z]
                .into_iter()
                .filter_map(force)
                .map(|f| f * f)
                .sum();
            let area = row(ForceAxis::Z)?[0];
            Specific {
                cutting: Some(squares.sqrt() / area).filter(|k| k.is_finite() && *k > 0.0),
                axial: None,
            }
        }
    })
}

/// N/mm² that no solid worth machining stays below, and that none exceeds at chips of 0.01 mm and more.
const ANY_MATERIAL: [f64; 2] = [10.0, 30_000.0];

/// Where most materials lie, N/mm².
pub(crate) const USUAL: [f64; 2] = [100.0, 10_000.0];

/// Words in a material's name, and its specific cutting energy in N/mm²: Kienzle's unit forces (steel 1500–2500, cast iron
/// 800–1500, aluminium 400–900, titanium 1300–1700, nickel alloys 2400–3500, plastics 50–200) for chips of 0.01 to 0.3 mm.
/// The bounds are wide: only another unit leaves them.
const MATERIALS: [(&[&str], [f64; 2]); 7] = [
    (
        &["titan", "ti6al4v", "ti-6al", "ti 6al", "ti64", "ti-64", "3.7"],
        [1200.0, 12_000.0],
    ),
    (&["inconel", "nickel", "718", "waspaloy"], [1500.0, 20_000.0]),
    (
        &[
            "steel", "stahl", "acier", "acero", "aisi", "c45", "ck45", "s235", "s275", "s355", "st37",
            "st 37", "st52", "st 52", "mncr", "crni", "crmo", "4140", "4340", "1.0", "1.1", "1.2", "1.3",
            "1.4", "1.5", "1.6", "1.7", "1.8",
        ],
        [1300.0, 14_000.0],
    ),
    (
        &["cast iron", "grauguss", "ggg", "en-gjl", "en-gjs"],
        [700.0, 8000.0],
    ),
    (&["alumin", "6061", "7075", "6082", "2024"], [350.0, 6000.0]),
    (&["brass", "copper", "bronze", "messing"], [300.0, 8000.0]),
    (&["acetal", "pom", "delrin", "nylon", "plastic"], [12.0, 1500.0]),
];

/// Is a material (in small letters) called so? A word is found anywhere, `1.4` where a European material number (EN 10027-2) begins so:
/// `1.4301`.
fn is_called(material: &str, word: &str) -> bool {
    const DIGITS_OF_A_NUMBER: usize = 5;
    if !word.starts_with(|c: char| c.is_ascii_digit()) || !word.contains('.') {
        return material.contains(word);
    }
    let digits = |text: &str| text.bytes().filter(u8::is_ascii_digit).count();
    let mut numbers = material.split(|c: char| !c.is_ascii_digit() && c != '.');
    numbers.any(|n| n.starts_with(word) && digits(n) == DIGITS_OF_A_NUMBER)
}

/// Chip thickness for which the lower bounds hold, mm: thinner chips take more.
const THICK_CHIP_MM: f64 = 0.3;
const THIN_CHIP_MM: f64 = 0.01;

/// By what factor chips of this mean thickness take at least more energy than the thickest: Kienzle's exponent is 0.2 and
/// more for most materials.
fn thin_chip(chip_mm: f64) -> f64 {
    if chip_mm > 0.0 {
        (THICK_CHIP_MM / chip_mm.clamp(THIN_CHIP_MM, THICK_CHIP_MM)).powf(0.2)
    } else {
        1.0
    }
}

/// Mean chip thickness over the engagement, mm.
fn chip_mm(trials: &CuttingTrials, cut: &CutAnalysis) -> Option<f64> {
    match trials.cuts[cut.cut].geometry {
        CutGeometry::Milling {
            feed_per_tooth_mm,
            immersion,
            ..
        } => {
            let arc = immersion.exit_rad - immersion.start_rad;
            (arc > 0.0)
                .then(|| feed_per_tooth_mm * (immersion.start_rad.cos() - immersion.exit_rad.cos()) / arc)
        }
        // Two lips, each at half the point angle.
        CutGeometry::Drilling { .. } => {
            let lips = trials.tool.teeth.max(1) as f64;
            Some(cut.feed_mm / lips * 59f64.to_radians().sin())
        }
        CutGeometry::Turning { .. } => {
            let row = average_row(trials.tool, &trials.cuts[cut.cut].geometry, ForceAxis::Z).ok()?;
            Some(row[0] / row[3]).filter(|h| h.is_finite())
        }
    }
}

/// Factors of units that get mixed up: wanted over found.
const UNITS: [(f64, &str); 4] = [
    (1000.0, "kN called N"),
    (9.80665, "kgf called N"),
    (4.448_221_6, "lbf called N"),
    (1e-3, "N called kN"),
];
const TORQUE_UNITS: [(f64, &str); 5] = [
    (0.112_984_8, "in·lbf called N·m"),
    (0.01, "N·cm called N·m"),
    (1e-3, "N·mm called N·m"),
    (1000.0, "kN·m called N·m"),
    (1.355_818, "ft·lbf called N·m"),
];

/// Warnings about scales that cannot be; `cuts` are of one material. Those whose mean force a high-pass took away say nothing of
/// units.
pub(super) fn of_scales(trials: &CuttingTrials, cuts: &[&CutAnalysis], process: Process) -> Vec<String> {
    let is_whole = |cut: &CutAnalysis| cut.notices.iter().all(|n| n.kind != HIGH_PASS);
    let cuts: Vec<&CutAnalysis> = cuts.iter().copied().filter(|c| is_whole(c)).collect();
    let cuts = cuts.as_slice();
    if cuts.is_empty() {
        return Vec::new();
    }
    let specific: Vec<Specific> = cuts.iter().filter_map(|c| specific(trials, c)).collect();
    let middle = |pick: fn(&Specific) -> Option<f64>| {
        let values: Vec<f64> = specific.iter().filter_map(pick).map(f64::abs).collect();
        (!values.is_empty()).then(|| median(&values))
    };
    let (cutting, axial) = (middle(|s| s.cutting), middle(|s| s.axial));
    let chip = median(&cuts.iter().filter_map(|c| chip_mm(trials, c)).collect::<Vec<_>>());
    let name = cuts.first().and_then(|c| trials.cuts[c.cut].material.as_deref());
    let material = name.unwrap_or_default().to_lowercase();
    let known = MATERIALS
        .iter()
        .find(|(words, _)| words.iter().any(|word| is_called(&material, word)));
    let (bounds, usual, of) = match known {
        Some((_, [low, high])) => {
            let bounds = [(low * thin_chip(chip)).round(), *high];
            (bounds, bounds, name.unwrap_or_default().to_owned())
        }
        None => (ANY_MATERIAL, USUAL, "any material worth machining".to_owned()),
    };
    let (names, units): (&str, &[(f64, &str)]) = match process {
        Process::Milling => ("Fx and Fy", &UNITS),
        Process::Drilling => ("Mz", &TORQUE_UNITS),
        Process::Turning => ("Fx, Fy and Fz", &UNITS),
    };
    let mut warnings = Vec::new();
    if let Some(energy) = cutting.filter(|e| *e < bounds[0] || *e > bounds[1]) {
        let side = if energy < bounds[0] { "small" } else { "large" };
        warnings.push(format!(
            "{names} look too {side}: the specific cutting energy comes out as {} N/mm², that of {of} lies between {} and \
             {} N/mm²{}; check the units in the files, the amplifier's range, and {}",
            figures(energy, 3),
            bounds[0],
            bounds[1],
            suspects(units, |factor| (usual[0]..=usual[1]).contains(&(energy * factor))),
            match process {
                Process::Milling | Process::Drilling => "teeth, depth and feed",
                Process::Turning => "depth and feed",
            }
        ));
    } else if let (Some(cutting), Some(axial)) = (cutting, axial) {
        // A ball or a helix of 60° may press axially as hard as it cuts; a drill's thrust is about half its cutting force.
        let limits = match process {
            Process::Milling | Process::Turning => [0.0, 4.0],
            Process::Drilling => [0.12, 6.0],
        };
        let ratio = axial / cutting;
        if ratio < limits[0] || ratio > limits[1] {
            let side = if ratio > limits[1] { "large" } else { "small" };
            warnings.push(format!(
                "Fz looks too {side} beside {names}: {} against {} N/mm² of chip cross-section{}; check the units \
                 and the amplifier's range of Fz",
                figures(axial, 3),
                figures(cutting, 3),
                suspects(&UNITS, |factor| {
                    let ratio = ratio * factor;
                    ratio > limits[0].max(0.02) && ratio < limits[1]
                })
            ));
        }
    }
    warnings.extend(small_channels(cuts));
    warnings
}

/// `: kN called N, or lbf called N?`
fn suspects(units: &[(f64, &str)], fits: impl Fn(f64) -> bool) -> String {
    let names: Vec<&str> = units.iter().filter(|u| fits(u.0)).map(|u| u.1).collect();
    if names.is_empty() {
        String::new()
    } else {
        format!(": {}?", names.join(", or "))
    }
}

/// What a misfit by this ratio (measured over predicted) would be as a mix-up of units; `None` where it looks like none.
pub(super) fn unit_slip(ratio: f64, axis: ForceAxis) -> Option<&'static str> {
    let units: &[(f64, &str)] = if axis == ForceAxis::Mz {
        &TORQUE_UNITS
    } else {
        &UNITS
    };
    // Feeds and wear scatter by some percent; the offset of a coarse zero more.
    let fits = |u: &&(f64, &str)| (ratio * u.0 - 1.0).abs() < 0.12 && (u.0 - 1.0).abs() > 0.5;
    units.iter().find(fits).map(|u| u.1)
}

/// Ratio of the spans of two force channels of one dynamometer beyond which their units differ.
const SAME_UNIT: f64 = 400.0;

fn small_channels(cuts: &[&CutAnalysis]) -> Vec<String> {
    let mut told: Vec<(String, Vec<&str>, f64)> = Vec::new();
    for cut in cuts {
        let forces = || cut.channels.iter().filter(|c| c.axis != ForceAxis::Mz);
        let span = |c: &ChannelAnalysis| {
            let low = c.trace.min.iter().copied().fold(f64::INFINITY, f64::min);
            let high = c.trace.max.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            high - low
        };
        let largest = forces().map(span).fold(0.0, f64::max);
        for channel in forces().filter(|c| span(c) > 0.0 && SAME_UNIT * span(c) < largest) {
            let ratio = largest / span(channel);
            match told.iter_mut().find(|t| t.0 == channel.name) {
                Some(t) => t.1.push(&cut.id),
                None => told.push((channel.name.clone(), vec![&cut.id], ratio)),
            }
        }
    }
    told.into_iter()
        .map(|(name, ids, ratio)| {
            format!(
                "cut {}: {name} spans {ratio:.0} times less than the largest force channel: kN called N, or the amplifier's range is \
                 set wrongly; correct the unit in the files",
                ids.join(", ")
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_are_known_by_their_numbers_too() {
        let known = |name: &str| -> Option<f64> {
            let of = MATERIALS
                .iter()
                .find(|(words, _)| words.iter().any(|w| is_called(name, w)));
            of.map(|(_, bounds)| bounds[0])
        };
        for steel in [
            "1.4301",
            "1.0503 normalised",
            "s235jr",
            "st 52",
            "x5crni18-10",
            "16mncr5",
            "acier xc48",
            "ck45",
        ] {
            assert_eq!(known(steel), Some(1300.0), "{steel}");
        }
        assert_eq!(known("3.7165"), Some(1200.0));
        assert_eq!(known("en aw-7075"), Some(350.0));
        // Versions, lengths and plates are no material numbers.
        for other in ["block 1.4", "plate 11.4301", "v1.0.2", "wood", "3.1355"] {
            assert_eq!(known(other), None, "{other}");
        }
    }
}
