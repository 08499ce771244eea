//! The sheet figures are drawn on: a plotters bitmap three times as fine as the image, averaged down.
//!
//! All coordinates and sizes are pixels of the finished image, y downwards.

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::OnceLock;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontTransform, register_font};

use crate::{Error, Result};

/// Linear oversampling: plotters draws on whole pixels, so smooth slopes and text come from averaging 3 × 3 of them.
const OVERSAMPLING: usize = 3;
const FONT: &str = "DejaVu Sans";
/// plotters scales a font by ascent − descent; DejaVu's is 1.164 em.
const LINE_PER_EM: f64 = 1.164;
/// Height of a capital letter in em.
const CAP_HEIGHT: f64 = 0.729;

/// All figures are this wide, pixels.
pub(crate) const WIDTH: u32 = 1200;

/// The error of a figure with nothing left to show.
pub(crate) fn nothing_to_draw(title: &str, what: &str) -> Error {
    Error::computation(format!("figure \"{title}\" has nothing to draw: {what}"))
}

pub type CanvasPoint = (f64, f64);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Color(pub u8, pub u8, pub u8);

impl Color {
    fn fill(self, opacity: f64) -> ShapeStyle {
        let color = RGBAColor(self.0, self.1, self.2, opacity);
        ShapeStyle {
            color,
            filled: true,
            stroke_width: 1,
        }
    }

    /// Relative luminance 0 … 1 (Rec. 709 weights on the encoded values: enough to choose black or white on top).
    pub fn lightness(self) -> f64 {
        (0.2126 * f64::from(self.0) + 0.7152 * f64::from(self.1) + 0.0722 * f64::from(self.2)) / 255.0
    }
}

/// How a line looks. `dash` holds alternating lengths of ink and gap in pixels; empty is a solid line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    pub color: Color,
    pub width: f64,
    pub dash: &'static [f64],
}

impl Stroke {
    pub const fn solid(color: Color, width: f64) -> Self {
        Stroke {
            color,
            width,
            dash: &[],
        }
    }

    pub const fn dashed(color: Color, width: f64, dash: &'static [f64]) -> Self {
        Stroke { color, width, dash }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    Disc,
    Ring,
    Square,
    Diamond,
    Triangle,
    Cross,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    Left,
    Center,
    Right,
}

/// How a text looks; `align` is along the reading direction, vertically the capitals are centred on the point.
#[derive(Debug, Clone, Copy)]
pub struct Lettering {
    pub em: f64,
    pub bold: bool,
    pub color: Color,
    pub align: Align,
    /// Reads from bottom to top.
    pub upright: bool,
}

impl Lettering {
    pub const fn new(em: f64, color: Color) -> Self {
        Lettering {
            em,
            bold: false,
            color,
            align: Align::Left,
            upright: false,
        }
    }

    pub const fn bold(self) -> Self {
        Lettering { bold: true, ..self }
    }

    pub const fn align(self, align: Align) -> Self {
        Lettering { align, ..self }
    }

    pub const fn upright(self) -> Self {
        Lettering {
            upright: true,
            ..self
        }
    }

    pub const fn color(self, color: Color) -> Self {
        Lettering { color, ..self }
    }

    fn font(&self) -> FontDesc<'static> {
        let style = if self.bold {
            FontStyle::Bold
        } else {
            FontStyle::Normal
        };
        let size = self.em * LINE_PER_EM * OVERSAMPLING as f64;
        let font = FontDesc::new(FontFamily::Name(FONT), size, style);
        match self.upright {
            true => font.transform(FontTransform::Rotate270),
            false => font,
        }
    }

    /// Width of `text` in pixels.
    pub fn width(&self, text: &str) -> f64 {
        if fonts().is_err() {
            return 0.0;
        }
        let horizontal = Lettering {
            upright: false,
            ..*self
        };
        horizontal
            .font()
            .box_size(text)
            .map_or(0.0, |(width, _)| f64::from(width) / OVERSAMPLING as f64)
    }

