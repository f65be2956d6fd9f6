"""Where results are kept: one file a run, one data set a study, a catalogue of all."""
