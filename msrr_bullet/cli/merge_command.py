"""The command ``msrr merge``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


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
