//! The arrays of a MAT-file, whatever is in them.

use matfile::{MatFile, NumericData};

use super::super::InputError;
use super::super::text::Notes;
use super::Variable;

/// Structs within structs are followed this deep.
const DEPTH: usize = 4;
/// A deflated byte becomes 1032 at most; a damaged size that says more must not be allocated.
const MOST_INFLATED: usize = 1032;
/// Bytes of the widest element, a complex double.
const ELEMENT: usize = 16;

pub(super) fn v5(bytes: &[u8]) -> Result<Vec<Variable>, InputError> {
    let file = MatFile::parse(bytes).map_err(|e| {
        InputError::new(format!("this MAT-file cannot be read ({e})"))
            .remedy("save it again in MATLAB: save('new.mat', '-v7')")
    })?;
    Ok(file
        .arrays()
        .iter()
        .map(|array| {
            let (re, im) = numbers(array.data());
            Variable {
                name: array.name().to_owned(),
                size: array.size().clone(),
                re,
                im,
            }
        })
        .collect())
}

fn numbers(data: &NumericData) -> (Vec<f64>, Option<Vec<f64>>) {
    // 64-bit integers beyond 2⁵³ are rounded; measurements are not that long.
    macro_rules! to_f64 {
        ($($kind:ident),*) => {
            match data {
                $(NumericData::$kind { real, imag } => {
                    let floats = |v: &Vec<_>| v.iter().map(|x| *x as f64).collect();
                    (floats(real), imag.as_ref().map(floats))
                })*
            }
        };
    }
    to_f64!(
        Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Single, Double
    )
}

pub(super) fn v73(bytes: &[u8], notes: &mut Notes) -> Result<Vec<Variable>, InputError> {
    let unreadable = |e: hdf5_pure::Error| {
        InputError::new(format!("this HDF5 file (MAT v7.3) cannot be read ({e})"))
            .remedy("save it again in MATLAB in the older form: save('new.mat', '-v7')")
    };
    let file = hdf5_pure::File::from_bytes(bytes.to_vec()).map_err(unreadable)?;
    let mut variables = Vec::new();
    walk(&file.root(), "", DEPTH, bytes.len(), &mut variables, notes).map_err(unreadable)?;
    Ok(variables)
}

fn walk(
    group: &hdf5_pure::Group,
    path: &str,
    depth: usize,
    file_size: usize,
    variables: &mut Vec<Variable>,
    notes: &mut Notes,
) -> Result<(), hdf5_pure::Error> {
    let full = |name: &str| {
        if path.is_empty() {
            name.to_owned()
        } else {
            format!("{path}.{name}")
        }
    };
    for name in group.datasets()? {
        let dataset = group.dataset(&name)?;
        match variable(&dataset, full(&name), file_size) {
            Ok(Some(variable)) => variables.push(variable),
            Ok(None) => {}
            Err(e) => notes.about(&full(&name), format!("cannot be read ({e}): left out")),
        }
    }
    if depth > 0 {
        // `#refs#` and `#subsystem#` are MATLAB's own.
        for name in group.groups()?.into_iter().filter(|n| !n.starts_with('#')) {
            walk(
                &group.group(&name)?,
                &full(&name),
                depth - 1,
                file_size,
                variables,
                notes,
            )?;
        }
    }
    Ok(())
}

