//! `lobestone lobes`: stability lobes of a campaign.

use crate::Result;
use crate::analysis::{LobeAnalysis, RedundancyAnalysis};
use crate::campaign::{Campaign, LobeMethod, Process};
use crate::commands::measure::lobes_document::LobesDocument;
use crate::commands::measure::{drill, hole, lobe_tool};
use crate::commands::next_step::Guide;
use crate::commands::text::{files_first, number, table, warnings};
use crate::commands::{CampaignArg, Outcome};
use crate::lobes::outcome::Outcomes;
use crate::lobes::redundancy::AngleStatus;

/// Postures or angles of which the change by added effects is told.
const MOST_SENTENCES: usize = 8;

#[derive(clap::Args)]
pub struct LobesArgs {
    #[command(flatten)]
    campaign: CampaignArg,
}

pub fn run(args: LobesArgs) -> Result<Outcome> {
    outcome(&Campaign::load(&args.campaign.dir)?)
}

fn outcome(campaign: &Campaign) -> Result<Outcome> {
    let analysis = LobeAnalysis::run(campaign)?;
    Ok(Outcome::new(
        LobesDocument::new(&analysis),
        files_first(&[], &campaign.guesses.all_told()) + &text(&analysis),
        Some(Guide::structure(campaign).lobes()),
    ))
}

fn redundancy_text(found: &RedundancyAnalysis) -> String {
    let r = &found.recommendation;
    let count = |status| found.angles.iter().filter(|a| a.status == status).count();
    let joints: Vec<String> = r
        .posture
        .joints_deg
        .iter()
        .flatten()
        .map(|j| format!("{j:.2}"))
        .collect();
    let margin = |v: Option<f64>, unit: &str| v.map_or("–".to_string(), |v| format!("{v:.3}{unit}"));
    let sweep = format!(
        "\nTool of {} turned about its axis in steps of {}°: {} angles usable, {} forbidden, {} out of reach\n\
         Recommended: {:.1} rpm at {:.1}°, safe to {:.4} mm with the speed off by up to {:.0} % (5 % quantile over the model's uncertainty: {})\n\
         Joints: {} degrees; nearest limit {} away, singularity margin {} of 1\n\
         Enumeration {:.4} mm, particle swarm {:.4} mm, {:.2} % apart: {}\n",
        found.posture,
        found.step_deg,
        count(AngleStatus::Reachable),
        count(AngleStatus::Forbidden),
        count(AngleStatus::Unreachable),
        r.point.spindle_rpm,
        r.point.angle_deg,
        r.point.depth_mm,
        100.0 * r.speed_margin,
        margin(r.lower_quantile_mm, " mm"),
        joints.join(", "),
        margin(r.posture.limit_margin_deg, "°"),
        margin(r.posture.singularity_margin, ""),
        r.enumeration.depth_mm,
        r.swarm.depth_mm,
        100.0 * r.difference,
        if r.agree {
            "they agree"
        } else {
            "they disagree; the deeper one is given"
        },
    );
    sweep + &elbows_text(found)
}

/// Nearer to a joint's limit a posture is worth a word, °.
const NEAR_A_LIMIT_DEG: f64 = 3.0;

fn elbows_text(found: &RedundancyAnalysis) -> String {
    if found.elbows.is_empty() {
        return String::new();
    }
    let or_none = |v: Option<String>| v.unwrap_or("–".into());
    let with_hole = found.elbows.iter().any(|e| e.hole_in_tolerance.is_some());
    let rows: Vec<Vec<String>> = found
        .elbows
        .iter()
        .map(|elbow| {
            let hole = elbow
                .hole_in_tolerance
                .map(|keeps| if keeps { "in" } else { "out" });
            let mut row = vec![
                format!("{}°", elbow.turned_deg),
                elbow.usable_angles.to_string(),
                or_none(elbow.point.map(|p| format!("{:.4}", p.depth_mm))),
                or_none(elbow.point.map(|p| format!("{:.1}", p.spindle_rpm))),
                or_none(elbow.point.map(|p| format!("{:.1}°", p.angle_deg))),
            ];
            row.extend(with_hole.then(|| or_none(hole.map(str::to_string))));
            row.push(if elbow.chosen {
                "chosen".into()
            } else {
                String::new()
            });
            row
        })
        .collect();
    let mut header = vec!["elbow turned by", "usable angles", "depth mm", "rpm", "angle"];
    header.extend(with_hole.then_some("hole"));
    header.push("");
    let hole_decides = with_hole && {
        let chosen = found.elbows.iter().find(|e| e.chosen).and_then(|e| e.point);
        let deepest_mm = found
            .elbows
            .iter()
            .filter_map(|e| e.point)
            .map(|p| p.depth_mm)
            .fold(0.0, f64::max);
        chosen.is_some_and(|p| p.depth_mm < deepest_mm)
    };
    let why = match hole_decides {
        true => "Deeper limits are passed over where the hole leaves its tolerances\n",
        false => "",
    };
    let near = found
        .recommendation
        .posture
        .limit_margin_deg
        .filter(|margin| *margin < NEAR_A_LIMIT_DEG);
    let near = near.map_or(String::new(), |margin| {
        format!(
            "A joint stands {margin:.1}° from its limit there: the robot may refuse the approach; try the next elbow, or forbid these angles \
             with forbidden_deg\n"
        )
    });
    format!(
        "\nElbow turned with the tool at rest\n{}{why}{near}",
        table(&header, &rows).trim_start_matches('\n')
    )
}

