"""Results of a run: fields, numbers, records, files."""
