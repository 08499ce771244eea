//! The axes on which cutting forces are recorded, averaged and compared.

use crate::data::{ChannelRole, Process};

/// What is averaged and compared: the forces on the tool in tool axes (x feed, y normal, z axial; turning: x against the
/// feed, y away from the work, z along the cutting speed; N), and the torque about the spindle (N·m, opposing rotation positive).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ForceAxis {
    /// Force along the feed; turning: against it.
    X,
    /// Force normal to feed and tool axis; turning: away from the work.
    Y,
    /// Force along the tool axis; turning: along the cutting speed.
    Z,
    /// Torque.
    Mz,
}

impl ForceAxis {
    /// All axes, in the order of [`ForceAxis::index`].
    pub const ALL: [ForceAxis; 4] = [ForceAxis::X, ForceAxis::Y, ForceAxis::Z, ForceAxis::Mz];

    /// Place in arrays by axis: 0 to 3.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Name for people: `Fx`, `Fy`, `Fz`, `Mz`.
    pub fn label(self) -> &'static str {
        ["Fx", "Fy", "Fz", "Mz"][self.index()]
    }

    /// Unit for people: N, of the torque N·m.
    pub fn unit(self) -> &'static str {
        if self == ForceAxis::Mz { "N·m" } else { "N" }
    }

    /// The axes that carry the coefficients of a process.
    pub fn of(process: Process) -> &'static [ForceAxis] {
        match process {
            Process::Milling | Process::Turning => &[ForceAxis::X, ForceAxis::Y, ForceAxis::Z],
            Process::Drilling => &[ForceAxis::Z, ForceAxis::Mz],
        }
    }
}

/// The axis that a recorded channel is of; `None` for what is no force.
pub(crate) fn axis_of(role: ChannelRole) -> Option<ForceAxis> {
    Some(match role {
        ChannelRole::ForceX => ForceAxis::X,
        ChannelRole::ForceY => ForceAxis::Y,
        ChannelRole::ForceZ => ForceAxis::Z,
        ChannelRole::TorqueZ => ForceAxis::Mz,
        ChannelRole::Other => return None,
    })
}
