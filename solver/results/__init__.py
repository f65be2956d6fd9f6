"""Results of a run: fields, figures, the audit."""
