//! Force records made for tests: an end mill of four teeth, its forces added up from slices along the axis.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

pub const RATE: f64 = 4000.0;
pub const TEETH: usize = 4;
/// Ktc Krc Kac (N/mm²) Kte Kre Kae (N/mm).
pub const TRUTH: [f64; 6] = [900.0, 380.0, 220.0, 18.0, 15.0, 6.0];
const DEPTH_MM: f64 = 2.0;
const DIAMETER_MM: f64 = 10.0;
const HELIX_DEG: f64 = 30.0;
/// Air, cut, air, s.
const AIR_S: f64 = 0.6;
pub const CUT_S: f64 = 3.0;
const POINTS: usize = 2000;

pub struct MadeCut<'a> {
    pub rpm: f64,
    pub feed_mm: f64,
    /// Speed over the stated one at a time from the middle of the cut, s.
    pub speed: &'a dyn Fn(f64) -> f64,
}

/// What the tool is like.
#[derive(Debug, Clone, Copy, Default)]
pub struct MadeTool {
    /// 0, or a radius that is no less than the depth.
    pub corner_radius_mm: f64,
    /// Offset of its axis from the spindle's, towards tooth 0.
    pub runout_mm: f64,
    /// Kienzle's exponents of the tangential, radial and axial force, from 0.1 mm.
    pub exponents: [f64; 3],
}

/// Ends of the edge's bits as distance from the axis and height, mm: up the side of the tool, or round its corner.
fn outline(corner_radius_mm: f64) -> Vec<[f64; 2]> {
    let bits = 40;
    let radius = 0.5 * DIAMETER_MM;
    (0..=bits)
        .map(|b| {
            let share = f64::from(b) / f64::from(bits);
            if corner_radius_mm < DEPTH_MM {
                return [radius, share * DEPTH_MM];
            }
            let (sin, cos) = (share * (1.0 - DEPTH_MM / corner_radius_mm).acos()).sin_cos();
            [
                radius - corner_radius_mm * (1.0 - sin),
                corner_radius_mm * (1.0 - cos),
            ]
        })
        .collect()
}

/// Forces on the tool by its angle, in [`POINTS`] steps of a turn: vectors in space, bit by bit of the edge.
fn turn(feed_mm: f64, tool: MadeTool) -> Vec<[f64; 3]> {
    let outline = outline(tool.corner_radius_mm);
    let lag = 2.0 * HELIX_DEG.to_radians().tan() / DIAMETER_MM;
    let at = |angle: f64| {
        let mut sum = [0.0; 3];
        for tooth in 0..TEETH {
            for ends in outline.windows(2) {
                let z = 0.5 * (ends[0][1] + ends[1][1]);
                let phi = (angle + TAU * tooth as f64 / TEETH as f64 - lag * z).rem_euclid(TAU);
                if phi >= PI {
                    continue;
                }
                let (out, up) = (ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
                let length = out.hypot(up);
                let (sin, cos) = phi.sin_cos();
                // Tooth m before stood farther out here, or nearer; what is left is the least that any of a turn left.
                let out_by = |m: usize| {
                    let from_offset = lag * z - TAU * (tooth + m) as f64 / TEETH as f64;
                    tool.runout_mm * from_offset.cos()
                };
                let left = |m: usize| m as f64 * feed_mm * sin + out_by(0) - out_by(m);
                let radial = (1..=TEETH).map(left).fold(f64::INFINITY, f64::min);
                if radial <= 0.0 {
                    continue;
                }
                let chip = radial * up / length;
                let [t, r, a] = [0, 1, 2].map(|i| {
                    let size = (chip / 0.1).powf(-tool.exponents[i]);
                    (TRUTH[i] * chip * size + TRUTH[i + 3]) * length
                });
                // Away from the axis across the edge, and along it.
                let outward = (a * out - r * up) / length;
                sum[0] += -t * cos + outward * sin;
                sum[1] += t * sin + outward * cos;
                sum[2] += (r * out + a * up) / length;
            }
        }
        sum
    };
    (0..POINTS).map(|k| at(TAU * k as f64 / POINTS as f64)).collect()
}

/// Writes a campaign of slots. `more(cut, axis, time, angle, cutting)` is added to every sample, on top of white noise of 3 N.
pub fn write_campaign(
    dir: &Path,
    cuts: &[MadeCut],
    more: &dyn Fn(usize, usize, f64, f64, bool) -> f64,
) -> crate::campaign::Campaign {
    write_campaign_of(dir, MadeTool::default(), cuts, more)
}

/// As [`write_campaign`], with another tool.
pub fn write_campaign_of(
    dir: &Path,
    tool: MadeTool,
    cuts: &[MadeCut],
    more: &dyn Fn(usize, usize, f64, f64, bool) -> f64,
) -> crate::campaign::Campaign {
    let mut toml = format!(
        "schema = \"lobestone/campaign/1\"\nname = \"made\"\n\n[tool]\nkind = \"endmill\"\ndiameter_mm = {DIAMETER_MM:?}\nteeth = {TEETH}\n\
         helix_deg = {HELIX_DEG:?}\ncorner_radius_mm = {:?}\n\n[material]\nname = \"unnamed\"\n",
        tool.corner_radius_mm
    );
    std::fs::create_dir_all(dir.join("force")).unwrap();
    for (c, cut) in cuts.iter().enumerate() {
        let id = format!("{:02}", c + 1);
        let _ = write!(
            toml,
            "\n[[cut]]\nid = \"{id}\"\nfile = \"force/cut{id}.csv\"\nprocess = \"milling\"\nspindle_rpm = {:?}\nfeed_per_tooth_mm = \
             {:?}\naxial_depth_mm = {DEPTH_MM:?}\nimmersion = \"slot\"\n",
            cut.rpm, cut.feed_mm
        );
        let turn = turn(cut.feed_mm, tool);
        let mut random = ChaCha8Rng::seed_from_u64(c as u64 + 7);
        let mut text = String::from("Time [s],Fx [N],Fy [N],Fz [N]\n");
        let mut angle = 0.3 + c as f64;
        for i in 0..((2.0 * AIR_S + CUT_S) * RATE) as usize {
            let t = i as f64 / RATE;
            let cutting = (AIR_S..AIR_S + CUT_S).contains(&t);
            let forces = match cutting {
                true => {
                    let at = angle.rem_euclid(TAU) / TAU * POINTS as f64;
                    let (low, part) = (at.floor() as usize, at.fract());
                    let (a, b) = (turn[low % POINTS], turn[(low + 1) % POINTS]);
                    [0, 1, 2].map(|j| a[j] + part * (b[j] - a[j]))
                }
                false => [0.0; 3],
            };
            let _ = write!(text, "{t:.5}");
            for (axis, force) in forces.iter().enumerate() {
                let noise: f64 = crate::statistics::nearly_normal(&mut random);
                let value = force + 3.0 * noise + more(c, axis, t, angle, cutting);
                let _ = write!(text, ",{value:.3}");
            }
            text.push('\n');
            angle += TAU * cut.rpm / 60.0 / RATE * (cut.speed)(t - AIR_S - 0.5 * CUT_S);
        }
        std::fs::write(dir.join(format!("force/cut{id}.csv")), text).unwrap();
    }
    std::fs::write(dir.join("campaign.toml"), toml).unwrap();
    crate::campaign::Campaign::load(dir).unwrap()
}
