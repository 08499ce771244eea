//! What a TDMS channel's properties say of its raw values: scales that turn counts into volts, and volts into newtons.
//!
//! Source: National Instruments, "TDMS File Format Internal Structure" (2023), and the properties `NI_Scale[i]_…` that LabVIEW
//! and DAQmx write.

use std::collections::HashMap;

/// A property of an object.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Property {
    Number(f64),
    Text(String),
}

/// Properties by their names.
pub(super) type Properties = HashMap<String, Property>;

/// The raw values as the input of a scale.
const RAW: f64 = 4_294_967_295.0;
/// More scales or points than this are a damaged count.
const MOST: usize = 4096;

/// One scale.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum RawScale {
    /// Constant first.
    Polynomial(Vec<f64>),
    /// Raw values, rising, and what they mean; straight between them.
    Table(Vec<(f64, f64)>),
}

impl RawScale {
    fn value(&self, x: f64) -> f64 {
        match self {
            RawScale::Polynomial(coefficients) => coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c),
            RawScale::Table(points) => {
                let at = points.partition_point(|p| p.0 < x);
                match (points.get(at.wrapping_sub(1)), points.get(at)) {
                    (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0),
                    (Some(end), None) | (None, Some(end)) => end.1,
                    (None, None) => x,
                }
            }
        }
    }
}

/// Applies scales one after another.
pub(super) fn apply(scales: &[RawScale], values: &mut [f64]) {
    for value in values {
        *value = scales.iter().fold(*value, |x, scale| scale.value(x));
    }
}

/// The scales of a channel whose values are stored as they came from the converter, first to last; none where they are stored
/// scaled.
///
/// # Errors
/// The kind of a scale that is not known here.
pub(super) fn scales(properties: &Properties) -> Result<Vec<RawScale>, String> {
    let number = |key: &str| match properties.get(key) {
        Some(Property::Number(value)) if value.is_finite() => Some(*value),
        _ => None,
    };
    let text = |key: &str| match properties.get(key) {
        Some(Property::Text(value)) => Some(value.as_str()),
        _ => None,
    };
    let count = number("NI_Number_Of_Scales").unwrap_or(0.0);
    if text("NI_Scaling_Status") == Some("scaled") || count < 1.0 {
        return Ok(Vec::new());
    }
    let damaged = || "whose properties are damaged".to_owned();
    let mut chain = Vec::new();
    let mut at = count - 1.0;
    while at != RAW {
        if chain.len() > MOST {
            return Err(damaged());
        }
        let prefix = format!("NI_Scale[{at}]");
        // DAQmx: without a kind it is the converter's own value.
        let Some(kind) = text(&format!("{prefix}_Scale_Type")) else {
            break;
        };
        let of = |key: &str| number(&format!("{prefix}_{kind}_{key}"));
        let list = |key: &str, length: f64| -> Option<Vec<f64>> {
            if !(0.0..MOST as f64).contains(&length) {
                return None;
            }
            (0..length as usize).map(|i| of(&format!("{key}[{i}]"))).collect()
        };
        match kind {
            "Linear" => {
                let (Some(intercept), Some(slope)) = (of("Y_Intercept"), of("Slope")) else {
                    return Err(damaged());
                };
                chain.push(RawScale::Polynomial(vec![intercept, slope]));
            }
            "Polynomial" => {
                let length = of("Coefficients_Size").unwrap_or(4.0);
                chain.push(RawScale::Polynomial(
                    list("Coefficients", length).ok_or_else(damaged)?,
                ));
            }
            "Table" => {
                let length = of("Pre_Scaled_Values_Size").ok_or_else(damaged)?;
                let raw = list("Pre_Scaled_Values", length).ok_or_else(damaged)?;
                let scaled = list("Scaled_Values", length).ok_or_else(damaged)?;
                let mut points: Vec<(f64, f64)> = raw.into_iter().zip(scaled).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                if points.is_empty() || points.windows(2).any(|w| w[0].0 == w[1].0) {
                    return Err(damaged());
                }
                chain.push(RawScale::Table(points));
            }
            // Without numbers of its own.
            "AdvancedAPI" => {}
            other => return Err(format!("of the kind {other:?}, which is not known here")),
        }
        at = of("Input_Source").unwrap_or(RAW);
    }
    chain.reverse();
    Ok(chain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn properties(pairs: &[(&str, f64)], texts: &[(&str, &str)]) -> Properties {
        let numbers = pairs.iter().map(|(k, v)| ((*k).to_owned(), Property::Number(*v)));
        let texts = texts
            .iter()
            .map(|(k, v)| ((*k).to_owned(), Property::Text((*v).to_owned())));
        numbers.chain(texts).collect()
    }

    #[test]
    fn scales_are_applied_from_the_raw_value_on() {
        // Counts to volts by a polynomial, volts to newtons by a line.
        let of = properties(
            &[
                ("NI_Number_Of_Scales", 2.0),
                ("NI_Scale[0]_Polynomial_Coefficients_Size", 2.0),
                ("NI_Scale[0]_Polynomial_Coefficients[0]", 0.5),
                ("NI_Scale[0]_Polynomial_Coefficients[1]", 0.001),
                ("NI_Scale[0]_Polynomial_Input_Source", RAW),
                ("NI_Scale[1]_Linear_Slope", 500.0),
                ("NI_Scale[1]_Linear_Y_Intercept", -1.0),
                ("NI_Scale[1]_Linear_Input_Source", 0.0),
            ],
            &[
                ("NI_Scale[0]_Scale_Type", "Polynomial"),
                ("NI_Scale[1]_Scale_Type", "Linear"),
                ("NI_Scaling_Status", "unscaled"),
            ],
        );
        let mut values = [0.0, 1000.0];
        apply(&scales(&of).unwrap(), &mut values);
        assert_eq!(values, [249.0, 749.0]);
        let mut scaled = of.clone();
        scaled.insert("NI_Scaling_Status".into(), Property::Text("scaled".into()));
        assert_eq!(scales(&scaled).unwrap(), []);
        let mut strain = of.clone();
        strain.insert("NI_Scale[1]_Scale_Type".into(), Property::Text("Strain".into()));
        assert!(scales(&strain).unwrap_err().contains("Strain"));
        let mut circle = of;
        circle.insert(
            "NI_Scale[0]_Polynomial_Input_Source".into(),
            Property::Number(1.0),
        );
        assert!(scales(&circle).is_err());
    }

    #[test]
    fn a_table_is_straight_between_its_points() {
        let table = RawScale::Table(vec![(0.0, 0.0), (1.0, 10.0), (3.0, 20.0)]);
        assert_eq!(
            [-1.0, 0.5, 2.0, 9.0].map(|x| table.value(x)),
            [0.0, 5.0, 15.0, 20.0]
        );
    }
}
