"""Run with ``python -m pidalab``."""

from pidalab.plant.cli import main

if __name__ == "__main__":
    main(prog_name="pidalab")
