"""What changes its mode, what ends a mode, and the equations that hold in each."""
