//! Transpose Jacobian control.

use super::describe::{Default, Description, Form, Parameter, Per, Signal};

/// Q̂ in N, the task force from which the torques follow by τ = Jᵀ Q̂.
pub(super) const FORCE: Signal = Signal {
    key: "force",
    symbol: "Q̂",
    title: "Task force",
    unit: "N",
    per: Per::Axis,
    range: None,
};

/// K_p.
pub(super) const KP: Parameter = Parameter {
    key: "law.kp",
    label: "K_p",
    form: Form::Matrix,
    unit: "N/m",
    default: Default::Required,
    help: "Stiffness: the task force for each metre of tracking error.",
};

/// K_d.
pub(super) const KD: Parameter = Parameter {
    key: "law.kd",
    label: "K_d",
    form: Form::Matrix,
    unit: "N s/m",
    default: Default::Required,
    help: "Damping: the task force for each m/s of tracking error's rate.",
};

/// tj.
pub const DESCRIPTION: Description = Description {
    name: "tj",
    title: "transpose Jacobian",
    equation: "Q̂ = K_p e + K_d ė (7)",
    parameters: &[KP, KD],
    echo: FORCE,
    has_memory: false,
    signals: &[],
};
