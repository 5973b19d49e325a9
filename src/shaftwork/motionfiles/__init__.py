"""Motions as files that other tools read: netCDF, which is HDF5, and Parquet."""
