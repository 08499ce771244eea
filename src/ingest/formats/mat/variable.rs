//! An array of a MAT-file, and what its name says of it.

use num_complex::Complex64;

/// Shorter vectors are no axis.
pub(crate) const MIN_AXIS: usize = 4;

/// A numeric array, column by column as MATLAB holds it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Variable {
    /// Fields of a struct as `struct.field`.
    pub name: String,
    pub size: Vec<usize>,
    pub re: Vec<f64>,
    /// Same length as `re`; `None` for a real array.
    pub im: Option<Vec<f64>>,
}

/// Text of a MAT-file, a line each row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Labels {
    pub name: String,
    pub rows: Vec<String>,
}

impl Variable {
    /// The value at an index into [`re`](Self::re).
    pub fn value(&self, at: usize) -> Complex64 {
        Complex64::new(self.re[at], self.im.as_ref().map_or(0.0, |im| im[at]))
    }

    /// The name without the structs it lies in.
    pub fn own_name(&self) -> &str {
        self.name.rsplit('.').next().unwrap_or(&self.name)
    }

    /// Words of the name in small letters: `Hf_coh_chan_2` → hf, coh, chan, 2.
    pub fn words(&self) -> Vec<String> {
        let words = self.own_name().split(|c: char| !c.is_alphanumeric());
        words.filter(|w| !w.is_empty()).map(str::to_lowercase).collect()
    }

    pub fn mentions(&self, parts: &[&str]) -> bool {
        let name = self.own_name().to_lowercase();
        parts.iter().any(|p| name.contains(p))
    }

    pub fn is_called(&self, names: &[&str]) -> bool {
        names.contains(&self.own_name().to_lowercase().as_str())
    }

    /// What lies in the same struct has the same root.
    pub fn root(&self) -> &str {
        self.name.split_once('.').map_or("", |(root, _)| root)
    }

    /// `H1_2`, `C1_2`, `X1`: a letter and channel numbers, as SignalCalc names its functions.
    pub fn is_analyser_name(&self) -> bool {
        let mut characters = self.own_name().chars();
        characters.next().is_some_and(|c| c.is_ascii_uppercase())
            && characters.next().is_some_and(|c| c.is_ascii_digit())
            && characters.all(|c| c.is_ascii_digit() || c == '_')
    }

    /// The channels in a name of SignalCalc: 1 and 2 of `H1_2` (2 over 1), 3 of `X3`.
    pub fn analyser_channels(&self) -> Option<Vec<usize>> {
        let numbers = self.own_name().get(1..).filter(|_| self.is_analyser_name())?;
        numbers.split('_').map(|n| n.parse().ok()).collect()
    }

    pub fn is_called_frf(&self) -> bool {
        let first = self.own_name().chars().next();
        self.mentions(&[
            "frf",
            "tf_",
            "xfer",
            "transfer",
            "recept",
            "mobil",
            "accelerance",
            "inertance",
        ]) || matches!(first, Some('H' | 'h'))
            && (self.is_called(&["h", "hf", "hv"])
                || self.own_name()[1..].starts_with(|c: char| c.is_ascii_digit() || c == '_'))
    }

    pub fn is_called_signal(&self) -> bool {
        let letter = self.own_name().chars().next().filter(|_| self.is_analyser_name());
        matches!(letter, Some('X' | 'W'))
            || self.is_called(&["t", "zeit", "t_s", "tvec"])
            || self.mentions(&["time", "force", "acc", "signal", "hammer"])
    }

    /// Factor to hertz where the name is that of a frequency axis.
    pub fn frequency_factor(&self) -> Option<f64> {
        if self.is_called(&["omega", "w", "w_rad", "omega_rad", "wvec"]) {
            return Some(0.5 / std::f64::consts::PI);
        }
        let is_named = self.mentions(&["freq", "frq"])
            || self.is_called(&[
                "f", "hz", "f_hz", "fhz", "fvec", "faxis", "f_axis", "fr", "ff", "xaxis", "x_axis",
            ]);
        is_named.then_some(1.0)
    }

    pub fn is_frequency_step(&self) -> bool {
        self.is_called(&[
            "df",
            "delta_f",
            "deltaf",
            "d_f",
            "df_hz",
            "fstep",
            "f_step",
            "f_inc",
            "freq_step",
            "freq_inc",
            "increment",
            "frequency_resolution",
            "freq_resolution",
            "fres",
            "f_res",
            "delta_freq",
            "deltafreq",
            "x_increment",
            "x_delta",
        ])
    }

    pub fn is_frequency_start(&self) -> bool {
        self.is_called(&[
            "f_start",
            "fstart",
            "f0",
            "f_0",
            "f_min",
            "fmin",
            "start_freq",
            "startfreq",
            "freq_start",
            "start_value",
            "f_begin",
            "x_start",
            "f_start_hz",
            "start_frequency",
        ])
    }

    /// The sampling rate, where the variable is one number that says it or the interval.
    pub fn says_rate_hz(&self) -> Option<f64> {
        let scalar = self.scalar().filter(|s| *s > 0.0)?;
        let name = self.own_name().to_lowercase();
        let name = name.trim_end_matches("_hz").trim_end_matches("_s");
        let is_rate = [
            "sample_rate",
            "samplerate",
            "sampling_rate",
            "samplingrate",
            "sampling_freq",
            "sample_freq",
            "samplingfreq",
        ]
        .iter()
        .any(|part| name.contains(part))
            || ["fs", "fsamp", "f_s", "rate", "sr"].contains(&name);
        let is_step = [
            "dt",
            "ts",
            "delta_t",
            "deltat",
            "d_t",
            "sample_interval",
            "sampling_interval",
        ]
        .contains(&name);
        match (is_rate, is_step) {
            (true, _) => Some(scalar),
            (_, true) => Some(1.0 / scalar).filter(|r| r.is_finite()),
            _ => None,
        }
    }

    pub fn is_vector(&self) -> bool {
        self.size.iter().filter(|n| **n > 1).count() == 1
    }

    pub fn scalar(&self) -> Option<f64> {
        match (self.re.as_slice(), &self.im) {
            ([one], None) if one.is_finite() => Some(*one),
            _ => None,
        }
    }

    pub fn is_axis(&self) -> bool {
        self.im.is_none()
            && self.is_vector()
            && self.re.len() >= MIN_AXIS
            && self.re.iter().all(|x| x.is_finite())
            && self.re.windows(2).all(|w| w[0] < w[1])
    }

    /// The vectors along the (first) dimension of a length, with what to put behind the name of each.
    pub fn along(&self, length: usize) -> Option<Vec<(String, Vec<usize>)>> {
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
    pub fn subscripts(&self, mut at: usize, dimension: usize) -> String {
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
