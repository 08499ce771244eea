//! What the arrays of a MAT-file are, by name, shape and kind of number. A MAT-file has no standard for measurements:
//! whatever is decided here is said in the notes.

use num_complex::Complex64;

use super::super::text::Notes;
use super::super::{Contents, FrfRecord, InputError, OtherRecord, Quantity, TimeRecord, checks, waveform};
use super::Variable;

/// Shorter vectors are no axis.
const MIN_AXIS: usize = 4;
/// Change of the step from which on times are not evenly spaced.
const UNEVEN: f64 = 0.02;
/// Names of arrays shown in one message.
const SHOWN: usize = 8;

impl Variable {
    /// The name without the structs it lies in.
    fn own_name(&self) -> &str {
        self.name.rsplit('.').next().unwrap_or(&self.name)
    }

    /// Words of the name in small letters: `Hf_coh_chan_2` → hf, coh, chan, 2.
    fn words(&self) -> Vec<String> {
        let words = self.own_name().split(|c: char| !c.is_alphanumeric());
        words.filter(|w| !w.is_empty()).map(str::to_lowercase).collect()
    }

    fn mentions(&self, parts: &[&str]) -> bool {
        let name = self.own_name().to_lowercase();
        parts.iter().any(|p| name.contains(p))
    }

    fn is_called(&self, names: &[&str]) -> bool {
        names.contains(&self.own_name().to_lowercase().as_str())
    }

    fn is_vector(&self) -> bool {
        self.size.iter().filter(|n| **n > 1).count() == 1
    }

    fn scalar(&self) -> Option<f64> {
        match (self.re.as_slice(), &self.im) {
            ([one], None) if one.is_finite() => Some(*one),
            _ => None,
        }
    }

    fn is_axis(&self) -> bool {
        self.im.is_none()
            && self.is_vector()
            && self.re.len() >= MIN_AXIS
            && self.re.iter().all(|x| x.is_finite())
            && self.re.windows(2).all(|w| w[0] < w[1])
    }

    /// The vectors along the (first) dimension of a length, with what to put behind the name of each.
    fn along(&self, length: usize) -> Option<Vec<(String, Vec<usize>)>> {
        let dimension = self.size.iter().position(|n| *n == length)?;
        let stride: usize = self.size[..dimension].iter().product();
        let block = stride * length;
        if block == 0 || !self.re.len().is_multiple_of(block) {
            return None;
        }
        let starts: Vec<usize> = (0..self.re.len()).filter(|k| k % block < stride).collect();
        let several = starts.len() > 1;
        let vectors = starts.into_iter().map(|start| {
            let suffix = if several {
                self.subscripts(start, dimension)
            } else {
                String::new()
            };
            (suffix, (0..length).map(|k| start + k * stride).collect())
        });
        Some(vectors.collect())
    }

    /// `(:,2,1)`, as one would write it in MATLAB.
    fn subscripts(&self, mut at: usize, dimension: usize) -> String {
        let mut parts = Vec::new();
        for (d, size) in self.size.iter().enumerate() {
            parts.push(if d == dimension {
                ":".to_owned()
            } else {
                (at % size + 1).to_string()
            });
            at /= size;
        }
        format!("({})", parts.join(","))
    }
}

pub(super) fn contents(variables: Vec<Variable>, notes: &mut Notes) -> Result<Contents, InputError> {
    if variables.is_empty() {
        return Err(
            InputError::new("a MAT-file without numeric arrays at its top level").remedy(
                "structs and cells of a v7 file are not read: in MATLAB s = load(…), then \
             save('flat.mat', '-struct', 's', '-v7')",
            ),
        );
    }
    let mut used = vec![false; variables.len()];
    let mut contents = Contents::default();
    frequency_functions(&variables, &mut used, &mut contents, notes);
    contents.times = time_signals(&variables, &mut used, notes);
    if contents.frfs.is_empty() && contents.times.is_empty() && contents.others.is_empty() {
        return Err(InputError::new(format!(
            "a MAT-file in which no FRF and no time signal is recognised ({})",
            names(variables.iter())
        ))
        .remedy(
            "name the axis f (Hz) or t (s); FRFs are complex arrays with a dimension as long as f, signals real ones \
             with a dimension as long as t",
        ));
    }
    let left: Vec<&Variable> = variables
        .iter()
        .zip(&used)
        .filter(|(_, u)| !**u)
        .map(|(v, _)| v)
        .collect();
    if !left.is_empty() {
        notes.file(format!("arrays left out: {}", names(left.into_iter())));
    }
    Ok(contents)
}

fn names<'a>(variables: impl ExactSizeIterator<Item = &'a Variable>) -> String {
    let count = variables.len();
    let mut shown: Vec<&str> = variables.take(SHOWN).map(|v| v.name.as_str()).collect();
    if count > SHOWN {
        shown.push("…");
    }
    shown.join(", ")
}

