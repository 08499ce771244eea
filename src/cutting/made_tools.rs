//! Tools and cuts for tests.

use crate::cutting::waveform::MillingCut;
use crate::data::{Immersion, Tool, ToolKind};

pub fn drill() -> Tool {
    Tool {
        kind: ToolKind::Drill,
        diameter_mm: 9.5,
        teeth: 2,
        helix_deg: 30.0,
        corner_radius_mm: 0.0,
        lead_angle_deg: 90.0,
        half_point_angle_deg: Some(67.5),
        web_thickness_mm: Some(1.425),
        chisel_edge_angle_deg: 125.0,
        each_tooth: Vec::new(),
    }
}

/// Of 12 mm and two teeth.
pub fn endmill(corner_radius_mm: f64, lead_angle_deg: f64) -> Tool {
    Tool {
        kind: ToolKind::Endmill,
        diameter_mm: 12.0,
        teeth: 2,
        helix_deg: 30.0,
        corner_radius_mm,
        lead_angle_deg,
        half_point_angle_deg: None,
        web_thickness_mm: None,
        chisel_edge_angle_deg: 125.0,
        each_tooth: Vec::new(),
    }
}

/// A straight edge, 2 mm deep, 0.1 mm a tooth; its upper end lags by 0.15 rad.
pub fn milling_cut(teeth: usize, start_deg: f64, exit_deg: f64) -> MillingCut {
    MillingCut {
        teeth,
        feed_per_tooth_mm: 0.1,
        axial_depth_mm: 2.0,
        immersion: Immersion {
            start_rad: start_deg.to_radians(),
            exit_rad: exit_deg.to_radians(),
        },
        lag_rad: 0.15,
        shape: None,
        places: Vec::new(),
    }
}
