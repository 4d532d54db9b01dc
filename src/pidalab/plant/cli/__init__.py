"""The command line: from a plant record to controller code, and what a controller does to a plant."""

from __future__ import annotations

import io
import sys

import click

from pidalab.plant.cli import known, recorded

CONTEXT_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True}


@click.group(context_settings=CONTEXT_SETTINGS)
@click.version_option(package_name="pidalab")
def main() -> None:
    """PIDA control: from a plant record to controller code, and what a controller does to a plant.

    \b
    From a record, a delimited text file with an open-loop step:
      pidalab report step.csv --sample-time 0.2                compare PI, PID and PIDA
      pidalab tune step.csv --sample-time 0.2 --out folder     tune one of them and write its code
      pidalab check log.csv --kp 0.6 --ti 12                   judge the gains that run
    For a known plant:
      pidalab compare --num 1 --den 1,3,3,1 --delay 1          apply every rule to it
      pidalab simulate --den 1,3,3,1 --kp 2 --ti 3 --until 30  simulate one loop
    Without a plant:
      pidalab rules                                            list the rules by name
      pidalab rule --ku 250 --tu 7200                          gains from ultimate gain and period
      pidalab benchmark rule.py:tune --out folder              rank a rule of yours on 134 plants
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # for consoles that lack a character
            stream.reconfigure(errors="replace")


for module in (recorded, known):
    for command in vars(module).copy().values():
        if isinstance(command, click.Command):
            main.add_command(command)
