//! One figure in the terms of plotly.js, and the traces, axes and layouts that all of them are made of.

use serde_json::{Value, json};

use crate::report::figure::canvas::{Color, Marker, Stroke};
use crate::report::figure::style;

/// A figure as plotly.js takes it.
#[derive(Debug, Clone, Default)]
pub struct Plot {
    /// Shown above it, as plain text.
    pub(super) title: String,
    pub(super) height_px: f64,
    /// Traces.
    pub(super) data: Vec<Value>,
    pub(super) layout: Value,
    /// What a click leads to; null where nothing.
    pub(super) links: Value,
    /// What the first trace is for each model of the page's FRFs; null where it has nothing to do with them.
    pub(super) stages: Value,
    /// What is chosen between, such as `Cut`, and the name of each figure that may take this one's place.
    pub(super) choice: Option<(&'static str, Vec<(String, Plot)>)>,
}

impl Plot {
    /// A figure whose place others can take, chosen by name; the first of them is shown first.
    pub fn one_of(what: &'static str, plots: Vec<(String, Plot)>) -> Self {
        let first = plots.first().map_or_else(Plot::default, |(_, plot)| plot.clone());
        Plot {
            choice: Some((what, plots)),
            ..first
        }
    }

    /// As it stands above the figure at first.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// Room that it takes, CSS pixels.
    pub fn height_px(&self) -> f64 {
        self.height_px
    }

    /// Whether it follows the model that is chosen in the page's explorer.
    pub fn follows_models(&self) -> bool {
        self.stages.is_array()
    }

    /// Whether others can be chosen in its place.
    pub fn offers_choice(&self) -> bool {
        self.choice.is_some()
    }

    /// For the page's script.
    pub(crate) fn value(&self) -> Value {
        json!({
            "title": self.title,
            "height": self.height_px.round(),
            "data": self.data,
            "layout": self.layout,
            "links": self.links,
            "stages": self.stages,
            "choice": self.choice.as_ref().map(|(what, plots)| {
                let plots = plots.iter().map(|(name, plot)| json!({ "name": name, "plot": plot.value() }));
                json!({ "what": what, "plots": plots.collect::<Vec<_>>() })
            }),
        })
    }
}

/// A name as plotly.js shows it: it knows some HTML, so that nothing of a name may look like a tag or an entity.
pub(super) fn text(name: &str) -> String {
    let mut text = String::with_capacity(name.len());
    for c in name.chars() {
        match c {
            '&' => text += "&amp;",
            '<' => text += "&lt;",
            '>' => text += "&gt;",
            // Of a hover template.
            '%' => text += "&#37;",
            c if c.is_control() => text.push(' '),
            c => text.push(c),
        }
    }
    text
}

/// Five significant digits; null where there is no number.
pub(super) fn number(value: f64) -> Value {
    if !value.is_finite() {
        return Value::Null;
    }
    let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    // A whole number needs no point.
    match rounded.fract() == 0.0 && rounded.abs() < 1e9 {
        true => json!(rounded as i64),
        false => json!(rounded),
    }
}

pub(super) fn numbers(values: impl IntoIterator<Item = f64>) -> Value {
    values.into_iter().map(number).collect()
}

pub(super) fn css(color: Color) -> String {
    format!("#{:02x}{:02x}{:02x}", color.0, color.1, color.2)
}

/// `opacity` 0 … 1.
pub(super) fn css_with(color: Color, opacity: f64) -> String {
    format!("rgba({},{},{},{opacity})", color.0, color.1, color.2)
}

/// The `line` of a trace.
pub(super) fn line(stroke: Stroke) -> Value {
    let mut line = json!({ "color": css(stroke.color), "width": stroke.width });
    if !stroke.dash.is_empty() {
        let lengths: Vec<String> = stroke.dash.iter().map(|d| format!("{d}px")).collect();
        line["dash"] = json!(lengths.join(","));
    }
    line
}

pub(super) fn symbol(marker: Marker) -> &'static str {
    match marker {
        Marker::Disc => "circle",
        Marker::Ring => "circle-open",
        Marker::Square => "square",
        Marker::Diamond => "diamond",
        Marker::Triangle => "triangle-up",
        Marker::Cross => "x-thin",
    }
}

