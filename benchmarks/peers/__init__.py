"""The same records given to other Python packages: delay, model, time.

    pip install -r benchmarks/peers/requirements.txt
    python -m benchmarks.peers simulated --output docs/tables/peers_table.md
    python -m benchmarks.peers measured --output docs/tables/peers_measured_table.md

A package that is not installed is a row that says so. The measured records are no part of the
project; ``--data`` names their folder.
"""
