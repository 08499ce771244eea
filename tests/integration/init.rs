//! `lobestone init`: from the files of practice campaigns to campaigns that say the same as the ones they came with.

use std::path::Path;

use crate::support::{blind, copy_of, document, lobestone};
use lobestone::campaign::{BodyRef, Campaign, CutGeometry};

/// A practice campaign's files without its campaign.toml, and what that said.
fn bare(name: &str) -> (tempfile::TempDir, Campaign) {
    let folder = copy_of(name);
    std::fs::remove_file(folder.path().join("campaign.toml")).unwrap();
    (folder, Campaign::load(&blind(name)).unwrap())
}

fn joined(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}

/// The flags for the robot side of a campaign.
fn structure_flags(campaign: &Campaign) -> Vec<String> {
    let mut flags = vec!["--robot".into(), campaign.robot.as_ref().unwrap().model.clone()];
    for posture in &campaign.postures {
        flags.push("--posture".into());
        flags.push(format!("{}={}", posture.id, joined(&posture.joints_deg)));
    }
    for point in &campaign.points {
        let body = match point.body {
            BodyRef::Base => "base".to_string(),
            BodyRef::Link(i) => format!("link{i}"),
            BodyRef::Tool => "tool".to_string(),
        };
        flags.push("--point".into());
        flags.push(format!(
            "{}={body}:{}:base",
            point.node,
            joined(&point.position_m)
        ));
    }
    flags
}

fn init(dir: &Path, flags: &[String]) -> serde_json::Value {
    let mut arguments = vec!["init", dir.to_str().unwrap()];
    arguments.extend(flags.iter().map(String::as_str));
    document(&arguments)
}

#[test]
fn frfs_and_flags_make_a_campaign_that_computes() {
    let (folder, original) = bare("frf-9113");
    let made = init(folder.path(), &structure_flags(&original));
    assert_eq!(made["complete"], true, "{made}");
    assert_eq!(made["missing"].as_array().unwrap().len(), 0);
    let campaign = Campaign::load(folder.path()).unwrap();
    assert_eq!(campaign.postures, original.postures);
    assert_eq!(campaign.points, original.points);
    assert_eq!(campaign.frfs.len(), original.frfs.len());
    let nrms = |dir: &Path| {
        let compared = document(&["compare", dir.to_str().unwrap()]);
        compared["error"]["nrms"].as_f64().unwrap()
    };
    let (ours, theirs) = (nrms(folder.path()), nrms(&blind("frf-9113")));
    assert!((ours / theirs - 1.0).abs() < 1e-9, "{ours} {theirs}");
    let step = made["next_step"].as_str().unwrap();
    assert!(step.contains("`lobestone compare "), "{step}");
}

#[test]
fn what_nobody_said_is_left_to_fill_in() {
    let (folder, original) = bare("frf-9113");
    let made = init(folder.path(), &[]);
    assert_eq!(made["complete"], false);
    let missing: Vec<&str> = made["missing"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| m["key"].as_str().unwrap())
        .collect();
    let several = original.points.len() > 1;
    let expected = match several {
        true => vec!["model", "body", "joints_deg"],
        false => vec!["model", "joints_deg"],
    };
    assert_eq!(missing, expected);
    let file = folder.path().join("campaign.toml");
    let mut text = std::fs::read_to_string(&file).unwrap();
    let left = text.matches("# fill in: ").count();
    let points = if several { original.points.len() } else { 0 };
    assert_eq!(left, 1 + original.postures.len() + points);
    // Filling in where it says so makes it load.
    for posture in &original.postures {
        let line = text
            .lines()
            .find(|l| l.starts_with("# fill in: joints_deg"))
            .unwrap()
            .to_string();
        text = text.replacen(
            &line,
            &format!("joints_deg = [{}]", joined(&posture.joints_deg)),
            1,
        );
    }
    for _ in 0..points {
        let line = text
            .lines()
            .find(|l| l.starts_with("# fill in: body"))
            .unwrap()
            .to_string();
        text = text.replacen(&line, "body = \"tool\"", 1);
    }
    let line = text
        .lines()
        .find(|l| l.starts_with("# fill in: model"))
        .unwrap()
        .to_string();
    std::fs::write(&file, text.replace(&line, "model = \"irb6640\"")).unwrap();
    assert_eq!(Campaign::load(folder.path()).unwrap().postures, original.postures);
}

