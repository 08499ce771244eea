//! The modal analyst's report: modes of FRFs without any robot.

use std::collections::BTreeSet;
use std::path::Path;

use num_complex::Complex64;

use super::figure::{CellFormat, CompassFigure, HeatMap, IndicatorFigure, WirePicture, WireShapesFigure};
use super::number::{decimals, with_error};
use super::parts::{figure, made};
use super::picker::picker;
use super::words::count;
use super::{Block, Drawing, Fold, Page, ReportSection, ReportTable, TableColumn};
use crate::analysis::ModalAnalysis;
use crate::analysis::modes::modal::SetModes;
use crate::analysis::modes::modal_export::scaled_modes;
use crate::analysis::modes::mode_set::dofs_of_frfs;
use crate::analysis::modes::shape_comparison::{ShapeComparison, at_nodes};
use crate::ingest::{Dof, Geometry};
use crate::modal::indicators::FrfMatrix;
use crate::modal::scaling::{DrivingPoint, check_driving_point};
use crate::report::sections::modal_section::{
    coherence, mac, modes, reconstruction, reconstruction_of, stabilisation, tracked,
};

/// Warnings shown; the command tells all.
const MOST_WARNINGS: usize = 12;
/// Rejected poles, shapes, FRFs shown.
const MOST_REJECTED: usize = 40;
const MOST_INPUTS: usize = 3;
const MOST_SHAPES: usize = 18;
/// References of which the indicator functions are drawn.
const MOST_REFERENCES: usize = 6;
/// Steps of the frequency axis that a figure can show.
const MOST_LINES: usize = 4000;

/// What the page is made of besides the analysis.
#[derive(Debug, Clone, Default)]
pub struct Extras<'a> {
    pub geometry: Option<&'a Geometry>,
    /// By set; `None` where nothing was compared.
    pub comparisons: &'a [Option<ShapeComparison>],
    /// Files or campaign folder as they were given, and the fingerprint of what is in them.
    pub inputs: Vec<String>,
    pub fingerprint: Option<String>,
    /// The command line that made the page, without the poles to take.
    pub command: String,
}

pub fn page(analysis: &ModalAnalysis, extras: &Extras, title: &str) -> Page {
    let analysis = &with_short_names(analysis.clone());
    let mut sections = vec![overview(analysis)];
    for (k, set) in analysis.sets.iter().enumerate() {
        let number = match analysis.sets.len() {
            1 => String::new(),
            _ => format!(" · {}", set.set),
        };
        let comparison = extras.comparisons.get(k).and_then(Option::as_ref);
        let section = |id: &str, title: &str, lead: &str, blocks: Vec<Block>| ReportSection {
            id: format!("{id}-{}", k + 1),
            title: format!("{title}{number}"),
            lead: lead.into(),
            blocks,
        };
        let mut blocks = vec![stabilisation(set)];
        blocks.extend(picker(set, &extras.command));
        blocks.extend(rejected(set));
        sections.push(section(
            "stabilisation",
            "Which poles are modes",
            "Poles of many model orders: those that stay are modes; for those left out it is said why.",
            blocks,
        ));
        sections.push(section(
            "indicators",
            "Mode indicators",
            "Where modes are, and how many at once, without any fit.",
            indicators(set),
        ));
        let mut blocks = reconstruction(set);
        blocks.extend(worst(set));
        blocks.extend(coherence(set));
        blocks.push(per_frf(set));
        sections.push(section(
            "reconstruction",
            "Measured against put together from the modes",
            "What the modes leave over is noise, or something that is no mode.",
            blocks,
        ));
        let mut blocks = shapes(set, extras.geometry);
        blocks.extend(complexity(set));
        blocks.extend(mac(set));
        sections.push(section(
            "shapes",
            "Mode shapes",
            "How the structure moves in each mode, and how alike the shapes are.",
            blocks,
        ));
        sections.push(section(
            "scale",
            "Driving points and modal mass",
            "Where force and response are at one point, the modes get their scale.",
            scale(set),
        ));
        if let Some(comparison) = comparison {
            sections.push(section(
                "model",
                "Against the model",
                "Shapes of the model at the measured points.",
                against(set, comparison),
            ));
        }
    }
    let mut origin = made();
    origin.extend(given(&extras.inputs).map(|inputs| ("of".into(), inputs)));
    origin.extend(extras.fingerprint.clone().map(|hash| ("FRF data".into(), hash)));
    Page {
        title: title.into(),
        subtitle: "Modes of measured FRFs".into(),
        origin,
        sections,
        ..Page::default()
    }
}

