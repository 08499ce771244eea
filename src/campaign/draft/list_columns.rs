//! What the columns of a cut list are called in English, German, French and Spanish laboratories, and in which units they are.

/// What a column holds: a key of `[[cut]]`, or one of these that keys are made of.
pub(super) const FEED_RATE: &str = "feed_mm_per_min";
pub(super) const FEED_PER_TURN: &str = "feed_mm_per_turn";
pub(super) const RADIAL_DEPTH: &str = "radial_depth_mm";
pub(super) const DIRECTION: &str = "direction";
pub(super) const DIAMETER: &str = "diameter_mm";
pub(super) const TEETH: &str = "teeth";
pub(super) const HELIX: &str = "helix_deg";
pub(super) const HALF_POINT_ANGLE: &str = "half_point_angle_deg";
/// Keys of `[tool]`: lists say them in every row.
pub(super) const OF_TOOL: [&str; 4] = [DIAMETER, TEETH, HELIX, HALF_POINT_ANGLE];
pub(super) const CUTTING_SPEED: &str = "cutting_speed_m_per_min";
/// The number of the cut where no column names its file.
pub(super) const NUMBER: &str = "number";
/// A feed whose unit says which.
const FEED: &str = "feed";

/// Names in lower case, without accents.
const NAMES: [(&str, &[&str]); 23] = [
    (
        "file",
        &[
            "file name",
            "filename",
            "record",
            "datei",
            "dateiname",
            "messdatei",
            "messung",
            "versuch",
            "fichier",
            "essai",
            "archivo",
            "fichero",
            "ensayo",
            "test",
            "run",
        ],
    ),
    (
        NUMBER,
        &[
            "nr", "nr.", "no", "no.", "n°", "nº", "number", "nummer", "numero", "schnitt", "cut",
        ],
    ),
    (
        "spindle_rpm",
        &[
            "n",
            "s",
            "rpm",
            "speed",
            "spindle speed",
            "drehzahl",
            "spindeldrehzahl",
            "vitesse de rotation",
            "vitesse de broche",
            "vitesse broche",
            "frequence de rotation",
            "regime",
            "velocidad de giro",
            "velocidad del husillo",
            "velocidad husillo",
            "revoluciones",
        ],
    ),
    (
        "feed_per_tooth_mm",
        &[
            "fz",
            "feed per tooth",
            "zahnvorschub",
            "vorschub pro zahn",
            "vorschub je zahn",
            "avance par dent",
            "avance por diente",
        ],
    ),
    (
        FEED_RATE,
        &[
            "vf",
            "feed rate",
            "feedrate",
            "vorschubgeschwindigkeit",
            "vitesse d'avance",
            "velocidad de avance",
        ],
    ),
    (
        FEED_PER_TURN,
        &[
            "fu",
            "fn",
            "feed per rev",
            "feed per revolution",
            "feed per turn",
            "vorschub pro umdrehung",
            "vorschub je umdrehung",
            "avance par tour",
            "avance por vuelta",
            "avance por revolucion",
        ],
    ),
    (FEED, &["f", "feed", "vorschub", "avance"]),
    (
        "axial_depth_mm",
        &[
            "ap",
            "axial depth",
            "axial depth of cut",
            "depth of cut",
            "schnitttiefe",
            "axiale zustellung",
            "zustellung",
            "profondeur axiale",
            "profondeur de passe",
            "profondeur de passe axiale",
            "profundidad axial",
            "profundidad de corte",
            "profundidad de corte axial",
            "profundidad de pasada",
        ],
    ),
    (
        RADIAL_DEPTH,
        &[
            "ae",
            "radial depth",
            "radial depth of cut",
            "width of cut",
            "eingriffsbreite",
            "schnittbreite",
            "radiale zustellung",
            "engagement radial",
            "profondeur radiale",
            "largeur de coupe",
            "largeur de passe",
            "ancho de corte",
            "profundidad de corte radial",
            "profundidad radial",
        ],
    ),
    (
        "start_deg",
        &[
            "start",
            "start angle",
            "entry angle",
            "eintritt",
            "eintrittswinkel",
            "startwinkel",
            "angle d'entree",
            "angulo de entrada",
        ],
    ),
    (
        "exit_deg",
        &[
            "exit",
            "exit angle",
            "austritt",
            "austrittswinkel",
            "angle de sortie",
            "angulo de salida",
        ],
    ),
    ("immersion", &["eingriff"]),
    (
        DIRECTION,
        &[
            "milling mode",
            "frasart",
            "fraesart",
            "mode de fraisage",
            "modo de fresado",
            "up/down",
            "gleichlauf/gegenlauf",
        ],
    ),
    ("order", &["reihenfolge", "ordre", "orden", "lfd nr", "lfd. nr."]),
    ("material", &["workpiece", "werkstoff", "matiere", "materiau"]),
    (
        "process",
        &[
            "operation",
            "operacion",
            "prozess",
            "verfahren",
            "bearbeitung",
            "procede",
            "usinage",
            "proceso",
            "mecanizado",
        ],
    ),
    (
        "pilot_diameter_mm",
        &[
            "pilot",
            "pilot hole",
            "vorbohrung",
            "pilotbohrung",
            "vorbohrdurchmesser",
            "pilot diameter",
            "diametre de l'avant-trou",
            "avant-trou",
            "agujero previo",
        ],
    ),
    (
        "hole_depth_mm",
        &[
            "hole depth",
            "bohrtiefe",
            "profondeur de percage",
            "profundidad de taladrado",
        ],
    ),
    (
        CUTTING_SPEED,
        &[
            "vc",
            "v_c",
            "cutting speed",
            "schnittgeschwindigkeit",
            "vitesse de coupe",
            "velocidad de corte",
        ],
    ),
    (
        DIAMETER,
        &[
            "d",
            "diameter",
            "tool diameter",
            "work diameter",
            "workpiece diameter",
            "werkstuckdurchmesser",
            "werkstueckdurchmesser",
            "diametre de la piece",
            "diametro de la pieza",
            "durchmesser",
            "werkzeugdurchmesser",
            "diametre",
            "diametre de l'outil",
            "diametre outil",
            "diametro",
            "diametro de la herramienta",
            "diametro herramienta",
        ],
    ),
    (
        TEETH,
        &[
            "z",
            "number of teeth",
            "zahne",
            "zaehne",
            "zahnezahl",
            "zaehnezahl",
            "dents",
            "nombre de dents",
            "nb de dents",
            "nb dents",
            "dientes",
            "numero de dientes",
            "n.º dientes",
            "nº dientes",
            "no. of teeth",
        ],
    ),
    (
        HELIX,
        &[
            "helix",
            "helix angle",
            "drall",
            "drallwinkel",
            "spiralwinkel",
            "angle d'helice",
            "angulo de helice",
        ],
    ),
    (
        HALF_POINT_ANGLE,
        &[
            "point angle",
            "spitzenwinkel",
            "angle de pointe",
            "angulo de punta",
        ],
    ),
];

