//! Geometry of a test (or of a finite element model) and mode shapes on it: universal datasets 15 and 2411 (nodes), 82
//! (trace lines), 55 (data at nodes), 164 (unit of length), and a CSV of nodes and lines.
//!
//! Source of the formats: Universal File Datasets, Structural Dynamics Research Laboratory, University of Cincinnati.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use num_complex::Complex64;

use crate::ingest::formats::uff::is_separator;
use crate::ingest::tables::number;
use crate::ingest::text::{Lines, decode, without_byte_order_mark};
use crate::{Error, InputError, Result};

/// Where the measured points are, and what to draw between them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Geometry {
    /// By number, position in m.
    pub nodes: BTreeMap<i64, [f64; 3]>,
    /// Pairs of node numbers.
    pub lines: Vec<[i64; 2]>,
}

/// One mode at nodes, as dataset 55 holds it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodalShape {
    /// First line of the dataset's text.
    pub title: String,
    /// Undamped natural frequency.
    pub frequency_hz: f64,
    /// Viscous damping ratio ζ.
    pub damping_ratio: f64,
    /// For the shape as it stands, kg; 0 where the file does not say.
    pub modal_mass_kg: f64,
    /// For complex modes (residue = ψψ/a), kg/s.
    pub modal_a: Option<Complex64>,
    /// By node number, along x, y, z.
    pub at_node: BTreeMap<i64, [Complex64; 3]>,
}

impl NodalShape {
    /// Is any component complex?
    pub fn is_complex(&self) -> bool {
        self.modal_a.is_some()
    }
}

/// Reads geometry and shapes of one file: a universal file, or a CSV with rows `node,x,y,z` (m) and `line,from,to`.
///
/// # Errors
/// The file cannot be read or holds no node, line or shape; a row of a CSV that is neither.
pub fn read_geometry(path: &Path) -> Result<(Geometry, Vec<NodalShape>)> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let bytes = without_byte_order_mark(&bytes);
    let universal = Lines::new(&bytes).find(|l| !l.trim_ascii().is_empty());
    let found = match universal {
        Some(line) if is_separator(line) => Ok(of_universal(&bytes)),
        _ => of_csv(&decode(&bytes)).map(|geometry| (geometry, Vec::new())),
    };
    let (geometry, shapes) = found.map_err(|e| Error::from(e.file(path)))?;
    if geometry.nodes.is_empty() && shapes.is_empty() {
        return Err(
            InputError::new("neither nodes (dataset 15 or 2411) nor mode shapes (dataset 55)")
                .file(path)
                .remedy("give a universal file with geometry or shapes, or a CSV with rows node,x,y,z and line,from,to")
                .into(),
        );
    }
    Ok((geometry, shapes))
}

fn of_csv(text: &str) -> std::result::Result<Geometry, InputError> {
    let mut geometry = Geometry::default();
    for (k, row) in text.lines().enumerate() {
        let cells: Vec<&str> = row.split([',', ';', '\t']).map(str::trim).collect();
        let first = cells[0];
        if first.is_empty() || first.starts_with('#') {
            continue;
        }
        let whole = |text: &str| text.parse::<i64>().ok();
        let metres = |text: &str| text.parse::<f64>().ok().filter(|x| x.is_finite());
        match cells.as_slice() {
            ["line", from, to] if whole(from).is_some() && whole(to).is_some() => {
                geometry
                    .lines
                    .extend(whole(from).zip(whole(to)).map(|(a, b)| [a, b]));
            }
            ["node", rest @ ..] | rest if rest.len() == 4 && whole(rest[0]).is_some() => {
                let at: Option<Vec<f64>> = rest[1..].iter().map(|t| metres(t)).collect();
                match (whole(rest[0]), at.as_deref()) {
                    (Some(node), Some(&[x, y, z])) => geometry.nodes.insert(node, [x, y, z]),
                    _ => return Err(wrong_row(k, row)),
                };
            }
            // A heading.
            _ if geometry.nodes.is_empty() && geometry.lines.is_empty() => {}
            _ => return Err(wrong_row(k, row)),
        }
    }
    Ok(geometry)
}

fn wrong_row(k: usize, row: &str) -> InputError {
    let row: String = row.chars().take(60).collect();
    InputError::new(format!("neither node,x,y,z nor line,from,to: {row:?}"))
        .line(k + 1)
        .remedy("write one node a row, positions in m, and one line a row: line,1,2")
}

