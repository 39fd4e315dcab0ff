"""Ten thousand simulated records, one in a hundred of them corrupt, through one campaign.

python -m benchmarks.campaign --records 10000 --jobs 2 --output docs/tables/campaign.md
"""
