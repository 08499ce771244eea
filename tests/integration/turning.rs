//! Turned bars on a dynamometer, from files that a test writes: forces added up over the outline of a nosed edge, strip by
//! strip, with code of its own.

use std::fmt::Write;
use std::path::Path;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::support::{COEFFICIENTS, document, lobestone};

/// Ktc Krc Kac (N/mm²) Kte Kre Kae (N/mm).
const TRUTH: [f64; 6] = [2050.0, 880.0, -140.0, 62.0, 71.0, -4.0];
const RATE: f64 = 2000.0;
/// Air, cut, air, s.
const AIR_S: f64 = 0.8;
const CUT_S: f64 = 2.5;

#[derive(Clone, Copy)]
struct Tool {
    nose_mm: f64,
    kappa_deg: f64,
}

const INSERT: Tool = Tool {
    nose_mm: 0.8,
    kappa_deg: 75.0,
};

#[derive(Clone, Copy)]
struct Cut {
    feed_mm: f64,
    depth_mm: f64,
    speed_m_per_min: f64,
    diameter_mm: f64,
}

/// Feeds and depths, at one cutting speed while the bar gets thinner.
fn cuts(feeds: &[f64], depths: &[f64]) -> Vec<Cut> {
    let mut all = Vec::new();
    for (i, depth_mm) in depths.iter().enumerate() {
        for (j, feed_mm) in feeds.iter().enumerate() {
            all.push(Cut {
                feed_mm: *feed_mm,
                depth_mm: *depth_mm,
                speed_m_per_min: 180.0,
                diameter_mm: 80.0 - 3.0 * (i * feeds.len() + j) as f64,
            });
        }
    }
    all
}

/// Where the leading flank of the tool stands at a height above the finished surface, mm along the feed.
fn flank(tool: Tool, height: f64) -> f64 {
    let (r, kappa) = (tool.nose_mm, tool.kappa_deg.to_radians());
    let corner = r * (1.0 - kappa.cos());
    if height < corner {
        return (r * r - (r - height).powi(2)).sqrt();
    }
    r * kappa.sin() + (height - corner) / kappa.tan()
}

/// Force on the tool (x against the feed, y away from the work, z along the speed): `law(h)` gives force per width for
/// tangential, radial and axial at a chip thickness.
fn force(tool: Tool, cut: Cut, law: &dyn Fn(f64) -> [f64; 3]) -> [f64; 3] {
    const STRIPS: usize = 40_000;
    let mut sum = [0.0; 3];
    let mut add = |along_feed: f64, up: f64, area: f64| {
        let length = along_feed.hypot(up);
        let [t, r, a] = law(area / length).map(|force| force * length);
        let (sin, cos) = (up / length, along_feed / length);
        sum[0] += r * sin - a * cos;
        sum[1] += r * cos + a * sin;
        sum[2] += t;
    };
    // Finer towards the tip, where the outline lies flat.
    let height = |k: usize| cut.depth_mm * (k as f64 / STRIPS as f64).powi(3);
    for k in 0..STRIPS {
        let (low, high) = (height(k), height(k + 1));
        let middle = 0.5 * (low + high);
        // What the turn before left at this height: up to its leading flank, unless this turn's trailing flank comes first.
        let r = tool.nose_mm;
        let free = match middle < r {
            true => 2.0 * (r * r - (r - middle).powi(2)).sqrt(),
            false => f64::INFINITY,
        };
        let width = match r > 0.0 {
            true => cut.feed_mm.min(free),
            false => cut.feed_mm,
        };
        add(
            flank(tool, high) - flank(tool, low),
            high - low,
            width * (high - low),
        );
    }
    // Behind the tip the nose rubs as far as the ridge.
    if tool.nose_mm > 0.0 {
        let end = (0.5 * cut.feed_mm / tool.nose_mm).asin();
        for k in 0..2000 {
            let at = |k: usize| end * k as f64 / 2000.0;
            let arc = |k: usize| (tool.nose_mm * at(k).sin(), tool.nose_mm * (1.0 - at(k).cos()));
            let ((x0, z0), (x1, z1)) = (arc(k), arc(k + 1));
            add(x1 - x0, -(z1 - z0), 0.0);
        }
    }
    sum
}