fn of_universal(bytes: &[u8]) -> (Geometry, Vec<NodalShape>) {
    let mut geometry = Geometry::default();
    let mut shapes = Vec::new();
    let mut metres_per_unit = 1.0;
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        if !is_separator(line) {
            continue;
        }
        let Some(header) = lines
            .by_ref()
            .find(|l| !l.trim_ascii().is_empty() && !is_separator(l))
        else {
            break;
        };
        let header = decode(header);
        let number: String = header.trim().chars().take_while(char::is_ascii_digit).collect();
        let body: Vec<String> = lines
            .by_ref()
            .take_while(|l| !is_separator(l))
            .map(decode)
            .collect();
        match number.as_str() {
            "15" => geometry.nodes.extend(body.iter().filter_map(|l| node_15(l))),
            "2411" => geometry.nodes.extend(body.chunks(2).filter_map(node_2411)),
            "82" => geometry.lines.extend(traces(&body)),
            "55" => shapes.extend(shape(&body)),
            "164" => {
                let factor = body.get(1).and_then(|l| numbers(l).first().copied());
                metres_per_unit = factor.filter(|f| *f > 0.0).map_or(1.0, |f| 1.0 / f);
            }
            _ => {}
        }
    }
    for at in geometry.nodes.values_mut() {
        *at = at.map(|x| x * metres_per_unit);
    }
    (geometry, shapes)
}

/// Numbers of a line, Fortran's D exponents too.
fn numbers(line: &str) -> Vec<f64> {
    line.split_ascii_whitespace()
        .map_while(|t| number::field(t.as_bytes(), b'.'))
        .collect()
}

/// 4I10, 3E13.5; columns may touch.
fn node_15(line: &str) -> Option<(i64, [f64; 3])> {
    let node = line.get(..10)?.trim().parse().ok()?;
    let at = |k: usize| {
        let text = line.get(40 + 13 * k..(53 + 13 * k).min(line.len()))?;
        number::field(text.trim().as_bytes(), b'.')
    };
    Some((node, [at(0)?, at(1)?, at(2)?]))
}

/// 4I10, then 3D25.16 on a line of its own.
fn node_2411(pair: &[String]) -> Option<(i64, [f64; 3])> {
    let [labels, at] = pair else { return None };
    let node = labels.split_ascii_whitespace().next()?.parse().ok()?;
    match numbers(at).as_slice() {
        &[x, y, z] => Some((node, [x, y, z])),
        _ => None,
    }
}

/// A pen that goes from node to node; 0 lifts it.
fn traces(body: &[String]) -> Vec<[i64; 2]> {
    let nodes: Vec<i64> = body
        .iter()
        .skip(2)
        .flat_map(|l| l.split_ascii_whitespace())
        .map_while(|t| t.parse().ok())
        .collect();
    let moves = nodes
        .windows(2)
        .filter(|w| w[0] != 0 && w[1] != 0 && w[0] != w[1]);
    moves.map(|w| [w[0], w[1]]).collect()
}

/// Dataset 55: normal modes (analysis type 2) and complex modes (3, or 7 for second order).
fn shape(body: &[String]) -> Option<NodalShape> {
    let integers = |line: &str| -> Vec<i64> {
        line.split_ascii_whitespace()
            .map_while(|t| t.parse().ok())
            .collect()
    };
    let kind = integers(body.get(5)?);
    let [_, analysis, _, _, data, per_node, ..] = *kind.as_slice() else {
        return None;
    };
    let counts = integers(body.get(6)?);
    let reals_wanted = usize::try_from(*counts.get(1)?).ok()?;
    let mut rest = body[7..].iter();
    let mut reals: Vec<f64> = Vec::new();
    while reals.len() < reals_wanted {
        let line = numbers(rest.next()?);
        if line.is_empty() {
            return None;
        }
        reals.extend(line);
    }
    let mut found = NodalShape {
        title: body[0].trim().to_owned(),
        ..NodalShape::default()
    };
    match (analysis, reals.as_slice()) {
        (2, [frequency, mass, damping, ..]) => {
            (found.frequency_hz, found.modal_mass_kg, found.damping_ratio) = (*frequency, *mass, *damping);
        }
        (3 | 7, [re, im, a_re, a_im, ..]) => {
            let size = re.hypot(*im);
            found.frequency_hz = size / std::f64::consts::TAU;
            found.damping_ratio = if size > 0.0 { -re / size } else { 0.0 };
            found.modal_a = Some(Complex64::new(*a_re, *a_im));
        }
        _ => return None,
    }
    let complex = data == 5 || data == 6;
    let per_node = usize::try_from(per_node).ok().filter(|n| (1..=9).contains(n))?;
    let wanted = per_node * if complex { 2 } else { 1 };
    while let Some(label) = rest.next() {
        let Some(node) = integers(label).first().copied() else {
            break;
        };
        let mut values = Vec::with_capacity(wanted);
        while values.len() < wanted {
            let line = numbers(rest.next()?);
            if line.is_empty() {
                return None;
            }
            values.extend(line);
        }
        let at = |k: usize| match complex {
            _ if k >= per_node => Complex64::ZERO,
            true => Complex64::new(values[2 * k], values[2 * k + 1]),
            false => Complex64::from(values[k]),
        };
        found.at_node.insert(node, [at(0), at(1), at(2)]);
    }
    (!found.at_node.is_empty()).then_some(found)
}