/// The `marker` of a trace, with a white edge.
pub(super) fn sign(marker: Marker, size: f64, color: Color) -> Value {
    // A thin cross is nothing but its edge.
    let edge = match marker {
        Marker::Cross => json!({ "color": css(color), "width": 2.5 }),
        _ => json!({ "color": "#fff", "width": 1 }),
    };
    json!({ "symbol": symbol(marker), "size": size, "color": css(color), "line": edge })
}

/// An axis in the look of the static figures; `title` is no name out of a file, or has been through [`text`].
pub(super) fn axis(title: &str) -> Value {
    json!({
        "title": { "text": title, "standoff": 8 },
        "showline": true,
        "mirror": true,
        "linecolor": "#3c4046",
        "ticks": "outside",
        "ticklen": 4,
        "gridcolor": "#dee1e5",
        "zeroline": false,
        "automargin": true,
    })
}

/// `axis` with more properties or others.
pub(super) fn with(mut axis: Value, more: Value) -> Value {
    if let (Some(axis), Value::Object(more)) = (axis.as_object_mut(), more) {
        axis.extend(more);
    }
    axis
}

/// What all layouts begin with: the legend above the frame, all of it in the page's letters.
pub(super) fn layout() -> Value {
    json!({
        "font": { "family": "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', Arial, sans-serif", "size": 13,
                  "color": css(style::INK) },
        "margin": { "l": 64, "r": 24, "t": 16, "b": 48 },
        "legend": { "orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom" },
        "hovermode": "closest",
        "hoverlabel": { "align": "left", "namelength": -1 },
        "plot_bgcolor": "#fff",
        "paper_bgcolor": "#fff",
    })
}

/// Name of the axis of panel `i` in a layout: `xaxis`, `xaxis2`, …
pub(super) fn axis_key(letter: char, i: usize) -> String {
    format!("{letter}axis{}", suffix(i))
}

/// Name of the axis of panel `i` in a trace: `x`, `x2`, …
pub(super) fn axis_name(letter: char, i: usize) -> String {
    format!("{letter}{}", suffix(i))
}

fn suffix(i: usize) -> String {
    match i {
        0 => String::new(),
        i => (i + 1).to_string(),
    }
}

/// A layout of panels above each other with one x axis; `y`: the axis of each, topmost first, and its share of the height.
pub(super) fn stacked(x: Value, y: Vec<(Value, f64)>) -> Value {
    let mut layout = layout();
    let gap = 0.05;
    let shares: f64 = y.iter().map(|(_, share)| share).sum();
    let room = 1.0 - gap * y.len().saturating_sub(1) as f64;
    let mut top = 1.0;
    let last = y.len().saturating_sub(1);
    for (i, (axis, share)) in y.into_iter().enumerate() {
        let bottom = (top - room * share / shares).max(0.0);
        layout[axis_key('y', i)] = with(axis, json!({ "domain": [bottom, top] }));
        top = bottom - gap;
    }
    layout["xaxis"] = with(x, json!({ "anchor": axis_name('y', last), "mirror": "all" }));
    layout
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_no_markup_and_numbers_keep_five_digits() {
        assert_eq!(text("<b>&amp;</b> 5 %"), "&lt;b&gt;&amp;amp;&lt;/b&gt; 5 &#37;");
        assert_eq!(number(1.234567e-7).to_string(), "1.2346e-7");
        assert_eq!(number(1200.0).to_string(), "1200");
        assert_eq!(number(f64::NAN), Value::Null);
        assert_eq!(numbers([1.5, f64::INFINITY]).to_string(), "[1.5,null]");
    }

    #[test]
    fn panels_fill_the_height_from_the_top() {
        let axes = vec![(axis("a"), 2.0), (axis("b"), 1.0)];
        let layout = stacked(axis("x"), axes);
        let domain = |key: &str, i: usize| layout[key]["domain"][i].as_f64().unwrap();
        assert_eq!(domain("yaxis", 1), 1.0);
        assert!(domain("yaxis2", 0).abs() < 1e-12);
        assert!((domain("yaxis", 0) - domain("yaxis2", 1) - 0.05).abs() < 1e-12);
        assert_eq!(layout["xaxis"]["anchor"], "y2");
    }
}
