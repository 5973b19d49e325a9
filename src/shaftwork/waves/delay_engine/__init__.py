"""The engine for networks whose shafts are travelling waves: between kinks, what arrives is known history."""
