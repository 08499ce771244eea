//! Joint compliances where a file has none: orders of magnitude by payload class, and said to be that.

use crate::data::RobotSpec;

/// Arms of one size.
struct PayloadClass {
    /// Upper ends, kg.
    payload_kg: f64,
    moving_mass_kg: f64,
    /// Base to elbow and the last three joints, rad/(N·m).
    main: f64,
    wrist: f64,
}

/// Joint stiffness grows with the torque that a joint is made for. Light arms with strain wave gears have about 10⁴ N·m/rad
/// (what is published of arms of 5 to 15 kg payload lies between 0.3 and 3 of it), heavy ones with RV gears 10⁶ (the
/// built-in IRB 6640: 1.5 to 2.1·10⁶, its wrist 0.24 to 0.56·10⁶); the class between is halfway on the logarithm.
const CLASSES: [PayloadClass; 3] = [
    PayloadClass {
        payload_kg: 20.0,
        moving_mass_kg: 80.0,
        main: 5e-5,
        wrist: 2e-4,
    },
    PayloadClass {
        payload_kg: 80.0,
        moving_mass_kg: 600.0,
        main: 5e-6,
        wrist: 2e-5,
    },
    PayloadClass {
        payload_kg: f64::INFINITY,
        moving_mass_kg: f64::INFINITY,
        main: 6e-7,
        wrist: 3e-6,
    },
];

/// Joints that count as the wrist, from the tool.
const WRIST: usize = 3;

/// Puts the guess of its payload class into every joint of a robot and notes it among the robot's guesses.
///
/// `payload_kg`: as the maker rates the arm; `None`: the class is chosen by the mass of the links.
pub fn compliances(spec: &mut RobotSpec, payload_kg: Option<f64>) {
    let mass_kg: f64 = spec.links.iter().map(|link| link.mass_kg).sum();
    let fits = |class: &&PayloadClass| match payload_kg {
        Some(payload_kg) => payload_kg <= class.payload_kg,
        None => mass_kg <= class.moving_mass_kg,
    };
    let class = CLASSES.iter().find(fits).unwrap_or(&CLASSES[2]);
    let main = spec.joints.len().saturating_sub(WRIST);
    for (i, joint) in spec.joints.iter_mut().enumerate() {
        joint.compliance_rad_per_nm = if i < main { class.main } else { class.wrist };
    }
    let up_to = match class.payload_kg.is_finite() {
        true => format!("up to {} kg", class.payload_kg),
        false => format!("more than {} kg", CLASSES[1].payload_kg),
    };
    let by = match payload_kg {
        Some(payload_kg) => format!("a payload of {payload_kg} kg"),
        None => format!("{mass_kg:.1} kg of moving links"),
    };
    spec.guesses.push(format!(
        "joint compliances: an order of magnitude for arms with a payload of {up_to} (class by {by}), not measured on this robot"
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{awkward_arm, irb6640};

    #[test]
    fn the_class_follows_payload_or_mass_and_is_told() {
        let of = |mut spec: RobotSpec, payload_kg| {
            compliances(&mut spec, payload_kg);
            let all: Vec<f64> = spec.joints.iter().map(|j| j.compliance_rad_per_nm).collect();
            (all, spec.guesses.join(" "))
        };
        let (heavy, told) = of(irb6640(), None);
        assert_eq!(heavy, [6e-7, 6e-7, 6e-7, 3e-6, 3e-6, 3e-6]);
        assert!(
            told.contains("more than 80 kg") && told.contains("1119.4 kg of moving links"),
            "{told}"
        );
        // Within a factor of three of what the thesis identified on that robot.
        for (guess, joint) in heavy.iter().zip(&irb6640().joints) {
            let factor = guess / joint.compliance_rad_per_nm;
            assert!((1.0 / 3.0..3.0).contains(&factor), "{factor}");
        }
        let (light, told) = of(awkward_arm(7), Some(14.0));
        assert_eq!(light, [5e-5, 5e-5, 5e-5, 5e-5, 2e-4, 2e-4, 2e-4]);
        assert!(told.contains("payload of 14 kg"), "{told}");
        assert_eq!(of(awkward_arm(6), Some(50.0)).0[0], 5e-6);
    }
}
