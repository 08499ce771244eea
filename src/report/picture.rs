//! One measured curve and the model without and with what it lacks, as vector graphics that follow the page's colours.
//!
//! Which of the two models is shown is chosen by the page's style alone (classes `before` and `after`), so that it works
//! without scripts too.

use std::fmt::Write;

use minijinja::HtmlEscape;

use super::number::{format_si, significant};
use crate::report::figure::sheet::axis::{FigureAxis, extent, positive_extent};

/// Size of the drawing in its own units; the page scales it.
const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 244.0;
/// Room left, right, above and below the frame.
const MARGINS: [f64; 4] = [90.0, 12.0, 10.0, 40.0];
/// Columns that a curve is thinned to: each keeps its lowest and highest value.
const COLUMNS: usize = 300;
/// Decades that a log axis shows at most below the largest value.
const DECADES: f64 = 6.0;

/// Measured values and models of them over one axis.
#[derive(Debug, Clone, Default)]
pub struct Picture {
    /// What a reader who cannot see it should know.
    pub alt: String,
    pub x_label: String,
    pub y_label: String,
    /// Unit of the values, `m/N`, `N`.
    pub unit: String,
    /// Magnitudes on a log axis.
    pub log: bool,
    pub x: Vec<f64>,
    /// As long as `x`, as are the others; not a number where there is nothing.
    pub measured: Vec<f64>,
    pub before: Option<Vec<f64>>,
    pub after: Option<Vec<f64>>,
    /// Standard deviation of the measurement.
    pub noise: Option<Vec<f64>>,
    /// From where to where the error stands.
    pub shaded: Option<[f64; 2]>,
}

impl Picture {
    /// A whole `<svg>` element; text in it is escaped.
    pub fn svg(&self) -> String {
        let Some((x, y)) = self.axes() else {
            return String::new();
        };
        let mut svg = format!(
            "<svg class=\"picture\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">",
            HtmlEscape(&self.alt)
        );
        let frame = Frame { x: &x, y: &y };
        frame.shade(&mut svg, self.shaded);
        frame.grid(&mut svg, |value| match self.log {
            true => format_si(value, &self.unit, 1),
            false => plain(value),
        });
        if let Some(noise) = &self.noise {
            frame.line(&mut svg, "noise", &self.x, noise);
        }
        frame.dots(&mut svg, &self.x, &self.measured);
        for (class, values) in [("before", &self.before), ("after", &self.after)] {
            if let Some(values) = values {
                frame.line(&mut svg, class, &self.x, values);
            }
        }
        let middle = frame.left() + 0.5 * frame.width();
        let _ = write!(
            svg,
            "<text x=\"{middle:.0}\" y=\"{:.0}\" text-anchor=\"middle\">{}</text>",
            HEIGHT - 6.0,
            HtmlEscape(&self.x_label)
        );
        let across = MARGINS[2] + 0.5 * frame.height();
        let _ = write!(
            svg,
            "<text transform=\"translate(13 {across:.0}) rotate(-90)\" text-anchor=\"middle\">{}</text></svg>",
            HtmlEscape(&self.y_label)
        );
        svg
    }

    /// `None` where there is nothing to draw.
    fn axes(&self) -> Option<(FigureAxis, FigureAxis)> {
        let curves = || {
            let models = [&self.before, &self.after].into_iter().flatten();
            models.chain([&self.measured]).flatten().copied()
        };
        let x = FigureAxis::linear("", extent(self.x.iter().copied())?, 6);
        let y = match self.log {
            true => {
                let (low, high) = positive_extent(curves())?;
                FigureAxis::log("", (low.max(high / 10f64.powf(DECADES)) / 1.3, high * 1.3))
            }
            false => FigureAxis::padded("", extent(curves())?, 0.06, 5),
        };
        Some((x, y))
    }
}

/// A mark of an axis without zeros that say nothing: `50`, not `50.0` next to `100`.
fn plain(value: f64) -> String {
    let text = significant(value, 3);
    match text.contains('.') && !text.contains('·') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

/// The rectangle that curves are drawn in.
struct Frame<'a> {
    x: &'a FigureAxis,
    y: &'a FigureAxis,
}

