"""Linear systems closed through dead times: algebra, responses, poles; discrete and continuous."""
