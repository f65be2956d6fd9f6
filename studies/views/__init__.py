"""What is looked at: results read, printed, drawn, compared with published numbers."""