/// A universal file with nodes (15), trace lines (82) and shapes (55); real shapes as normal modes, others as complex.
pub fn geometry_text(geometry: &Geometry, shapes: &[NodalShape]) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    if !geometry.nodes.is_empty() {
        out += "    -1\n    15\n";
        for (node, [x, y, z]) in &geometry.nodes {
            let _ = writeln!(
                out,
                "{node:10}{:10}{:10}{:10}{}{}{}",
                0,
                0,
                8,
                e13(*x),
                e13(*y),
                e13(*z)
            );
        }
        out += "    -1\n";
    }
    push_lines(&mut out, geometry);
    for (k, shape) in shapes.iter().enumerate() {
        push_shape(&mut out, k + 1, shape);
    }
    out
}

/// A universal file with nodes in double precision (2411) and trace lines (82).
pub fn nodes_text(geometry: &Geometry) -> String {
    let mut out = String::from("    -1\n  2411\n");
    for (node, [x, y, z]) in &geometry.nodes {
        // Coordinate systems of place and displacement, colour; Fortran's D25.16.
        let _ = writeln!(out, "{node:10}{:10}{:10}{:10}", 1, 1, 11);
        let _ = writeln!(out, "{}{}{}", d25(*x), d25(*y), d25(*z));
    }
    out += "    -1\n";
    push_lines(&mut out, geometry);
    out
}

fn push_lines(out: &mut String, geometry: &Geometry) {
    if !geometry.lines.is_empty() {
        let pen: Vec<i64> = geometry.lines.iter().flat_map(|[a, b]| [*a, *b, 0]).collect();
        let _ = writeln!(out, "    -1\n    82\n{:10}{:10}{:10}\nlines", 1, pen.len(), 8);
        for row in pen.chunks(8) {
            let row: String = row.iter().map(|n| format!("{n:10}")).collect();
            let _ = writeln!(out, "{row}");
        }
        *out += "    -1\n";
    }
}

fn push_shape(out: &mut String, number: usize, shape: &NodalShape) {
    let complex = shape.is_complex();
    let title: String = shape.title.chars().filter(|c| !c.is_control()).take(80).collect();
    out.push_str("    -1\n    55\n");
    for line in [title.as_str(), "NONE", "NONE", "NONE", "NONE"] {
        let _ = writeln!(out, "{line}");
    }
    // Structural, normal or complex first order mode, three translations, displacement, real or complex, three values.
    let (analysis, data) = if complex { (3, 5) } else { (2, 2) };
    let _ = writeln!(out, "{:10}{analysis:10}{:10}{:10}{data:10}{:10}", 1, 2, 8, 3);
    let reals = if complex { 6 } else { 4 };
    let _ = writeln!(out, "{:10}{reals:10}{:10}{number:10}", 2, 0);
    let omega = std::f64::consts::TAU * shape.frequency_hz;
    let zeta = shape.damping_ratio;
    let values: Vec<f64> = match shape.modal_a {
        Some(a) => {
            let damped = omega * (1.0 - zeta * zeta).max(0.0).sqrt();
            let pole = Complex64::new(-zeta * omega, damped);
            let b = -pole * a;
            vec![pole.re, pole.im, a.re, a.im, b.re, b.im]
        }
        None => vec![shape.frequency_hz, shape.modal_mass_kg, zeta, 0.0],
    };
    let _ = writeln!(out, "{}", values.iter().map(|v| e13(*v)).collect::<String>());
    for (node, at) in &shape.at_node {
        let _ = writeln!(out, "{node:10}");
        let values: String = match complex {
            true => at.iter().flat_map(|z| [e13(z.re), e13(z.im)]).collect(),
            false => at.iter().map(|z| e13(z.re)).collect(),
        };
        let _ = writeln!(out, "{values}");
    }
    out.push_str("    -1\n");
}

