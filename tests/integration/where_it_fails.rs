//! Where the model fails, and what of that the missing effect takes away: `compare` and `diagnose`.

use serde_json::Value;

use crate::support::{blind, copy_of, document, lobestone, truth};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

#[test]
fn compare_says_where() {
    let dir = blind("frf-9114");
    let dir = dir.to_str().unwrap();
    let compared = document(&["compare", dir]);

    let peaks = compared["residual_peaks"].as_array().unwrap();
    assert!(!peaks.is_empty() && peaks.len() <= 5);
    for (peak, hz) in peaks
        .iter()
        .zip(compared["residual_peaks_hz"].as_array().unwrap())
    {
        assert_eq!(peak["frequency_hz"], *hz);
        assert!(number(&peak["times_noise"]) > 1.0);
    }
    let worst = compared["worst_frfs"].as_array().unwrap();
    assert!(worst.len() > 1);
    for pair in worst.windows(2) {
        assert!(number(&pair[0]["times_noise"]) >= number(&pair[1]["times_noise"]));
    }
    for frf in worst {
        let ratio = number(&frf["nrms"]) / number(&frf["noise_floor_nrms"]);
        assert!((ratio / number(&frf["times_noise"]) - 1.0).abs() < 1e-9);
        let line = &frf["worst_line"];
        // Magnitudes differ by no more than the complex values do.
        let apart = (number(&line["measured_m_per_n"]) - number(&line["model_m_per_n"])).abs();
        assert!(apart <= number(&line["times_noise"]) * number(&line["noise_m_per_n"]) * (1.0 + 1e-9));
    }
    let map = &compared["map"];
    let postures = map["times_noise"].as_array().unwrap();
    assert_eq!(postures.len(), map["postures"].as_array().unwrap().len());
    let cells = postures[0][0].as_array().unwrap();
    assert_eq!(cells.len() + 1, map["band_edges_hz"].as_array().unwrap().len());

    let text = lobestone(&["compare", dir]).stdout;
    assert!(
        text.contains("residual stands out at") && text.contains("error map") && text.contains("worst FRFs")
    );
    // Bars elsewhere are made of the same characters.
    let shades = text.split("error map").nth(1).unwrap().lines().skip(1);
    assert!(
        shades
            .take_while(|l| !l.is_empty())
            .any(|l| l.contains(['▓', '█'])),
        "dark where the model fails"
    );
    let grid = text.lines().filter(|l| l.contains(['·', '░', '▒', '▓', '█']));
    let widest = grid
        .filter(|l| !l.contains("error map"))
        .map(|l| l.chars().count())
        .max();
    assert!(widest.unwrap() <= 80);
}

#[test]
fn what_the_missing_effect_takes_away() {
    let copy = copy_of("frf-9114");
    let found = document(&["diagnose", copy.path().to_str().unwrap()]);
    let explains = &found["explains"];
    assert_eq!(explains["effect"], truth("frf-9114")["effect"]);
    assert!(number(&explains["share"]) > 0.98, "{explains}");
    assert!(number(&explains["times_noise_after"]) < 1.1);
    assert_eq!(explains["nrms_before"], found["baseline"]["nrms"]);
    assert_eq!(explains["nrms_after"], found["candidates"][0]["nrms"]);
    for kind in ["by_posture", "by_direction", "by_point"] {
        let parts = explains[kind].as_object().unwrap();
        let sum: f64 = parts.values().map(|p| number(&p["of_all"])).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{kind}: {sum}");
    }
    let bands = explains["by_band"].as_array().unwrap();
    let sum: f64 = bands.iter().map(|b| number(&b["of_all"])).sum();
    assert!((sum - 1.0).abs() < 1e-9);
    let place = &explains["taken_from"];
    assert!(number(&place["from_hz"]) < number(&place["to_hz"]));
}

#[test]
fn where_nothing_is_missing_nothing_is_explained() {
    let copy = copy_of("frf-9112");
    let found = document(&["diagnose", copy.path().to_str().unwrap()]);
    assert!(found["explains"].is_null());
}
