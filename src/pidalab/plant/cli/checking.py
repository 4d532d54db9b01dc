"""The command that judges the gains of a running loop by a log of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from pidalab.plant.cli.parts import ms_worst, one_line, show, times
from pidalab.plant.cli.recorded import read_record, record

if TYPE_CHECKING:
    from pidalab.controllers import PIDA
    from pidalab.plant.running_loop import Check

FIRMWARE_NAMES = ("klipper", "betaflight", "betaflight-yaw")


@click.command("check")
@record
@click.option(
    "--kp", type=float, required=True, help="Gain, in units of u per unit of y; or P of a firmware."
)
@click.option("--ti", type=float, help="Integral time, in the log's unit of time.")
@times
@click.option(
    "--firmware",
    type=click.Choice(FIRMWARE_NAMES),
    help="The gains are its numbers --kp, --ki, --kd, in place of times; the log is in seconds.",
)
@click.option("--ki", type=float, help="I of that firmware.")
@click.option("--kd", default=0.0, help="D of that firmware.")
@click.option("--full-output", default=1.0, help="u of the log at full power of that firmware.")
@click.option("--filter", "lag", default=0.0, help="Time constant of the measurement's filter.")
@click.option("--sample-time", type=float, help="Of the controller; by default that of the log.")
@ms_worst
@one_line
def check_command(
    model: str,
    lag: float,
    sample_time: float | None,
    ms_worst: float,
    firmware: str | None,
    full_output: float,
    **options: Any,
) -> None:
    """Judge the gains of a running loop by a log of it, the RECORD.

    Changes of the set point, a step of the load or a bump of u show the plant. Prints the Ms of the loop with its
    interval, what the gains miss, and three sets to try.

    \b
    Examples:
      pidalab check log.csv --time time --u valve --y level --kp 0.6 --ti 12 --sample-time 0.5
      pidalab check hotend.csv --firmware klipper --kp 22.2 --ki 1.08 --kd 114 --sample-time 0.3
    """
    import control

    from pidalab import _check
    from pidalab.plant.fitting import fit
    from pidalab.plant.running_loop import check

    read = read_record(options)
    lags = control.TransferFunction([1.0], [lag, 1.0]) if _check.real("--filter", lag, at_least=0.0) else None
    running = _running(firmware, full_output, **options)
    found = check(read if model == "auto" else fit(read, model), running, lags, sample_time, ms_worst)
    sections = [("Log", str(read)), ("Model", f"{found.fit.process!r}\n{found.fit}"), ("Gains", str(found))]
    if firmware is not None:
        sections.append((f"The sets as {firmware} writes them", _as_firmware(found, firmware, full_output)))
    show(sections)


def _running(
    firmware: str | None,
    full_output: float,
    kp: float,
    ti: float | None,
    ki: float | None,
    kd: float,
    **times: float,
) -> PIDA:
    """Return the controller that runs, of times or of the numbers of a firmware."""
    from pidalab.controllers import PIDA

    if firmware is None and ti is not None and ki is None and not kd:
        return PIDA(kp, ti, **times)
    if firmware is not None and ki is not None and ti is None and not times["td"] and not times["ta"]:
        return PIDA.from_firmware(firmware, kp, ki, kd, full_output)
    raise click.UsageError(
        "give --kp, --ti and perhaps --td and --ta, or --firmware with --kp, --ki and perhaps --kd"
    )


def _as_firmware(found: Check, firmware: str, full_output: float) -> str:
    """Return the sets to try as the three numbers of a firmware, which has no acceleration."""
    from pidalab.plant.vendor import firmware_form

    lines = []
    for row in found.rows:
        if row.design is not None and not row.design.controller.gains().ka:
            form = firmware_form(row.design.controller.gains(), firmware, full_output)
            lines.append(
                f"{row.rule:14} {', '.join(f'{name} = {value:.4g}' for name, value in form.items())}"
            )
    return "\n".join(lines)
