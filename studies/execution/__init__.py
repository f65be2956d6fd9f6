"""How a study is carried out: what is missing, computed in parallel."""
