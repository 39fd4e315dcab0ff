"""Conditions under which `tools/matrix.py` runs the tests: a pytest plugin, ``-p conditions``.

TESTS_IN_ORDER_OF=7 shuffles all tests, with that seed; TESTS_IN_LOCALE=1 takes the locale of the
environment for numbers and times too, as programs with windows do before anybody imports us.
"""

from __future__ import annotations

import locale
import os
import random

SEED = os.environ.get("TESTS_IN_ORDER_OF")


def pytest_configure(config):
    if os.environ.get("TESTS_IN_LOCALE"):
        locale.setlocale(locale.LC_ALL, "")


def pytest_collection_modifyitems(items):
    if SEED:
        # The same in every worker, which pytest-xdist asks for.
        items.sort(key=lambda item: item.nodeid)
        random.Random(SEED).shuffle(items)
