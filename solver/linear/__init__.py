"""Linear systems: sparse symmetric factors, Schur complements, dense and iterative solution."""