fn linear(h: f64) -> [f64; 3] {
    [0, 1, 2].map(|i| TRUTH[i] * h + TRUTH[i + 3])
}

/// What stands in a campaign besides its cuts.
struct Setup<'a> {
    /// `[dynamometer]` of the file.
    matrix: &'a str,
    /// Recorded channels of forces in tool axes.
    recorded: &'a dyn Fn([f64; 3]) -> [f64; 3],
    /// Changes a sample of a channel: (cut, channel, sample).
    spoil: &'a dyn Fn(usize, usize, f64) -> f64,
    tool: Tool,
    /// Of the material and the tool's table in the file.
    tool_toml: String,
}

fn plain(tool: Tool) -> Setup<'static> {
    Setup {
        matrix: "",
        recorded: &|f| f,
        spoil: &|_, _, v| v,
        tool,
        tool_toml: format!(
            "kind = \"turning\"\nnose_radius_mm = {:?}\ncutting_edge_angle_deg = {:?}\n",
            tool.nose_mm, tool.kappa_deg
        ),
    }
}

fn write_campaign(dir: &Path, cuts: &[Cut], setup: &Setup, law: &dyn Fn(f64) -> [f64; 3]) {
    let mut toml = format!(
        "schema = \"lobestone/campaign/1\"\nname = \"turned\"\n\n[tool]\n{}\n[material]\nname = \"C45 steel\"\n{}",
        setup.tool_toml, setup.matrix
    );
    std::fs::create_dir_all(dir.join("force")).unwrap();
    for (c, cut) in cuts.iter().enumerate() {
        let _ = write!(
            toml,
            "\n[[cut]]\nid = \"{:02}\"\nfile = \"force/{:02}.csv\"\nprocess = \"turning\"\ncutting_speed_m_per_min = {:?}\n\
             diameter_mm = {:?}\nfeed_per_rev_mm = {:?}\ndepth_of_cut_mm = {:?}\norder = {}\n",
            c + 1,
            c + 1,
            cut.speed_m_per_min,
            cut.diameter_mm,
            cut.feed_mm,
            cut.depth_mm,
            c + 1
        );
        std::fs::write(
            dir.join(format!("force/{:02}.csv", c + 1)),
            record(c, cut, setup, law),
        )
        .unwrap();
    }
    std::fs::write(dir.join("campaign.toml"), toml).unwrap();
}

fn record(c: usize, cut: &Cut, setup: &Setup, law: &dyn Fn(f64) -> [f64; 3]) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(c as u64 + 11);
    let mut noise = move || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    let full = force(setup.tool, *cut, law);
    let turn_s = 0.06 * std::f64::consts::PI * cut.diameter_mm / cut.speed_m_per_min;
    let mut text = String::from("Time [s],Fx [N],Fy [N],Fz [N]\n");
    for i in 0..((2.0 * AIR_S + CUT_S) * RATE) as usize {
        let t = i as f64 / RATE;
        let cutting = (AIR_S..AIR_S + CUT_S).contains(&t);
        // The bar runs out a little, and the chip breaks: neither changes the mean.
        let runout = 0.03 * (std::f64::consts::TAU * t / turn_s).sin();
        let chip = 0.02 * noise();
        let now = full.map(|f| if cutting { f * (1.0 + runout + chip) } else { 0.0 });
        let recorded = (setup.recorded)(now);
        let _ = write!(text, "{t:.5}");
        for (channel, value) in recorded.into_iter().enumerate() {
            let drifted = value + 3.0 * noise() + 4.0 + (1.5 - channel as f64) * t;
            let _ = write!(text, ",{:.3}", (setup.spoil)(c, channel, drifted));
        }
        text.push('\n');
    }
    text
}

