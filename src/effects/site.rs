//! Where effects sit, and how an effect at a site is called.

use super::Spot;

/// Where an effect sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Site {
    /// The effect has no place of its own.
    Everywhere,
    /// 1-based joint.
    Joint(usize),
    /// 1-based link.
    Link(usize),
    /// The tool.
    Tool,
    /// A place where the data drew something.
    At(Spot),
}

impl Site {
    /// `joint-2`, `link-4`; `None` where the effect has no place of its own.
    pub fn label(self) -> Option<String> {
        match self {
            Site::Everywhere => None,
            Site::Joint(i) => Some(format!("joint-{i}")),
            Site::Link(i) => Some(format!("link-{i}")),
            Site::Tool => Some("tool".into()),
            Site::At(spot) => Some(spot.label()),
        }
    }
}

/// A site and a discrete choice there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct At {
    /// Where the effect sits.
    pub site: Site,
    /// Its discrete choice, from 0.
    pub variant: usize,
}

impl At {
    /// Without a place and without a choice.
    pub const EVERYWHERE: At = At {
        site: Site::Everywhere,
        variant: 0,
    };
}

/// `EFFECT[@SITE][:key=value,…]` as a person writes it, taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WrittenEffect<'a> {
    /// All before the colon: what the effect at its site is called.
    pub label: &'a str,
    /// Its id.
    pub id: &'a str,
    /// Where it sits, if that is said.
    pub site: Option<&'a str>,
    /// What stands behind the colon.
    pub values: Option<&'a str>,
}

impl<'a> WrittenEffect<'a> {
    /// The parts of `text`, whatever they mean.
    pub fn of(text: &'a str) -> Self {
        let apart = |text: &'a str, mark| {
            text.split_once(mark)
                .map_or((text, None), |(front, rest)| (front, Some(rest)))
        };
        let (label, values) = apart(text, ':');
        let (id, site) = apart(label, '@');
        WrittenEffect {
            label,
            id,
            site,
            values,
        }
    }
}

/// How an effect at a site is called.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct EffectName {
    /// Its id.
    pub effect: String,
    /// `None` where the effect has no place of its own.
    pub site: Option<String>,
    /// A discrete choice as key and value (`direction`, `y`).
    pub variant: Option<(String, String)>,
}

impl EffectName {
    /// `effect@site`, or the bare id; the discrete choice is not part of it.
    pub fn label(&self) -> String {
        match &self.site {
            Some(site) => format!("{}@{site}", self.effect),
            None => self.effect.clone(),
        }
    }
}