    /// `text` itself, or as much of its beginning as fits into `width` with an ellipsis.
    pub fn fit(&self, text: &str, width: f64) -> String {
        // A file's name may be of any length; nothing longer than this fits anywhere.
        const LONGEST: usize = 400;
        let clean: String = text
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .take(LONGEST)
            .collect();
        if self.width(&clean) <= width && clean.chars().count() == text.chars().count() {
            return clean;
        }
        let letters: Vec<char> = clean.chars().collect();
        let shortened = |count: usize| {
            letters
                .iter()
                .take(count)
                .collect::<String>()
                .trim_end()
                .to_owned()
                + "…"
        };
        // Largest count that fits, by bisection: the width grows with every letter.
        let (mut fits, mut too_long) = (0, letters.len() + 1);
        while too_long - fits > 1 {
            let middle = (fits + too_long) / 2;
            if self.width(&shortened(middle)) <= width {
                fits = middle
            } else {
                too_long = middle
            }
        }
        shortened(fits)
    }

    /// `text` in lines of at most `width`, broken at spaces; the last of `max_lines` is shortened if need be.
    pub fn wrap(&self, text: &str, width: f64, max_lines: usize) -> Vec<String> {
        let mut lines: Vec<String> = vec![];
        let mut words = text.split_whitespace().peekable();
        while let Some(word) = words.next() {
            let mut line = word.to_owned();
            let last = lines.len() + 1 >= max_lines;
            while let Some(next) = words.peek() {
                let longer = format!("{line} {next}");
                if !last && self.width(&longer) > width {
                    break;
                }
                line = longer;
                words.next();
            }
            lines.push(self.fit(&line, width));
        }
        lines
    }
}

/// Registers the embedded fonts with plotters, once a process.
fn fonts() -> Result<()> {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    let ok = *REGISTERED.get_or_init(|| {
        register_font(
            FONT,
            FontStyle::Normal,
            include_bytes!("../../fonts/DejaVuSans.ttf"),
        )
        .is_ok()
            && register_font(
                FONT,
                FontStyle::Bold,
                include_bytes!("../../fonts/DejaVuSans-Bold.ttf"),
            )
            .is_ok()
    });
    match ok {
        true => Ok(()),
        false => Err(Error::computation("the embedded font cannot be read")),
    }
}

/// A white sheet of `width` × `height` pixels, painted and encoded as PNG.
///
/// # Errors
/// What the drawing library or the PNG encoder refuses.
pub fn paint(width: u32, height: u32, draw: impl FnOnce(&Canvas)) -> Result<Vec<u8>> {
    fonts()?;
    let fine = (width * OVERSAMPLING as u32, height * OVERSAMPLING as u32);
    let mut buffer = vec![255u8; fine.0 as usize * fine.1 as usize * 3];
    {
        let area = BitMapBackend::with_buffer(&mut buffer, fine).into_drawing_area();
        let canvas = Canvas {
            area,
            problem: RefCell::new(None),
        };
        draw(&canvas);
        canvas.keep(canvas.area.present());
        if let Some(problem) = canvas.problem.into_inner() {
            return Err(Error::computation(format!("drawing failed: {problem}")));
        }
    }
    encode(width, height, &average(&buffer, width as usize))
}

fn average(fine: &[u8], width: usize) -> Vec<u8> {
    let stride = width * OVERSAMPLING * 3;
    let mut coarse = Vec::with_capacity(fine.len() / (OVERSAMPLING * OVERSAMPLING));
    let mut sums = vec![0u16; width * 3];
    for rows in fine.chunks_exact(stride * OVERSAMPLING) {
        sums.fill(0);
        for row in rows.chunks_exact(stride) {
            for (sum, pixels) in sums.chunks_exact_mut(3).zip(row.chunks_exact(OVERSAMPLING * 3)) {
                for pixel in pixels.chunks_exact(3) {
                    for (sum, value) in sum.iter_mut().zip(pixel) {
                        *sum += u16::from(*value);
                    }
                }
            }
        }
        let cells = (OVERSAMPLING * OVERSAMPLING) as u16;
        coarse.extend(sums.iter().map(|sum| ((sum + cells / 2) / cells) as u8));
    }
    coarse
}

/// Colours nearer to each other than this (root of the sum of squares, of 255) are one: nobody sees the difference, and the soft
/// edges of lines and letters, which have the most shades, take a quarter less room.
const ALIKE: u32 = 18;