/// Fortran's E13.5: two digits of the exponent at least.
fn e13(value: f64) -> String {
    format!("{:>13}", exponential(value, 5, 'e'))
}

/// Fortran's D25.16.
fn d25(value: f64) -> String {
    format!("{:>25}", exponential(value, 16, 'D'))
}

fn exponential(value: f64, digits: usize, letter: char) -> String {
    let text = format!("{value:.digits$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let (sign, digits) = match exponent.strip_prefix('-') {
        Some(digits) => ('-', digits),
        None => ('+', exponent),
    };
    format!("{mantissa}{letter}{sign}{digits:0>2}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(complex: bool) -> (Geometry, NodalShape) {
        let nodes = [
            (1, [0.0, 0.0, 0.0]),
            (2, [0.5, 0.0, -0.125]),
            (30, [1.0, 0.25, 0.0]),
        ];
        let geometry = Geometry {
            nodes: nodes.into_iter().collect(),
            lines: vec![[1, 2], [2, 30]],
        };
        let z = |re: f64, im: f64| Complex64::new(re, if complex { im } else { 0.0 });
        let shape = NodalShape {
            title: "mode 1".into(),
            frequency_hz: 12.5,
            damping_ratio: 0.02,
            modal_mass_kg: if complex { 0.0 } else { 3.5 },
            modal_a: complex.then_some(Complex64::new(1.5, 550.0)),
            at_node: [
                (1, [z(0.0, 0.0), z(0.0, 0.0), z(1.0, 0.0)]),
                (30, [z(0.0, 0.0), z(-0.25, 0.5), z(-1e-3, 2e-12)]),
            ]
            .into_iter()
            .collect(),
        };
        (geometry, shape)
    }

    #[test]
    fn what_is_written_reads_back() {
        for complex in [false, true] {
            let (geometry, shape) = sample(complex);
            let text = geometry_text(&geometry, std::slice::from_ref(&shape));
            let (read, shapes) = of_universal(text.as_bytes());
            assert_eq!(read, geometry);
            let [back] = shapes.as_slice() else {
                panic!("{shapes:?}")
            };
            assert_eq!(back.at_node, shape.at_node);
            approx::assert_relative_eq!(back.frequency_hz, 12.5, max_relative = 1e-5);
            approx::assert_relative_eq!(back.damping_ratio, 0.02, max_relative = 1e-4);
            assert_eq!(
                (back.modal_mass_kg, back.modal_a),
                (shape.modal_mass_kg, shape.modal_a)
            );
        }
    }

    #[test]
    fn nodes_of_2411_and_a_unit_of_length() {
        let text = "    -1\n   164\n         2mm                         2\n  1.00000000000000000D+03  1.00000000000000000D+00  \
                    1.00000000000000000D+00\n    -1\n    -1\n  2411\n         7         1         1        11\n   \
                    1.0000000000000000D+02   2.5000000000000000D+01   0.0000000000000000D+00\n    -1\n";
        let (geometry, _) = of_universal(text.as_bytes());
        assert_eq!(geometry.nodes[&7], [0.1, 0.025, 0.0]);
    }

    #[test]
    fn a_csv_of_nodes_and_lines() {
        let geometry = of_csv("node,x,y,z\n1,0,0,0\nnode,2,0.5,0,1e-1\n\n# the spar\nline,1,2\n").unwrap();
        assert_eq!(geometry.nodes[&2], [0.5, 0.0, 0.1]);
        assert_eq!(geometry.lines, [[1, 2]]);
        let error = of_csv("1,0,0,0\n2,0,zero,0\n").unwrap_err().to_string();
        assert!(error.contains("2,0,zero,0"), "{error}");
    }
}
