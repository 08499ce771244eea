//! The structure of a robot as a [`Domain`]: effects change its chain of compliant elements, or the response channels.

use num_complex::Complex64;

use crate::data::RobotSpec;
use crate::effects::{Domain, Known};
use crate::robot::{Chain, Dual, Kinematics, RobotModel};

/// Effects on the structure of a robot and on the measurement of its FRFs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Structure;

impl Domain for Structure {
    type Object = RobotSpec;
    type Summary = DataSummary;
    type Setting<'a> = PostureSetting<'a>;
    type Physics = Chain;
    type Sensors = ChannelFilter;
}

impl<'a> Known<'a, Structure> {
    /// A robot, and a summary of its FRFs.
    pub fn robot(object: &'a RobotSpec, data: DataSummary) -> Self {
        Known { object, data }
    }
}

/// What the model is set up for when an effect changes it.
pub struct PostureSetting<'a> {
    /// The robot without effects.
    pub robot: &'a RobotModel,
    /// Where its frames are.
    pub kinematics: &'a Kinematics,
    /// How it was measured.
    pub conditions: Conditions,
}

#[cfg(test)]
impl<'a> PostureSetting<'a> {
    /// Under no conditions of its own.
    pub(crate) fn of_tests(robot: &'a RobotModel, kinematics: &'a Kinematics) -> Self {
        PostureSetting {
            robot,
            kinematics,
            conditions: Conditions::default(),
        }
    }
}

/// Conditions under which a block of FRFs was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Conditions {
    /// 0 at the highest hammer level of the campaign, 1 at the lowest, logarithmic between; 0 where there is one level.
    pub level_fraction: f64,
    /// 0 at the first posture of the campaign, 1 at the last, in their order; 0 where there is one posture.
    pub order_fraction: f64,
}

/// What happens to the response channels between the structure and the file.
#[derive(Debug, Clone)]
pub struct ChannelFilter {
    /// Rows of the matrix that turns true displacements (x, y, z of the point's axes) into measured ones.
    pub mixing: [[Dual; 3]; 3],
    /// The response is this late against the force, s.
    pub delay_s: Dual,
}

impl ChannelFilter {
    /// e^(−iωτ) with the sign of an FRF's axes, at `omega` (rad/s).
    pub fn factor(&self, omega: f64, sign: f64) -> Complex64 {
        match self.delay_s.value == 0.0 {
            true => sign.into(),
            false => Complex64::from_polar(sign, -omega * self.delay_s.value),
        }
    }

    /// Channels that show what is there.
    pub fn faithful() -> Self {
        ChannelFilter {
            mixing: Dual::unit_matrix(),
            delay_s: Dual::constant(0.0),
        }
    }
}

/// What is known of a campaign's FRFs when an effect is asked whether it can be told from them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataSummary {
    /// Different hammer levels.
    pub force_levels: usize,
    /// Postures with FRFs.
    pub postures: usize,
    /// Lowest measured frequency, Hz.
    pub lowest_hz: f64,
    /// Highest measured frequency, Hz.
    pub highest_hz: f64,
}
