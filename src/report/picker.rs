//! The stabilisation diagram to pick poles from by mouse or keyboard: what is picked stands below as the command that repeats it.

use std::fmt::Write as _;

use minijinja::HtmlEscape;

use super::number::decimals;
use super::{Block, Drawing};
use crate::analysis::modes::modal::SetModes;
use crate::modal::stabilisation::Stability;
use crate::report::figure::sheet::axis::FigureAxis;

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 480.0;
/// Left, top, right, bottom of the plotting area.
const FRAME: [f64; 4] = [56.0, 16.0, 984.0, 430.0];
/// Poles drawn at most; the least stable are left out first.
const MOST_POLES: usize = 6000;
const SCRIPT: &str = include_str!("picker.js");

/// `None` without poles. The script is part of the drawing and touches nothing outside it.
pub fn picker(set: &SetModes, command: &str) -> Option<Block> {
    let diagram = &set.global.stabilisation;
    let mut poles: Vec<_> = diagram
        .poles
        .iter()
        .filter(|p| p.frequency_hz.is_finite())
        .collect();
    if poles.is_empty() {
        return None;
    }
    poles.sort_by_key(|p| std::cmp::Reverse(p.stability));
    poles.truncate(MOST_POLES);
    let frequencies = || poles.iter().map(|p| p.frequency_hz);
    let (low, high) = (
        frequencies().fold(f64::INFINITY, f64::min),
        frequencies().fold(f64::NEG_INFINITY, f64::max),
    );
    let margin = 0.03 * (high - low).max(0.01 * high);
    let (low, high) = ((low - margin).max(0.0), high + margin);
    let highest = 1.04 * poles.iter().map(|p| p.order).max().unwrap_or(1).max(1) as f64;
    let [left, top, right, bottom] = FRAME;
    let x = |f: f64| left + (f - low) / (high - low).max(1e-9) * (right - left);
    let y = |order: f64| bottom - order / highest * (bottom - top);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" tabindex=\"0\" role=\"application\" class=\"picker\" \
         data-command=\"{}\" aria-label=\"Poles over frequency and model order. Arrow keys choose a pole, Enter picks it.\">\
         <style>.picker circle{{cursor:pointer}}.picker circle:hover{{stroke:#1c1e21;stroke-width:2}}\
         .picker circle.taken{{fill:#ba2822;r:7px}}.picker circle.at{{stroke:#1c1e21;stroke-width:3;r:9px}}</style>\
         <rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#3c4046\"/>",
        HtmlEscape(command),
        right - left,
        bottom - top
    );
    // Writing to a String cannot fail.
    let across = FigureAxis::linear("Frequency (Hz)", (low, high), 8);
    for tick in &across.ticks {
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"14\" fill=\"#1c1e21\">{}</text>",
            x(tick.at),
            bottom + 20.0,
            tick.label
        );
    }
    for tick in FigureAxis::linear("", (0.0, highest), 5).ticks {
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" font-size=\"14\" fill=\"#1c1e21\">{}</text>",
            left - 8.0,
            y(tick.at) + 5.0,
            tick.label
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"14\" fill=\"#1c1e21\">{}; upwards: model order</text>",
        0.5 * (left + right),
        bottom + 42.0,
        across.label
    );
    for mode in &set.global.modes {
        let at = x(mode.frequency_hz);
        let _ = write!(
            svg,
            "<line x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{bottom}\" stroke=\"#5f646c\" stroke-dasharray=\"3 4\"/>"
        );
    }
    for pole in poles.iter().rev() {
        let (radius, fill, stroke) = match pole.stability {
            Stability::New => (3.0, "#ffffff", "#969aa0"),
            Stability::Frequency => (3.5, "#e28a20", "none"),
            Stability::Damping => (4.0, "#a0c4e4", "none"),
            Stability::Full => (4.5, "#0d549c", "none"),
        };
        let _ = write!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{stroke}\" data-f=\"{:.4}\" \
             data-z=\"{:.6}\"><title>{} Hz, {} %, order {}</title></circle>",
            x(pole.frequency_hz),
            y(pole.order as f64),
            pole.frequency_hz,
            pole.damping_ratio,
            decimals(pole.frequency_hz, 2),
            decimals(100.0 * pole.damping_ratio, 2),
            pole.order
        );
    }
    let _ = write!(
        svg,
        "</svg><p><b>Picked:</b> <code class=\"picked\">nothing yet</code></p><p class=\"pointed\" aria-live=\"polite\"></p>\
         <script>{SCRIPT}</script>"
    );
    Some(Block::Drawing(Drawing {
        svg,
        caption: "Click poles to pick them, again to put them back (by keyboard: arrow keys and Enter). White: new at its order; \
                  orange: same frequency as at the order below; light blue: and damping; blue: and shape. Dotted: modes taken."
            .into(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::ModalAnalysis;
    use crate::analysis::modes::mode_set::FrfInput;
    use crate::modal::Settings;
    use num_complex::Complex64;

    #[test]
    fn it_answers_to_the_keyboard_and_no_command_ends_it() {
        let frequency_hz: Vec<f64> = (0..400).map(|k| 4.0 + 0.05 * f64::from(k)).collect();
        let receptance = |f: &f64| 1e-6 / Complex64::new(1.0 - (f / 12.0).powi(2), 0.06 * f / 12.0);
        let input = FrfInput {
            name: "1Z/1Z".into(),
            set: "p1".into(),
            dofs: None,
            receptance_m_per_n: frequency_hz.iter().map(receptance).collect(),
            frequency_hz,
            coherence: None,
            added_decay_per_s: 0.0,
        };
        let found = ModalAnalysis::of(vec![input], Vec::new(), &Settings::default()).unwrap();
        let Some(Block::Drawing(drawing)) = picker(&found.sets[0], "lobestone modal '</script>\"<b>'") else {
            panic!("no poles");
        };
        assert!(drawing.svg.contains("tabindex=\"0\"") && drawing.svg.contains("keydown"));
        assert_eq!(drawing.svg.matches("</script>").count(), 1);
        assert!(!drawing.svg.contains("<b>'"));
    }
}
