"""What numpydoc asks of docstrings, and what is not asked for here.

`conf.py` gives both to numpydoc, and a test asks the same of everything that is public.
"""

NOT_ASKED = {
    "ES01": "One sentence may say it all.",
    "SA01": "Neighbours are named in the text, where it says when to use them.",
    "EX01": "Methods of one line; a test asks functions and classes for an example that runs.",
    "PR01": "Results are made by the package and list their attributes; functions are tested.",
    "PR03": "Parameters that belong together share an entry.",
    "PR04": "Entries such as `samples, hankel`, as for another function, have no type.",
    "PR07": "`name : str, optional` says it all.",
    "PR08": "A description may begin with a symbol or a unit.",
    "RT01": "Methods of one line; functions are tested.",
    "RT03": "The type says it: what the fields mean stands in its own docstring.",
    "SS05": "Nouns such as poles are taken for verbs.",
    "YD01": "Context managers that yield nothing.",
}
"""Checks of numpydoc that are left out, each with its reason."""

ASKED_OF_FUNCTIONS = ("PR01", "RT01")
"""Of these, what every public function keeps to all the same."""

CHECKS = {"all", *NOT_ASKED}
"""As numpydoc wants it: all but those listed."""

CONSTANTS = r"\.paper\.[A-Z][A-Z_0-9]*$"
"""Data, whose docstring is that of their type."""