/// The files that a page is of, few enough for its header.
fn given(inputs: &[String]) -> Option<String> {
    let more = inputs.len().saturating_sub(MOST_INPUTS);
    let mut shown = inputs[..inputs.len() - more].join(", ");
    if more > 0 {
        shown += &format!(" and {more} more");
    }
    (!inputs.is_empty()).then_some(shown)
}

/// Sets are called after whole paths: on the page the name of the file is enough, where no two files share it. Of a page
/// with one set every warning is of that set.
fn with_short_names(mut analysis: ModalAnalysis) -> ModalAnalysis {
    let short = |set: &SetModes| {
        let name = Path::new(&set.set).file_name();
        name.map_or_else(|| set.set.clone(), |n| n.to_string_lossy().into_owned())
    };
    let names: BTreeSet<String> = analysis.sets.iter().map(short).collect();
    let alone = analysis.sets.len() == 1;
    if names.len() < analysis.sets.len() {
        return analysis;
    }
    for set in &mut analysis.sets {
        let name = short(set);
        for warning in &mut analysis.warnings {
            *warning = match warning.strip_prefix(&format!("{}: ", set.set)) {
                Some(of_the_set) if alone => of_the_set.to_string(),
                _ => warning.replace(&set.set, &name),
            };
        }
        set.set = name;
    }
    analysis
}

fn overview(analysis: &ModalAnalysis) -> ReportSection {
    let mut blocks = vec![modes(analysis)];
    if let Some(Block::Table(table)) = blocks.first_mut() {
        table.caption = "Modes, all FRFs of a set together".into();
        table.columns[0] = TableColumn::text("set");
        if analysis.sets.len() == 1 {
            table.columns.remove(0);
            table.rows.iter_mut().for_each(|row| drop(row.remove(0)));
        }
    }
    if analysis.sets.len() > 1 {
        blocks.extend(tracked(analysis));
    }
    let verdicts = analysis.sets.iter().map(|set| {
        let name = format!("{} ({})", set.set, count(set.frfs.len(), "FRF", "FRFs"));
        (name, format!("{}: {}", set.verdict, set.why))
    });
    blocks.push(Block::KeyValues(verdicts.collect()));
    let warnings = analysis.warnings.iter();
    blocks.extend(warnings.take(MOST_WARNINGS).cloned().map(Block::Warning));
    if analysis.warnings.len() > MOST_WARNINGS {
        blocks.push(Block::Paragraph(format!(
            "{} more: see the command modal.",
            count(analysis.warnings.len() - MOST_WARNINGS, "warning", "warnings")
        )));
    }
    ReportSection {
        id: "modes".into(),
        title: "Modes".into(),
        lead: "Frequencies and damping of all FRFs of a set together, with one standard deviation.".into(),
        blocks,
    }
}

fn rejected(set: &SetModes) -> Option<Block> {
    let rejected = &set.global.rejected;
    if rejected.is_empty() {
        return None;
    }
    let rows = rejected.iter().take(MOST_REJECTED).map(|r| {
        vec![
            decimals(r.frequency_hz, 2),
            decimals(100.0 * r.damping_ratio, 2),
            r.reason.clone(),
        ]
    });
    let more = rejected.len().saturating_sub(MOST_REJECTED);
    let table = Block::Table(ReportTable {
        caption: String::new(),
        columns: vec![
            TableColumn::number("frequency (Hz)"),
            TableColumn::number("damping ratio (%)"),
            TableColumn::text("why not"),
        ],
        rows: rows.collect(),
        notes: if more > 0 {
            vec![format!("and {more} more: see the command modal with --json")]
        } else {
            vec![]
        },
    });
    Some(Block::Fold(Fold {
        title: format!(
            "{} that are no modes, or that these FRFs do not prove",
            count(rejected.len(), "pole", "poles")
        ),
        blocks: vec![table],
        open: false,
    }))
}

