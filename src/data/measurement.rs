//! Where the robot stood, and where on it was measured.

#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    pub id: String,
    pub joints_deg: Vec<f64>,
}

/// The body of the robot that a measurement point sits on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BodyRef {
    Base,
    /// 1-based link number; its frame is DH frame i.
    Link(usize),
    /// Origin at the tool centre point, axes of the tool.
    Tool,
}

/// In which frame X, Y, Z of the FRF files are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxesRef {
    Base,
    /// The frame of the point's body.
    Body,
    Tool,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    pub node: i64,
    pub body: BodyRef,
    pub position_m: [f64; 3],
    pub axes: AxesRef,
}