fn cfc(dir: &Path) -> Value {
    document(&["cfc", dir.to_str().unwrap()])
}

fn warnings(document: &Value) -> String {
    let list = document["warnings"].as_array().unwrap().iter();
    list.map(|w| w.as_str().unwrap()).collect::<Vec<_>>().join("\n")
}

fn value(group: &Value, key: &str) -> Option<(f64, f64)> {
    Some((group[key]["value"].as_f64()?, group[key]["std_error"].as_f64()?))
}

#[test]
fn coefficients_come_back_from_a_nosed_edge_and_the_standard_errors_hold() {
    let dir = tempfile::tempdir().unwrap();
    let all = cuts(&[0.1, 0.16, 0.25, 0.4], &[0.5, 1.0, 2.5]);
    // The dynamometer's x is the passive force counted into the work, its y the feed force.
    let setup = Setup {
        matrix: "\n[dynamometer]\ntool_from_dyno = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]\n",
        recorded: &|[x, y, z]| [-y, x, z],
        ..plain(INSERT)
    };
    write_campaign(dir.path(), &all, &setup, &linear);
    let result = cfc(dir.path());
    let pooled = &result["pooled"][0];
    assert_eq!(pooled["process"], "turning");
    let mut off = 0.0;
    for (key, truth) in COEFFICIENTS.iter().zip(TRUTH) {
        let (value, std) = value(pooled, key).unwrap();
        eprintln!("{key} {value:.2} ± {std:.2}, truth {truth}");
        assert!((value - truth).abs() < 4.0 * std, "{key} {value} ± {std}");
        assert!(std < 0.02 * TRUTH[0], "{key} ± {std}");
        off += ((value - truth) / std).powi(2);
    }
    // χ² of six: 0.2 and 22 are a thousandth away on either side.
    assert!((0.2..22.0).contains(&off), "{off}");
    assert!((value(pooled, COEFFICIENTS[0]).unwrap().0 / TRUTH[0] - 1.0).abs() < 0.01);
    assert_eq!(warnings(&result), "");
    // One cutting speed, though no two spindle speeds are alike.
    assert_eq!(result["groups"].as_array().unwrap().len(), 1);
    assert_eq!(result["trends"].as_array().unwrap().len(), 0);
    assert!(result["cuts"].as_array().unwrap().iter().all(|c| {
        let close = |key: &str, truth: f64| (c[key].as_f64().unwrap() / truth - 1.0).abs() < 1e-5;
        close("cutting_speed_m_per_min", 180.0) && c["tooth_line"].is_null() && c["spindle"].is_null()
    }));
    // The waveform, which is the same force once more, agrees.
    let waveform = &result["groups"][0]["waveform"];
    let of_waveform = waveform["ktc_n_per_mm2"]["value"].as_f64().unwrap();
    assert!((of_waveform / TRUTH[0] - 1.0).abs() < 0.01, "{waveform}");
    // Taken for sharp, the edge's normal points elsewhere.
    let toml = std::fs::read_to_string(dir.path().join("campaign.toml")).unwrap();
    std::fs::write(
        dir.path().join("campaign.toml"),
        toml.replace("nose_radius_mm = 0.8", "nose_radius_mm = 0.0"),
    )
    .unwrap();
    let wrong = cfc(dir.path());
    let (krc, std) = value(&wrong["pooled"][0], COEFFICIENTS[1]).unwrap();
    assert!(std > 10.0, "{krc} ± {std}");
    let misfit = wrong["pooled"][0]["chi2_per_dof"]["y"].as_f64().unwrap();
    assert!(misfit > 100.0, "{misfit}");
}

