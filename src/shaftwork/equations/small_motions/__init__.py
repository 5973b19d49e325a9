"""Small motions about a point: transfer functions and state matrices in symbols."""
