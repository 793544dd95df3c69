"""What the draft of fmi-ls-wasm (0.1.0, June 2026) calls the methods of an FMU, and their types, in words of the
Component Model's interface language. ``fmu_src/component/component.c`` has a function for each."""

from typing import Final, NamedTuple

PACKAGE: Final = "fmi:fmi3/{}@3.0.0"

TYPES: Final = {
    "value-reference": "u32",
    "status": "enum<ok, warning, discard, error, fatal>",
    "fmu-state": "list<u8>",
    "interval-qualifier": "enum<interval-not-yet-known, interval-unchanged, interval-changed>",
    "interval-fraction": "record<counter: u64, resolution: u64>",
    "dependency-kind": "enum<dependent, constant, fixed, tunable, discrete>",
    "variable-dependency": "record<dependent-value-reference: value-reference, element-index-of-dependent: u32,"
    " independent-value-reference: value-reference, element-index-of-independent: u32, kind: dependency-kind>",
    "discrete-states-info": "record<new-discrete-states-needed: bool, terminate-simulation: bool,"
    " nominals-of-continuous-states-changed: bool, values-of-continuous-states-changed: bool,"
    " next-event-time-defined: bool, next-event-time: f64>",
}
"""The types that interfaces share, each after those that it is made of."""

INNER: Final = ("dependency-kind",)
"""Those that only other types are made of."""

CALLBACKS: Final = {
    "callbacks": "log-message(instance-name: string, status: status, category: string, message: string)",
    "intermediate-update-callbacks": "intermediate-update(intermediate-update-time: f64,"
    " intermediate-variable-set-requested: bool, intermediate-variable-get-allowed: bool,"
    " intermediate-step-finished: bool, can-return-early: bool) -> tuple<bool, f64>",
}
"""The function that an FMU calls of each of the importer's interfaces."""

GET_VERSION: Final = "get-version() -> string"

_VALUES = {
    "float32": "f32", "float64": "f64", "int8": "s8", "int16": "s16", "int32": "s32", "int64": "s64", "uint8": "u8",
    "uint16": "u16", "uint32": "u32", "uint64": "u64", "boolean": "bool", "string": "string", "binary": "list<u8>",
    "clock": "bool",
}  # fmt: skip
_REFERENCES = "value-references: list<value-reference>"
_ALONG = "unknowns: list<value-reference>, knowns: list<value-reference>, seed: list<f64>"
_COMMON = (
    "set-debug-logging(logging-on: bool, categories: list<string>) -> status",
    "enter-initialization-mode(tolerance: option<f64>, start-time: f64, stop-time: option<f64>) -> status",
    "exit-initialization-mode() -> status",
    "enter-event-mode() -> status",
    "update-discrete-states() -> result<discrete-states-info, status>",
    "terminate() -> status",
    "reset() -> status",
    "enter-configuration-mode() -> status",
    "exit-configuration-mode() -> status",
    *(f"get-{name}({_REFERENCES}) -> result<list<{kind}>, status>" for name, kind in _VALUES.items()),
    *(f"set-{name}({_REFERENCES}, values: list<{kind}>) -> status" for name, kind in _VALUES.items()),
    "get-number-of-variable-dependencies(vr: value-reference) -> result<u64, status>",
    "get-variable-dependencies(dependent: value-reference) -> result<list<variable-dependency>, status>",
    "get-fmu-state() -> result<fmu-state, status>",
    "set-fmu-state(state: fmu-state) -> status",
    f"get-directional-derivative({_ALONG}) -> result<list<f64>, status>",
    f"get-adjoint-derivative({_ALONG}) -> result<list<f64>, status>",
    f"get-interval-decimal({_REFERENCES}) -> result<list<tuple<f64, interval-qualifier>>, status>",
    f"get-interval-fraction({_REFERENCES}) -> result<list<tuple<interval-fraction, interval-qualifier>>, status>",
    f"get-shift-decimal({_REFERENCES}) -> result<list<f64>, status>",
    f"get-shift-fraction({_REFERENCES}) -> result<list<interval-fraction>, status>",
    f"set-interval-decimal({_REFERENCES}, intervals: list<f64>) -> status",
    f"set-interval-fraction({_REFERENCES}, intervals: list<interval-fraction>) -> status",
    f"set-shift-decimal({_REFERENCES}, shifts: list<f64>) -> status",
    f"set-shift-fraction({_REFERENCES}, shifts: list<interval-fraction>) -> status",
    "evaluate-discrete-states() -> status",
    "enter-step-mode() -> status",
    "get-output-derivatives(requests: list<tuple<value-reference, u32>>) -> result<list<f64>, status>",
)


class Kind(NamedTuple):
    """A kind of instance: the interface ``name`` with a resource NAME-instance, of an FMU whose modelDescription.xml
    has the ``element``. ``record``: the type of its own, by name; ``make`` makes an instance; ``methods`` of it."""

    element: str
    name: str
    record: tuple[str, str]
    make: str
    methods: tuple[str, ...]


_MADE = "instance-name: string, instantiation-token: string, resource-path: string, visible: bool, logging-on: bool"
_STEP = "record<last-successful-time: f64, event-handling-needed: bool, terminate-simulation: bool, early-return: bool>"
KINDS: Final = (
    Kind(
        "CoSimulation",
        "co-simulation",
        ("do-step-result", _STEP),
        f"instantiate-co-simulation({_MADE}, event-mode-used: bool, early-return-allowed: bool,"
        " required-intermediate-variables: list<value-reference>)",
        (
            *_COMMON,
            "set-input-derivatives(requests: list<tuple<value-reference, u32>>, values: list<f64>) -> status",
            "do-step(current-communication-point: f64, communication-step-size: f64,"
            " no-set-fmu-state-prior-to-current-point: bool) -> result<do-step-result, status>",
        ),
    ),
    Kind(
        "ModelExchange",
        "model-exchange",
        ("completed-step-result", "record<enter-event-mode: bool, terminate-simulation: bool>"),
        f"instantiate-model-exchange({_MADE})",
        (
            *_COMMON,
            "enter-continuous-time-mode() -> status",
            "set-time(time: f64) -> status",
            "set-continuous-states(continuous-states: list<f64>) -> status",
            "get-continuous-state-derivatives() -> result<list<f64>, status>",
            "get-event-indicators() -> result<list<f64>, status>",
            "get-continuous-states() -> result<list<f64>, status>",
            "get-nominals-of-continuous-states() -> result<list<f64>, status>",
            "get-number-of-event-indicators() -> result<u64, status>",
            "get-number-of-continuous-states() -> result<u64, status>",
            "completed-integrator-step(no-set-fmu-state-prior-to-current-point: bool)"
            " -> result<completed-step-result, status>",
        ),
    ),
)
