//! Modes of the measured FRFs.

use num_complex::Complex64;

use crate::analysis::ModalAnalysis;
use crate::analysis::modes::modal::{AnalysedFrf, SetModes};
use crate::analysis::modes::stick_shapes::StickShape;
use crate::modal::Reconstruction;
use crate::modal::tracking::Track;
use crate::report::figure::{
    CellFormat, CoherenceCurve, CoherenceFigure, FrfCurve, FrfFigure, HeatMap, ModeShapesFigure, NoiseLevel,
    NyquistFigure, StabilisationFigure, StabilisationPole, StickPicture,
};
use crate::report::number::{concise, decimals, with_error};
use crate::report::parts::figure;
use crate::report::words::count;
use crate::report::{Block, Drawing, Fold, ReportSection, ReportTable, TableColumn};

/// Warnings shown; the command `modal` tells all.
const MOST_WARNINGS: usize = 6;
/// Mode shapes drawn.
const MOST_SHAPES: usize = 9;

pub fn summary(analysis: &ModalAnalysis) -> Option<String> {
    let modes = || analysis.sets.iter().flat_map(|p| &p.global.modes);
    let lowest = modes().map(|m| m.frequency_hz).fold(f64::INFINITY, f64::min);
    let highest = modes().map(|m| m.frequency_hz).fold(0.0, f64::max);
    if !lowest.is_finite() {
        return None;
    }
    Some(format!(
        "The measured FRFs alone, without any model, show {} at {}, from {} to {} Hz.",
        count(analysis.mode_count(), "mode", "modes"),
        count(analysis.sets.len(), "posture", "postures"),
        decimals(lowest, 2),
        decimals(highest, 2),
    ))
}

pub fn section(analysis: &ModalAnalysis, shapes: &[StickShape]) -> ReportSection {
    let tracked = if analysis.sets.len() > 1 {
        tracked(analysis)
    } else {
        None
    };
    let mut blocks = match tracked {
        // Each mode once: what the table by posture adds is a click away.
        Some(tracked) => vec![
            tracked,
            Block::Fold(Fold {
                title: "The same modes posture by posture, with what each rests on".into(),
                blocks: vec![modes(analysis)],
                open: false,
            }),
        ],
        None => vec![modes(analysis)],
    };
    // One posture shows how it was done; all of them would be a picture book.
    if let Some(set) = analysis.richest_set() {
        blocks.push(stabilisation(set));
        blocks.extend(reconstruction(set));
        blocks.extend(coherence(set));
        if measured_points(set) < 2 {
            blocks.push(Block::Paragraph(
                "Mode shapes and their likeness (MAC) are not shown: one point, whatever its directions, cannot tell shapes \
                 apart. Two or three more points along the arm can."
                    .into(),
            ));
        } else {
            blocks.extend(mode_shapes(set, shapes));
            blocks.extend(mac(set));
        }
    }
    blocks.extend(
        analysis
            .warnings
            .iter()
            .take(MOST_WARNINGS)
            .cloned()
            .map(Block::Warning),
    );
    if analysis.warnings.len() > MOST_WARNINGS {
        let rest = analysis.warnings.len() - MOST_WARNINGS;
        blocks.push(Block::Paragraph(format!(
            "{} more: see the command modal.",
            count(rest, "warning", "warnings")
        )));
    }
    ReportSection {
        id: "modes".into(),
        title: "Modes of the measured FRFs".into(),
        lead: "Frequencies and damping that the measurement shows by itself; no robot model is used.".into(),
        blocks,
    }
}

pub(crate) fn modes(analysis: &ModalAnalysis) -> Block {
    let mut rows = Vec::new();
    for set in &analysis.sets {
        if set.global.modes.is_empty() {
            rows.push(vec![set.set.clone(), "no mode found".into()]);
        }
        for mode in &set.global.modes {
            rows.push(vec![
                set.set.clone(),
                with_error(mode.frequency_hz, mode.frequency_std_hz),
                with_error(100.0 * mode.damping_ratio, 100.0 * mode.damping_std),
                format!("{} of {}", mode.found_in, set.frfs.len()),
                mode.complexity.map_or("–".into(), |c| decimals(c.mpc, 3)),
            ]);
        }
    }
    Block::Table(ReportTable {
        caption: "Modes, all FRFs of a posture together".into(),
        columns: vec![
            TableColumn::text("posture"),
            TableColumn::number("frequency (Hz)"),
            TableColumn::number("damping ratio (%)"),
            TableColumn::number("seen in FRFs"),
            TableColumn::number("phase collinearity"),
        ],
        rows,
        notes: vec![
            "± is one standard deviation. Phase collinearity: 1 where all points move in phase or against it.".into(),
        ],
    })
}

