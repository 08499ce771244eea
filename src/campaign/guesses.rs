//! What a campaign file itself calls guessed: `init` puts the mark, and whoever has looked takes it out.

use crate::text::listed;

/// Behind a value that nobody gave, before the reason.
pub(super) const MARK: &str = "# guessed: ";
/// Values told with their tables.
const SHOWN: usize = 4;
/// Tables that say how cutting was done; the others are the robot's.
const OF_CUTTING: [&str; 4] = ["tool", "dynamometer", "cut", "channel"];

/// Guesses that were made alike.
#[derive(Debug, Clone, PartialEq, Default)]
struct Alike {
    /// `point`, `frf`, `tool` …
    kind: String,
    key: String,
    why: String,
    /// What the table is called (nothing where it is the only one) and the value that was taken.
    taken: Vec<(String, String)>,
}

/// The guesses that still stand in a campaign file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Guesses(Vec<Alike>);

impl Guesses {
    /// Those of a text that is valid TOML.
    pub(super) fn of_text(text: &str) -> Self {
        let mut all: Vec<Alike> = Vec::new();
        let (mut kind, mut name) = (String::new(), String::new());
        for line in text.lines().map(str::trim) {
            if let Some(header) = line.strip_prefix('[') {
                kind = header.trim_matches(['[', ']', ' ']).to_string();
                name.clear();
                continue;
            }
            let Some((key, rest)) = line.split_once('=').filter(|_| !line.starts_with('#')) else {
                continue;
            };
            let (value, why) = match rest.split_once(MARK) {
                Some((value, why)) => (value.trim(), Some(why.trim())),
                None => (rest.trim(), None),
            };
            let key = key.trim();
            if name.is_empty() && ["id", "node", "file"].contains(&key) {
                name = value.trim_matches('"').to_string();
            }
            let Some(why) = why else { continue };
            let same = |a: &&mut Alike| a.kind == kind && a.key == key && a.why == why;
            let taken = (name.clone(), value.to_string());
            match all.iter_mut().find(same) {
                Some(alike) => alike.taken.push(taken),
                None => all.push(Alike {
                    kind: kind.clone(),
                    key: key.to_string(),
                    why: why.to_string(),
                    taken: vec![taken],
                }),
            }
        }
        Guesses(all)
    }

    /// Those that a comparison of FRFs rests on, in a sentence; `None` where there are none.
    pub fn of_robot_told(&self) -> Option<String> {
        self.told(false)
    }

    /// Those that an evaluation of cuts rests on.
    pub fn of_cutting_told(&self) -> Option<String> {
        self.told(true)
    }

    /// Both, for what rests on robot and cuts.
    pub fn all_told(&self) -> Vec<String> {
        self.of_robot_told()
            .into_iter()
            .chain(self.of_cutting_told())
            .collect()
    }

    fn told(&self, cutting: bool) -> Option<String> {
        let own = self
            .0
            .iter()
            .filter(|a| OF_CUTTING.contains(&a.kind.as_str()) == cutting);
        let told: Vec<String> = own.map(Alike::told).collect();
        (!told.is_empty()).then(|| {
            format!(
                "guessed in campaign.toml, and nobody has confirmed it: {}. Where it is right, take the mark `# guessed` out",
                told.join("; ")
            )
        })
    }
}

impl Alike {
    /// `axes = "base" for point 1 and 2 (X, Y, Z taken along the robot's base)`.
    fn told(&self) -> String {
        let Alike {
            kind,
            key,
            why,
            taken,
        } = self;
        let value = taken.first().map_or("", |(_, value)| value);
        let one_value = taken.iter().all(|(_, v)| v == value);
        let each = taken.iter().take(SHOWN).map(|(name, v)| match one_value {
            true => name.clone(),
            false => format!("{v} for {name}"),
        });
        let mut each: Vec<String> = each.collect();
        if taken.len() > SHOWN {
            each.push(format!("{} more", taken.len() - SHOWN));
        }
        let each = listed(&each);
        match one_value {
            true if each.is_empty() => format!("{key} = {value} in [{kind}] ({why})"),
            true => format!("{key} = {value} for {kind} {each} ({why})"),
            false => format!("{key} of each {kind}: {each} ({why})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guesses_are_told_side_by_side_until_their_mark_is_out() {
        let text = "schema = \"x\"\n[[point]]\nnode = 1\naxes = \"base\"  # guessed: along the base\n\
                    [[point]]\nnode = 2\naxes = \"base\"  # guessed: along the base\n\
                    [[frf]]\nfile = \"a.csv\"\nposture = \"A\"  # guessed: from the file name\n\
                    [[frf]]\nfile = \"b.csv\"\nposture = \"B\"  # guessed: from the file name\n\
                    [tool]\n# fill in: teeth = …  # guessed: never\nkind = \"endmill\"  # guessed: what the process needs\n";
        let guesses = Guesses::of_text(text);
        let robot = guesses.of_robot_told().unwrap();
        assert!(
            robot.contains("axes = \"base\" for point 1 and 2 (along the base)"),
            "{robot}"
        );
        assert!(
            robot.contains("posture of each frf: \"A\" for a.csv and \"B\" for b.csv (from the file name)"),
            "{robot}"
        );
        let cutting = guesses.of_cutting_told().unwrap();
        assert!(
            cutting.contains("kind = \"endmill\" in [tool] (what the process needs)"),
            "{cutting}"
        );
        assert!(!cutting.contains("never") && !robot.contains("endmill"));
        let confirmed = text.replace("  # guessed", "  # measured");
        assert_eq!(Guesses::of_text(&confirmed), Guesses::default());
    }
}
