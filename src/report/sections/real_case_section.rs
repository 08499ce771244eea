//! The loop on the thesis' own tables: which effect they propose, and how far to trust it.

use crate::report::figure::{ResonanceFigure, ResonanceRow};
use crate::report::number::{decimals, significant};
use crate::report::parts::{figure, paragraph};
use crate::report::words::{at_place, parameter, sizes};
use crate::report::{Block, ReportTable, TableColumn};
use crate::thesis::RealCase;
use crate::thesis::drawn_case::DrawnLaw;
use crate::thesis::real_case::{CONFIGURATIONS, Explanation};

pub fn blocks(case: &RealCase) -> Vec<Block> {
    let mut blocks = vec![paragraph(format!(
        "Which effect is missing? The loop that diagnoses campaigns was run on the modal table and the list of minima of \
         the real part together: {} resonances at four configurations, frequency and size of each. Its baseline is the \
         rigid-link model with joints and damping tuned to all of them; every effect of the library that such tables can \
         show was added in turn, refitted, and judged on configurations left out.",
        case.resonances.len()
    ))];
    blocks.push(resonance_figure(case));
    blocks.extend(explanations(case));
    blocks.push(drawn(case));
    blocks.extend(case.answer().into_iter().map(paragraph));
    blocks.push(paragraph(format!("Caveats. {}", case.caveats().join(" "))));
    blocks
}

fn best_name(case: &RealCase) -> &str {
    case.candidates.first().map_or("best effect", |c| &c.name)
}

fn resonance_figure(case: &RealCase) -> Block {
    let rows = CONFIGURATIONS.iter().enumerate().flat_map(|(i, configuration)| {
        ['X', 'Y'].map(|axis| ResonanceRow {
            label: format!("{configuration} {axis}"),
            measured_hz: case
                .resonances
                .iter()
                .filter(|r| r.configuration == *configuration && r.axis == axis)
                .map(|r| (r.frequency_hz, r.readings_hz))
                .collect(),
            before_hz: case.baseline_modes_hz.get(i).cloned().unwrap_or_default(),
            after_hz: case.best_modes_hz.get(i).cloned().unwrap_or_default(),
        })
    });
    let bands = case.baseline.checked.bands.iter().map(|b| (b.from_hz, b.to_hz));
    let title = "Measured resonances and the model's modes";
    let drawing = ResonanceFigure {
        title: title.into(),
        before_label: "modes, rigid links tuned to all resonances".into(),
        after_label: format!("modes with {}", at_place(best_name(case))),
        rows: rows.collect(),
        bands_hz: bands.collect(),
    };
    let caption = "Each row is a configuration and an axis. Bars through the signs span merged minima; the shaded bands are \
                   those in question. A mode may move the tool point hardly at all along the row's axis.";
    figure("thesis-resonances", title, caption, drawing.png())
}

fn explanations(case: &RealCase) -> [Block; 2] {
    let row = |e: &Explanation| {
        let bands: Vec<String> = e
            .checked
            .bands
            .iter()
            .map(|b| format!("{} of {}", b.met, b.measured))
            .collect();
        let [low, high] = e.checked.static_ratio;
        vec![
            at_place(&e.name),
            decimals(e.delta_bic, 1),
            significant(e.p_value, 2),
            decimals(e.reduced_chi2, 1),
            decimals(e.held_out_chi2, 0),
            format!("{} of {}", e.checked.met, case.resonances.len()),
            bands.join("; "),
            format!("{} to {}", decimals(low, 2), decimals(high, 2)),
            decimals(e.weight, 2),
        ]
    };
    let how_big = |e: &Explanation| {
        let bound = if e.at_bound { " (at its bound)" } else { "" };
        vec![at_place(&e.name), format!("{}{bound}", sizes(&e.parameters))]
    };
    let bands: Vec<String> = case
        .baseline
        .checked
        .bands
        .iter()
        .map(|b| format!("{}–{} Hz", b.from_hz, b.to_hz))
        .collect();
    let mut notes: Vec<String> = case
        .not_tried
        .iter()
        .map(|(effect, reason)| format!("Not tried: {} ({reason}).", at_place(effect)))
        .collect();
    notes.dedup();
    let judged = Block::Table(ReportTable {
        caption: "Explanations of the tables, best first after the rigid links".into(),
        columns: vec![
            TableColumn::text("explanation"),
            TableColumn::number("BIC difference"),
            TableColumn::number("p, corrected"),
            TableColumn::number("variance left (1 is noise)"),
            TableColumn::number("misfit held out"),
            TableColumn::number("resonances with a mode"),
            TableColumn::number(format!("of those at {}", bands.join("; "))),
            TableColumn::number("static stiffness, model / measured"),
            TableColumn::number("weight"),
        ],
        rows: std::iter::once(&case.baseline)
            .chain(&case.candidates)
            .map(row)
            .collect(),
        notes,
    });
    let fitted = Block::Table(ReportTable {
        caption: "How big each would have to be".into(),
        columns: vec![TableColumn::text("explanation"), TableColumn::text("best fit")],
        rows: case.candidates.iter().map(how_big).collect(),
        notes: Vec::new(),
    });
    [judged, fitted]
}

fn drawn(case: &RealCase) -> Block {
    let row = |part: &DrawnLaw| {
        let bands: Vec<String> = part
            .checked
            .bands
            .iter()
            .map(|b| format!("{} of {}", b.close, b.measured))
            .collect();
        let joint = part.checked.farthest_joint.as_ref();
        let [low, high] = part.checked.static_ratio;
        vec![
            part.words.clone(),
            format!(
                "{}{}",
                sizes(&part.parameters),
                if part.at_bound { " (at its bound)" } else { "" }
            ),
            decimals(part.delta_bic, 1),
            decimals(part.reduced_chi2, 1),
            bands.join("; "),
            joint.map_or("–".into(), |j| {
                format!("{} × {}", parameter(&j.name), decimals(j.factor, 2))
            }),
            format!("{} to {}", decimals(low, 2), decimals(high, 2)),
        ]
    };
    Block::Table(ReportTable {
        caption: "What the tables draw themselves: simple laws besides the joints, best first".into(),
        columns: vec![
            TableColumn::text("law and place"),
            TableColumn::text("best fit"),
            TableColumn::number("BIC difference"),
            TableColumn::number("variance left (1 is noise)"),
            TableColumn::number("resonances within two standard deviations, by band"),
            TableColumn::text("joint moved farthest"),
            TableColumn::number("static stiffness, model / measured"),
        ],
        rows: case.drawn.parts.iter().map(row).collect(),
        notes: Vec::new(),
    })
}
