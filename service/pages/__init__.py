"""Pages for people, beside the resources for programs: HTML made here, drawn by small scripts."""
