"""Analogue circuits of a network: force-current (`Network.circuit`) and force-voltage (`Network.dual`)."""
