"""How uncertain parameters make measures and courses of a motion uncertain."""