/// FRFs, coherences and spectra on the frequency axes.
fn frequency_functions(
    variables: &[Variable],
    used: &mut [bool],
    contents: &mut Contents,
    notes: &mut Notes,
) {
    let is_frequency = |v: &Variable| {
        v.is_axis()
            && v.re[0] >= 0.0
            && (v.mentions(&["freq"]) || v.is_called(&["f", "hz", "f_hz", "fhz", "fvec", "faxis", "f_axis"]))
    };
    let mut coherences: Vec<(&Variable, Vec<usize>, &Variable)> = Vec::new();
    for a in 0..variables.len() {
        let axis = &variables[a];
        if !is_frequency(axis) {
            continue;
        }
        used[a] = true;
        for k in 0..variables.len() {
            let variable = &variables[k];
            if used[k] || is_frequency(variable) {
                continue;
            }
            let Some(vectors) = variable.along(axis.re.len()) else {
                continue;
            };
            let kind = kind(variable);
            for (suffix, at) in vectors {
                let value = || at.iter().map(|&i| complex(variable, i)).collect::<Vec<_>>();
                match kind {
                    Kind::Frf => {
                        used[k] = true;
                        let record = FrfRecord {
                            name: format!("{}{suffix}", variable.name),
                            response: None,
                            reference: None,
                            quantity: quantity(variable),
                            frequency_hz: axis.re.clone(),
                            value: value(),
                            coherence: None,
                        };
                        contents.frfs.extend(checks::tidy_frf(record, notes));
                    }
                    Kind::Coherence => {
                        used[k] = true;
                        coherences.push((variable, at, axis));
                    }
                    Kind::Other(kind) => {
                        used[k] = true;
                        contents.others.push(OtherRecord {
                            kind,
                            name: format!("{}{suffix}", variable.name),
                            abscissa: axis.re.clone(),
                            abscissa_unit: "Hz".into(),
                            value: value(),
                            unit: String::new(),
                        });
                    }
                    Kind::Unknown => {}
                }
            }
        }
    }
    // A coherence goes to the FRF with the same name but for that word, or to the only one there is.
    for (variable, at, axis) in coherences {
        let word = |w: &String| !["coh", "coherence", "gamma2"].contains(&w.as_str());
        let bare: Vec<String> = variable.words().into_iter().filter(word).collect();
        let only = contents.frfs.len() == 1;
        let frf = contents.frfs.iter_mut().find(|frf| {
            let source = variables.iter().find(|v| v.name == frf.name);
            frf.coherence.is_none() && (only || source.is_some_and(|s| s.words() == bare))
        });
        let values: Vec<f64> = at.iter().map(|&i| variable.re[i]).collect();
        match frf {
            Some(frf) => {
                frf.coherence = checks::on_lines(&frf.frequency_hz, &axis.re, &values);
                if frf.coherence.is_none() {
                    notes.about(&variable.name, "coherence outside 0..1: left out");
                }
            }
            None => notes.about(&variable.name, "a coherence that belongs to no FRF: left out"),
        }
    }
}

#[derive(Clone, Copy)]
enum Kind {
    Frf,
    Coherence,
    Other(&'static str),
    Unknown,
}

fn kind(variable: &Variable) -> Kind {
    if variable.mentions(&["coh", "gamma2"]) {
        Kind::Coherence
    } else if variable.mentions(&["cross", "csd"]) {
        Kind::Other("cross spectrum")
    } else if variable.mentions(&["psd"]) {
        Kind::Other("power spectral density")
    } else if variable.mentions(&["spec", "fft"]) {
        Kind::Other("spectrum")
    } else if variable.im.is_some() {
        Kind::Frf
    } else {
        Kind::Unknown
    }
}

fn quantity(variable: &Variable) -> Option<Quantity> {
    if variable.mentions(&["recept", "complian"]) {
        Some(Quantity::Receptance)
    } else if variable.mentions(&["mobil"]) {
        Some(Quantity::Mobility)
    } else if variable.mentions(&["accel", "inert"]) {
        Some(Quantity::Accelerance)
    } else {
        None
    }
}

fn complex(variable: &Variable, at: usize) -> Complex64 {
    Complex64::new(variable.re[at], variable.im.as_ref().map_or(0.0, |im| im[at]))
}

/// Real arrays along a time axis, or, where there is only a sampling rate, along the longest dimension there is.
fn time_signals(variables: &[Variable], used: &mut [bool], notes: &mut Notes) -> Vec<TimeRecord> {
    let mut records = Vec::new();
    let rate = variables.iter().enumerate().find_map(|(k, v)| {
        let scalar = v.scalar().filter(|s| *s > 0.0)?;
        let is_rate = v.mentions(&["sample_rate", "samplerate", "sampling_rate", "samplingrate"])
            || v.is_called(&["fs", "fsamp", "f_s", "rate", "sr"]);
        let is_step = v.is_called(&["dt", "ts", "delta_t", "deltat", "d_t"]);
        match (is_rate, is_step) {
            (true, _) => Some((k, scalar)),
            (_, true) => Some((k, 1.0 / scalar)),
            _ => None,
        }
    });
    let is_time = |v: &Variable| {
        v.is_axis()
            && (v.is_called(&["t", "zeit", "t_s", "tvec"]) || v.own_name().to_lowercase().starts_with("time"))
    };
    let mut axes: Vec<(usize, f64, f64)> = Vec::new();
    for (axis, _) in variables
        .iter()
        .zip(used.iter())
        .filter(|(v, u)| !**u && is_time(v))
    {
        let length = axis.re.len();
        let own = (axis.re[length - 1] - axis.re[0]) / (length - 1) as f64;
        // The rate is exact where the axis was stored in single precision.
        let said = rate
            .map(|(_, r)| 1.0 / r)
            .filter(|s| (s / own - 1.0).abs() < 1e-3);
        let step = said.unwrap_or(own);
        // Times summed up in single precision drift off the grid, but every step is one.
        let even = |w: &[f64]| ((w[1] - w[0]) / step - 1.0).abs() < UNEVEN;
        if axis.re.windows(2).all(even) {
            axes.push((length, 1.0 / step, axis.re[0]));
        } else {
            notes.about(&axis.name, "times are not evenly spaced: left out");
        }
    }
    for (k, variable) in variables.iter().enumerate() {
        if is_time(variable) && !used[k] {
            used[k] = true;
        }
    }
    if let (true, Some((_, rate))) = (axes.is_empty(), rate) {
        let free = variables
            .iter()
            .zip(used.iter())
            .filter(|(v, u)| !**u && v.im.is_none());
        let longest = free.flat_map(|(v, _)| v.size.iter().copied()).max();
        axes.extend(longest.filter(|n| *n >= MIN_AXIS).map(|n| (n, rate, 0.0)));
    }
    if let Some((k, _)) = rate.filter(|_| !axes.is_empty()) {
        used[k] = true;
    }
    for (length, rate, start_s) in axes {
        for (k, variable) in variables.iter().enumerate() {
            if used[k] || variable.im.is_some() || variable.re.iter().any(|x| !x.is_finite()) {
                continue;
            }
            let Some(vectors) = variable.along(length) else {
                continue;
            };
            used[k] = true;
            for (suffix, at) in vectors {
                let samples = at.iter().map(|&i| variable.re[i]).collect();
                let name = format!("{}{suffix}", variable.name);
                let channel = waveform::channel(name, String::new(), samples, notes);
                waveform::put(&mut records, rate, start_s, channel);
            }
        }
    }
    records
}

#[cfg(test)]
mod tests {
    use super::*;

