"""Study files: read, checked, run."""
