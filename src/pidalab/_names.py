"""Words that rooms of the library and the command line share; without imports, so that a command starts at once."""

KINDS = ("PI", "PID", "PIDA")  # of controllers, by their highest derivative
WITHOUT_ACCELERATION = KINDS[:2]
# models that rules start from, as `pidalab.rules.models` makes them of a process
STARTING_MODELS = ("process", "reaction", "first_order", "second_order", "third_order", "integrator")