/// The commonest colours, at most 256 and none [`ALIKE`] but those of areas, and for each pixel the nearest of them. What is drawn has few
/// colours; the rare ones are the edges of lines.
fn indexed(rgb: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let mut counts: HashMap<[u8; 3], usize> = HashMap::new();
    for (color, length) in runs(rgb) {
        *counts.entry(color).or_default() += length;
    }
    let mut colors: Vec<([u8; 3], usize)> = counts.into_iter().collect();
    colors.sort_unstable_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let distance = |a: &[u8; 3], b: &[u8; 3]| -> u32 {
        let steps = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2));
        steps.sum()
    };
    let mut palette: Vec<[u8; 3]> = Vec::new();
    for (color, pixels) in &colors {
        // What covers more than edges do, such as the shade behind a panel, stays as it is.
        let area = 500 * pixels > rgb.len() / 3;
        if palette.len() < 256 && (area || palette.iter().all(|p| distance(color, p) > ALIKE.pow(2))) {
            palette.push(*color);
        }
    }
    let nearest = |color: &[u8; 3]| {
        let places = (0..=255u8).zip(&palette);
        places
            .min_by_key(|(_, p)| distance(color, p))
            .map_or(0, |(i, _)| i)
    };
    let places: HashMap<[u8; 3], u8> = colors.iter().map(|(c, _)| (*c, nearest(c))).collect();
    let mut indices = Vec::with_capacity(rgb.len() / 3);
    for (color, length) in runs(rgb) {
        indices.resize(indices.len() + length, places[&color]);
    }
    (palette.concat(), indices)
}

/// Neighbouring pixels of one colour, and how many they are.
fn runs(rgb: &[u8]) -> impl Iterator<Item = ([u8; 3], usize)> {
    let (pixels, _) = rgb.as_chunks::<3>();
    pixels.chunk_by(|a, b| a == b).map(|run| (run[0], run.len()))
}

fn encode(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>> {
    let failed = |error: png::EncodingError| Error::computation(format!("PNG: {error}"));
    let mut bytes = vec![];
    let (palette, indices) = indexed(rgb);
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    // A third of the size of true colours.
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    // Flat areas repeat as they stand; differences between neighbours, the crate's choice, are a quarter larger.
    encoder.set_filter(png::FilterType::NoFilter);
    encoder.set_compression(png::Compression::Best);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&indices).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// Drawing keeps going after a failure and remembers the first one, so that figures read as a list of what is drawn.
pub struct Canvas<'a> {
    area: DrawingArea<BitMapBackend<'a>, Shift>,
    problem: RefCell<Option<String>>,
}

