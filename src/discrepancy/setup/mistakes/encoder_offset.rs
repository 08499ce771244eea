use super::super::finding::{SetupFinding, with_error};
use super::super::group::FrfGroup;
use super::super::mistake::{Distortion, Estimated, Mistake, MistakeSize};
use crate::identify::frfs::frf_data::FrfData;
use crate::robot::Kinematics;

/// A joint stood elsewhere than its angle says, deg: at every posture (the encoder's zero), or at one (written down wrongly).
pub struct EncoderOffset {
    /// 1-based.
    pub joint: usize,
}

impl Distortion for EncoderOffset {
    fn kinematics(&self, values: &[f64], kinematics: &Kinematics) -> Kinematics {
        kinematics.turned(self.joint, values[0].to_radians())
    }
}

impl Mistake for EncoderOffset {
    fn sizes(&self) -> Vec<MistakeSize> {
        vec![MistakeSize::either_way(3.0, 30.0)]
    }

    fn groups(&self, data: &FrfData) -> Vec<FrfGroup> {
        FrfGroup::postures(data)
    }

    fn finding(&self, estimated: &Estimated) -> SetupFinding {
        let (value, error) = (estimated.values[0], estimated.errors[0]);
        let (place, remedy) = match estimated.group.posture {
            None => (
                format!("joint {}, all postures", self.joint),
                format!(
                    "Add {} deg to angle {} of every joints_deg in campaign.toml, and check the zero of that encoder.",
                    with_error(value, error),
                    self.joint
                ),
            ),
            Some(_) => (
                format!("joint {}, {}", self.joint, estimated.place()),
                format!(
                    "Check angle {} of this posture in campaign.toml: the FRFs fit an angle that is {} deg larger.",
                    self.joint,
                    with_error(value, error)
                ),
            ),
        };
        SetupFinding {
            kind: "encoder-offset",
            place,
            value: Some(value),
            std_error: Some(error),
            unit: "deg",
            confidence: 0.0,
            remedy,
        }
    }
}
