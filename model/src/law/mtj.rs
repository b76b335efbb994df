//! Modified transpose Jacobian control.

use super::{
    describe::{Default, Description, Form, Parameter, Per, Signal},
    tj::{FORCE, KD, KP},
};

/// mtj.
pub const DESCRIPTION: Description = Description {
    name: "mtj",
    title: "modified transpose Jacobian",
    equation: "Q̂ = K_p e + K_d ė + h [+ M̄ ë (11)] (16)",
    parameters: &[
        KP,
        KD,
        Parameter {
            key: "law.acceleration",
            label: "M̄ ë (11)",
            form: Form::Flag,
            unit: "",
            default: Default::Value("false"),
            help: "Adds the acceleration term of eq. (11), which makes the memory stand latency.",
        },
        Parameter {
            key: "law.factor.kind",
            label: "k from",
            form: Form::Choice(&["switch", "exponential", "diagonal"]),
            unit: "",
            default: Default::Value("\"exponential\""),
            help: "How the regulating factor follows from the error: eq. (14), (15a) or (15b).",
        },
        Parameter {
            key: "law.factor.error",
            label: "e_max",
            form: Form::List,
            unit: "m",
            default: Default::Value("1.0"),
            help: "Threshold of the tracking error.",
        },
        Parameter {
            key: "law.factor.error_rate",
            label: "ė_max",
            form: Form::List,
            unit: "m/s",
            default: Default::Value("10.0"),
            help: "Threshold of the tracking error's rate.",
        },
        Parameter {
            key: "law.factor.ceiling",
            label: "largest k",
            form: Form::Number,
            unit: "",
            default: Default::Value("1.0"),
            help: "What k is multiplied with: its largest value.",
        },
    ],
    echo: FORCE,
    has_memory: true,
    signals: &[
        Signal {
            key: "factor",
            symbol: "k",
            title: "Regulating factor",
            unit: "",
            per: Per::Axis,
            range: Some([0.0, 1.0]),
        },
        Signal {
            key: "memory",
            symbol: "h",
            title: "Memory",
            unit: "N",
            per: Per::Axis,
            range: None,
        },
    ],
};