/// The same mode from posture to posture, one row a mode.
pub(crate) fn tracked(analysis: &ModalAnalysis) -> Option<Block> {
    let tracks = analysis.tracks();
    if tracks.is_empty() {
        return None;
    }
    let mut columns = vec![TableColumn::text("mode")];
    columns.extend(
        analysis
            .sets
            .iter()
            .map(|s| TableColumn::number(format!("{} (Hz, %)", s.set))),
    );
    let cell = |track: &Track, set: usize| {
        track.mode_of_set[set].map_or("–".to_string(), |m| {
            let mode = &analysis.sets[set].global.modes[m];
            format!(
                "{}, {}",
                concise(mode.frequency_hz, mode.frequency_std_hz),
                concise(100.0 * mode.damping_ratio, 100.0 * mode.damping_std)
            )
        })
    };
    Some(Block::Table(ReportTable {
        caption: "The modes from posture to posture: frequency and damping ratio".into(),
        columns,
        rows: tracks
            .iter()
            .enumerate()
            .map(|(k, track)| {
                let mut row = vec![(k + 1).to_string()];
                row.extend((0..analysis.sets.len()).map(|set| cell(track, set)));
                row
            })
            .collect(),
        notes: vec![
            "In brackets: one standard deviation, in units of the last digit.".into(),
            "Paired by frequency and shape; the order of close modes may change between postures.".into(),
        ],
    }))
}

pub(crate) fn stabilisation(set: &SetModes) -> Block {
    let diagram = &set.global.stabilisation;
    let mut measured: Vec<(f64, f64)> = Vec::new();
    for fit in set.global.reconstructions.iter().flatten() {
        if measured.is_empty() {
            measured = fit.frequency_hz.iter().map(|f| (*f, 0.0)).collect();
        }
        if measured.len() == fit.frequency_hz.len() {
            for (sum, h) in measured.iter_mut().zip(&fit.measured_m_per_n) {
                sum.1 += h.norm();
            }
        }
    }
    let picture = StabilisationFigure {
        title: format!("Stabilisation diagram, {}", set.set),
        poles: diagram
            .poles
            .iter()
            .map(|p| StabilisationPole {
                frequency_hz: p.frequency_hz,
                order: p.order,
                stability: p.stability,
            })
            .collect(),
        chosen_hz: set.global.modes.iter().map(|m| m.frequency_hz).collect(),
        measured,
    };
    figure(
        "modal-stabilisation",
        "Poles over the model order; those that stay form columns",
        "Poles that stay from order to order are modes; the others follow noise. A mode without a stable pole under it comes from \
         the fit of all curves alone: look at it twice.",
        picture.png(),
    )
}

/// The FRF that the modes describe best is the least interesting one: the median one is shown.
fn median_fit(set: &SetModes) -> Option<(usize, &Reconstruction)> {
    let mut fits: Vec<(usize, f64)> = set
        .global
        .reconstructions
        .iter()
        .enumerate()
        .filter_map(|(k, r)| Some((k, r.as_ref()?.error_nrms)))
        .collect();
    fits.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (k, _) = *fits.get(fits.len() / 2)?;
    Some((k, set.global.reconstructions[k].as_ref()?))
}

/// As magnitude and phase, and as circles of the mobility.
pub(crate) fn reconstruction(set: &SetModes) -> Vec<Block> {
    match median_fit(set) {
        Some((k, fit)) => reconstruction_of(set, k, fit, "the median of the set"),
        None => Vec::new(),
    }
}

/// FRF `k` of the set against its modes; `which` says why this one.
pub(crate) fn reconstruction_of(set: &SetModes, k: usize, fit: &Reconstruction, which: &str) -> Vec<Block> {
    // FRFs of a campaign have the posture in their name.
    let own = &set.frfs[k].input.name;
    let name = match own.starts_with(&set.set) {
        true => own.clone(),
        false => format!("{} {own}", set.set),
    };
    let curve = |label: &str, value: &[Complex64]| FrfCurve {
        label: label.into(),
        frequency_hz: fit.frequency_hz.clone(),
        value: value.to_vec(),
    };
    let left: Vec<f64> = fit
        .measured_m_per_n
        .iter()
        .zip(&fit.fitted_m_per_n)
        .map(|(a, b)| (a - b).norm())
        .collect();
    let picture = FrfFigure {
        title: name.clone(),
        quantity: "Receptance".into(),
        unit: "m/N".into(),
        measured: Some(curve("measured", &fit.measured_m_per_n)),
        models: vec![curve("from the modes", &fit.fitted_m_per_n)],
        noise: Some(NoiseLevel {
            label: "left over".into(),
            frequency_hz: fit.frequency_hz.clone(),
            magnitude: left,
        }),
    };
    let mobility = |label: &str, value: &[Complex64]| {
        let omega = fit
            .frequency_hz
            .iter()
            .map(|f| Complex64::new(0.0, std::f64::consts::TAU * f));
        curve(label, &omega.zip(value).map(|(s, h)| s * h).collect::<Vec<_>>())
    };
    let circles = NyquistFigure {
        title: format!("Mobility of {name} in the complex plane"),
        unit: "m/(N·s)".into(),
        measured: Some(mobility("measured", &fit.measured_m_per_n)),
        models: vec![mobility("from the modes", &fit.fitted_m_per_n)],
    };
    vec![
        figure(
            "modal-reconstruction",
            "A measured FRF and what the modes make of it",
            format!(
                "An FRF put together from the modes: {} % is left over, its noise is {} % (of the mobility; {which}).",
                decimals(100.0 * fit.error_nrms, 1),
                decimals(100.0 * fit.noise_nrms, 1)
            ),
            picture.png(),
        )
        .with_plot(picture.plot()),
        figure(
            "modal-nyquist",
            "The same FRF as mobility in the complex plane",
            "Each mode draws a circle; a dent in it is a second mode close by, a circle that runs counter-clockwise a wrong \
             sign.",
            circles.png(),
        )
        .with_plot(circles.plot(),
        ),
    ]
}