fn outcomes_text(outcomes: &Outcomes) -> String {
    let o = outcomes;
    let mut out = format!(
        "\nCuts with a noted outcome: {} of {} stable ones lie below the limit, {} of {} with chatter above it\n",
        o.stable_below_limit,
        o.stable_below_limit + o.stable_above_limit,
        o.chatter_above_limit,
        o.chatter_above_limit + o.chatter_below_limit,
    );
    out += &format!(
        "With the band (5-95 %): {} agree, {} disagree, of {} the model cannot say\n",
        o.agree, o.disagree, o.within_band
    );
    for cut in &o.cuts {
        if let Some(meaning) = &cut.meaning {
            let (name, said) = (&cut.id, cut.outcome.label());
            let (depth, speed) = (cut.depth_mm, cut.spindle_rpm);
            out += &format!("  cut {name} ({said}, {depth} mm at {speed} rpm): {meaning}\n");
        }
    }
    for cut in &o.not_compared {
        out += &format!("  cut {} is not compared: {}\n", cut.id, cut.reason);
    }
    out
}

fn text(analysis: &LobeAnalysis) -> String {
    let (process, depth) = match analysis.process {
        Process::Milling => (
            match analysis.method {
                LobeMethod::MultiFrequency => "milling, multi-frequency",
                LobeMethod::SemiDiscretisation => "milling, semi-discretisation",
                LobeMethod::ZeroOrder | LobeMethod::FrequencyDomain => "milling, zero-order",
            },
            "axial depth of cut",
        ),
        Process::Drilling => (
            analysis.drilling(),
            "radial width of cut, (diameter − pilot diameter)/2",
        ),
        Process::Turning => ("turning", "depth of cut"),
    };
    let mut out = format!(
        "Stability lobes: {process}, {} {}, Ktc {} and Krc {} N/mm²\nDepth: {depth}\n",
        analysis.teeth,
        if analysis.teeth == 1 { "tooth" } else { "teeth" },
        number(analysis.coefficients.ktc_n_per_mm2, 4),
        number(analysis.coefficients.krc_n_per_mm2, 4),
    );
    if let Some(damping) = &analysis.flank_damping {
        out += &format!(
            "Process damping of the flanks: at n rpm {} kN·s/m² across the tool and {} along it, per metre of width, times 1000/n\n",
            number(
                1e-3 * damping.lateral_n_per_m2 / (std::f64::consts::TAU * 1000.0 / 60.0),
                3
            ),
            number(
                1e-3 * damping.axial_n_per_m2 / (std::f64::consts::TAU * 1000.0 / 60.0),
                3
            ),
        );
    }
    // Over the redundancy angle all cases are alike.
    let shown = if analysis.redundancy.is_some() {
        1
    } else {
        analysis.cases.len()
    };
    for case in analysis.cases.iter().take(shown) {
        let (low, high) = case.band_hz;
        let posture = case.at_posture();
        out += &format!(
            "FRF{posture}: {}; chatter sought from {low:.3} to {high:.1} Hz\n",
            case.description
        );
    }
    let absolute = analysis.absolute();
    out += &match absolute {
        Some(limit) => format!(
            "\nStable at every speed below {:.4} mm (chatter there at {:.2} Hz)\n",
            limit.depth_mm, limit.chatter_hz
        ),
        None => "\nStable at every speed and depth\n".to_string(),
    };
    out += &drill::text(analysis);
    out += &lobe_tool::text(analysis);
    let did = analysis.what_effects_did();
    if !did.is_empty() {
        // Over the redundancy angle there is one for each angle.
        out += &format!(
            "\nBefore and after (baseline, refitted, against revision {}):\n",
            analysis.revision.unwrap_or(0)
        );
        out += &did
            .iter()
            .take(MOST_SENTENCES)
            .map(|s| format!("  {s}\n"))
            .collect::<String>();
    }
    let [from, to, step] = analysis.spindle_rpm;
    let optional = |v: Option<f64>, decimals: usize, none: &str| {
        v.map_or(none.to_string(), |v| format!("{v:.decimals$}"))
    };
    let rows: Vec<Vec<String>> = analysis
        .best()
        .iter()
        .map(|(case, peak)| {
            let gain = peak.depth_mm.zip(absolute).map(|(d, a)| d / a.depth_mm);
            vec![
                case.posture.clone().unwrap_or_else(|| "–".into()),
                optional(case.angle_deg, 1, "–"),
                format!("{:.1}", peak.spindle_rpm),
                optional(peak.depth_mm, 4, "no limit"),
                optional(peak.lower_quantile_mm, 4, "–"),
                optional(gain, 1, "–"),
            ]
        })
        .collect();
    let header = [
        "posture",
        "angle °",
        "speed rpm",
        "limit mm",
        "5 % mm",
        "× always safe",
    ];
    out += &format!(
        "\nBest speeds between {from} and {to} rpm (steps of {step})\n{}",
        table(&header, &rows)
    );
    if analysis.best().iter().any(|(_, peak)| peak.at_range_end) {
        out +=
            "A speed at the end of the range is the deepest there: the curve may rise further beyond it.\n";
    }
    if let Some(outcomes) = &analysis.outcomes {
        out += &outcomes_text(outcomes);
    }
    if let Some(found) = &analysis.redundancy {
        out += &redundancy_text(found);
    }
    out += &hole::text(analysis);
    out += &hole::feed_stiffness_text(analysis);
    out + &warnings(&analysis.warnings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{Dynamometer, LobeAxis, LobeMode, LobeSource, LobesSection};
    use approx::assert_relative_eq;
    use serde_json::Value;

    fn campaign(source: LobeSource) -> Campaign {
        let mode = |axis, frequency_hz, damping_ratio, stiffness_n_per_m| LobeMode {
            axis,
            frequency_hz,
            damping_ratio,
            stiffness_n_per_m,
            extension_mm_per_rad: 0.0,
        };
        Campaign {
            dir: "cell".into(),
            name: "lobes".into(),
            operator: None,
            date: None,
            robot: None,
            postures: vec![],
            beyond_limits: vec![],
            points: vec![],
            frfs: vec![],
            tool: None,
            dynamometer: Dynamometer {
                tool_from_dyno: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            },
            cuts: vec![],
            lobes: Some(LobesSection {
                process: Process::Drilling,
                source,
                method: LobeMethod::FrequencyDomain,
                ktc_n_per_mm2: Some(1014.2),
                krc_n_per_mm2: Some(619.9),
                kac_n_per_mm2: None,
                from_orthogonal: false,
                teeth: Some(2),
                immersion: None,
                half_point_angle_deg: Some(67.5),
                process_damping_n_per_m: None,
                margin_stiffness_n_per_m: None,
                margin_damping_ns_per_m: None,
                feed_per_rev_mm: None,
                spindle_rpm: [100.0, 900.0, 1.0],
                modes: vec![
                    mode(LobeAxis::X, 12.3, 0.028, 5e5),
                    mode(LobeAxis::Y, 12.2, 0.025, 3e5),
                    mode(LobeAxis::Theta, 3000.0, 0.02, 1e4),
                ],
                redundancy: None,
                tool: vec![],
                hole: None,
            }),
            material: None,
            channels: Vec::new(),
            orthogonal: None,
            plan: Default::default(),
            guesses: Default::default(),
            contacts: Vec::new(),
        }
    }

    #[test]
    fn modes_give_the_document_of_the_contract() {
        let Outcome { json, text, .. } = outcome(&campaign(LobeSource::Modes)).unwrap();
        let curve = &json["curves"][0];
        for key in [
            "posture",
            "angle_deg",
            "spindle_rpm",
            "depth_limit_mm",
            "chatter_hz",
        ] {
            assert!(curve.get(key).is_some(), "{key}");
        }
        assert_eq!(curve["spindle_rpm"].as_array().unwrap().len(), 801);
        assert_eq!(curve["depth_limit_mm"].as_array().unwrap().len(), 801);
        let absolute = json["absolute_limit_mm"].as_f64().unwrap();
        let least = curve["depth_limit_mm"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(Value::as_f64)
            .fold(f64::INFINITY, f64::min);
        assert_relative_eq!(absolute, least, max_relative = 1e-3);
        // Peaks of the lowest modes near 60 f/(N k).
        let speeds: Vec<f64> = json["best"]
            .as_array()
            .unwrap()
            .iter()
            .map(|b| b["spindle_rpm"].as_f64().unwrap())
            .collect();
        assert!(speeds.iter().any(|n| (n - 366.0).abs() < 6.0), "{speeds:?}");
        assert!(text.contains("Stable at every speed below"), "{text}");
        assert!(text.contains("1 in z or theta not used"), "{text}");
    }

    #[test]
    fn what_is_missing_is_named() {
        let mut lacking = campaign(LobeSource::Modes);
        lacking.lobes.as_mut().unwrap().half_point_angle_deg = None;
        let message = outcome(&lacking).err().unwrap().to_string();
        assert!(message.contains("lobes.half_point_angle_deg"), "{message}");
        lacking.lobes = None;
        let message = outcome(&lacking).err().unwrap().to_string();
        assert!(message.contains("no [lobes] table"), "{message}");
    }

    /// The methods of a milling campaign: all three answer, and differ little in a slot with three teeth.
    #[test]
    fn every_milling_method_answers() {
        let mut milling = campaign(LobeSource::Modes);
        let lobes = milling.lobes.as_mut().unwrap();
        lobes.process = Process::Milling;
        lobes.teeth = Some(3);
        lobes.immersion = Some(crate::campaign::Immersion::SLOT);
        lobes.spindle_rpm = [200.0, 400.0, 20.0];
        lobes.modes.truncate(2);
        let mut limits = Vec::new();
        for method in [
            LobeMethod::ZeroOrder,
            LobeMethod::MultiFrequency,
            LobeMethod::SemiDiscretisation,
        ] {
            milling.lobes.as_mut().unwrap().method = method;
            let Outcome { json, .. } = outcome(&milling).unwrap();
            assert_eq!(json["method"], serde_json::to_value(method).unwrap());
            limits.push(json["curves"][0]["depth_limit_mm"][4].as_f64().unwrap());
            assert!(json["absolute_limit_mm"].as_f64().unwrap() > 0.0);
        }
        assert_relative_eq!(limits[1], limits[2], max_relative = 0.01);
        assert_relative_eq!(limits[0], limits[1], max_relative = 0.1);
        let lobes = milling.lobes.as_mut().unwrap();
        lobes.process_damping_n_per_m = Some(1e5);
        let message = outcome(&milling).err().unwrap().to_string();
        assert!(message.contains("tool.diameter_mm"), "{message}");
        milling.lobes.as_mut().unwrap().method = LobeMethod::ZeroOrder;
        let message = outcome(&milling).err().unwrap().to_string();
        assert!(message.contains("lobes.process_damping_n_per_m"), "{message}");
    }

    #[test]
    fn the_surface_over_the_angle_recommends_a_place() {
        let mut turned = campaign(LobeSource::Model);
        turned.robot = Some(crate::campaign::RobotSection {
            model: "irb6640".into(),
            mass_tolerance: None,
            stiffness_tolerance: 0.3,
            links: Default::default(),
        });
        turned.postures.push(crate::campaign::Posture {
            id: "p1".into(),
            joints_deg: vec![135.0, -2.0, 53.0, 83.0, 30.0, -117.0],
        });
        let lobes = turned.lobes.as_mut().unwrap();
        lobes.spindle_rpm = [150.0, 600.0, 2.0];
        lobes.redundancy = Some(crate::campaign::Redundancy {
            posture: 0,
            step_deg: 20.0,
            forbidden_deg: vec![[170.0, 230.0]],
            elbow_step_deg: None,
        });
        let Outcome { json, text, .. } = outcome(&turned).unwrap();
        let found = &json["redundancy"];
        let angles = found["angles"].as_array().unwrap();
        assert_eq!(angles.len(), 18);
        let usable = angles.iter().filter(|a| a["status"] == "reachable").count();
        assert_eq!(json["curves"].as_array().unwrap().len(), usable);
        assert!(angles.iter().filter(|a| a["status"] == "forbidden").count() <= 3);
        assert!(json["curves"][0]["angle_deg"].is_number() && json["best"][0]["angle_deg"].is_number());
        assert_eq!(found["agree"], true, "{found}");
        let place = &found["recommended"];
        let angle = place["angle_deg"].as_f64().unwrap();
        assert!(!(170.0..=230.0).contains(&angle), "{place}");
        assert!(place["depth_mm"].as_f64() <= place["tip_depth_mm"].as_f64());
        assert_eq!(place["joints_deg"].as_array().unwrap().len(), 6);
        assert!(text.contains("they agree"), "{text}");
        turned
            .lobes
            .as_mut()
            .unwrap()
            .redundancy
            .as_mut()
            .unwrap()
            .forbidden_deg = vec![[0.0, 360.0]];
        let message = outcome(&turned).err().unwrap().to_string();
        assert!(message.contains("no redundancy angle can be used"), "{message}");
    }
}