/// A numeric array; `None` for text, references and what is empty.
fn variable(
    dataset: &hdf5_pure::Dataset,
    name: String,
    file_size: usize,
) -> Result<Option<Variable>, hdf5_pure::Error> {
    use hdf5_pure::{AttrValue, DType};
    let attributes = dataset.attrs()?;
    let class = match attributes.get("MATLAB_class") {
        Some(AttrValue::AsciiString(text) | AttrValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    if ["char", "cell", "function_handle", "string"].contains(&class.as_str())
        || attributes.contains_key("MATLAB_empty")
    {
        return Ok(None);
    }
    let product = |sizes: &[u64]| sizes.iter().try_fold(1u64, |all, n| all.checked_mul(*n));
    let most = (file_size.saturating_mul(MOST_INFLATED) / ELEMENT) as u64;
    let shape = dataset.shape()?;
    let chunk = dataset.chunk_shape()?;
    let sizes = [Some(shape.clone()), chunk];
    if sizes
        .iter()
        .flatten()
        .any(|s| product(s).is_none_or(|n| n > most))
    {
        return Ok(None);
    }
    // HDF5 counts the dimensions from the slowest, MATLAB from the fastest.
    let size: Vec<usize> = shape.iter().rev().map(|n| *n as usize).collect();
    let (re, im) = match dataset.dtype()? {
        DType::Compound(fields) => match fields.as_slice() {
            [(re, DType::F64), (im, DType::F64)] if re == "real" && im == "imag" => {
                pairs(&dataset.read_raw()?, |b: [u8; 8]| f64::from_le_bytes(b))
            }
            [(re, DType::F32), (im, DType::F32)] if re == "real" && im == "imag" => {
                pairs(&dataset.read_raw()?, |b: [u8; 4]| {
                    f64::from(f32::from_le_bytes(b))
                })
            }
            _ => return Ok(None),
        },
        DType::F64
        | DType::F32
        | DType::I8
        | DType::I16
        | DType::I32
        | DType::I64
        | DType::U8
        | DType::U16
        | DType::U32
        | DType::U64 => (dataset.read_f64()?, None),
        _ => return Ok(None),
    };
    let whole = size.iter().product::<usize>() == re.len();
    Ok(whole.then_some(Variable { name, size, re, im }))
}

/// Real and imaginary parts that lie next to each other.
fn pairs<const N: usize>(raw: &[u8], number: impl Fn([u8; N]) -> f64) -> (Vec<f64>, Option<Vec<f64>>) {
    let values = raw.chunks_exact(N).filter_map(|b| b.try_into().ok()).map(number);
    let all: Vec<f64> = values.collect();
    let part = |first: usize| all.iter().skip(first).step_by(2).copied().collect();
    (part(0), Some(part(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Name, real and imaginary part.
    type Array<'a> = (&'a str, &'a [f64], Option<&'a [f64]>);

    /// A v5 file by the format's description: little-endian, one double array a variable.
    fn v5_file(arrays: &[Array]) -> Vec<u8> {
        let mut header = b"MATLAB 5.0 MAT-file".to_vec();
        header.resize(124, b' ');
        header.extend([0x00, 0x01, b'I', b'M']);
        let element = |kind: u32, data: &[u8]| {
            let mut out = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
            out.extend(data);
            out.resize(out.len().div_ceil(8) * 8, 0);
            out
        };
        let doubles = |v: &[f64]| v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        for (name, re, im) in arrays {
            let flags = if im.is_some() { 0x0806u32 } else { 6 };
            let mut body = element(6, &[flags.to_le_bytes(), [0; 4]].concat());
            body.extend(element(
                5,
                &[(re.len() as u32).to_le_bytes(), 1u32.to_le_bytes()].concat(),
            ));
            body.extend(element(1, name.as_bytes()));
            body.extend(element(9, &doubles(re)));
            if let Some(im) = im {
                body.extend(element(9, &doubles(im)));
            }
            header.extend(element(14, &body));
        }
        header
    }

    fn v73_file() -> Vec<u8> {
        let mut builder = hdf5_pure::FileBuilder::new();
        builder
            .create_dataset("f")
            .with_f64_data(&[1.0, 2.0, 3.0])
            .with_shape(&[1, 3]);
        let mut group = builder.create_group("s");
        // Two columns of three rows in MATLAB.
        group
            .create_dataset("x")
            .with_f32_data(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
            .with_shape(&[2, 3]);
        builder.add_group(group.finish());
        builder.finish().unwrap()
    }

    #[test]
    fn arrays_of_both_versions_come_out_column_by_column() {
        let file = v5_file(&[("f", &[1.0, 2.0], None), ("H", &[3.0, 4.0], Some(&[-1.0, -2.0]))]);
        let found = v5(&file).unwrap();
        assert_eq!(found[1].name, "H");
        assert_eq!(
            (found[1].size.as_slice(), found[1].re.as_slice()),
            (&[2, 1][..], &[3.0, 4.0][..])
        );
        assert_eq!(found[1].im.as_deref(), Some(&[-1.0, -2.0][..]));
        let mut found = v73(&v73_file(), &mut Notes::default()).unwrap();
        found.sort_by(|a, b| a.name.cmp(&b.name));
        assert_eq!(found[0].size, [3, 1]);
        assert_eq!(
            (found[1].name.as_str(), found[1].size.as_slice()),
            ("s.x", &[3, 2][..])
        );
        assert_eq!(found[1].re, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }

    #[test]
    fn damaged_files_are_errors_or_less_data_and_never_a_panic() {
        let old = v5_file(&[("f", &[1.0, 2.0], None), ("H", &[3.0, 4.0], Some(&[-1.0, -2.0]))]);
        let new = v73_file();
        for at in 0..old.len() {
            let mut damaged = old.clone();
            damaged[at] ^= 0xFF;
            let _ = v5(&damaged);
            let _ = v5(&old[..at]);
        }
        for at in 0..new.len() {
            let mut damaged = new.clone();
            damaged[at] ^= 0xFF;
            let _ = v73(&damaged, &mut Notes::default());
            let _ = v73(&new[..at], &mut Notes::default());
        }
    }
}
