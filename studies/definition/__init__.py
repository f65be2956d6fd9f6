"""The definition of a study: its parameters, its sweep, its runs, their ids."""