#[test]
fn cuts_and_a_list_of_them_make_a_campaign_that_computes() {
    for name in ["force-9400", "force-9439"] {
        let (folder, original) = bare(name);
        let tool = original.tool.as_ref().unwrap();
        let mut list =
            "file;process;spindle_rpm;feed_per_tooth_mm;axial_depth_mm;start_deg;exit_deg;feed_per_rev_mm;\
                        pilot_diameter_mm;hole_depth_mm;order\n"
                .to_string();
        for cut in &original.cuts {
            // As a German spreadsheet writes numbers.
            let cells = match cut.geometry {
                CutGeometry::Milling {
                    feed_per_tooth_mm,
                    axial_depth_mm,
                    immersion,
                } => format!(
                    "milling;{};{feed_per_tooth_mm};{axial_depth_mm};{};{};;;",
                    cut.spindle_rpm,
                    immersion.start_rad.to_degrees(),
                    immersion.exit_rad.to_degrees()
                ),
                CutGeometry::Drilling {
                    feed_per_rev_mm,
                    pilot_diameter_mm,
                    hole_depth_mm,
                } => format!(
                    "drilling;{};;;;;{feed_per_rev_mm};{pilot_diameter_mm};{}",
                    cut.spindle_rpm,
                    hole_depth_mm.unwrap()
                ),
                CutGeometry::Turning { .. } => panic!("no practice campaign is turned"),
            };
            let file = cut.file.file_name().unwrap().to_str().unwrap();
            list += &format!("{file};{};{}\n", cells.replace('.', ","), cut.order.unwrap());
        }
        let elsewhere = tempfile::tempdir().unwrap();
        let path = elsewhere.path().join("cuts.csv");
        std::fs::write(&path, list).unwrap();
        let rows = original.dynamometer.tool_from_dyno.map(|r| joined(&r));
        let mut flags: Vec<String> = [
            "--cut-list",
            path.to_str().unwrap(),
            "--diameter-mm",
            &tool.diameter_mm.to_string(),
            "--teeth",
            &tool.teeth.to_string(),
            "--tool-from-dyno",
            &rows.join(";"),
        ]
        .map(String::from)
        .into();
        match (tool.half_point_angle_deg, tool.web_thickness_mm) {
            (Some(angle), Some(web)) => {
                flags.extend(["--half-point-angle-deg".into(), angle.to_string()]);
                flags.extend(["--web-thickness-mm".into(), web.to_string()]);
            }
            _ => flags.extend(["--helix-deg".into(), tool.helix_deg.to_string()]),
        }
        let made = init(folder.path(), &flags);
        assert_eq!(made["complete"], true, "{made}");
        let campaign = Campaign::load(folder.path()).unwrap();
        assert_eq!(campaign.tool, original.tool);
        assert_eq!(campaign.dynamometer, original.dynamometer);
        let facts = |c: &Campaign| -> Vec<_> {
            c.cuts
                .iter()
                .map(|cut| (cut.id.clone(), cut.order, cut.spindle_rpm))
                .collect()
        };
        assert_eq!(facts(&campaign), facts(&original));
        let coefficients = |dir: &Path| {
            let found = document(&["cfc", dir.to_str().unwrap()]);
            found["pooled"][0]["ktc_n_per_mm2"]["value"].as_f64().unwrap()
        };
        let (ours, theirs) = (coefficients(folder.path()), coefficients(&blind(name)));
        assert!((ours / theirs - 1.0).abs() < 1e-9, "{name}: {ours} {theirs}");
    }
}

#[test]
fn names_of_files_say_what_was_cut() {
    let (folder, _) = bare("force-9400");
    let force = folder.path().join("force");
    let target = force.join("cut01_n1160_fz0.05_ap2_slot.txt");
    std::fs::rename(force.join("cut01.txt"), target).unwrap();
    for other in ["cut04", "cut05", "cut09", "cut13", "cut16"] {
        std::fs::remove_file(force.join(format!("{other}.txt"))).unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "cut 3 was loud\n").unwrap();
    let tool = ["--diameter-mm", "16", "--teeth", "6", "--helix-deg", "42"].map(String::from);
    let made = init(
        folder.path(),
        &[&tool[..], &["--process".into(), "milling".into()]].concat(),
    );
    assert_eq!(made["complete"], true, "{made}");
    assert_eq!(made["not_used"][0]["file"], "notes.txt");
    let text = std::fs::read_to_string(folder.path().join("campaign.toml")).unwrap();
    assert!(
        text.contains("spindle_rpm = 1160.0  # guessed: from the file name"),
        "{text}"
    );
    let campaign = Campaign::load(folder.path()).unwrap();
    assert_eq!(campaign.cuts[0].id, "01");
    assert_eq!(campaign.cuts[0].spindle_rpm, 1160.0);
}

