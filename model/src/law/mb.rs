//! Model-based control, or computed torque.

use super::{
    describe::{Default, Description, Form, Parameter},
    tj::FORCE,
};

/// mb.
pub const DESCRIPTION: Description = Description {
    name: "mb",
    title: "computed torque",
    equation: "Q̂ = Ĥ (ẍ_d + K_d ė + K_p e) + Ĉ (4)",
    parameters: &[
        Parameter {
            key: "law.kp",
            label: "K_p",
            form: Form::Matrix,
            unit: "1/s²",
            default: Default::Required,
            help: "Acceleration for each metre of tracking error.",
        },
        Parameter {
            key: "law.kd",
            label: "K_d",
            form: Form::Matrix,
            unit: "1/s",
            default: Default::Required,
            help: "Acceleration for each m/s of tracking error's rate.",
        },
        Parameter {
            key: "law.model.mass_scale",
            label: "model mass",
            form: Form::Number,
            unit: "",
            default: Default::Value("1.0"),
            help: "What the model's masses and inertias are multiplied with.",
        },
    ],
    echo: FORCE,
    has_memory: false,
    signals: &[],
};
