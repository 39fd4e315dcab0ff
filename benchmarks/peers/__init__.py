"""The same records given to other Python packages: delay, frequency response, time.

    pip install -r benchmarks/peers/requirements.txt
    python -m benchmarks.peers --output docs/_generated/peers.md

A package that is not installed is a row that says so.
"""
