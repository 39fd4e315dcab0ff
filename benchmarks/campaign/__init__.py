"""Ten thousand simulated records, one in a hundred of them corrupt, through one campaign.

python -m benchmarks.campaign --output docs/tables/campaign_table.md
"""