impl Frame<'_> {
    fn left(&self) -> f64 {
        MARGINS[0]
    }

    fn width(&self) -> f64 {
        WIDTH - MARGINS[0] - MARGINS[1]
    }

    fn height(&self) -> f64 {
        HEIGHT - MARGINS[2] - MARGINS[3]
    }

    /// Where a value lies across; outside the frame it lies on its edge.
    fn across(&self, value: f64) -> Option<f64> {
        Some(self.left() + self.width() * self.x.fraction(value)?.clamp(0.0, 1.0))
    }

    fn down(&self, value: f64) -> Option<f64> {
        Some(MARGINS[2] + self.height() * (1.0 - self.y.fraction(value)?.clamp(0.0, 1.0)))
    }

    fn shade(&self, svg: &mut String, range: Option<[f64; 2]>) {
        let ends = range.map(|[from, to]| (self.across(from), self.across(to)));
        if let Some((Some(from), Some(to))) = ends {
            let _ = write!(
                svg,
                "<rect class=\"shade\" x=\"{from:.1}\" y=\"{}\" width=\"{:.1}\" height=\"{}\"/>",
                MARGINS[2],
                (to - from).max(2.0),
                self.height()
            );
        }
    }

    fn grid(&self, svg: &mut String, label: impl Fn(f64) -> String) {
        let (left, top, width, height) = (self.left(), MARGINS[2], self.width(), self.height());
        let (right, bottom) = (left + width, top + height);
        for tick in self.y.ticks.iter().filter(|t| !t.label.is_empty()) {
            let inside = self.y.fraction(tick.at).is_some_and(|f| (0.0..=1.0).contains(&f));
            if let (true, Some(y)) = (inside, self.down(tick.at)) {
                let _ = write!(
                    svg,
                    "<path class=\"grid\" d=\"M{left} {y:.1}H{right}\"/><text x=\"{:.0}\" y=\"{:.1}\" \
                     text-anchor=\"end\">{}</text>",
                    left - 6.0,
                    y + 4.0,
                    HtmlEscape(&label(tick.at))
                );
            }
        }
        for tick in self.x.ticks.iter().filter(|t| !t.label.is_empty()) {
            if let Some(x) = self.across(tick.at) {
                let _ = write!(
                    svg,
                    "<path class=\"grid\" d=\"M{x:.1} {top}V{bottom}\"/><text x=\"{x:.1}\" y=\"{:.0}\" \
                     text-anchor=\"middle\">{}</text>",
                    bottom + 15.0,
                    HtmlEscape(&tick.label)
                );
            }
        }
        let _ = write!(
            svg,
            "<path class=\"frame\" d=\"M{left} {top}V{bottom}H{right}\"/>"
        );
    }

    fn line(&self, svg: &mut String, class: &str, x: &[f64], y: &[f64]) {
        let mut path = String::new();
        let mut pen = 'M';
        for point in thinned(x, y) {
            let place = point.and_then(|(x, y)| Some((self.across(x)?, self.down(y)?)));
            match place {
                Some((x, y)) => {
                    let _ = write!(path, "{pen}{x:.1} {y:.1}");
                    pen = 'L';
                }
                None => pen = 'M',
            }
        }
        let _ = write!(svg, "<path class=\"{class}\" d=\"{path}\"/>");
    }

    fn dots(&self, svg: &mut String, x: &[f64], y: &[f64]) {
        let mut path = String::new();
        for (x, y) in thinned(x, y).into_iter().flatten() {
            if let (Some(x), Some(y)) = (self.across(x), self.down(y)) {
                let _ = write!(path, "M{x:.1} {y:.1}h0");
            }
        }
        let _ = write!(svg, "<path class=\"measured\" d=\"{path}\"/>");
    }
}

/// At most two points a column, its lowest and its highest in the order in which they come; `None`: a gap.
fn thinned(x: &[f64], y: &[f64]) -> Vec<Option<(f64, f64)>> {
    let points: Vec<(f64, f64)> = x.iter().copied().zip(y.iter().copied()).collect();
    let size = points.len().div_ceil(COLUMNS).max(1);
    if size <= 2 {
        let whole = points.into_iter();
        return whole.map(|p| Some(p).filter(|p| p.1.is_finite())).collect();
    }
    let mut kept = Vec::with_capacity(2 * COLUMNS);
    for column in points.chunks(size) {
        let there = || column.iter().enumerate().filter(|(_, p)| p.1.is_finite());
        let lowest = there().min_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let highest = there().max_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let (Some(lowest), Some(highest)) = (lowest, highest) else {
            kept.push(None);
            continue;
        };
        let (first, second) = match lowest.0 <= highest.0 {
            true => (lowest, highest),
            false => (highest, lowest),
        };
        kept.push(Some(*first.1));
        if first.0 != second.0 {
            kept.push(Some(*second.1));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(log: bool) -> Picture {
        let x: Vec<f64> = (0..2000).map(|i| 0.05 * f64::from(i)).collect();
        let peak = |f: f64, at: f64| 1e-6 / ((1.0 - (f / at).powi(2)).abs() + 0.02);
        Picture {
            alt: "<FRF> \"p1\"".into(),
            x_label: "Frequency (Hz)".into(),
            y_label: "Receptance".into(),
            unit: "m/N".into(),
            log,
            measured: x.iter().map(|f| peak(*f, 40.0)).collect(),
            before: Some(x.iter().map(|f| peak(*f, 30.0)).collect()),
            after: Some(x.iter().map(|f| peak(*f, 40.0)).collect()),
            noise: None,
            shaded: Some([28.0, 44.0]),
            x,
        }
    }

    #[test]
    fn it_is_small_whole_and_escaped() {
        for log in [true, false] {
            let svg = picture(log).svg();
            assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>"));
            assert!(svg.contains("&lt;FRF&gt; &quot;p1&quot;") && !svg.contains("<FRF"));
            assert!(svg.len() < 40_000, "{}", svg.len());
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
            for class in ["before", "after", "measured", "shade"] {
                assert_eq!(svg.matches(&format!("class=\"{class}\"")).count(), 1, "{class}");
            }
        }
        assert!(picture(true).svg().contains("µm&#x2f;N"), "ticks bear their unit");
    }

    #[test]
    fn thinning_keeps_every_peak_and_every_gap() {
        let x: Vec<f64> = (0..9000).map(f64::from).collect();
        let mut y = vec![1.0; 9000];
        y[4321] = 7.0;
        y[8000] = -3.0;
        y[100..300].fill(f64::NAN);
        let kept = thinned(&x, &y);
        assert!(kept.len() <= 2 * COLUMNS);
        assert!(kept.contains(&Some((4321.0, 7.0))) && kept.contains(&Some((8000.0, -3.0))));
        assert!(kept.contains(&None));
        assert!(kept.iter().flatten().map(|p| p.0).is_sorted());
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        assert_eq!(Picture::default().svg(), "");
        let dead = Picture {
            x: vec![1.0, 2.0],
            measured: vec![0.0, 0.0],
            log: true,
            ..Picture::default()
        };
        assert_eq!(dead.svg(), "", "a log axis has no zero");
    }
}