/// FRFs of the set on common lines by response and reference; one column where the set is no full grid.
fn matrix(set: &SetModes) -> Option<FrfMatrix<'_>> {
    let first = &set.frfs.first()?.input.frequency_hz;
    if set.frfs.iter().any(|f| f.input.frequency_hz != *first) {
        return None;
    }
    let value = |k: usize| set.frfs[k].input.receptance_m_per_n.as_slice();
    let dofs = dofs_of_frfs(set);
    let single = || (0..set.frfs.len()).map(|k| vec![value(k)]).collect();
    let known: Option<Vec<[usize; 2]>> = dofs.into_iter().collect();
    let grid = known.and_then(|dofs| {
        let side = |k: usize| dofs.iter().map(|d| d[k]).collect::<BTreeSet<usize>>();
        let (responses, references) = (side(0), side(1));
        // By reciprocity the shorter side may be the references.
        let (long, short, swap) = match references.len() <= responses.len() {
            true => (responses, references, false),
            false => (references, responses, true),
        };
        if short.len() > MOST_REFERENCES || dofs.len() != long.len() * short.len() {
            return None;
        }
        let find = |a: usize, b: usize| {
            let wanted = if swap { [b, a] } else { [a, b] };
            dofs.iter().position(|d| *d == wanted)
        };
        long.iter()
            .map(|a| {
                short
                    .iter()
                    .map(|b| find(*a, *b).map(value))
                    .collect::<Option<Vec<_>>>()
            })
            .collect::<Option<Vec<_>>>()
    });
    Some(FrfMatrix {
        frequency_hz: first,
        receptance_m_per_n: grid.unwrap_or_else(single),
    })
}

fn indicators(set: &SetModes) -> Vec<Block> {
    let Some(matrix) = matrix(set) else {
        return vec![Block::Paragraph(
            "The FRFs of the set have lines of their own: no indicator functions.".into(),
        )];
    };
    let every = matrix.frequency_hz.len().div_ceil(MOST_LINES).max(1);
    // Not beyond the band that was looked at.
    let fitted = set
        .global
        .reconstructions
        .iter()
        .flatten()
        .flat_map(|r| [r.frequency_hz.first(), r.frequency_hz.last()]);
    let (low, high) = fitted
        .flatten()
        .fold((f64::INFINITY, 0.0_f64), |(a, b), f| (a.min(*f), b.max(*f)));
    let inside = |f: f64| f > 0.0 && (!low.is_finite() || (low..=high).contains(&f));
    let kept: Vec<usize> = (0..matrix.frequency_hz.len())
        .step_by(every)
        .filter(|k| inside(matrix.frequency_hz[*k]))
        .collect();
    let thinned = |curves: Vec<Vec<f64>>, name: &str| -> Vec<(String, Vec<f64>)> {
        let one = |(k, curve): (usize, Vec<f64>)| {
            (
                format!("{name} {}", k + 1),
                kept.iter().map(|i| curve[*i]).collect(),
            )
        };
        curves.into_iter().enumerate().map(one).collect()
    };
    let frequency_hz: Vec<f64> = kept.iter().map(|i| matrix.frequency_hz[*i]).collect();
    let chosen_hz: Vec<f64> = set.global.modes.iter().map(|m| m.frequency_hz).collect();
    let cmif = IndicatorFigure {
        title: format!("Complex mode indicator function, {}", set.set),
        label: "Singular value of the mobility (m/(N·s))".into(),
        log: true,
        frequency_hz: frequency_hz.clone(),
        curves: thinned(matrix.cmif(), "CMIF"),
        chosen_hz: chosen_hz.clone(),
    };
    let mmif = IndicatorFigure {
        title: format!("Multivariate mode indicator function, {}", set.set),
        label: "Share of the response in phase".into(),
        log: false,
        frequency_hz,
        curves: thinned(matrix.mmif(), "MMIF"),
        chosen_hz,
    };
    vec![
        figure(
            "modal-cmif",
            "Singular values of the FRF matrix over frequency",
            "A peak is a mode; a peak of the second curve below one of the first is a second mode at the same place (as many \
             curves as references).",
            cmif.png(),
        ),
        figure(
            "modal-mmif",
            "Smallest part of the response in phase with the forces",
            "Falls towards 0 at a normal mode; as many curves fall as there are modes at once.",
            mmif.png(),
        ),
    ]
}

