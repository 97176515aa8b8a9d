"""The reference of messages, outcomes, faults and exported tables."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from code_reference import ROOT, class_text, enum_values, load, public, values_table
from markdown_text import cell, prose, table

from msrr_bullet.export import documented_tables
from msrr_bullet.export.table import Column
from msrr_bullet.sweep.trial_table import TRIAL_COLUMNS

GALLERY = ROOT / "docs" / "gallery.md"

#: What of a run shows best why it ended so: every outcome but the successes has its sentence.
_FIRST_LOOK = {
    "incomplete": "`events.csv` says what the base station gave up and why, `msrr plot` its units.",
    "stuck": "`lock.csv` says whether the lock opened, and `truth.csv` whether the unit then backed out.",
    "jammed": "`msrr plot` shows how far off the axis the unit was, in truth and in its own belief.",
    "not_seated": "`seat_switches.csv` says which side is missing, and `replay.html` shows the last seconds.",
    "lock_failed": "`lock.csv` says when it gave way; compare `lock.strength_n` with `lock.pull_force_n`.",
    "target_lost": "`exposures.csv` says whether frames arrived, and `msrr frames` whether the marker was "
    "covered, out of view or not detected.",
    "gave_up": "The robot's reason names what was not fulfilled; `msrr plot` shows the errors of that time.",
    "never_detected": "`exposures.csv` says whether frames arrived, and `msrr frames` what they show.",
    "blocked": "`replay.html` shows what stands in the way.",
    "collision": "`clearance.csv` names the bodies; `msrr plot` shows belief beside truth.",
    "clearance_violated": "`clearance.csv` names the bodies, the distance and the place.",
    "left_arena": "`decisions.csv` says what was commanded, and `truth.csv` how the unit drove.",
    "aborted": "`events.csv` says what ended the other step.",
    "timeout": "`events.csv` says in which phase the time went; `time_limit_s` is the scene's limit.",
    "program_failed": "The message on the terminal names the class and its error.",
    "false_dock": "`beliefs.csv` beside `truth.csv`; `seat_switches.csv` says whether a switch was wrong.",
    "false_abort": "The robot's reason; most often it sees itself farther off than `docking.verify` accepts.",
}


def messages_page() -> str:
    """Return the page of all message types."""
    messages = load("msrr_scenes")["messages"]
    text = f"# Messages\n\n{prose(messages.docstring.value)}\n\n"
    text += "[The log](log.md) says which topic holds which message.\n"
    for module in (member for member in public(messages) if member.is_module):
        text += f"\n## {module.name.capitalize()}\n\n{prose(module.docstring.value)}\n"
        text += "".join(class_text(member) for member in public(module) if member.is_class)
    return text


def outcomes_page() -> str:
    """Return the page of the outcomes of a trial, the beliefs of the robot, and the faults."""
    scenes = load("msrr_scenes")
    outcome = scenes["outcome.Outcome"]
    seen = _outcomes_of_the_gallery()
    rows = []
    for value, meaning in enum_values(outcome).items():
        examples = ", ".join(f"[`{name}`](../gallery.md#{name})" for name in seen.get(value, [])[:3])
        rows.append((f"`{value}`", meaning, examples))
    successes = {"complete", "docked", "undocked"}
    looks = [(f"`{value}`", _FIRST_LOOK[value]) for value in enum_values(outcome) if value not in successes]
    return _OUTCOMES.format(
        about=prose(outcome.docstring.value),
        outcomes=table(("outcome", "meaning", "a scene that ended so"), rows),
        looks=table(("outcome", "look first at"), looks),
        convictions=values_table(scenes["messages.decisions.Conviction"]),
        reasons=values_table(scenes["messages.decisions.FailureReason"]),
        phases=values_table(scenes["messages.decisions.Phase"]),
        faults=table(("kind", "what it does"), _faults(scenes)),
    )


def _outcomes_of_the_gallery() -> dict[str, list[str]]:
    """Return the scenes of the gallery by the outcomes of their runs there."""
    found: dict[str, list[str]] = {}
    for section in GALLERY.read_text(encoding="utf-8").split("\n### ")[1:]:
        name, run = re.match(r"`(\w+)`", section), re.search(r"This run: (\w+)", section)
        if name and run:
            found.setdefault(run[1], []).append(name[1])
    return found


def _faults(scenes: Any) -> list[tuple[str, str]]:
    kinds = [m for m in public(scenes["specs.faults"]) if m.is_class]
    values = [re.search(r"\w+", str(kind.members["kind"].annotation).partition("[")[2]) for kind in kinds]
    return [(f"`{v[0]}`", cell(k.docstring.value)) for v, k in zip(values, kinds, strict=True) if v]


def tables_text() -> str:
    """Return the descriptions of the table of a sweep, and of all tables that an export can have."""
    text = f"\n## The trials of a sweep\n\n{_columns(TRIAL_COLUMNS)}"
    for name, about, columns in documented_tables():
        text += f"\n## `{name}.csv`\n\n{prose(about)}\n\n{_columns(columns)}"
    return text


def _columns(columns: Iterable[Column]) -> str:
    rows = [(f"`{column.name}`", cell(column.about)) for column in columns]
    return table(("column", "holds"), rows)


_OUTCOMES = """\
# Outcomes and faults

## Outcomes
{about}

{outcomes}
The exit code of `msrr dock` says whether a trial ended `docked` or `complete`;
[the command line](command_line.md#exit-codes) lists all exit codes.

## Where to look first
The [tutorial on failures](../tutorials/failure.md) goes this way with one seed. Files named `.csv` come from
`msrr export RUN --csv`.

{looks}
## What the robot believes
{convictions}
## Why an attempt failed, as the robot knows it
A belief has one of these as its *setback*, with a sentence that holds the figures.

{reasons}
## Phases of a docking step
{phases}
## Faults
A scene causes them on purpose with its key [`faults`](scene_keys.md#faults); no robot is told.

{faults}"""