/// Names of a speed that may be that of the spindle or that of cutting.
const SPEED: [&str; 4] = ["speed", "geschwindigkeit", "vitesse", "velocidad"];
/// Units of turns a minute.
const PER_MINUTE: [&str; 11] = [
    "", "1/min", "min-1", "min^-1", "/min", "rpm", "u/min", "upm", "tr/min", "r/min", "rev/min",
];

/// A column whose meaning is known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub key: &'static str,
    /// A number in it times this is in the key's unit; 1 for text.
    pub factor: f64,
}

/// A column's name without its unit.
pub(super) fn name_of(head: &str) -> &str {
    split_unit(head).0
}

/// What a column's head says. `Ok(None)`: nothing that is known here.
///
/// # Errors
/// The unit, where it is not understood, or missing where it decides what is meant.
pub(super) fn column(head: &str, keys: &[&'static str]) -> Result<Option<Column>, String> {
    let (name, unit) = split_unit(head);
    let name = plain(name);
    let spaced = name.replace('_', " ");
    let named = |(key, names): &(&'static str, &[&str])| names.contains(&spaced.as_str()).then_some(*key);
    let own = keys.iter().chain(&OF_TOOL).find(|k| **k == name).copied();
    let key_of = |spaced: &str| {
        NAMES
            .iter()
            .find(|(_, names)| names.contains(&spaced))
            .map(|(key, _)| *key)
    };
    let unit = plain(unit).replace([' ', '*'], "");
    // A speed of which the unit alone says which.
    let speed = SPEED.contains(&spaced.as_str()).then_some(match unit.as_str() {
        "m/min" => Some(CUTTING_SPEED),
        u if PER_MINUTE.contains(&u) && !u.is_empty() => Some("spindle_rpm"),
        _ => None,
    });
    let Some(key) = own
        .or(speed.flatten())
        .or_else(|| NAMES.iter().find_map(named))
        .or_else(|| key_with_symbol(&spaced, &key_of))
    else {
        return Ok(None);
    };
    let factor = |known: &[(&str, f64)]| {
        let found = known.iter().find(|(u, _)| *u == unit);
        found
            .map(|(_, factor)| *factor)
            .ok_or_else(|| format!("unit {unit:?} of column {name:?} is not understood"))
    };
    let length = [
        ("", 1.0),
        ("mm", 1.0),
        ("µm", 1e-3),
        ("um", 1e-3),
        ("m", 1e3),
        ("in", 25.4),
        ("inch", 25.4),
    ];
    let per_tooth =
        ["", "/z", "/zahn", "/tooth", "/dent", "/diente", "pertooth"].map(|of| (format!("mm{of}"), 1.0));
    let per_turn =
        ["", "/u", "/rev", "/r", "/tr", "/tour", "/vuelta", "/umdr"].map(|of| (format!("mm{of}"), 1.0));
    let rate = [
        ("mm/min", 1.0),
        ("m/min", 1e3),
        ("mm/s", 60.0),
        ("in/min", 25.4),
        ("ipm", 25.4),
    ];
    let is = |known: &[(String, f64)]| known.iter().any(|(u, _)| *u == unit);
    let (key, factor) = match key {
        "spindle_rpm" => {
            let per_second = ["1/s", "s-1", "s^-1", "hz", "rev/s", "u/s", "tr/s"];
            let all: Vec<(&str, f64)> = PER_MINUTE
                .map(|u| (u, 1.0))
                .into_iter()
                .chain(per_second.map(|u| (u, 60.0)))
                .collect();
            (key, factor(&all)?)
        }
        FEED | FEED_RATE if rate.iter().any(|(u, _)| *u == unit) => (FEED_RATE, factor(&rate)?),
        FEED_RATE if unit.is_empty() => (FEED_RATE, 1.0),
        FEED if unit == "mm" || unit.is_empty() => {
            return Err(format!(
                "column {name:?} does not say per what: write fz [mm], f [mm/rev] or vf [mm/min]"
            ));
        }
        FEED if is(&per_tooth) => ("feed_per_tooth_mm", 1.0),
        FEED | FEED_PER_TURN if is(&per_turn) || unit.is_empty() => (FEED_PER_TURN, 1.0),
        "feed_per_tooth_mm" if is(&per_tooth) => (key, 1.0),
        "start_deg" | "exit_deg" | HELIX | HALF_POINT_ANGLE => {
            let degrees = 180.0 / std::f64::consts::PI;
            let factor = factor(&[
                ("", 1.0),
                ("°", 1.0),
                ("deg", 1.0),
                ("grad", 1.0),
                ("degre", 1.0),
                ("grados", 1.0),
                ("rad", degrees),
            ])?;
            // A drill's point is named by the whole angle; who writes our key means the half.
            let is_whole = key == HALF_POINT_ANGLE && own.is_none();
            (key, if is_whole { 0.5 * factor } else { factor })
        }
        FEED => return Err(format!("unit {unit:?} of column {name:?} is not understood")),
        CUTTING_SPEED => (
            key,
            factor(&[("", 1.0), ("m/min", 1.0), ("m/s", 60.0), ("mm/s", 0.06)])?,
        ),
        _ if key.ends_with("_mm") || key == FEED_PER_TURN => (key, factor(&length)?),
        _ => (key, 1.0),
    };
    Ok(Some(Column { key, factor }))
}

/// A name with its symbol, `Drehzahl n`, `Axial depth, ap`, `fz feed per tooth`, or with a word for number, `N° essai`, `Cut no`.
fn key_with_symbol(spaced: &str, key_of: &impl Fn(&str) -> Option<&'static str>) -> Option<&'static str> {
    const LONGEST_SYMBOL: usize = 3;
    let bare = spaced.replace(',', " ");
    let words: Vec<&str> = bare.split_whitespace().collect();
    let (first, last) = (*words.first()?, *words.last()?);
    if words.len() < 2 {
        return None;
    }
    let (front, back) = (words[..words.len() - 1].join(" "), words[1..].join(" "));
    for (name, symbol) in [(front, last), (back, first)] {
        let Some(key) = key_of(&name) else {
            continue;
        };
        let is_number = symbol == "#" || symbol == "number" || key_of(symbol) == Some(NUMBER);
        if is_number && matches!(key, "file" | NUMBER) {
            return Some(NUMBER);
        }
        if symbol.chars().count() <= LONGEST_SYMBOL
            && (key_of(symbol) == Some(key) || key_of(symbol) == Some(FEED))
        {
            return Some(key);
        }
    }
    None
}

/// Units that stand behind a stroke, `ap / mm`, as ISO 80000 writes headings.
const AFTER_STROKE: [&str; 14] = [
    "mm", "µm", "um", "m", "1/min", "min-1", "rpm", "u/min", "mm/min", "m/min", "mm/rev", "mm/u", "°", "deg",
];

/// `Drehzahl [1/min]`, `ap (mm)`, `ap in mm`, `ap / mm`: name and unit.
fn split_unit(head: &str) -> (&str, &str) {
    if let Some((name, unit)) = head.split_once('/')
        && AFTER_STROKE.contains(&plain(unit).as_str())
    {
        return (name.trim(), unit.trim());
    }
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((name, rest)) = head.split_once(open) {
            return (name.trim(), rest.split(close).next().unwrap_or("").trim());
        }
    }
    match head.split_once(" in ") {
        Some((name, unit)) if !unit.trim().contains(' ') => (name.trim(), unit.trim()),
        _ => (head.trim(), ""),
    }
}

/// Lower case, without accents.
pub(super) fn plain(text: &str) -> String {
    let bare = |c: char| match c {
        'à' | 'á' | 'â' | 'ä' => 'a',
        'è' | 'é' | 'ê' | 'ë' => 'e',
        'ì' | 'í' | 'î' | 'ï' => 'i',
        'ò' | 'ó' | 'ô' | 'ö' => 'o',
        'ù' | 'ú' | 'û' | 'ü' => 'u',
        'ç' => 'c',
        'ñ' => 'n',
        '’' => '\'',
        'μ' => 'µ',
        c => c,
    };
    text.trim().to_lowercase().chars().map(bare).collect()
}

/// Up or down milling by any of its names; `Some(true)`: down.
pub(super) fn is_down(word: &str) -> Option<bool> {
    match plain(word).as_str() {
        "down" | "climb" | "downmilling" | "gleichlauf" | "gl" | "avalant" | "concordancia" => Some(true),
        "up" | "conventional" | "upmilling" | "gegenlauf" | "geg" | "opposition" | "oposicion" => Some(false),
        _ => None,
    }
}

/// Words for a full slot and for the processes, as `campaign.toml` has them.
pub(super) fn english(word: &str) -> Option<(&'static str, &'static str)> {
    Some(match plain(word).as_str() {
        "slot" | "slotting" | "fullslot" | "nut" | "nuten" | "vollnut" | "rainure" | "rainurage"
        | "ranura" | "ranurado" => ("immersion", "slot"),
        "mill" | "milling" | "fraesen" | "frasen" | "fraisage" | "fresado" => ("process", "milling"),
        "drill" | "drilling" | "bohren" | "percage" | "taladrado" => ("process", "drilling"),
        "turn" | "turning" | "facing" | "drehen" | "langsdrehen" | "laengsdrehen" | "plandrehen"
        | "tournage" | "chariotage" | "dressage" | "torneado" | "cilindrado" | "refrentado" => {
            ("process", "turning")
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::load::CUT;

    #[test]
    fn columns_are_known_in_four_languages_with_their_units() {
        for (head, key, factor) in [
            ("Drehzahl [1/min]", "spindle_rpm", 1.0),
            ("n (1/s)", "spindle_rpm", 60.0),
            ("Vitesse de rotation (tr/min)", "spindle_rpm", 1.0),
            ("Velocidad de giro [rpm]", "spindle_rpm", 1.0),
            ("Velocidad [rpm]", "spindle_rpm", 1.0),
            ("Vitesse [m/min]", CUTTING_SPEED, 1.0),
            ("spindle_rpm", "spindle_rpm", 1.0),
            ("fz [µm]", "feed_per_tooth_mm", 1e-3),
            ("Avance par dent (mm/dent)", "feed_per_tooth_mm", 1.0),
            ("Vorschub [mm/min]", FEED_RATE, 1.0),
            ("F [m/min]", FEED_RATE, 1e3),
            ("avance [mm/vuelta]", FEED_PER_TURN, 1.0),
            ("Eingriffsbreite in mm", RADIAL_DEPTH, 1.0),
            ("Profundidad de corte", "axial_depth_mm", 1.0),
            ("Eintritt [°]", "start_deg", 1.0),
            ("Ángulo de salida (rad)", "exit_deg", 180.0 / std::f64::consts::PI),
            ("Drallwinkel [°]", HELIX, 1.0),
            ("Spitzenwinkel [°]", HALF_POINT_ANGLE, 0.5),
            ("half_point_angle_deg", HALF_POINT_ANGLE, 1.0),
            ("N.º dientes", TEETH, 1.0),
            ("Zähnezahl", TEETH, 1.0),
            ("vc [m/min]", CUTTING_SPEED, 1.0),
            ("f [mm/U]", FEED_PER_TURN, 1.0),
            ("Schnittgeschwindigkeit (m/s)", CUTTING_SPEED, 60.0),
            ("steady_s", "steady_s", 1.0),
            ("N° essai", NUMBER, 1.0),
            ("Versuch Nr.", NUMBER, 1.0),
            ("Cut #", NUMBER, 1.0),
            ("Drehzahl n [1/min]", "spindle_rpm", 1.0),
            ("Feed per tooth, fz (mm)", "feed_per_tooth_mm", 1.0),
            ("ap depth of cut [mm]", "axial_depth_mm", 1.0),
            ("n / 1/min", "spindle_rpm", 1.0),
            ("ap / mm", "axial_depth_mm", 1.0),
            ("Vorschub f [mm/min]", FEED_RATE, 1.0),
        ] {
            assert_eq!(column(head, &CUT), Ok(Some(Column { key, factor })), "{head}");
        }
        assert_eq!(column("Bemerkung", &CUT), Ok(None));
        assert_eq!(column("Drehzahl max", &CUT), Ok(None));
        for head in ["Vorschub", "f [mm]", "ap [furlong]", "n [m/min]"] {
            assert!(column(head, &CUT).is_err(), "{head}");
        }
    }
}
