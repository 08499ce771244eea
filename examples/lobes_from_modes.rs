//! Stability lobes from modes and cutting coefficients: down-milling of aluminium with a robot, half immersion.
//!
//! ```sh
//! cargo run --release --example lobes_from_modes
//! ```

use std::f64::consts::PI;

use lobestone::data::Immersion;
use lobestone::lobes::{AxisMode, ModalFrf, RegenerativeForce, SpeedLimit, StabilitySolver, speed_grid};

fn main() -> lobestone::Result<()> {
    let mode = |axis, frequency_hz, damping_ratio, stiffness_n_per_m| AxisMode {
        axis,
        frequency_hz,
        damping_ratio,
        stiffness_n_per_m,
    };
    // x: the feed; y: normal to it. The soft modes are the robot's, the stiff ones those of spindle and tool.
    let frf = ModalFrf::from_axis_modes(&[
        mode(0, 12.3, 0.028, 1.5e6),
        mode(0, 640.0, 0.021, 1.1e7),
        mode(1, 17.8, 0.031, 0.9e6),
        mode(1, 710.0, 0.019, 0.9e7),
    ])?;
    let immersion = Immersion {
        start_rad: 0.5 * PI,
        exit_rad: PI,
    };
    let (ktc_n_per_mm2, krc_n_per_mm2, teeth) = (800.0, 250.0, 4);
    let force = RegenerativeForce::milling_zero_order(ktc_n_per_mm2, krc_n_per_mm2, teeth, immersion)?;
    let solver = StabilitySolver::new(force, &frf);

    if let Some(limit) = solver.absolute_limit() {
        println!(
            "absolute stability limit: {:.3} mm axial depth, chatter at {:.1} Hz",
            limit.depth_mm, limit.chatter_hz
        );
    }
    let curve = solver.curve(&speed_grid([2000.0, 14000.0, 20.0])?);
    println!("\nspindle, rpm   depth limit, mm   chatter, Hz");
    let limits = curve.depth_limit_mm.iter().zip(&curve.chatter_hz);
    for (rpm, (depth_mm, chatter_hz)) in curve.spindle_rpm.iter().zip(limits).step_by(50) {
        match (depth_mm, chatter_hz) {
            (Some(depth_mm), Some(chatter_hz)) => println!("{rpm:12.0}{depth_mm:18.3}{chatter_hz:14.1}"),
            _ => println!("{rpm:12.0}          no limit"),
        }
    }
    println!("\nbest speeds");
    for peak in solver.best(&curve, 3) {
        match peak.depth_mm {
            Some(depth_mm) => println!("{:12.0} rpm: {depth_mm:.3} mm", peak.spindle_rpm),
            None => println!("{:12.0} rpm: no limit", peak.spindle_rpm),
        }
    }
    Ok(())
}
