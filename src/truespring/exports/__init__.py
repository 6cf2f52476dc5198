"""Springs for other simulators: each target is one function that writes files, and one line in TARGETS."""
