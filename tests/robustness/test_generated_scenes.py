"""Generated scenes, valid, nearly valid and broken: each is refused with a message, or can be run.

A scene begins as a shipped one or as a row of units, and is changed in some places: to values in the range
of a key, at its ends and just beyond, of a wrong type; keys that do not exist; odd texts; far poses; other
plans.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from msrr_bullet.run import run_trial
from msrr_bullet.trial.check import check_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.wall_limit import WallLimitError
from msrr_control.docking.barrier import BarrierParams
from msrr_control.docking.c1 import C1DockingParams, LinearParams
from msrr_control.docking.c2 import C2DockingParams
from msrr_control.docking.graceful import GracefulParams
from msrr_control.staging.parameters import AssemblyParams, C2AssemblyParams
from msrr_scenes.errors import MsrrError
from msrr_scenes.loading.file_schema import file_schema
from msrr_scenes.loading.load import LIBRARY, load_scene, shipped_scenes
from msrr_scenes.specs.scene import Scene

#: Longest time that a check may take [s]: ten times what the check of 50 units takes.
CHECK_LIMIT_S = 60.0
#: Limit of a run on the wall clock, and what native code may take beyond it [s].
WALL_LIMIT_S, BEYOND_S = 20.0, 40.0

ODD: list[Any] = [
    *(math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, 1e15, 10**4000, -(10**30), 0, -1, 2**63),
    *("", "x y", "../../x", "a[/]", "\ud800", "\u0000", "ünit", "a" * 5000, "-", "None", "1e5", "0x10"),
    *(True, None, [], {}, [[]], {"": 1}, [1, 2, 3], {"params": 3}, "no.such:Class", "math:pi"),
]
DOCKING = {
    "c1": C1DockingParams,
    "c2": C2DockingParams,
    "cbf": BarrierParams,
    "graceful": GracefulParams,
    "linear": LinearParams,
}
ASSEMBLY = {"c1": AssemblyParams, "c2": C2AssemblyParams}
#: Parameters of the implementations that are no specifications.
PLAIN = {
    "detector": (
        "pupil",
        "quad_decimate quad_sigma decode_sharpening min_white_black_diff max_hamming min_decision_margin",
    ),
    "estimator": (
        "corner_ekf",
        "corner_sigma_px tilt_sigma_deg gate_probability reset_after horizon_s start_inflation slip",
    ),
}
SCHEMA = Scene.model_json_schema()
#: What editors check scene files by.
EDITOR = jsonschema.Draft202012Validator(file_schema())
TEXTS = {name: (LIBRARY / f"{name}.yaml").read_text() for name in shipped_scenes()}

Place = tuple[tuple[str | int, ...], dict[str, Any]]  # path in a document, and JSON schema of the value there


def places(
    schema: dict[str, Any], root: dict[str, Any], data: Any, path: tuple[Any, ...] = ()
) -> Iterator[Place]:
    """Yield every value that a document may hold, for mappings of bodies those that are there."""
    if "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    options = schema.get("anyOf") or schema.get("oneOf") or []
    for option in options:
        yield from places(option, root, data, path)
    if "properties" in schema:
        for key, value in schema["properties"].items():
            yield from places(value, root, data.get(key) if isinstance(data, dict) else None, (*path, key))
    elif schema.get("type") == "object" and isinstance(data, dict):
        values = schema.get("additionalProperties")
        for key in data if isinstance(values, dict) else ():
            yield from places(values, root, data[key], (*path, key))
    elif schema.get("type") == "array" and isinstance(data, list):
        for i, item in enumerate(data):
            yield from places(schema.get("items") or schema["prefixItems"][0], root, item, (*path, i))
    elif not options:
        yield path, schema


def in_range(rng: random.Random, schema: dict[str, Any]) -> Any:
    """Return a value of the range of a key, its ends and what lies just beyond included."""
    kind = schema.get("type")
    if kind == "boolean":
        return rng.random() < 0.5
    if "enum" in schema or "const" in schema:
        return rng.choice(schema.get("enum", [schema.get("const")]))
    if kind not in ("number", "integer"):
        return rng.choice(ODD)
    low = schema.get("minimum", schema.get("exclusiveMinimum"))
    high = schema.get("maximum", schema.get("exclusiveMaximum"))
    way = rng.random()
    if way < 0.2:
        value = rng.choice([low, high])
    elif way < 0.25:
        value = rng.choice([low - 1e-9, high * 1.001 + 1e-9])
    elif low > 0.0:
        value = math.exp(rng.uniform(math.log(low), math.log(high)))
    else:
        value = rng.uniform(low, high) * 10.0 ** -rng.uniform(0.0, 4.0)
    return round(value) if kind == "integer" else value


def put(document: Any, path: tuple[Any, ...], value: Any) -> None:
    """Write a value into a document, with the mappings on the way there."""
    for key, following in pairwise(path):
        wanted = list if isinstance(following, int) else dict
        here = document.get(key) if isinstance(document, dict) else document[key]
        if not isinstance(here, wanted):  # also a text that stands for a mapping
            document[key] = {}
        document = document[key]
    document[path[-1]] = value


def row(rng: random.Random) -> dict[str, Any]:
    """Return a scene of units in a row, each of which docks to the one before."""
    names = [f"u{i}" for i in range(rng.choice([2, 2, 3, 4, 6]))]
    ports = [rng.choice(["rear", "rear", "left", "right"]) for _ in names]
    units: dict[str, Any] = {names[0]: {"number": 0, "pose": {"x_m": 1.2}}}
    for i, name in enumerate(names[1:]):
        pose = {
            "frame": f"{names[i]}.{ports[i]}",
            "x_m": -rng.uniform(0.3, 0.9),
            "y_m": rng.uniform(-0.1, 0.1),
        }
        units[name] = {"number": i + 1, "pose": pose}
    plan = [{"unit": names[i + 1], "to": f"{names[i]}.{ports[i]}"} for i in range(len(names) - 1)]
    scene: dict[str, Any] = {"units": units, "plan": plan[: rng.choice([1, 1, 2, 5])], "time_limit_s": 60}
    scene["arena"] = {"x_m": [-6, 6], "y_m": [-6, 6]}
    if rng.random() < 0.5:
        scene["cameras"] = {"overhead": {"height_m": rng.choice([3.0, 6.0, 10.0])}}
    return scene


def change(rng: random.Random, document: dict[str, Any], way: float) -> None:
    """Change a document in one place; ``way``, from 0 to 1, says how, the larger the deeper."""
    found = [place for place in places(SCHEMA, SCHEMA, document) if place[0]]
    if way < 0.55:
        path, leaf = rng.choice(found)
        put(document, path, in_range(rng, leaf))
    elif way < 0.63:
        put(document, rng.choice(found)[0], rng.choice(ODD))
    elif way < 0.67:
        put(document, (*rng.choice(found)[0][:-1], rng.choice(["x", "nmae", "kind", "\ud800", "k" * 200])), 1)
    elif way < 0.73:
        far = {"x_m": rng.choice([1e15, 99.0, -50.0]), "y_m": rng.uniform(-1.0, 1.0)}
        put(document, ("units", rng.choice(list(document["units"])), "pose"), far)
    elif way < 0.79:
        change_plan(rng, document)
    elif way < 0.83:
        change_mission(rng, document)
    elif way < 0.90:
        change_law(rng, document)
    else:
        add_faults(rng, document)


def change_plan(rng: random.Random, document: dict[str, Any]) -> None:
    names, plan = list(document["units"]), document.setdefault("plan", [])
    ports = [f"{name}.{port}" for name in names for port in ("rear", "left", "right", "front")]
    unit = rng.choice(names)
    moved = {"move": unit, "pose": {"x_m": rng.uniform(-1.5, 1.5), "y_m": rng.uniform(-1.0, 1.0)}}
    plan.append(rng.choice([{"unit": unit, "to": rng.choice(ports)}, {"undock": unit}, moved]))
    rng.shuffle(plan)
    if rng.random() < 0.5:
        del plan[rng.randrange(len(plan))]


def change_mission(rng: random.Random, document: dict[str, Any]) -> None:
    """Let a base station lead the units: with a shape, a start as an assembly, or a bad radio."""
    names = list(document["units"])
    if rng.random() < 0.6:
        shapes = [
            {pattern: rng.randint(0, 9)}
            for pattern in rng.sample(["line", "tee", "cross", "comb", "zigzag"], 2)
        ]
        document["shape"] = rng.choice([shapes[0], shapes])
        if rng.random() < 0.8:
            document.pop("plan", None)
    if rng.random() < 0.4:
        port = rng.choice(["rear", "left", "right", "front"])
        document["assembled"] = [f"{rng.choice(names)}.front-{rng.choice(names)}.{port}"]
    document["radio"] = {
        "loss": rng.choice([0.0, 0.3, 1.0]),
        "latency_ms": rng.choice([0, 200, 900]),
        "silences": [
            {"from_s": 1.0, "until_s": rng.choice([0.5, 4.0]), "units": [rng.choice([*names, "zz"])]}
        ],
    }


def change_law(rng: random.Random, document: dict[str, Any]) -> None:
    kind = rng.choice(["docking", "assembly", "detector", "estimator"])
    if kind in PLAIN:
        name, keys = PLAIN[kind]
        params = {rng.choice(keys.split()): rng.choice([*ODD, 1e-9, 0.5, 1, 2.0, 50, 1e6])}
    else:
        name = rng.choice(list(DOCKING if kind == "docking" else ASSEMBLY))
        schema = (DOCKING if kind == "docking" else ASSEMBLY)[name].model_json_schema()
        params = {}
        for path, leaf in rng.sample(list(places(schema, schema, {})), rng.choice([1, 2])):
            if path:
                put(params, path, in_range(rng, leaf))
    put(document, ("control", kind), {"name": rng.choice([name, name, name, "nothing"]), "params": params})


def add_faults(rng: random.Random, document: dict[str, Any]) -> None:
    unit = rng.choice(list(document["units"]))
    kinds = [
        {"kind": "seat_switch_stuck", "unit": unit, "value": rng.choice(["open", "closed"])},
        {"kind": "marker_hidden", "unit": unit},
        {"kind": "port_plugged", "unit": unit, "port": "rear", "attempts": [rng.randint(0, 21)]},
        {"kind": "camera_blackout", "camera": f"{unit}/onboard", "from_s": rng.uniform(0, 2), "to_s": 1.5},
        {"kind": "camera_misaligned", "unit": unit, "yaw_deg": rng.uniform(-400.0, 400.0)},
    ]
    document["faults"] = [rng.choice(kinds) for _ in range(rng.choice([1, 1, 2, 3]))]


def generated(seed: int) -> str:
    """Return the text of a scene file."""
    rng = random.Random(seed)
    document = row(rng) if rng.random() < 0.5 else yaml.safe_load(TEXTS[rng.choice(list(TEXTS))])
    if len(document.get("plan", ())) == 1:
        document["time_limit_s"] = rng.choice([0.05, 0.3, 1.0, 3.0])
    if rng.random() < 0.7:  # pixels and contact take longest
        document |= {"plant": rng.choice(["bullet", "unicycle"]), "perception": "parametric"}
    if rng.random() < 0.01:
        document["units"] |= {f"n{i}": {"number": i % 50} for i in range(rng.choice([40, 6000]))}
    for way in sorted((rng.random() for _ in range(rng.choice([0, 1, 1, 2, 3]))), reverse=True):
        change(rng, document, way)
    return yaml.safe_dump(document, sort_keys=False)


def accepted(folder: Path, seed: int) -> Scene | None:
    """Return a generated scene that the check accepts; None for one that it refuses with a message."""
    path = folder / "generated.yaml"
    path.write_text(generated(seed))
    begun = time.monotonic()
    try:
        scene = load_scene(path)
        check_trial(scene)
    except MsrrError as error:
        text = str(error)
        assert "generated.yaml" in text, f"seed {seed}: {text[:300]}"
        assert "pydantic" not in text, f"seed {seed}: {text[:300]}"
        assert len(text) < 10_000, f"seed {seed}: {len(text)} characters"
        text.encode("utf-8")
        return None
    finally:
        assert time.monotonic() - begun < CHECK_LIMIT_S, f"seed {seed}"
    document = yaml.safe_load(path.read_text())
    marked = [e.message for e in EDITOR.iter_errors(document) if not isinstance(e.instance, str)]
    assert marked == [], f"seed {seed}: editors mark a scene that is read"  # but for numbers written as texts
    return scene


def run_or_stop(scene: Scene, seed: int) -> TrialResult | None:
    """Run a trial; None if it takes longer than the limit on the wall clock."""
    begun = time.monotonic()
    try:
        return run_trial(scene, seed, wall_limit_s=WALL_LIMIT_S)
    except WallLimitError:
        return None
    finally:
        assert time.monotonic() - begun < WALL_LIMIT_S + BEYOND_S, f"seed {seed}"


def test_a_sample_of_generated_scenes_is_checked(tmp_path: Path) -> None:
    kept = sum(accepted(tmp_path, seed) is not None for seed in range(30))
    assert 4 <= kept <= 20  # the generator makes both kinds


@pytest.mark.nightly
@pytest.mark.timeout(4 * 3600)
def test_five_thousand_generated_scenes_are_checked_and_three_hundred_run(tmp_path: Path) -> None:
    """Whatever the check accepts, a trial accepts; nothing ends in a traceback or takes for ever."""
    kept = 0
    for seed in range(5000):
        scene = accepted(tmp_path, seed)
        if scene is not None:
            kept += 1
            if kept <= 300:
                run_or_stop(scene, seed)
    assert kept >= 1000