/// kc1.1 = 2220 N/mm² and m = 0.14 as a steel might have for the cutting force; the others are of the same order.
#[test]
fn kienzles_law_comes_back_from_kienzles_law() {
    const K11: [f64; 3] = [2220.0, 540.0, 380.0];
    const M: [f64; 3] = [0.14, 0.42, 0.36];
    let law = |h: f64| match h > 0.0 {
        true => [0, 1, 2].map(|i| K11[i] * h.powf(1.0 - M[i])),
        false => [0.0; 3],
    };
    for tool in [
        Tool {
            nose_mm: 0.0,
            kappa_deg: 90.0,
        },
        INSERT,
    ] {
        let dir = tempfile::tempdir().unwrap();
        let all = cuts(&[0.04, 0.08, 0.16, 0.3, 0.6], &[1.0, 3.0]);
        write_campaign(dir.path(), &all, &plain(tool), &law);
        let kienzle = &cfc(dir.path())["pooled"][0]["kienzle"];
        assert_eq!(kienzle["preferred"], "kienzle", "{kienzle}");
        for (i, component) in kienzle["components"].as_array().unwrap().iter().enumerate() {
            for (key, truth) in [("k1_1_n_per_mm2", K11[i]), ("m", M[i])] {
                let (value, std) = value(component, key).unwrap();
                eprintln!("{key} {value:.3} ± {std:.3}, truth {truth}");
                assert!((value - truth).abs() < 4.0 * std + 1e-3 * truth, "{component}");
                assert!(std < 0.05 * truth, "{component}");
            }
        }
    }
}

#[test]
fn what_one_feed_or_one_depth_cannot_tell_is_told() {
    let sharp = Tool {
        nose_mm: 0.0,
        kappa_deg: 90.0,
    };
    let dir = tempfile::tempdir().unwrap();
    write_campaign(
        dir.path(),
        &cuts(&[0.2], &[1.0, 2.0, 3.0]),
        &plain(sharp),
        &linear,
    );
    let result = cfc(dir.path());
    let told = warnings(&result);
    for pair in ["Ktc and Kte", "Krc and Kre", "Kac and Kae"] {
        assert!(told.contains(pair), "{told}");
    }
    assert!(told.contains("cut at two feeds or more"), "{told}");
    assert!(
        COEFFICIENTS
            .iter()
            .all(|key| value(&result["pooled"][0], key).is_none())
    );

    // A nose separates them by itself, if it is what the campaign says.
    let dir = tempfile::tempdir().unwrap();
    write_campaign(
        dir.path(),
        &cuts(&[0.2], &[0.3, 1.0, 3.0]),
        &plain(INSERT),
        &linear,
    );
    let told = warnings(&cfc(dir.path()));
    assert!(
        told.contains("one feed (0.2 mm)") && told.contains("by the nose alone"),
        "{told}"
    );

    let dir = tempfile::tempdir().unwrap();
    write_campaign(
        dir.path(),
        &cuts(&[0.1, 0.2, 0.4], &[1.5]),
        &plain(INSERT),
        &linear,
    );
    let result = cfc(dir.path());
    let told = warnings(&result);
    assert!(
        told.contains("one depth (1.5 mm)") && told.contains("nose radius"),
        "{told}"
    );
    let (ktc, std) = value(&result["pooled"][0], COEFFICIENTS[0]).unwrap();
    assert!((ktc - TRUTH[0]).abs() < 4.0 * std && std < 40.0, "{ktc} ± {std}");
}

