//! Which robot it is, and what of its file a calibration may change.

/// The `[robot]` section of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotSection {
    /// Built-in name (`irb6640`) or path of a robot file.
    pub model: String,
    /// Relative standard deviation of each link's mass (and inertia with it); `None`: masses are exact.
    pub mass_tolerance: Option<f64>,
    /// Standard deviation of the logarithm of a joint stiffness about the robot file's value.
    pub stiffness_tolerance: f64,
    /// What else of the robot file is not exact.
    pub links: LinkTolerances,
}

/// Standard deviations of the links' numbers about those of the robot file; `None`: the file is exact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkTolerances {
    /// Of the logarithm of the principal moments of inertia.
    pub inertia: Option<f64>,
    /// Of the centres of mass, m.
    pub centre_m: Option<f64>,
    /// Of lengths and offsets of the kinematics, m.
    pub length_m: Option<f64>,
    /// Of the logarithm of the sections' walls.
    pub wall: Option<f64>,
}

/// What of a robot's links a calibration may free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkGroup {
    /// Masses, and the inertias with them.
    Masses,
    /// Principal moments of inertia.
    Inertias,
    /// Centres of mass, along all three axes of the link's frame.
    Centres,
    /// Lengths and offsets of the kinematics.
    Lengths,
    /// Wall thicknesses of the sections of links that bend.
    Walls,
}

impl LinkGroup {
    /// All five, masses first.
    pub const ALL: [LinkGroup; 5] = [
        LinkGroup::Masses,
        LinkGroup::Inertias,
        LinkGroup::Centres,
        LinkGroup::Lengths,
        LinkGroup::Walls,
    ];

    /// Those that a model has whose links bend, or do not.
    pub fn of_model(bends: bool) -> Vec<LinkGroup> {
        let all = LinkGroup::ALL.into_iter();
        all.filter(|g| bends || *g != LinkGroup::Walls).collect()
    }

    /// The key of `[robot]` that frees the group for good.
    pub const fn key(self) -> &'static str {
        match self {
            LinkGroup::Masses => "mass_tolerance",
            LinkGroup::Inertias => "inertia_tolerance",
            LinkGroup::Centres => "com_tolerance_mm",
            LinkGroup::Lengths => "length_tolerance_mm",
            LinkGroup::Walls => "wall_tolerance",
        }
    }

    /// What is taken where nobody has said anything else, in the unit of the key: numbers of a data sheet or a drawing that
    /// somebody had to estimate.
    pub fn usual_tolerance(self) -> f64 {
        match self {
            LinkGroup::Masses => 0.1,
            LinkGroup::Inertias => 0.4,
            LinkGroup::Centres => 50.0,
            LinkGroup::Lengths => 10.0,
            LinkGroup::Walls => 0.3,
        }
    }
}

impl RobotSection {
    /// The tolerance of a group, in the unit of its key; `None`: the robot file is exact there.
    pub fn tolerance(&self, group: LinkGroup) -> Option<f64> {
        let mm = |m: f64| m * 1e3;
        match group {
            LinkGroup::Masses => self.mass_tolerance,
            LinkGroup::Inertias => self.links.inertia,
            LinkGroup::Centres => self.links.centre_m.map(mm),
            LinkGroup::Lengths => self.links.length_m.map(mm),
            LinkGroup::Walls => self.links.wall,
        }
    }

    /// The same section with `groups` free: within the usual tolerance, where it gives none.
    pub fn freeing(&self, groups: &[LinkGroup]) -> RobotSection {
        let mut free = self.clone();
        for group in groups.iter().filter(|g| self.tolerance(**g).is_none()) {
            let usual = group.usual_tolerance();
            match group {
                LinkGroup::Masses => free.mass_tolerance = Some(usual),
                LinkGroup::Inertias => free.links.inertia = Some(usual),
                LinkGroup::Centres => free.links.centre_m = Some(usual * 1e-3),
                LinkGroup::Lengths => free.links.length_m = Some(usual * 1e-3),
                LinkGroup::Walls => free.links.wall = Some(usual),
            }
        }
        free
    }
}
