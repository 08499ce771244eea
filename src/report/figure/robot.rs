//! The robot as a stick figure, one small picture a posture.

use super::WIDTH;
use super::canvas::{Marker, paint};
use super::mode_shapes::{COLUMNS, HEIGHT, Layout, MOVED, StickPicture, base_axes, picture_title};
use super::panel::Header;
use super::{nothing_to_draw, style};
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
        let header = Header::new(&self.title, &[], left, right);
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
                let joints = Layout::new(picture, at, size).chain(0.0);
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