#[test]
fn swapped_turned_and_clipped_channels_are_told() {
    let all = cuts(&[0.1, 0.2, 0.4], &[1.0, 2.0]);
    let told_of = |setup: Setup| {
        let dir = tempfile::tempdir().unwrap();
        write_campaign(dir.path(), &all, &setup, &linear);
        warnings(&cfc(dir.path()))
    };
    let swapped = told_of(Setup {
        recorded: &|[x, y, z]| [z, y, x],
        ..plain(INSERT)
    });
    assert!(
        swapped.contains("Fz is not the largest force") && swapped.contains("Fx may be the cutting force"),
        "{swapped}"
    );
    assert!(!swapped.contains("too small"), "{swapped}");
    let turned = told_of(Setup {
        recorded: &|[x, y, z]| [-x, y, -z],
        ..plain(INSERT)
    });
    assert!(
        turned.contains("Fx and Fz are negative") && turned.contains("tool_from_dyno"),
        "{turned}"
    );
    let clipped = told_of(Setup {
        spoil: &|cut, channel, v| if cut == 5 && channel == 2 { v.min(900.0) } else { v },
        ..plain(INSERT)
    });
    // A constant force that is cut off stands still.
    assert!(
        clipped.contains("cut 06 (Fz: ") && clipped.contains("choose a larger range"),
        "{clipped}"
    );
    let lbf = told_of(Setup {
        spoil: &|_, _, v| v / 1000.0,
        ..plain(INSERT)
    });
    assert!(lbf.contains("kN called N"), "{lbf}");
}

#[test]
fn every_command_opens_a_turned_campaign() {
    let dir = tempfile::tempdir().unwrap();
    let all = cuts(&[0.1, 0.16, 0.25, 0.4], &[1.0, 2.5]);
    write_campaign(dir.path(), &all, &plain(INSERT), &linear);
    let at = dir.path().to_str().unwrap();
    for command in ["inspect", "compare", "diagnose", "cfc"] {
        let run = lobestone(&[command, at]);
        eprintln!("== {command}\n{}{}", run.stdout, run.stderr);
        assert_eq!(run.status, Some(0), "{command}: {}", run.stderr);
        assert!(!run.stdout.contains("NaN"), "{command}: {}", run.stdout);
    }
    let text = lobestone(&["cfc", at]).stdout;
    assert!(text.contains("Turning, C45 steel: coefficient"), "{text}");
    // A clean campaign lacks nothing.
    let diagnosis = document(&["diagnose", at]);
    assert_eq!(diagnosis["verdict"], "none", "{diagnosis}");
    let not_tried = diagnosis["not_tried"].to_string();
    for effect in ["runout", "chatter", "crosstalk", "dynamometer-resonance"] {
        assert!(not_tried.contains(effect), "{not_tried}");
    }
    let run = lobestone(&["report", at, "--static"]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let html = std::fs::read_to_string(dir.path().join("report/report.html")).unwrap();
    assert!(html.contains("turning: r normal to the edge"));
    assert!(dir.path().join("report/regression-turning-force.png").is_file());
}

#[test]
fn wear_over_the_sequence_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let mut all = cuts(&[0.1, 0.3, 0.16, 0.4], &[1.0, 2.0]);
    all.push(all[0]);
    let sharp = Tool {
        nose_mm: 0.0,
        kappa_deg: 90.0,
    };
    let last = all.len() as f64 - 1.0;
    write_campaign(dir.path(), &all, &plain(sharp), &linear);
    for (c, cut) in all.iter().enumerate() {
        let growth = 1.0 + 1.2 * c as f64 / last;
        let worn = move |h: f64| [0, 1, 2].map(|i| TRUTH[i] * h + growth * TRUTH[i + 3]);
        let text = record(c, cut, &plain(sharp), &worn);
        std::fs::write(dir.path().join(format!("force/{:02}.csv", c + 1)), text).unwrap();
    }
    let diagnosis = document(&["diagnose", dir.path().to_str().unwrap()]);
    assert_eq!(diagnosis["effect"], "tool-wear", "{diagnosis}");
}

