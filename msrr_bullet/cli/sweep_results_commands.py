"""The commands of results of sweeps: ``msrr compare | merge``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from msrr_bullet.cli.console import open_console
from msrr_bullet.cli.options import (
    STANDARD_OUTPUT,
    JsonFile,
    check_writable,
    parse_overrides,
    write_output,
)
from msrr_scenes.errors import SceneError


def compare(
    first: Annotated[Path, typer.Argument(metavar="FIRST.csv", help="Table by msrr sweep --csv.")],
    second: Annotated[
        Path | None,
        typer.Argument(metavar="SECOND.csv", help="Table of another sweep.", show_default="FIRST.csv"),
    ] = None,
    json_file: JsonFile = None,
    first_with: Annotated[
        list[str] | None,
        typer.Option(
            "--first",
            metavar="KEY=VALUE",
            help="Of the first table only trials with this value, which was set or varied; repeatable.",
        ),
    ] = None,
    second_with: Annotated[
        list[str] | None,
        typer.Option("--second", metavar="KEY=VALUE", help="The same for the second table."),
    ] = None,
) -> None:
    """Compare two sweeps over the same seeds, trial by trial, or two levels of one sweep --vary.

    What the trials share, such as the start and the robots, cancels out.
    """
    from msrr_bullet.cli.sweep_report import comparison_table
    from msrr_bullet.sweep.compared_trials import is_same_level
    from msrr_bullet.sweep.comparison import compare_sweeps
    from msrr_bullet.sweep.variation import short_keys

    other = second or first
    chosen = parse_overrides(first_with, "--first"), parse_overrides(second_with, "--second")
    if second is None and is_same_level(*chosen):
        raise SceneError(
            f"{first}: there is nothing to compare it with; name a second table, or two levels of this one "
            "by --first KEY=VALUE and --second KEY=VALUE"
        )
    check_writable(json_file, taken=[first, other])
    comparison = compare_sweeps(first, other, *chosen)
    tables = (first.stem, other.stem) if first.stem != other.stem else (str(first), str(other))
    pairs = (zip(short_keys(list(given)), given.values(), strict=True) for given in chosen)
    values = [", ".join(f"{key} = {value}" for key, value in named) for named in pairs]
    if second is not None:
        values = [f"{name} {given}".rstrip() for name, given in zip(tables, values, strict=True)]
    table = comparison_table(comparison, *(given or first.stem for given in values))
    write_output(json_file, comparison.model_dump_json(indent=2) + "\n")
    open_console(stderr=json_file == STANDARD_OUTPUT).print(table)


def merge(
    stores: Annotated[list[Path], typer.Argument(metavar="STORE...", help="Stores of sweeps.")],
    into: Annotated[Path, typer.Option(metavar="FILE", help="Store that gets all their results.")] = Path(
        "runs/sweeps.sqlite"
    ),
) -> None:
    """Put the results of several stores of sweeps into one.

    A sweep with that store then takes them from there.
    """
    from msrr_bullet.sweep.trial_store import TrialStore, check_store

    for path in stores:
        check_store(path)  # before a new store is made of nothing
    with TrialStore(into) as store:
        for path, (added, held) in zip(stores, store.merge(*stores), strict=True):
            typer.echo(f"{path}: {added} results added, {held} were there already")
