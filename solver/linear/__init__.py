"""Sparse symmetric systems: analysed once, factorised and solved many times."""
