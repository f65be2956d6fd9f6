"""What is looked at when a path has been walked: fields, figures, the audit."""
