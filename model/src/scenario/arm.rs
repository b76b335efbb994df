//! The arm of a scenario.

use std::ops::{Deref, DerefMut};

use nalgebra::{DMatrix, SMatrix, SVector, Vector2};

use super::{
    FrictionSettings,
    error::ScenarioError,
    key::{
        Default::{Required, Value, Words},
        Form, Parameter, Range,
    },
    section::Section,
};
use crate::{
    JointCount,
    arm::{
        Kinematics,
        planar::{Configuration, PlanarArm, RigidLink},
    },
    for_axes, for_joints, task,
};

const KIND: Parameter = Parameter::new(
    "arm.kind",
    Form::Choice(&["planar"]),
    "",
    Value("\"planar\""),
    "What the arm is: a chain of rigid links in a plane.",
);
const POSITION: Parameter = Parameter::new(
    "arm.position",
    Form::Joints,
    "rad",
    Words("zeros"),
    "Joint angles at the start, each relative to the link before; not a singular configuration.",
);
const VELOCITY: Parameter = Parameter::new(
    "arm.velocity",
    Form::Joints,
    "rad/s",
    Words("zeros"),
    "Joint velocities at the start.",
);
const GRAVITY: Parameter = Parameter::new(
    "arm.gravity",
    Form::Point,
    "m/s²",
    Value("[0.0, 0.0]"),
    "Gravitational acceleration in the plane of the arm; [0, -9.81] stands it upright.",
);
const ARMATURE: Parameter = Parameter::new(
    "arm.armature",
    Form::JointList(Range::NotNegative),
    "kg m²",
    Words("none"),
    "Inertia of the rotors, reflected by their gears: on the diagonal of H, in the plant and in the \
     controller's model.",
);
/// The keys of `arm` itself.
pub(super) const KEYS: &[&Parameter] = &[&KIND, &POSITION, &VELOCITY, &GRAVITY, &ARMATURE];

const LENGTH: Parameter = Parameter::new(
    "arm.links[].length",
    Form::Number(Range::Positive),
    "m",
    Required,
    "From this joint to the next.",
);
const MASS: Parameter = Parameter::new(
    "arm.links[].mass",
    Form::Number(Range::Positive),
    "kg",
    Required,
    "Mass of the link.",
);
const CENTER: Parameter = Parameter::new(
    "arm.links[].center",
    Form::Number(Range::Any),
    "m",
    Words("half the length"),
    "From this joint to the centre of mass, along the link.",
);
const INERTIA: Parameter = Parameter::new(
    "arm.links[].inertia",
    Form::Number(Range::Positive),
    "kg m²",
    Required,
    "Moment of inertia about the centre of mass.",
);
/// The keys of an entry of `arm.links`.
pub(super) const LINK_KEYS: &[&Parameter] = &[&LENGTH, &MASS, &CENTER, &INERTIA];

/// Links and initial state of a planar arm.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmSettings {
    /// The links, base first.
    pub links: Chain,
    /// Gravitational acceleration in the plane, m/s².
    pub gravity: Vector2<f64>,
    /// Reflected inertia of each rotor, kg m²; `None` if they have none.
    pub armature: Option<Vec<f64>>,
    /// What resists the joints; `None` if nothing does.
    pub friction: Option<FrictionSettings>,
    /// Initial joint angles, rad; as many as links.
    pub position: Vec<f64>,
    /// Initial joint velocities, rad/s; as many as links.
    pub velocity: Vec<f64>,
}

/// One to seven links: a slice of them whose length is a [`JointCount`].
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    links: Vec<RigidLink<f64>>,
    count: JointCount,
}

impl Chain {
    /// A chain of links, base first; `None` if there are none or too many.
    pub fn new(links: Vec<RigidLink<f64>>) -> Option<Self> {
        let count = JointCount::new(links.len())?;
        Some(Self { links, count })
    }
}

impl Deref for Chain {
    type Target = [RigidLink<f64>];

    fn deref(&self) -> &[RigidLink<f64>] {
        &self.links
    }
}

impl DerefMut for Chain {
    fn deref_mut(&mut self) -> &mut [RigidLink<f64>] {
        &mut self.links
    }
}

/// Below this ratio of the smallest to the largest singular value of J a start counts as singular.
const SINGULAR: f64 = 1e-6;

