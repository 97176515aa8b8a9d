"""The command ``msrr perceive``: the perception of a robot on a recording."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from msrr_bullet.cli.console import open_console, status_line
from msrr_bullet.cli.exit_codes import BAD_INPUT, report_error
from msrr_scenes.wording import counted

if TYPE_CHECKING:  # loaded by the command, so that msrr --help is quick
    from msrr_bullet.recordings.perceiver import PerceivedInstant
    from msrr_bullet.recordings.result import RecordingResult, Sigma

#: Number of messages about frames that are printed one by one. A film of another size than the calibration
#: has one for each of its frames.
_PRINTED = 10


def perceive(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDING",
            help="MCAP file, bag of ROS 2, film, picture, folder of pictures, or run folder.",
        ),
    ],
    target: Annotated[Path, typer.Option(metavar="FILE", help="Target file: target, robot and camera.")],
    calibration: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Calibration of the camera, by OpenCV or ROS.",
            show_default="that of the target file, or else of the recording",
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            min=0.01,
            max=1000.0,
            help="Pictures per second in a folder; other recordings have times of their own.",
            show_default="rate_hz of the camera in the target file",
        ),
    ] = None,
    topic: Annotated[
        str | None, typer.Option(help="Topic of the images.", show_default="the only one with images")
    ] = None,
    odometry: Annotated[
        str | None,
        typer.Option(
            metavar="TOPIC", help="Topic of the odometry; none leaves it out.", show_default="the only one"
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Run folder.")] = Path("runs/perceived"),
) -> None:
    """Run perception on a recording, to see where the robot was.

    The exit code is 2 if parts cannot be read.
    """
    from msrr_bullet.recordings.run import Options, perceive
    from msrr_bullet.run_folder import RUN_FILES
    from msrr_scenes.loading.calibration_file import read_calibration

    told = None if calibration is None else read_calibration(calibration)
    console = open_console()
    messages: list[str] = []
    with status_line(console, str(recording)) as show:

        def observe(instant: PerceivedInstant) -> None:
            show(f"{recording}: {1e-9 * instant.stamp_ns:.1f} s")

        def report(text: str) -> None:
            messages.append(text)
            if len(messages) <= _PRINTED:
                report_error(text, BAD_INPUT)

        result = perceive(
            recording,
            target,
            Options(told, rate, topic, odometry),
            out=out,
            report=report,
            observer=observe,
        )
    for text in _rest(messages):
        report_error(text, BAD_INPUT)
    for line in _lines(result):
        typer.echo(line)
    typer.echo(f"{out}: {', '.join(name for name in RUN_FILES if (out / name).exists())}")
    raise typer.Exit(BAD_INPUT if result.unusable or result.cut_off else 0)


def _rest(messages: list[str]) -> list[str]:
    """Return what is printed of the messages after the first ones: their number, and the last one."""
    rest = messages[_PRINTED:]
    if len(rest) < 2:
        return rest
    return [f"{counted(len(rest) - 1, 'more message')}; the log has all of them as events", rest[-1]]


def _lines(result: RecordingResult) -> list[str]:
    """Return the result in words."""
    lines = [f"assumed: {text}" for text in result.assumptions]
    sights = ", ".join(f"{count} {status}" for status, count in result.line_of_sight.items())
    lines.append(
        f"{counted(result.frames, 'frame')} in {result.duration_s:.1f} s: {result.unusable} unusable, "
        f"target in {result.with_target}, used {result.used}; line of sight: {sights or 'none'}"
    )
    if result.last_pose is None or result.last_sigma is None or result.median_sigma is None:
        return [*lines, f"no estimate: {_why_none(result)}"]
    x, y, yaw = result.last_pose
    lines.append(
        f"{result.estimates} of {result.instants} instants with an estimate, ± {_text(result.median_sigma)} "
        f"(median); the last, {result.last_unseen_s:.2f} s after the target was seen: "
        f"x {x:z.4f} m, y {y:z.4f} m, yaw {math.degrees(yaw):z.2f} deg ± {_text(result.last_sigma)}"
    )
    return [*lines, *result.warnings()]


def _why_none(result: RecordingResult) -> str:
    """Return why there is no estimate, and what to do about it."""
    if not result.frames:
        return "no frame could be read"
    if result.unusable == result.frames:
        return "no frame could be used"
    if result.with_target:
        return (
            "the tags of the target agree with no pose of a robot on a flat floor; check robot.camera (z_m, "
            "and pitch_deg, which is positive where the camera looks down), marker.dock.z_m, the size of the "
            "tags and the calibration"
        )
    wanted = ", ".join(map(str, result.target_tags))
    if not result.tags:
        return f"no tag was found; the target has {wanted}"
    found = ", ".join(map(str, result.tags))
    which = "the target file has to name what carries these"
    return f"the target has the tags {wanted}, and only {found} were found; {which}"


def _text(sigma: Sigma) -> str:
    return f"{1e3 * sigma.position_m:.1f} mm, {math.degrees(sigma.yaw_rad):.2f} deg"
