//! `lobestone lobes`: stability lobes of a campaign.

use serde_json::{Value, json};

use super::text::{number, table, warnings};
use super::{CampaignArg, Outcome};
use crate::Result;
use crate::analysis::LobeAnalysis;
use crate::campaign::{Campaign, Process};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    campaign: CampaignArg,
}

pub fn run(args: Args) -> Result<Outcome> {
    outcome(&Campaign::load(&args.campaign.dir)?)
}

fn outcome(campaign: &Campaign) -> Result<Outcome> {
    let analysis = LobeAnalysis::run(campaign)?;
    Ok(Outcome {
        json: document(&analysis),
        text: text(&analysis),
    })
}

fn document(analysis: &LobeAnalysis) -> Value {
    let curves: Vec<Value> = analysis
        .cases
        .iter()
        .map(|case| {
            json!({
                "posture": case.posture,
                "angle_deg": case.angle_deg,
                "spindle_rpm": case.curve.spindle_rpm,
                "depth_limit_mm": case.curve.depth_limit_mm,
                "chatter_hz": case.curve.chatter_hz,
                "absolute_limit_mm": case.absolute.map(|a| a.depth_mm),
                "absolute_limit_hz": case.absolute.map(|a| a.chatter_hz),
                "frf": case.description,
                "band_hz": [case.band_hz.0, case.band_hz.1],
            })
        })
        .collect();
    let best: Vec<Value> = analysis
        .best()
        .iter()
        .map(|(case, peak)| {
            json!({
                "posture": case.posture,
                "angle_deg": case.angle_deg,
                "spindle_rpm": peak.spindle_rpm,
                "depth_mm": peak.depth_mm,
            })
        })
        .collect();
    let absolute = analysis.absolute();
    json!({
        "process": analysis.process,
        "method": analysis.method,
        "source": analysis.source,
        "teeth": analysis.teeth,
        "ktc_n_per_mm2": analysis.coefficients.ktc_n_per_mm2,
        "krc_n_per_mm2": analysis.coefficients.krc_n_per_mm2,
        "curves": curves,
        "absolute_limit_mm": absolute.map(|a| a.depth_mm),
        "absolute_limit_hz": absolute.map(|a| a.chatter_hz),
        "best": best,
        "warnings": analysis.warnings,
    })
}

fn text(analysis: &LobeAnalysis) -> String {
    let (process, depth) = match analysis.process {
        Process::Milling => ("milling, zero-order", "axial depth of cut"),
        Process::Drilling => (
            "drilling, lateral",
            "radial width of cut, (diameter − pilot diameter)/2",
        ),
    };
    let mut out = format!(
        "Stability lobes: {process}, {} teeth, Ktc {} and Krc {} N/mm²\nDepth: {depth}\n",
        analysis.teeth,
        number(analysis.coefficients.ktc_n_per_mm2, 4),
        number(analysis.coefficients.krc_n_per_mm2, 4),
    );
    for case in &analysis.cases {
        let (low, high) = case.band_hz;
        let posture = case
            .posture
            .as_ref()
            .map(|p| format!(" at {p}"))
            .unwrap_or_default();
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
                optional(gain, 1, "–"),
            ]
        })
        .collect();
    let header = ["posture", "angle °", "speed rpm", "limit mm", "× always safe"];
    out += &format!(
        "\nBest speeds between {from} and {to} rpm (steps of {step})\n{}",
        table(&header, &rows)
    );
    out + &warnings(&analysis.warnings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{Dynamometer, LobeAxis, LobeMethod, LobeMode, LobeSource, LobesSection};
    use approx::assert_relative_eq;

    fn campaign(source: LobeSource) -> Campaign {
        let mode = |axis, frequency_hz, damping_ratio, stiffness_n_per_m| LobeMode {
            axis,
            frequency_hz,
            damping_ratio,
            stiffness_n_per_m,
        };
        Campaign {
            dir: "cell".into(),
            name: "lobes".into(),
            robot: None,
            postures: vec![],
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
                teeth: Some(2),
                immersion: None,
                half_point_angle_deg: Some(67.5),
                feed_per_rev_mm: None,
                spindle_rpm: [100.0, 900.0, 1.0],
                modes: vec![
                    mode(LobeAxis::X, 12.3, 0.028, 5e5),
                    mode(LobeAxis::Y, 12.2, 0.025, 3e5),
                    mode(LobeAxis::Theta, 3000.0, 0.02, 1e4),
                ],
                redundancy: None,
            }),
            material: None,
        }
    }

    #[test]
    fn modes_give_the_document_of_the_contract() {
        let Outcome { json, text } = outcome(&campaign(LobeSource::Modes)).unwrap();
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
}