impl ArmSettings {
    pub(super) fn read(arm: Section<'_>, task: &task::Description) -> Result<Self, ScenarioError> {
        arm.word(&KIND, &[()])?;
        let expected = "1 to 7 links, each {length, mass, center, inertia}";
        let sections = arm.sections("links", expected)?;
        let links = sections.into_iter().map(read_link).collect::<Result<Vec<_>, _>>()?;
        let links = Chain::new(links).ok_or_else(|| arm.refuse("links", expected))?;
        let count = links.len();
        let per_joint =
            |key| Ok(arm.optional_list(key, count)?.unwrap_or_else(|| vec![0.0; count]));
        let (position, velocity) = (per_joint(&POSITION)?, per_joint(&VELOCITY)?);
        let gravity = Vector2::from(arm.point(&GRAVITY)?);
        let armature = arm.one_or_each(&ARMATURE, count)?;
        let armature = armature.filter(|rotors| rotors.iter().any(|inertia| *inertia > 0.0));
        let friction = FrictionSettings::read(arm.section_or_empty("friction")?, count)?;
        let settings = Self { links, gravity, armature, friction, position, velocity };
        if for_joints!(settings.joints(), N => for_axes!(task, M => settings.is_singular::<N, M>()))
        {
            return Err(arm.refuse(
                "position",
                "a start that is not singular (the links lie in one line, where no torque moves the \
                 tip along it): bend a joint",
            ));
        }
        arm.finish()?;
        Ok(settings)
    }

    /// How many joints there are.
    pub fn joints(&self) -> JointCount {
        self.links.count
    }

    /// The arm with static dimensions; `N` is the number of links.
    pub fn build<const N: usize>(&self) -> PlanarArm<f64, N> {
        let arm = PlanarArm::new(&std::array::from_fn(|i| self.links[i]), self.gravity);
        match &self.armature {
            None => arm,
            Some(rotors) => arm.with_rotors(std::array::from_fn(|i| rotors[i])),
        }
    }

    /// The same arm with all masses and inertias multiplied by `mass_scale`.
    pub fn scaled(&self, mass_scale: f64) -> Self {
        let mut arm = self.clone();
        for link in arm.links.iter_mut() {
            link.mass *= mass_scale;
            link.inertia *= mass_scale;
        }
        for inertia in arm.armature.iter_mut().flatten() {
            *inertia *= mass_scale;
        }
        arm
    }

    /// The same arm with a load at its tip, a point of this mass, kg.
    pub fn carrying(&self, load: f64) -> Self {
        let mut arm = self.clone();
        if let Some(last) = arm.links.last_mut() {
            let RigidLink { length, mass, center, inertia } = *last;
            let all = mass + load;
            let middle = (mass * center + load * length) / all;
            let own = mass * (center - middle).powi(2);
            let of_load = load * (length - middle).powi(2);
            *last =
                RigidLink { length, mass: all, center: middle, inertia: inertia + own + of_load };
        }
        arm
    }

    /// Where each link ends at joint angles `q` in rad, base first; the last end is the tip. m.
    ///
    /// Angles that are missing are taken as zero.
    pub fn ends(&self, q: &[f64]) -> Vec<Vector2<f64>> {
        for_joints!(self.joints(), N => {
            let q = SVector::<f64, N>::from_fn(|i, _| q.get(i).copied().unwrap_or(0.0));
            self.build::<N>().ends(&Configuration::new(&q, &SVector::zeros())).to_vec()
        })
    }

    /// How far the tip can be from the base, m.
    pub fn reach(&self) -> f64 {
        self.links.iter().map(|link| link.length).sum()
    }

    fn is_singular<const N: usize, const M: usize>(&self) -> bool {
        let q = SVector::from_fn(|i, _| self.position[i]);
        let at = Configuration::new(&q, &SVector::zeros());
        let jacobian: SMatrix<f64, M, N> = self.build::<N>().jacobian(&at);
        // The eigenvalues of J Jᵀ are the squares of the singular values; one joint has one of
        // them.
        let squares = DMatrix::from_fn(M, M, |i, j| jacobian.row(i).dot(&jacobian.row(j)));
        let values = squares.symmetric_eigenvalues();
        N >= M && values.min() < SINGULAR * SINGULAR * values.max()
    }
}

fn read_link(link: Section<'_>) -> Result<RigidLink<f64>, ScenarioError> {
    let length = link.number(&LENGTH)?;
    let mass = link.number(&MASS)?;
    let center = link.optional_number(&CENTER)?.unwrap_or(length / 2.0);
    let inertia = link.number(&INERTIA)?;
    link.finish()?;
    Ok(RigidLink { length, mass, center, inertia })
}
