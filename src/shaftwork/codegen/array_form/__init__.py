"""The equations as arrays: a linear part and the laws beside it."""