    fn real(name: &str, size: &[usize], re: Vec<f64>) -> Variable {
        Variable {
            name: name.into(),
            size: size.to_vec(),
            re,
            im: None,
        }
    }

    fn count(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64).collect()
    }

    #[test]
    fn frfs_are_complex_arrays_along_the_frequencies_and_find_their_coherence() {
        let mut h = real("FRF", &[2, 6], count(12));
        h.im = Some(vec![0.5; 12]);
        let mut single = real("H_chan_2_accel", &[6, 1], count(6));
        single.im = Some(vec![1.0; 6]);
        // An analyser's value at 0 Hz says nothing.
        let coherence = real("H_coh_chan_2_accel", &[6, 1], vec![1.3, 0.1, 0.2, 0.3, 0.4, 1.0]);
        let mut notes = Notes::default();
        let all = vec![
            h,
            real("freq", &[1, 6], count(6)),
            single,
            coherence,
            real("PSD_1", &[6, 1], count(6)),
            real("odd", &[3, 1], count(3)),
        ];
        let found = contents(all, &mut notes).unwrap();
        let names: Vec<&str> = found.frfs.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["FRF(1,:)", "FRF(2,:)", "H_chan_2_accel"]);
        assert_eq!(found.frfs[1].value[2], Complex64::new(5.0, 0.5));
        assert_eq!(found.frfs[0].quantity, None);
        assert_eq!(found.frfs[2].quantity, Some(Quantity::Accelerance));
        assert_eq!(
            found.frfs[2].coherence.as_deref(),
            Some(&[0.0, 0.1, 0.2, 0.3, 0.4, 1.0][..])
        );
        assert_eq!(found.others.len(), 1);
        assert!(notes.into_warnings().iter().any(|w| w.contains("odd")));
    }

    #[test]
    fn signals_are_real_arrays_along_the_times_or_at_a_rate() {
        let t: Vec<f64> = count(8).iter().map(|k| f64::from((0.1 * k) as f32)).collect();
        let all = vec![
            real("t", &[8, 1], t),
            real("fs", &[1, 1], vec![10.0]),
            real("fx_n", &[8, 1], count(8)),
        ];
        let found = contents(all.clone(), &mut Notes::default()).unwrap();
        assert_eq!(found.times.len(), 1);
        assert_eq!(found.times[0].sample_rate_hz, 10.0);
        assert_eq!(
            found.times[0].channels[0].role,
            super::super::super::ChannelRole::ForceX
        );
        let found = contents(all[1..].to_vec(), &mut Notes::default()).unwrap();
        assert_eq!((found.times[0].sample_rate_hz, found.times[0].len()), (10.0, 8));
        let error = contents(all[2..].to_vec(), &mut Notes::default()).unwrap_err();
        assert!(error.problem.contains("fx_n"), "{error}");
        assert!(contents(Vec::new(), &mut Notes::default()).is_err());
    }
}
