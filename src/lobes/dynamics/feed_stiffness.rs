//! How stiff the robot is along the feed at a posture, against how stiff it is at best in any direction.
//!
//! The translational part of the tool point's compliance C says what a force moves: along a unit vector f the stiffness is
//! 1/(fᵀ C f). Indices of this kind rank postures and feed directions in robotic machining (Guo, Dong & Ke 2015; Chen, Peng,
//! Yan et al. 2019, Robotics and Computer-Integrated Manufacturing 35 and 55).

use nalgebra::{Matrix2, Matrix3, Matrix6, SymmetricEigen, Vector3};
use serde::Serialize;

use crate::data::Process;
use crate::lobes::dynamics::robot::lobe_axes;

/// Static stiffness of the tool point at a posture, along and across the tool, and along the feed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FeedStiffness {
    /// Along the tool.
    pub along_axis_n_per_m: f64,
    /// Across the tool, in the softest direction.
    pub across_least_n_per_m: f64,
    /// Across the tool, in the stiffest direction.
    pub across_greatest_n_per_m: f64,
    /// That stiffest direction, from the lobes' first axis (the base's x for a vertical tool) towards the second, 0…180.
    pub stiffest_across_deg: f64,
    /// Along the feed: drilling along the tool, else across it in the stiffest direction, which is the one to feed in.
    pub along_feed_n_per_m: f64,
    /// Stiffness along the feed over that in the stiffest direction there is: 1 where the feed runs along that.
    pub index: f64,
}

impl FeedStiffness {
    /// `compliance`: of the tool point (6×6, base axes); `tool_axis`: unit vector. `None` for a compliance that is no such.
    pub fn new(compliance: &Matrix6<f64>, tool_axis: Vector3<f64>, process: Process) -> Option<Self> {
        let moves: Matrix3<f64> = compliance.fixed_view::<3, 3>(0, 0).into_owned();
        let moves = 0.5 * (moves + moves.transpose());
        let sides = lobe_axes(tool_axis);
        let across = Matrix2::from_fn(|row, column| sides[row].dot(&(moves * sides[column])));
        let across = SymmetricEigen::new(across);
        let (stiff, soft) = match across.eigenvalues[0] <= across.eigenvalues[1] {
            true => (0, 1),
            false => (1, 0),
        };
        let direction = across.eigenvectors.column(stiff);
        let angle_deg = direction[1].atan2(direction[0]).to_degrees().rem_euclid(180.0);
        let along_axis = 1.0 / tool_axis.dot(&(moves * tool_axis));
        let [least, greatest] = [soft, stiff].map(|i| 1.0 / across.eigenvalues[i]);
        let along_feed = match process {
            Process::Drilling => along_axis,
            Process::Milling | Process::Turning => greatest,
        };
        let index = along_feed * moves.symmetric_eigenvalues().min();
        let found = FeedStiffness {
            along_axis_n_per_m: along_axis,
            across_least_n_per_m: least,
            across_greatest_n_per_m: greatest,
            stiffest_across_deg: angle_deg,
            along_feed_n_per_m: along_feed,
            index,
        };
        let sound = [along_axis, least, greatest, index];
        sound.iter().all(|v| v.is_finite() && *v > 0.0).then_some(found)
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::{Rotation3, Vector6};

    use super::*;

    /// Springs of 1, 2 and 4 N/µm along axes that are turned by 30° about a vertical tool.
    #[test]
    fn springs_turned_by_thirty_degrees() {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 30f64.to_radians());
        let moves = turn * Matrix3::from_diagonal(&Vector3::new(0.5e-6, 1e-6, 0.25e-6)) * turn.inverse();
        let mut compliance = Matrix6::from_diagonal(&Vector6::from_element(1e-7));
        compliance.fixed_view_mut::<3, 3>(0, 0).copy_from(&moves);
        let down = -Vector3::z();
        let drilling = FeedStiffness::new(&compliance, down, Process::Drilling).unwrap();
        assert_relative_eq!(drilling.along_axis_n_per_m, 4e6, max_relative = 1e-12);
        assert_relative_eq!(drilling.across_least_n_per_m, 1e6, max_relative = 1e-12);
        assert_relative_eq!(drilling.across_greatest_n_per_m, 2e6, max_relative = 1e-12);
        assert_relative_eq!(drilling.stiffest_across_deg, 30.0, max_relative = 1e-9);
        assert_relative_eq!(drilling.index, 1.0, max_relative = 1e-12);
        let milling = FeedStiffness::new(&compliance, down, Process::Milling).unwrap();
        assert_relative_eq!(milling.along_feed_n_per_m, 2e6, max_relative = 1e-12);
        assert_relative_eq!(milling.index, 0.5, max_relative = 1e-12);
        // The tool along the softest axis.
        let soft = turn * Vector3::y();
        let drilling = FeedStiffness::new(&compliance, soft, Process::Drilling).unwrap();
        assert_relative_eq!(drilling.along_axis_n_per_m, 1e6, max_relative = 1e-12);
        assert_relative_eq!(drilling.index, 0.25, max_relative = 1e-12);
        assert_eq!(
            FeedStiffness::new(&Matrix6::zeros(), down, Process::Drilling),
            None
        );
    }
}
