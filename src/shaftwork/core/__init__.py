"""What every stage knows: domains, parameters, errors."""
