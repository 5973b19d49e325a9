"""Design variables of a network for which measures of its motion become best."""
