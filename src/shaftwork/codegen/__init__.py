"""From equations to numbers: scalar and array code, compiled programs, recovery of every quantity."""