/// The FRF that the modes describe worst.
fn worst(set: &SetModes) -> Vec<Block> {
    let fits = set.global.reconstructions.iter().enumerate();
    let worst = fits
        .filter_map(|(k, r)| Some((k, r.as_ref()?)))
        .max_by(|a, b| a.1.error_nrms.total_cmp(&b.1.error_nrms));
    match worst {
        Some((k, fit)) if set.frfs.len() > 2 => reconstruction_of(set, k, fit, "the worst of the set"),
        _ => Vec::new(),
    }
}

fn per_frf(set: &SetModes) -> Block {
    let rows = set
        .frfs
        .iter()
        .zip(&set.global.reconstructions)
        .map(|(frf, fit)| {
            let part = |of: Option<f64>| of.map_or("–".into(), |x| decimals(100.0 * x, 1));
            vec![
                frf.input.name.clone(),
                part(fit.as_ref().map(|f| f.error_nrms)),
                part(fit.as_ref().map(|f| f.noise_nrms)),
                frf.quality.verdict.to_string(),
                frf.quality.reasons.join(", "),
            ]
        });
    Block::Table(ReportTable {
        caption: "Each FRF".into(),
        columns: vec![
            TableColumn::text("FRF"),
            TableColumn::number("left over (%)"),
            TableColumn::number("its noise (%)"),
            TableColumn::text("quality"),
            TableColumn::text("because"),
        ],
        rows: rows.collect(),
        notes: vec!["Of the mobility, root mean square over the band.".into()],
    })
}

fn title_of(mode: &crate::modal::GlobalMode) -> String {
    format!(
        "{} Hz, {} %",
        with_error(mode.frequency_hz, mode.frequency_std_hz),
        with_error(100.0 * mode.damping_ratio, 100.0 * mode.damping_std)
    )
}

fn shapes(set: &SetModes, geometry: Option<&Geometry>) -> Vec<Block> {
    let Some(geometry) = geometry.filter(|g| !g.nodes.is_empty()) else {
        return vec![Block::Paragraph(
            "No geometry was given, so the shapes are not drawn: --geometry takes a universal file with datasets 15 or 2411 \
             and 82, or a CSV with rows node,x,y,z and line,from,to."
                .into(),
        )];
    };
    let measured: BTreeSet<i64> = set
        .dofs
        .iter()
        .filter_map(|d| d.parse::<Dof>().ok())
        .map(|d| d.node)
        .collect();
    let known: Vec<i64> = geometry
        .nodes
        .keys()
        .copied()
        .filter(|n| measured.contains(n))
        .collect();
    if known.is_empty() {
        return vec![Block::Warning(
            "None of the measured points is a node of the geometry: the shapes are not drawn. Node numbers of FRFs and \
             geometry must be the same."
                .into(),
        )];
    }
    let index = |node: i64| known.iter().position(|n| *n == node);
    let mut lines: Vec<[usize; 2]> = geometry
        .lines
        .iter()
        .filter_map(|[a, b]| Some([index(*a)?, index(*b)?]))
        .collect();
    if lines.is_empty() {
        lines = (1..known.len()).map(|k| [k - 1, k]).collect();
    }
    let picture = WireShapesFigure {
        title: format!("Mode shapes, {}", set.set),
        nodes: known.iter().map(|n| geometry.nodes[n]).collect(),
        lines,
        pictures: set
            .global
            .modes
            .iter()
            .take(MOST_SHAPES)
            .map(|mode| {
                let at = at_nodes(set, mode);
                WirePicture {
                    title: title_of(mode),
                    shape: known
                        .iter()
                        .map(|n| at.get(n).copied().unwrap_or_default())
                        .collect(),
                }
            })
            .collect(),
    };
    let mut blocks = vec![figure(
        "modal-shapes",
        "The structure in each mode",
        "Both ends of the swing; not to scale. Directions that were not measured do not move.",
        picture.png(),
    )];
    blocks.extend(picture.animated_svg().map(|svg| {
        Block::Drawing(Drawing {
            svg,
            caption: "The same in motion, slowed to one swing in two seconds; points out of phase pass rest at other times."
                .into(),
        })
    }));
    blocks
}

