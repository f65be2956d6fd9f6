"""Results of a walk: fields, figures, the audit."""
