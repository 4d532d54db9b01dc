"""The subjects whose answers are kept.

A subject is a function that returns its questions by name. What is asked is chosen for its branches, not for its sense.
"""

import asked_data
import asked_designs
import asked_edges
import asked_loops
import asked_methods

SUBJECTS = {
    subject.__name__: subject
    for subject in (
        asked_loops.margins,
        asked_loops.responses,
        asked_loops.digital,
        asked_loops.sampled,
        asked_methods.rules,
        asked_methods.models,
        asked_methods.records,
        asked_methods.search,
        asked_edges.blocks,
        asked_edges.whole_loops,
        asked_edges.read_off_responses,
        asked_edges.simulated,
        asked_designs.in_computers,
        asked_designs.by_rules,
        asked_data.files,
        asked_data.moving,
        asked_designs.more,
        asked_designs.optima,
    )
}