#[test]
fn a_cut_list_of_a_lathe_makes_a_campaign() {
    let dir = tempfile::tempdir().unwrap();
    let all = cuts(&[0.1, 0.2, 0.4], &[1.0, 2.0]);
    write_campaign(dir.path(), &all, &plain(INSERT), &linear);
    let truth = cfc(dir.path());
    std::fs::remove_file(dir.path().join("campaign.toml")).unwrap();
    let mut list = String::from("Datei;vc [m/min];D [mm];f [mm/U];ap [mm]\n");
    for (c, cut) in all.iter().enumerate() {
        let row = format!(
            "{:02}.csv;{};{};{};{}\n",
            c + 1,
            cut.speed_m_per_min,
            cut.diameter_mm,
            cut.feed_mm,
            cut.depth_mm
        );
        list += &row.replace("0.", "0,");
    }
    std::fs::write(dir.path().join("schnitte.csv"), list).unwrap();
    let at = dir.path().to_str().unwrap();
    let run = lobestone(&[
        "init",
        at,
        "--process",
        "turning",
        "--nose-radius-mm",
        "0.8",
        "--cutting-edge-angle-deg",
        "75",
        "--cut-list",
        dir.path().join("schnitte.csv").to_str().unwrap(),
    ]);
    let toml = std::fs::read_to_string(dir.path().join("campaign.toml")).unwrap_or_default();
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    assert!(toml.contains("kind = \"turning\""), "{toml}");
    let again = cfc(dir.path());
    for key in COEFFICIENTS {
        let (own, _) = value(&again["pooled"][0], key).unwrap();
        let (before, std) = value(&truth["pooled"][0], key).unwrap();
        // Spindle speeds are written with three decimals.
        assert!((own - before).abs() < 0.05 * std, "{key} {own} {before}\n{toml}");
    }
}

/// A feed per turn, a depth and neither teeth nor immersion; or the operation in the lathe operator's own words.
#[test]
fn a_list_of_a_lathe_is_known_without_being_told() {
    for (head, row) in [
        (
            "archivo;rpm;f [mm/rev];ap [mm];D [mm]",
            "f416_a100.csv;1060;0,2;1;40",
        ),
        (
            "archivo;rpm;f [mm/rev];ap [mm];D [mm];operacion",
            "f416_a100.csv;1060;0,2;1;40;cilindrado",
        ),
        (
            "Datei;n [1/min];f [mm/U];ap [mm];D [mm];Bearbeitung",
            "f416_a100.csv;1060;0,2;1;40;Drehen",
        ),
    ] {
        let dir = tempfile::tempdir().unwrap();
        write_campaign(dir.path(), &cuts(&[0.2], &[1.0]), &plain(INSERT), &linear);
        std::fs::remove_file(dir.path().join("campaign.toml")).unwrap();
        // What the name seems to say is no feed rate.
        let record = dir.path().join("f416_a100.csv");
        std::fs::rename(dir.path().join("force/01.csv"), record).unwrap();
        std::fs::write(dir.path().join("list.csv"), format!("{head}\n{row}\n")).unwrap();
        let run = lobestone(&["init", dir.path().to_str().unwrap()]);
        let toml = std::fs::read_to_string(dir.path().join("campaign.toml")).unwrap_or_default();
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        for line in [
            "process = \"turning\"",
            "feed_per_rev_mm = 0.2",
            "depth_of_cut_mm = 1",
            "kind = \"turning\"",
        ] {
            assert!(toml.contains(line), "{head}: {line}\n{toml}");
        }
    }
}

