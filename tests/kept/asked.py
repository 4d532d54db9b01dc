"""The subjects whose answers are kept.

A subject is a function that returns its questions by name. What is asked is chosen for its branches, not for its sense.
"""

import asked_data
import asked_edges
import asked_ledger
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
        asked_ledger.ledger,
        asked_edges.edges,
        asked_data.files,
        asked_data.moving,
        asked_edges.more,
        asked_edges.optima,
        asked_ledger.pages_of_a_ledger,
    )
}