#[test]
fn nothing_is_overwritten_unasked_and_nothing_wrong_is_written() {
    let folder = copy_of("frf-9000");
    let file = folder.path().join("campaign.toml");
    let before = std::fs::read(&file).unwrap();
    let dir = folder.path().to_str().unwrap();
    let run = lobestone(&["init", dir]);
    assert_eq!(run.status, Some(1));
    assert!(run.stderr.contains("--force"), "{}", run.stderr);
    assert_eq!(std::fs::read(&file).unwrap(), before);
    // All is said, but the robot has six joints.
    let mut flags = structure_flags(&Campaign::load(folder.path()).unwrap());
    let wrong = flags.iter().position(|f| f.starts_with("p2=")).unwrap();
    flags[wrong] = "p2=1,2,3".into();
    let mut arguments = vec!["init", dir, "--force"];
    arguments.extend(flags.iter().map(String::as_str));
    let run = lobestone(&arguments);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("joints_deg") && run.stderr.contains("nothing was written"),
        "{}",
        run.stderr
    );
    assert_eq!(std::fs::read(&file).unwrap(), before);
    flags[wrong] = "p2=1,2,3,4,5,6".into();
    flags.push("--force".into());
    assert_eq!(init(folder.path(), &flags)["complete"], true);
    assert_ne!(std::fs::read(&file).unwrap(), before);
    assert_eq!(lobestone(&["init", dir, "--posture", "p1"]).status, Some(2));
    let stranger = lobestone(&["init", dir, "--force", "--posture", "p99=1,2,3,4,5,6"]);
    assert!(
        stranger.stderr.contains("no posture \"p99\""),
        "{}",
        stranger.stderr
    );
    let empty = tempfile::tempdir().unwrap();
    let nothing = lobestone(&["init", empty.path().to_str().unwrap()]);
    assert!(
        nothing.stderr.contains("no FRFs and no force records"),
        "{}",
        nothing.stderr
    );
    assert!(std::fs::read_dir(empty.path()).unwrap().next().is_none());
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_not_followed() {
    use std::os::unix::fs::symlink;
    let (folder, original) = bare("frf-9000");
    let outside = copy_of("frf-9112");
    symlink(outside.path().join("frf"), folder.path().join("more")).unwrap();
    symlink(outside.path().join("frf/p1.uff"), folder.path().join("p9.uff")).unwrap();
    symlink("..", folder.path().join("loop")).unwrap();
    let made = init(folder.path(), &[]);
    assert_eq!(made["frfs"].as_array().unwrap().len(), original.frfs.len());
}