#[test]
fn keys_of_other_processes_are_refused_with_the_right_name() {
    let dir = tempfile::tempdir().unwrap();
    write_campaign(dir.path(), &cuts(&[0.1, 0.2], &[1.0]), &plain(INSERT), &linear);
    let file = dir.path().join("campaign.toml");
    let toml = std::fs::read_to_string(&file).unwrap();
    for (from, to, said) in [
        ("nose_radius_mm", "corner_radius_mm", "write nose_radius_mm"),
        (
            "cutting_edge_angle_deg",
            "lead_angle_deg",
            "cutting_edge_angle_deg",
        ),
        ("depth_of_cut_mm", "axial_depth_mm", "write depth_of_cut_mm"),
        ("diameter_mm = 80.0\n", "", "spindle_rpm"),
        (
            "diameter_mm = 80.0\n",
            "diameter_mm = 80.0\nspindle_rpm = 500.0\n",
            "125.7 m/min",
        ),
        (
            "kind = \"turning\"\nnose_radius_mm = 0.8\ncutting_edge_angle_deg = 75.0\n",
            "kind = \"endmill\"\ndiameter_mm = 10.0\nteeth = 2\n",
            "no turning tool",
        ),
        (
            "kind = \"turning\"\n",
            "kind = \"turning\"\ndiameter_mm = 60.0\n",
            "the workpiece turns",
        ),
    ] {
        let changed = toml.replacen(from, to, 1);
        assert_ne!(changed, toml);
        std::fs::write(&file, changed).unwrap();
        let run = lobestone(&["cfc", dir.path().to_str().unwrap()]);
        assert_eq!(run.status, Some(1), "{to}: {}", run.stderr);
        assert!(run.stderr.contains(said), "{to}: {}", run.stderr);
    }
}

/// One mode across the edge of a sharp tool: b = 2 k ζ (1 + ζ)/Krc is the absolute limit of orthogonal turning.
#[test]
fn lobes_of_turning_have_their_closed_form() {
    let (k, zeta, krc): (f64, f64, f64) = (2.0e7, 0.03, 900.0);
    for (kappa_deg, axis) in [(90.0f64, "x"), (45.0, "x"), (45.0, "y")] {
        let dir = tempfile::tempdir().unwrap();
        let toml = format!(
            "schema = \"lobestone/campaign/1\"\n[tool]\nkind = \"turning\"\ncutting_edge_angle_deg = {kappa_deg:?}\n[lobes]\n\
             process = \"turning\"\nsource = \"modes\"\nktc_n_per_mm2 = 2000.0\nkrc_n_per_mm2 = {krc:?}\nspindle_rpm = [200.0, \
             3000.0, 1.0]\n[[lobes.mode]]\naxis = \"{axis}\"\nfrequency_hz = 150.0\ndamping_ratio = {zeta:?}\n\
             stiffness_n_per_m = {k:?}\n"
        );
        std::fs::write(dir.path().join("campaign.toml"), toml).unwrap();
        let found = document(&["lobes", dir.path().to_str().unwrap()]);
        let text = found.to_string();
        let (sin, cos) = kappa_deg.to_radians().sin_cos();
        let across = if axis == "x" { sin } else { cos };
        let expected = 2.0 * k * zeta * (1.0 + zeta) * sin / (krc * 1e6 * across * across) * 1e3;
        let least = found["cases"][0]["absolute_limit_mm"]
            .as_f64()
            .or_else(|| found["absolute_limit_mm"].as_f64())
            .unwrap_or_else(|| panic!("{}", &text[..text.len().min(1500)]));
        assert!(
            (least / expected - 1.0).abs() < 1e-3,
            "{kappa_deg} {axis}: {least} {expected}"
        );
    }
}

/// Thin chips dearer by (h/0.1 mm)^−0.25, round a nose where every bit of the edge has another chip.
#[test]
fn a_size_effect_is_found_with_its_exponent() {
    let dir = tempfile::tempdir().unwrap();
    let law = |h: f64| {
        let counted = if h > 0.0 { h * (h / 0.1).powf(-0.25) } else { 0.0 };
        linear(counted)
    };
    let all = cuts(&[0.05, 0.1, 0.2, 0.4], &[1.0, 2.5]);
    write_campaign(dir.path(), &all, &plain(INSERT), &law);
    let diagnosis = document(&["diagnose", dir.path().to_str().unwrap()]);
    assert_eq!(diagnosis["effect"], "size-effect", "{diagnosis}");
    let p = diagnosis["candidates"][0]["parameters"]["p"].as_f64().unwrap();
    assert!((p - 0.25).abs() < 0.005, "{p}");
}
