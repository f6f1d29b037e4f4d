"""Success counts in place of readings: reader, comparison, diagnosis and their pages.

Start at `data_kind.open_counts`.
"""
