//! What holds the drilling tool from outside while it cuts: pressure foot and clamps.

/// `[[contact]]`: a spring and a damper between the tool point and the ground (the workpiece, a clamp).
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// What people call it; empty where the file gives no name.
    pub name: String,
    /// Along what it holds.
    pub direction: ContactDirection,
    /// Contact stiffness k.
    pub stiffness_n_per_m: f64,
    /// Viscous contact damping c; 0: none.
    pub damping_ns_per_m: f64,
    /// Force at which it gives way: along the tool that of the foot on the workpiece, across it what friction holds.
    /// `None`: it holds whatever comes.
    pub preload_n: Option<f64>,
}

/// Along what a contact holds, in the axes of the lobes: z along the tool, x and y across it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactDirection {
    /// Along the tool.
    Axial,
    /// Across the tool, alike in all directions.
    Lateral,
    /// Across the tool along the first axis: the base's x for a vertical tool.
    X,
    /// Across the tool along the second axis: the base's y for a vertical tool.
    Y,
}

impl ContactDirection {
    /// As the campaign file has it.
    pub fn label(self) -> &'static str {
        match self {
            ContactDirection::Axial => "axial",
            ContactDirection::Lateral => "lateral",
            ContactDirection::X => "x",
            ContactDirection::Y => "y",
        }
    }
}

impl Contact {
    /// For people: its name, or its direction where it has none.
    pub fn title(&self) -> String {
        match self.name.is_empty() {
            true => format!("{} contact", self.direction.label()),
            false => self.name.clone(),
        }
    }
}
