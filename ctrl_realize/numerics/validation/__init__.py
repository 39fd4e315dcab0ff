"""Tests of a fitted model on its record: innovations, changes of parameters, held outputs."""
