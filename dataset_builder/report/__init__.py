"""Pictures, tables and pages for people, from results that others computed; Matplotlib is imported here alone."""
