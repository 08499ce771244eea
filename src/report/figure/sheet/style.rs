//! One look for all figures. Every colour differs from its neighbours in lightness and every line in
//! its dashes as well, so that a grey print or a colour-blind reader loses nothing.

use crate::report::figure::sheet::axis::Tick;
use crate::report::figure::sheet::canvas::{Color, Lettering, Marker, Stroke};

pub const INK: Color = Color(28, 30, 33);
pub const MUTED: Color = Color(95, 100, 108);
pub const WHITE: Color = Color(255, 255, 255);
pub const BLUE: Color = Color(13, 84, 156);
pub const ORANGE: Color = Color(226, 138, 32);
pub const RED: Color = Color(186, 40, 34);
pub const PALE_BLUE: Color = Color(160, 196, 228);
pub const PALE_GREEN: Color = Color(158, 206, 160);
pub const GREY: Color = Color(150, 154, 160);

pub const TITLE: Lettering = Lettering::new(17.0, INK).bold();
pub const AXIS: Lettering = Lettering::new(14.5, INK);
pub const TICK: Lettering = Lettering::new(13.5, INK);
pub const LEGEND: Lettering = Lettering::new(13.5, INK);
pub const NOTE: Lettering = Lettering::new(12.5, MUTED);

pub const FRAME: Stroke = Stroke::solid(Color(60, 64, 70), 1.0);

pub fn grid(tick: &Tick) -> Stroke {
    match tick.label.is_empty() {
        true => Stroke::solid(Color(241, 242, 244), 1.0),
        false => Stroke::solid(Color(222, 225, 229), 1.0),
    }
}

/// What was measured: dark signs, never a line alone.
pub const MEASURED: Color = INK;
/// A limit or a level to compare with.
pub const LEVEL: Stroke = Stroke::dashed(MUTED, 1.6, &[2.5, 3.5]);

/// The models of one FRF in the order of their making; the last is the one that counts.
pub fn model(index: usize, count: usize) -> Stroke {
    let from_last = count.saturating_sub(index + 1);
    match from_last {
        0 => Stroke::solid(BLUE, 2.0),
        1 => Stroke::dashed(ORANGE, 2.0, &[8.0, 4.0]),
        2 => Stroke::dashed(Color(122, 150, 110), 1.8, &[3.0, 3.0]),
        _ => Stroke::dashed(GREY, 1.6, &[10.0, 3.0, 2.0, 3.0]),
    }
}

/// Series of equal rank.
pub fn series(index: usize) -> Stroke {
    const COLORS: [Color; 7] = [
        BLUE,
        ORANGE,
        Color(140, 24, 60),
        Color(96, 168, 120),
        INK,
        Color(206, 92, 156),
        Color(120, 124, 130),
    ];
    const DASHES: [&[f64]; 5] = [
        &[],
        &[9.0, 4.0],
        &[3.0, 3.0],
        &[12.0, 3.0, 3.0, 3.0],
        &[16.0, 5.0],
    ];
    // Seven and five share no divisor: 35 different lines before the first comes again.
    let color = COLORS.get(index % COLORS.len()).copied().unwrap_or(INK);
    let dash = DASHES.get(index % DASHES.len()).copied().unwrap_or(&[]);
    Stroke {
        color,
        width: 2.0,
        dash,
    }
}

pub fn series_marker(index: usize) -> Marker {
    const MARKERS: [Marker; 5] = [
        Marker::Disc,
        Marker::Square,
        Marker::Diamond,
        Marker::Triangle,
        Marker::Ring,
    ];
    MARKERS
        .get(index % MARKERS.len())
        .copied()
        .unwrap_or(Marker::Disc)
}

/// Fills of bars side by side, far apart in lightness.
pub fn bar(index: usize) -> Color {
    const COLORS: [Color; 6] = [
        Color(198, 203, 209),
        Color(45, 48, 53),
        ORANGE,
        Color(52, 120, 190),
        Color(160, 196, 228),
        Color(140, 24, 60),
    ];
    COLORS.get(index % COLORS.len()).copied().unwrap_or(INK)
}

/// 0 … 1 from nearly white over orange to dark red: lightness falls all the way, so it survives a grey print.
pub fn ramp(share: f64) -> Color {
    const STOPS: [Color; 6] = [
        Color(255, 249, 238),
        Color(254, 224, 176),
        Color(250, 178, 112),
        Color(228, 110, 66),
        Color(178, 36, 36),
        Color(88, 4, 20),
    ];
    let position = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let index = (position as usize).min(STOPS.len() - 2);
    let part = position - index as f64;
    match (STOPS.get(index), STOPS.get(index + 1)) {
        (Some(a), Some(b)) => {
            let mix = |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
            Color(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
        }
        _ => INK,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_darkens_all_the_way_and_bars_differ_in_grey() {
        for i in 0..100 {
            assert!(ramp(f64::from(i) / 100.0).lightness() > ramp(f64::from(i + 1) / 100.0).lightness());
        }
        for i in 0..4 {
            for j in 0..i {
                assert!((bar(i).lightness() - bar(j).lightness()).abs() > 0.1, "{i} {j}");
            }
        }
        let (measured, model_stroke) = (MEASURED, model(1, 2));
        assert!(model_stroke.color.lightness() - measured.lightness() > 0.1);
        assert!(model(0, 2).color.lightness() - model_stroke.color.lightness() > 0.2);
    }
}