/// Coherence of the best and the worst FRF of the set, where it was measured.
pub(crate) fn coherence(set: &SetModes) -> Option<Block> {
    let mut known: Vec<(&AnalysedFrf, f64)> = set
        .frfs
        .iter()
        .filter_map(|f| f.input.coherence.as_ref().and(Some((f, f.quality.coherence?))))
        .collect();
    known.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut shown = vec![known.last()?.0];
    if known.len() > 1 {
        shown.push(known[0].0);
    }
    let picture = CoherenceFigure {
        title: format!("Coherence, {}: the best and the worst FRF", set.set),
        curves: shown
            .into_iter()
            .map(|frf| CoherenceCurve {
                label: frf.input.name.clone(),
                frequency_hz: frf.input.frequency_hz.clone(),
                coherence: frf.input.coherence.clone().unwrap_or_default(),
            })
            .collect(),
    };
    Some(figure(
        "modal-coherence",
        "Coherence over frequency",
        "1: the response comes from the hammer alone; dips at antiresonances are usual, dips at resonances are not.",
        picture.png(),
    ))
}

/// Places that the set's FRFs are of, in whatever directions: `1X` and `-1Z` are one.
fn measured_points(set: &SetModes) -> usize {
    let place = |dof: &String| {
        let name = dof.trim_start_matches(['+', '-']);
        name.trim_end_matches(|c: char| !c.is_ascii_digit()).to_string()
    };
    set.dofs
        .iter()
        .map(place)
        .collect::<std::collections::HashSet<_>>()
        .len()
}

/// Shapes on the robot's stick figure.
fn mode_shapes(set: &SetModes, shapes: &[StickShape]) -> Vec<Block> {
    if shapes.is_empty() {
        return Vec::new();
    }
    let picture = ModeShapesFigure {
        title: format!("Measured mode shapes, {}", set.set),
        pictures: shapes
            .iter()
            .take(MOST_SHAPES)
            .map(|s| StickPicture {
                title: format!(
                    "{} Hz, {} %",
                    decimals(s.frequency_hz, 2),
                    decimals(100.0 * s.damping_ratio, 1)
                ),
                chain: s.chain_m.clone(),
                chain_moved: s.chain_shape.clone(),
                points: s.points.clone(),
            })
            .collect(),
    };
    let moving = picture.animated_svg().map(|svg| {
        Block::Drawing(Drawing {
            svg,
            caption: "The same in motion, slowed to one swing in two seconds.".into(),
        })
    });
    let mut blocks = vec![figure(
        "modal-shapes",
        "How the robot moves in each mode, as far as it was measured",
        "Dots are measured; between the base and them the arm is drawn bending evenly, which is no measurement. \
         Not to scale.",
        picture.png(),
    )];
    blocks.extend(moving);
    blocks
}

pub(crate) fn mac(set: &SetModes) -> Option<Block> {
    let names: Vec<String> = set
        .global
        .modes
        .iter()
        .map(|m| format!("{} Hz", decimals(m.frequency_hz, 1)))
        .collect();
    if names.len() < 2 {
        return None;
    }
    let picture = HeatMap {
        title: format!("MAC between the modes, {}", set.set),
        row_label: "Mode".into(),
        column_label: "Mode".into(),
        rows: names.clone(),
        columns: names,
        values: set
            .global
            .mac
            .iter()
            .map(|row| row.iter().map(|m| Some(*m)).collect())
            .collect(),
        value_label: "MAC".into(),
        format: CellFormat::Decimals(2),
        range: Some((0.0, 1.0)),
        ..Default::default()
    };
    Some(figure(
        "modal-mac",
        "Modal assurance criterion of every two modes",
        "Modes of one structure should be unlike each other; a high value off the diagonal is one mode found twice, or \
         too few points to tell.",
        picture.png(),
    )
    .with_plot(picture.plot()))
}
