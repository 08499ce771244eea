//! Which FRFs a mistake concerns.

use std::sync::Arc;

use crate::data::{Axis, Point};
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// A selection of FRFs: those for which every given part agrees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrfGroup {
    /// Index into the campaign's postures.
    pub posture: Option<usize>,
    /// Index into the campaign's points.
    pub response_point: Option<usize>,
    /// Axis of the response.
    pub response_axis: Option<Axis>,
    /// Axis of the hit.
    pub reference_axis: Option<Axis>,
}

impl FrfGroup {
    /// Every FRF.
    pub const ALL: FrfGroup = FrfGroup {
        posture: None,
        response_point: None,
        response_axis: None,
        reference_axis: None,
    };

    /// Whether an FRF is one of the group.
    pub fn holds(&self, frf: &FrfDatum) -> bool {
        self.posture.is_none_or(|p| p == frf.posture)
            && self.response_point.is_none_or(|p| p == frf.response.point)
            && self.response_axis.is_none_or(|a| a == frf.response.axis)
            && self.reference_axis.is_none_or(|a| a == frf.reference.axis)
    }

    /// The data with a change (of an FRF, measured at these frequencies, Hz) made to every FRF of the group.
    pub fn changed(&self, data: &FrfData, change: impl Fn(&[f64], &mut FrfDatum)) -> FrfData {
        let mut data = data.clone();
        for block in &mut data.blocks {
            let block = Arc::make_mut(block);
            for frf in block.frfs.iter_mut().filter(|f| self.holds(f)) {
                change(&block.frequency_hz, frf);
            }
        }
        data
    }

    /// Whether every FRF of `other` is one of this group.
    pub fn contains(&self, other: &FrfGroup) -> bool {
        fn part<T: PartialEq>(own: Option<T>, other: Option<T>) -> bool {
            own.is_none() || own == other
        }
        part(self.posture, other.posture)
            && part(self.response_point, other.response_point)
            && part(self.response_axis, other.response_axis)
            && part(self.reference_axis, other.reference_axis)
    }

    /// `all files`, `posture p3, response X`.
    pub fn label(&self, data: &FrfData, points: &[Point]) -> String {
        let mut parts = Vec::new();
        if let Some(p) = self.posture {
            parts.push(format!(
                "posture {}",
                data.posture_ids.get(p).map_or("?", |id| id)
            ));
        }
        if let Some(p) = self.response_point {
            parts.push(format!("response node {}", points.get(p).map_or(0, |p| p.node)));
        }
        if let Some(axis) = self.response_axis {
            parts.push(format!("response {}", axis.letter()));
        }
        if let Some(axis) = self.reference_axis {
            parts.push(format!("hits along {}", axis.letter()));
        }
        match parts.is_empty() {
            true => "all files".into(),
            false => parts.join(", "),
        }
    }

    /// All files, each posture.
    pub fn postures(data: &FrfData) -> Vec<FrfGroup> {
        let mut groups = vec![FrfGroup::ALL];
        let postures = data.measured_postures();
        if postures.len() > 1 {
            groups.extend(postures.iter().map(|&p| FrfGroup {
                posture: Some(p),
                ..FrfGroup::ALL
            }));
        }
        groups
    }

    /// All files, each posture, each channel, and each channel at each posture; each selection of FRFs once.
    pub fn channels(data: &FrfData) -> Vec<FrfGroup> {
        let axes = || Axis::ALL.into_iter().map(Some);
        let mut parts = vec![FrfGroup::ALL];
        parts.extend(axes().map(|response_axis| FrfGroup {
            response_axis,
            ..FrfGroup::ALL
        }));
        parts.extend(axes().map(|reference_axis| FrfGroup {
            reference_axis,
            ..FrfGroup::ALL
        }));
        let points = data.response_points();
        parts.extend(points.iter().map(|&p| FrfGroup {
            response_point: Some(p),
            ..FrfGroup::ALL
        }));
        for &p in &points {
            parts.extend(axes().map(|response_axis| FrfGroup {
                response_point: Some(p),
                response_axis,
                ..FrfGroup::ALL
            }));
        }
        let mut groups = Vec::new();
        for posture in Self::postures(data) {
            groups.extend(parts.iter().map(|part| FrfGroup {
                posture: posture.posture,
                ..*part
            }));
        }
        distinct(groups, data)
    }
}

/// Groups that hold something, each selection of FRFs once: under the first name for it.
fn distinct(groups: Vec<FrfGroup>, data: &FrfData) -> Vec<FrfGroup> {
    let mut seen: Vec<Vec<bool>> = Vec::new();
    groups
        .into_iter()
        .filter(|group| {
            let members: Vec<bool> = data.frfs().map(|(_, f)| group.holds(f)).collect();
            let new = members.contains(&true) && !seen.contains(&members);
            if new {
                seen.push(members);
            }
            new
        })
        .collect()
}