/// A technician's folder: postures by letters, a copy, records named by hand, a list of cuts in German or French.
#[test]
fn a_folder_as_technicians_keep_it_needs_only_what_no_file_says() {
    let structure = Campaign::load(&blind("frf-9114")).unwrap();
    let forces = Campaign::load(&blind("force-9400")).unwrap();
    let german = "Versuchsreihe März\n\nDatei;Drehzahl [1/min];Vorschub [mm/min];ap [mm];Eintritt [°];Austritt [°];Reihenfolge;Bemerkung\n";
    let french = "Fichier;Vitesse de rotation (tr/min);Avance par dent (µm);Profondeur de passe (mm);Angle d'entrée;Angle de sortie;Ordre;Note\n";
    for (is_german, head) in [(true, german), (false, french)] {
        let folder = tempfile::tempdir().unwrap();
        let (raw, old) = (
            folder.path().join("Messung/roh"),
            folder.path().join("Messung/alt"),
        );
        let kraft = folder.path().join("Kraft (Kistler)");
        for dir in [&raw, &old, &kraft] {
            std::fs::create_dir_all(dir).unwrap();
        }
        let names = [
            "FRF_Pos A (neu).csv",
            "FRF_Pos B_final.csv",
            "frf_posC_v2.CSV",
            "FRF_Pos D.csv",
        ];
        for (i, name) in names.iter().enumerate() {
            let file = blind("frf-9114").join(format!("frf/p{}.csv", i + 1));
            std::fs::copy(&file, raw.join(name)).unwrap();
            if i == 3 {
                std::fs::copy(&file, old.join("FRF_Pos D - Kopie.csv")).unwrap();
            }
        }
        let tool = forces.tool.as_ref().unwrap();
        let mut list = head.to_string();
        for (i, cut) in forces.cuts.iter().enumerate() {
            let number: usize = cut.id.parse().unwrap();
            let name = match i {
                1 => format!("Versuch {number} 1620"),
                2 => format!("versuch_{number}_wdh"),
                _ => format!("Versuch_{number}"),
            };
            std::fs::copy(&cut.file, kraft.join(format!("{name}.txt"))).unwrap();
            let CutGeometry::Milling {
                feed_per_tooth_mm: fz,
                axial_depth_mm: ap,
                immersion,
            } = &cut.geometry
            else {
                panic!("a milling campaign");
            };
            let feed = match is_german {
                true => fz * tool.teeth as f64 * cut.spindle_rpm,
                false => 1000.0 * fz,
            };
            // Names a little otherwise than the files have them.
            list += &format!(
                "{};{};{feed};{ap};{};{};{};laut\n",
                name.replace('_', " "),
                cut.spindle_rpm,
                immersion.start_rad.to_degrees().round(),
                immersion.exit_rad.to_degrees().round(),
                cut.order.unwrap()
            )
            .replace('.', ",");
        }
        std::fs::write(folder.path().join("Liste.csv"), list).unwrap();
        let rows = forces.dynamometer.tool_from_dyno.map(|r| joined(&r));
        let mut flags: Vec<String> = ["--robot", "irb6640", "--quantity", "receptance", "--diameter-mm"]
            .map(String::from)
            .into();
        flags.extend([
            tool.diameter_mm.to_string(),
            "--teeth".into(),
            tool.teeth.to_string(),
        ]);
        flags.extend(["--helix-deg".into(), tool.helix_deg.to_string()]);
        flags.extend(["--tool-from-dyno".into(), rows.join(";")]);
        let made = init(folder.path(), &flags);
        let missing = made["missing"].as_array().unwrap();
        assert_eq!(missing.len(), 1, "{made}");
        assert_eq!(missing[0]["key"], "joints_deg");
        assert_eq!(missing[0]["of"], serde_json::json!(["A", "B", "D", "C"]));
        assert!(made["cut_list"].as_str().unwrap().ends_with("Liste.csv"));
        assert!(
            made["not_used"]
                .to_string()
                .contains("a copy of Messung/roh/FRF_Pos D.csv"),
            "{made}"
        );
        // The hand edit: joint angles.
        let file = folder.path().join("campaign.toml");
        let mut text = std::fs::read_to_string(&file).unwrap();
        for (posture, id) in structure.postures.iter().zip(["A", "B", "C", "D"]) {
            let at = text.find(&format!("[[posture]]\nid = \"{id}\"")).unwrap();
            let line = at + text[at..].find("# fill in: joints_deg").unwrap();
            let end = line + text[line..].find('\n').unwrap();
            let joints = joined(&posture.joints_deg);
            text.replace_range(line..end, &format!("joints_deg = [{joints}]"));
        }
        std::fs::write(&file, text).unwrap();
        let campaign = Campaign::load(folder.path()).unwrap();
        assert_eq!(campaign.frfs.len(), 4);
        for cut in &forces.cuts {
            let same = campaign
                .cuts
                .iter()
                .find(|c| c.order == cut.order)
                .unwrap_or_else(|| panic!("cut {}", cut.id));
            assert_eq!(same.spindle_rpm, cut.spindle_rpm);
            let (ours, theirs) = (format!("{:?}", same.geometry), format!("{:?}", cut.geometry));
            let feed = |g: &CutGeometry| match g {
                CutGeometry::Milling {
                    feed_per_tooth_mm, ..
                } => *feed_per_tooth_mm,
                CutGeometry::Drilling { .. } | CutGeometry::Turning { .. } => f64::NAN,
            };
            assert!(
                (feed(&same.geometry) / feed(&cut.geometry) - 1.0).abs() < 1e-6,
                "{ours} {theirs}"
            );
        }
        let coefficient = |dir: &Path| {
            let found = document(&["cfc", dir.to_str().unwrap()]);
            found["pooled"][0]["ktc_n_per_mm2"]["value"].as_f64().unwrap()
        };
        let (ours, theirs) = (coefficient(folder.path()), coefficient(&blind("force-9400")));
        assert!((ours / theirs - 1.0).abs() < 1e-5, "{ours} {theirs}");
        assert!(
            made["guessed"].to_string().contains("from the file name"),
            "{made}"
        );
    }
}

#[test]
fn engagement_follows_from_ae_and_the_diameter_and_its_guess_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let record = blind("force-9400").join("force/cut01.txt");
    std::fs::copy(&record, folder.path().join("6-n6000f300ap3ae4.txt")).unwrap();
    std::fs::copy(&record, folder.path().join("7-n6000f300ap3ae16 Gegenlauf.txt")).unwrap();
    std::fs::copy(&record, folder.path().join("8-n6000f300ap3ae8 Gegenlauf.txt")).unwrap();
    let flags = ["--diameter-mm", "16", "--teeth", "2", "--helix-deg", "30"].map(String::from);
    let made = init(folder.path(), &flags);
    assert_eq!(made["complete"], true, "{made}");
    let text = std::fs::read_to_string(folder.path().join("campaign.toml")).unwrap();
    for part in [
        "spindle_rpm = 6000.0  # guessed: from the file name",
        "feed_per_tooth_mm = 0.025  # guessed: 300 mm/min at 6000 rpm, 2 teeth",
        "start_deg = 120.0  # guessed: ae 4 of D 16 mm; down milling taken, up milling is 0 to 60.0 deg",
        "immersion = \"slot\"",
        "exit_deg = 90.0  # guessed: ae 8 of D 16 mm, up milling",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