fn complexity(set: &SetModes) -> Option<Block> {
    let modes: Vec<(String, Vec<Complex64>)> = set
        .global
        .modes
        .iter()
        .filter(|m| m.shape.len() > 1)
        .take(MOST_SHAPES)
        .map(|m| {
            let mpc = m
                .complexity
                .map_or(String::new(), |c| format!(", MPC {}", decimals(c.mpc, 3)));
            let title = format!("{} Hz{mpc}", decimals(m.frequency_hz, 2));
            (title, m.shape.iter().map(|s| s.1).collect())
        })
        .collect();
    if modes.is_empty() {
        return None;
    }
    let picture = CompassFigure {
        title: format!("Complexity of the shapes, {}", set.set),
        modes,
    };
    Some(figure(
        "modal-complexity",
        "Components of each shape in the complex plane",
        "Along one line: a standing wave. Spread over the circle: a travelling wave, two modes taken for one, or noise.",
        picture.png(),
    ))
}

fn scale(set: &SetModes) -> Vec<Block> {
    let points = driving_points(set);
    if points.is_empty() {
        return vec![Block::Paragraph(
            "No FRF has its force and its response in one degree of freedom: shapes have no scale, and there is no modal mass."
                .into(),
        )];
    }
    let list = |items: Vec<String>| {
        if items.is_empty() {
            "–".to_owned()
        } else {
            items.join(", ")
        }
    };
    let rows = points.iter().map(|p| {
        vec![
            p.name.clone(),
            p.verdict.to_owned(),
            list(p.wrong_sign_hz.iter().map(|f| decimals(*f, 2)).collect()),
            list(
                p.no_antiresonance_between_hz
                    .iter()
                    .map(|[a, b]| format!("{} … {}", decimals(*a, 1), decimals(*b, 1)))
                    .collect(),
            ),
            decimals(100.0 * p.negative_power_share, 1),
        ]
    });
    let mut blocks = vec![Block::Table(ReportTable {
        caption: "Driving points".into(),
        columns: vec![
            TableColumn::text("FRF"),
            TableColumn::text("is"),
            TableColumn::text("wrong sign at (Hz)"),
            TableColumn::text("no antiresonance between (Hz)"),
            TableColumn::number("negative power (%)"),
        ],
        rows: rows.collect(),
        notes: vec![
            "At its own point a force never takes power out: the real part of the mobility is not negative, all modal constants \
             are positive, and an antiresonance lies between every two resonances."
                .into(),
        ],
    })];
    let scaled = scaled_modes(set);
    if scaled.iter().any(Option::is_some) {
        let rows = set.global.modes.iter().zip(&scaled).map(|(mode, scale)| {
            let cell = |of: &dyn Fn(&crate::modal::scaling::ScaledMode) -> String| {
                scale.as_ref().map_or("–".into(), of)
            };
            vec![
                with_error(mode.frequency_hz, mode.frequency_std_hz),
                cell(&|s| set.dofs.get(s.driving_dof).cloned().unwrap_or_default()),
                cell(&|s| with_error(s.modal_mass_kg, s.modal_mass_std_kg)),
                cell(&|s| super::number::significant(s.modal_a.re, 3)),
                cell(&|s| super::number::significant(s.modal_a.im, 3)),
            ]
        });
        blocks.push(Block::Table(ReportTable {
            caption: "Modal mass and modal A (shapes with the largest component 1)".into(),
            columns: vec![
                TableColumn::number("frequency (Hz)"),
                TableColumn::text("driving point"),
                TableColumn::number("modal mass (kg)"),
                TableColumn::number("Re a (kg/s)"),
                TableColumn::number("Im a (kg/s)"),
            ],
            rows: rows.collect(),
            notes: vec!["Residue = ψψ/a. Shapes of unity modal mass and real normal modes: --export.".into()],
        }));
    }
    blocks
}