impl Canvas<'_> {
    fn keep<E: std::fmt::Display>(&self, outcome: std::result::Result<(), E>) {
        if let Err(error) = outcome {
            self.problem.borrow_mut().get_or_insert_with(|| error.to_string());
        }
    }

    /// Filled rectangle between two corners.
    pub fn rect(&self, a: CanvasPoint, b: CanvasPoint, color: Color, opacity: f64) {
        let (a, b) = (device(a), device(b));
        self.keep(self.area.draw(&Rectangle::new([a, b], color.fill(opacity))));
    }

    /// Filled convex polygon.
    pub fn polygon(&self, corners: &[CanvasPoint], color: Color, opacity: f64) {
        let corners: Vec<_> = corners.iter().copied().map(device).collect();
        self.keep(self.area.draw(&Polygon::new(corners, color.fill(opacity))));
    }

    pub fn line(&self, a: CanvasPoint, b: CanvasPoint, stroke: Stroke) {
        self.polyline(&[a, b], stroke);
    }

    /// Connected straight lines, dashes running on around the corners.
    pub fn polyline(&self, points: &[CanvasPoint], stroke: Stroke) {
        let period: f64 = stroke.dash.iter().sum();
        if stroke.dash.is_empty() || period <= 0.0 {
            for pair in points.windows(2) {
                if let [a, b] = *pair {
                    self.segment(a, b, stroke);
                }
            }
            return;
        }
        let (mut item, mut left, mut ink) = (0, stroke.dash.first().copied().unwrap_or(period), true);
        for pair in points.windows(2) {
            let [mut a, b] = *pair else { continue };
            loop {
                let length = (b.0 - a.0).hypot(b.1 - a.1);
                if !length.is_finite() {
                    break;
                }
                let step = left.min(length);
                let end = match length > 0.0 {
                    true => (
                        a.0 + (b.0 - a.0) * step / length,
                        a.1 + (b.1 - a.1) * step / length,
                    ),
                    false => b,
                };
                if ink && step > 0.0 {
                    self.segment(a, end, stroke);
                }
                if length < left {
                    left -= length;
                    break;
                }
                a = end;
                item = (item + 1) % stroke.dash.len();
                left = stroke.dash.get(item).copied().unwrap_or(period).max(0.5);
                ink = !ink;
            }
        }
    }

    /// A straight piece with round ends, as a polygon: plotters' own thick paths leave holes where a path folds back.
    fn segment(&self, a: CanvasPoint, b: CanvasPoint, stroke: Stroke) {
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        let half = 0.5 * stroke.width;
        if a.0 == b.0 || a.1 == b.1 {
            // Axis-parallel lines stay crisp as rectangles.
            let (dx, dy) = if a.0 == b.0 { (half, 0.0) } else { (0.0, half) };
            let low = (a.0.min(b.0) - dx, a.1.min(b.1) - dy);
            let high = (a.0.max(b.0) + dx, a.1.max(b.1) + dy);
            self.rect(low, high, stroke.color, 1.0);
        } else if length > 0.0 {
            let (nx, ny) = (-(b.1 - a.1) / length * half, (b.0 - a.0) / length * half);
            let corners = [
                (a.0 + nx, a.1 + ny),
                (b.0 + nx, b.1 + ny),
                (b.0 - nx, b.1 - ny),
                (a.0 - nx, a.1 - ny),
            ];
            self.polygon(&corners, stroke.color, 1.0);
        }
        let joint = (half * OVERSAMPLING as f64).round() as i32 - 1;
        if stroke.dash.is_empty() && joint >= 1 {
            for end in [a, b] {
                self.keep(
                    self.area
                        .draw(&Circle::new(device(end), joint, stroke.color.fill(1.0))),
                );
            }
        }
    }

    /// A sign of about `size` pixels across.
    pub fn marker(&self, at: CanvasPoint, marker: Marker, size: f64, color: Color) {
        let (x, y) = at;
        let r = 0.5 * size;
        let disc = |radius: f64, color: Color| {
            let radius = (radius * OVERSAMPLING as f64).round().max(1.0) as i32;
            self.keep(self.area.draw(&Circle::new(device(at), radius, color.fill(1.0))));
        };
        match marker {
            Marker::Disc => disc(r, color),
            Marker::Ring => {
                disc(r, color);
                disc(r - (0.22 * size).max(1.0), Color(255, 255, 255));
            }
            Marker::Square => self.rect((x - r * 0.9, y - r * 0.9), (x + r * 0.9, y + r * 0.9), color, 1.0),
            Marker::Diamond => {
                let r = r * 1.2;
                self.polygon(&[(x - r, y), (x, y - r), (x + r, y), (x, y + r)], color, 1.0);
            }
            Marker::Triangle => {
                let r = r * 1.15;
                self.polygon(
                    &[(x - r, y + 0.8 * r), (x, y - r), (x + r, y + 0.8 * r)],
                    color,
                    1.0,
                );
            }
            Marker::Cross => {
                let stroke = Stroke::solid(color, (0.22 * size).max(1.5));
                self.line((x - r, y - r), (x + r, y + r), stroke);
                self.line((x - r, y + r), (x + r, y - r), stroke);
            }
        }
    }

    pub fn text(&self, at: CanvasPoint, text: &str, lettering: Lettering) {
        let text: String = text
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect();
        if text.trim().is_empty() {
            return;
        }
        let back = lettering.width(&text)
            * match lettering.align {
                Align::Left => 0.0,
                Align::Center => 0.5,
                Align::Right => 1.0,
            };
        // plotters puts the baseline half a font size below the point it is given.
        let down = 0.5 * CAP_HEIGHT * lettering.em - 0.5 * LINE_PER_EM * lettering.em;
        let origin = match lettering.upright {
            false => (at.0 - back, at.1 + down),
            true => (at.0 + down, at.1 + back),
        };
        let color = RGBColor(lettering.color.0, lettering.color.1, lettering.color.2);
        let style = TextStyle::from(lettering.font())
            .color(&color)
            .pos(Pos::new(HPos::Left, VPos::Top));
        self.keep(self.area.draw_text(&text, &style, device(origin)));
    }
}

/// Whole pixels of the fine bitmap; far outside is as good as farther outside.
fn device(point: CanvasPoint) -> (i32, i32) {
    let place = |value: f64| {
        let value = value * OVERSAMPLING as f64;
        if value.is_finite() {
            value.clamp(-1e5, 1e5).round() as i32
        } else {
            -100_000
        }
    };
    (place(point.0), place(point.1))
}
