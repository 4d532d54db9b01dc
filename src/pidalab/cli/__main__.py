"""Run with ``python -m pidalab.cli``."""

from pidalab.cli import main

if __name__ == "__main__":
    main(prog_name="pidalab")
