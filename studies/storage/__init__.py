"""Storage of results: one file for each run, one data set for each study, a catalogue of all."""
