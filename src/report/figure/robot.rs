//! The robot as a stick figure, one small picture a posture.

use super::canvas::{Marker, WIDTH, nothing_to_draw, paint};
use super::mode_shapes::{
    COLUMNS, HEIGHT, MOVED, PictureLayout, StickPicture, base_axes, picture_title, project,
};
use super::panel::FigureHeader;
use super::style;
use crate::Result;

/// Postures drawn.
const PICTURES: usize = 12;

#[derive(Debug, Clone, Default)]
pub struct RobotFigure {
    pub title: String,
    /// Name of the posture; base, joints, flange, tool centre point, m.
    pub postures: Vec<(String, Vec<[f64; 3]>)>,
}

impl RobotFigure {
    /// # Errors
    /// No posture with finite positions.
    pub fn png(&self) -> Result<Vec<u8>> {
        let drawable = self
            .postures
            .iter()
            .filter(|(_, chain)| chain.len() >= 2 && chain.iter().flatten().all(|v| v.is_finite()));
        let pictures: Vec<StickPicture> = drawable
            .take(PICTURES)
            .map(|(name, chain)| StickPicture {
                title: name.clone(),
                chain: chain.clone(),
                chain_moved: vec![[0.0; 3]; chain.len()],
                points: Vec::new(),
            })
            .collect();
        if pictures.is_empty() {
            return Err(nothing_to_draw(&self.title, "no posture"));
        }
        let (left, right) = (30.0, f64::from(WIDTH) - 30.0);
        let header = FigureHeader::new(&self.title, &[], left, right);
        let columns = COLUMNS.min(pictures.len());
        let size = ((right - left) / columns as f64, HEIGHT);
        let height = header.bottom() + HEIGHT * pictures.len().div_ceil(columns) as f64 + 16.0;
        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            for (k, picture) in pictures.iter().enumerate() {
                let at = (
                    left + size.0 * (k % columns) as f64,
                    header.bottom() + HEIGHT * (k / columns) as f64,
                );
                let joints = PictureLayout::new(picture, at, size).chain(0.0);
                canvas.polyline(&joints, MOVED);
                for joint in joints {
                    canvas.marker(joint, Marker::Disc, 4.5, style::INK);
                }
                picture_title(canvas, picture, at, size);
                base_axes(canvas, at, size);
            }
        })
    }
}

/// Side of the picture of a posture, in units of its own.
const SIDE: f64 = 200.0;

/// One posture as an SVG element to stand in a page, with its shadow on the floor and the directions of the base; colours by
/// the classes `floor`, `shadow`, `arm`, `tool`, `joint` and `axes`. `None` without two finite positions. `chain`: base,
/// joints, flange, tool centre point, m.
pub fn posture_svg(name: &str, chain: &[[f64; 3]]) -> Option<String> {
    if chain.len() < 2 || !chain.iter().flatten().all(|v| v.is_finite()) {
        return None;
    }
    let below = |k: usize| chain.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
    let above = |k: usize| chain.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
    let floor = below(2).min(chain[0][2]);
    let margin = 0.12 * (0..3).map(|k| above(k) - below(k)).fold(1e-6, f64::max);
    let (x, y) = (
        [below(0) - margin, above(0) + margin],
        [below(1) - margin, above(1) + margin],
    );
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| project([x[i], y[j], floor]));
    let arm: Vec<(f64, f64)> = chain.iter().map(|p| project(*p)).collect();
    let shadow: Vec<(f64, f64)> = chain.iter().map(|p| project([p[0], p[1], floor])).collect();
    let all = || corners.iter().chain(&arm);
    let bounds = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = (
            all().map(of).fold(f64::INFINITY, f64::min),
            all().map(of).fold(f64::NEG_INFINITY, f64::max),
        );
        (0.5 * (low + high), high - low)
    };
    let ((middle_x, width), (middle_y, height)) = (bounds(|p| p.0), bounds(|p| p.1));
    let scale = (SIDE - 16.0) / width.max(height).max(1e-9);
    let place = |(x, y): &(f64, f64)| {
        (
            0.5 * SIDE + scale * (x - middle_x),
            0.5 * SIDE - scale * (y - middle_y),
        )
    };
    let points = |line: &[(f64, f64)]| {
        let pairs: Vec<String> = line
            .iter()
            .map(place)
            .map(|(x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        pairs.join(" ")
    };
    let title = name
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;");
    let (bones, tool) = (&arm[..arm.len() - 1], &arm[arm.len() - 2..]);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"posture\" viewBox=\"0 0 {SIDE} {SIDE}\" role=\"img\" \
         aria-label=\"The robot in posture {title}\"><polygon class=\"floor\" points=\"{}\"/>\
         <polyline class=\"shadow\" fill=\"none\" points=\"{}\"/>\
         <polyline class=\"arm\" fill=\"none\" points=\"{}\"/><polyline class=\"tool\" fill=\"none\" points=\"{}\"/>",
        points(&corners),
        points(&shadow),
        points(bones),
        points(tool)
    );
    for (x, y) in bones.iter().map(place) {
        svg += &format!("<circle class=\"joint\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\"/>");
    }
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let mut unit = [0.0; 3];
        unit[k] = 18.0;
        let (dx, dy) = project(unit);
        let (x, y) = (28.0, SIDE - 20.0);
        svg += &format!(
            "<path class=\"axes\" d=\"M{x},{y}l{dx:.1},{:.1}\"/><text class=\"axes\" x=\"{:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\" font-size=\"11\">{axis}</text>",
            -dy,
            x + 1.45 * dx,
            y - 1.45 * dy + 4.0
        );
    }
    Some(svg + "</svg>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_posture_lies_within_its_picture_and_its_name_is_only_text() {
        let chain = [
            [0.0; 3],
            [0.3, 0.0, 0.8],
            [0.4, 0.2, 1.9],
            [1.6, 0.9, 1.7],
            [1.6, 0.9, 1.2],
        ];
        let svg = posture_svg("p<1>\"", &chain).unwrap();
        assert!(svg.contains("posture p&lt;1>&quot;\""), "{svg}");
        assert_eq!(svg.matches("class=\"joint\"").count(), 4);
        for list in svg.split(" points=\"").skip(1) {
            for pair in list.split('"').next().unwrap().split(' ') {
                let (x, y) = pair.split_once(',').unwrap();
                for value in [x, y] {
                    let value: f64 = value.parse().unwrap();
                    assert!((0.0..=SIDE).contains(&value), "{pair}");
                }
            }
        }
        assert!(posture_svg("p1", &[[0.0; 3], [f64::NAN, 0.0, 0.0]]).is_none());
        assert!(posture_svg("p1", &[]).is_none());
    }
}
