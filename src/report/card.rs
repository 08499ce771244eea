//! The answer at a glance: what is missing, where, how big, how sure, what it does to the error, how to check it in the
//! laboratory, what to do next. One card for each side of the campaign, first on its page.

use super::picture::Picture;

/// How a card is coloured, and the word at its corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// Physics is missing, and it has a name.
    Missing,
    /// Nothing is missing.
    Clean,
    /// Something is missing, or may be, without a name.
    Open,
    /// The files come first.
    Files,
}

impl Tone {
    pub fn name(self) -> &'static str {
        match self {
            Tone::Missing => "missing",
            Tone::Clean => "clean",
            Tone::Open => "open",
            Tone::Files => "files",
        }
    }
}

/// Errors (nrms) of the model from one step to the next, and the noise.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ErrorBar {
    /// What the model is, and its error; in the order of the steps.
    pub steps: Vec<(String, f64)>,
    pub noise: f64,
}

/// Models in a picture, and the sentence under it.
#[derive(Debug, Clone, Default)]
pub struct BeforeAfter {
    pub picture: Picture,
    pub before: String,
    /// `None` where there is one model only.
    pub after: Option<String>,
    pub caption: String,
}

/// What a reader should know in a minute.
#[derive(Debug, Clone)]
pub struct VerdictCard {
    /// Anchor.
    pub id: &'static str,
    /// What was looked at: `Robot against FRFs`.
    pub side: &'static str,
    pub tone: Tone,
    pub headline: String,
    pub explanation: String,
    /// Name and value, such as where and how big.
    pub facts: Vec<(&'static str, String)>,
    pub bar: Option<ErrorBar>,
    pub curves: Option<BeforeAfter>,
    /// In the laboratory, without this program.
    pub check: Option<String>,
    /// With commands between backticks.
    pub next: String,
    /// What was guessed or noticed while the files were read.
    pub remarks: Vec<String>,
}

impl Default for VerdictCard {
    fn default() -> Self {
        VerdictCard {
            id: "verdict",
            side: "",
            tone: Tone::Open,
            headline: String::new(),
            explanation: String::new(),
            facts: Vec::new(),
            bar: None,
            curves: None,
            check: None,
            next: String::new(),
            remarks: Vec::new(),
        }
    }
}

impl ErrorBar {
    /// The largest value: the bar's end.
    fn top(&self) -> f64 {
        let all = self.steps.iter().map(|s| s.1).chain([self.noise]);
        all.filter(|v| v.is_finite()).fold(0.0, f64::max)
    }

    /// Each step and then the noise as a share of the bar, 0 … 100.
    pub fn shares(&self) -> Vec<f64> {
        let top = self.top();
        let all = self.steps.iter().map(|s| s.1).chain([self.noise]);
        all.map(|v| match top > 0.0 && v.is_finite() {
            true => 100.0 * v / top,
            false => 0.0,
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_ends_at_the_largest_error() {
        let bar = ErrorBar {
            steps: vec![("a".into(), 0.5), ("b".into(), 0.02)],
            noise: 0.01,
        };
        assert_eq!(bar.shares(), [100.0, 4.0, 2.0]);
        assert_eq!(ErrorBar::default().shares(), [0.0]);
    }
}
