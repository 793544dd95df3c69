"""Every effect alone, beside the others of its stage, and all at once: outputs are numbers, and no bit depends on how
time is divided, nor on a saved state."""

import zlib

import numpy as np
import pytest
from fmu_importer import OK, Fmu, Instance

from gyro_model.effect_points import active_parameters
from gyro_model.envelope import envelope_model
from gyro_model.generate_envelope import refused_effects
from gyro_model.model import Model, load_model

MODELS: dict[str, Model] = {"Gyroscope": load_model(), "GyroscopeEnvelope": envelope_model()}
CASES = [
    (form, id)
    for form, model in MODELS.items()
    for id in (*(e.id for e in model.effects if not e.nominal and e.limits), "all")
    if form == "Gyroscope" or id not in {e.id for e in refused_effects(model)}
]
STEPS = 30
# All at once want more of the envelope's steps: hard stops damp within 0.1 ms.
INTERNAL_STEP = {"Gyroscope": 5e-6, "GyroscopeEnvelope": 1e-4}


def device_of(model: Model, id: str) -> dict[str, float]:
    """Sizes of one effect up to where it counts, or a tenth of that of all."""
    refused = refused_effects(model) if model.NAME == "GyroscopeEnvelope" else ()
    effects = [e for e in model.effects if not e.nominal and e.limits and e not in refused]
    rng = np.random.default_rng(zlib.crc32(id.encode()))
    values: dict[str, float] = {}
    for effect in effects:
        if id in ("all", effect.id):
            values |= {n: v for n, v in active_parameters(effect, rng, model).items() if n in model.by_name}
    for quantity in (model.by_name[name] for name in values if id == "all"):
        if quantity.role == "size" and quantity.name != "adc_limit":
            values[quantity.name] = quantity.start + 0.1 * (values[quantity.name] - quantity.start)
    return values | {"seed": 3, "internal_step": INTERNAL_STEP[model.NAME]}


def run(instance: Instance, model: Model, first: int, last: int, parts: int) -> list[list[float]]:
    step = INTERNAL_STEP[model.NAME]
    outputs = [q.name for q in model.quantities if q.role == "output"]
    forces = [q for q in model.quantities if q.role == "input" and q.unit == "N"]
    rows = []
    for k in range(first, last):
        instance.set(**{q.name: 1e-8 * ((k * (i + 3)) % 7 - 3) for i, q in enumerate(forces)})
        instance.set(omega_z=0.5 * (k % 3), temperature=298.0 + k % 5, a_x=float(k % 2), v_bias=0.1 * (k % 4))
        for part in range(parts):
            assert instance.step((k + part / parts) * step, step / parts) == OK, instance.log
        rows.append(instance.get(*outputs))
    return rows


@pytest.mark.parametrize(("form", "id"), CASES, ids=[f"{form}-{id}" for form, id in CASES])
def test_no_bit_depends_on_steps_or_saved_states(form: str, id: str, loaded: dict[str, dict[int, Fmu]]) -> None:
    model, fmu = MODELS[form], loaded[form][3]
    with Instance(fmu) as whole, Instance(fmu) as parted, Instance(fmu) as carried:
        for one in (whole, parted):
            one.start(**device_of(model, id))
        wanted = run(whole, model, 0, STEPS, 1)
        assert np.isfinite(wanted).all()
        found = run(parted, model, 0, STEPS // 2, 4)
        saved = parted.save()
        status, moved = carried.deserialize(parted.serialize(saved))
        assert status == OK and carried.restore(moved) == OK, carried.log
        found += run(carried, model, STEPS // 2, STEPS, 3)
        assert found == wanted
        parted.free_saved(saved), carried.free_saved(moved)