/// Checks of all driving points of a set.
pub fn driving_points(set: &SetModes) -> Vec<DrivingPoint> {
    let own = set.frfs.iter().zip(&set.global.reconstructions).enumerate();
    own.filter_map(|(k, (frf, fit))| {
        let [response, reference] = frf.input.dofs.as_ref()?;
        let fit = fit.as_ref().filter(|_| response == reference)?;
        let modes: Vec<(f64, f64, Complex64, f64)> = set
            .global
            .modes
            .iter()
            .filter_map(|m| {
                let (constant, std) = (*m.constants.get(k)?)?;
                Some((m.frequency_hz, m.damping_ratio, constant, std))
            })
            .collect();
        Some(check_driving_point(
            &frf.input.name,
            &fit.frequency_hz,
            &fit.measured_m_per_n,
            &modes,
        ))
    })
    .collect()
}

fn against(set: &SetModes, comparison: &ShapeComparison) -> Vec<Block> {
    let name = |f: f64| format!("{} Hz", decimals(f, 1));
    let picture = HeatMap {
        title: format!("MAC, {} against the model", set.set),
        row_label: "Measured".into(),
        column_label: "Model".into(),
        rows: set.global.modes.iter().map(|m| name(m.frequency_hz)).collect(),
        columns: comparison.model_frequency_hz.iter().map(|f| name(*f)).collect(),
        values: comparison
            .mac
            .iter()
            .map(|row| row.iter().map(|m| Some(*m)).collect())
            .collect(),
        value_label: "MAC".into(),
        format: CellFormat::Decimals(2),
        range: Some((0.0, 1.0)),
        ..Default::default()
    };
    let rows = comparison.pairs.iter().map(|p| {
        vec![
            decimals(p.measured_hz, 2),
            decimals(p.model_hz, 2),
            decimals(100.0 * p.frequency_error, 1),
            decimals(p.mac, 3),
        ]
    });
    let mut notes = vec![format!(
        "{} in common, nodes matched by {}.",
        count(comparison.common_dofs, "degree of freedom", "degrees of freedom"),
        comparison.matched_by
    )];
    if !comparison.missing_dofs.is_empty() {
        notes.push(format!("The model lacks {}.", comparison.missing_dofs.join(", ")));
    }
    vec![
        figure(
            "modal-cross-mac",
            "Likeness of measured and model modes",
            "A dark diagonal is what one hopes for; a mode without a dark cell has no counterpart.",
            picture.png(),
        )
        .with_plot(picture.plot()),
        Block::Table(ReportTable {
            caption: "Pairs, each mode once, from a likeness of 0.5 on".into(),
            columns: vec![
                TableColumn::number("measured (Hz)"),
                TableColumn::number("model (Hz)"),
                TableColumn::number("model off by (%)"),
                TableColumn::number("MAC"),
            ],
            rows: rows.collect(),
            notes,
        }),
    ]
}
